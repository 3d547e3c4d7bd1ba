"""How many fibres and pieces of fibre are drawn: the picture against that of every real fibre."""

from collections.abc import Iterable, Iterator

from ...render.data.camera import Camera
from ...render.splat.splat import Splatter
from ..measure.picture import Swatch, difference, shown
from ..measure.study import Axis, Row, Study, cpu_seconds
from ..prepare.fibre_count import fibres_told_apart

__all__ = ["STUDY", "rows"]

SIZE = (480, 320)
ALL = 2000
"""More fibres than any ply has: all of them."""
FIBRES = (1, 2, 4, 8, 12, 24, 48)
STEPS = (1, 2, 4, 6, 10, 20)
USUAL_STEPS, FINEST_STEPS = 10, 40
VIEWS = {"from afar": 1.0, "four times nearer": 4.0}
WHY = {
    "fibres a ply": "so few are cords and not fibres, which the eye tells long before this number does",
    "pieces of a fibre": "twice the pieces are twice the particles to hold and to draw, for what is not seen",
}
"""What speaks for the defaults, by the panels' first words."""
AVERAGED = {"each pixel": 1, "means of 8 × 8 pixels": 8}
"""Single pixels show which fibres were drawn, means over about a yarn how bright they are together."""


def rows(quick: bool) -> Iterator[Row]:
    runs = 1 if quick else 3
    whole, finest = Swatch(f"yarn.fibres={ALL}"), Swatch(f"fabric.steps={FINEST_STEPS}")
    yarns = whole.layout.warp.yarn, whole.layout.weft.yarn
    extent = whole.layout.warp.pitch * whole.layout.cloth.ends, whole.layout.weft.pitch * whole.layout.cloth.picks
    for view, zoom in list(VIEWS.items())[: 1 if quick else None]:
        splatter, camera = Splatter(*SIZE), whole.camera(SIZE, zoom)
        usual = fibres_told_apart(yarns, extent, SIZE, zoom)
        tried = sorted({*((2, 4, 8, 12, 24) if quick else FIBRES), usual})
        counts = ((f"yarn.fibres={n}", n, n == usual) for n in tried)
        yield from _compared(f"fibres a ply, {view}", whole, counts, splatter, camera, runs)
        counts = ((f"fabric.steps={n}", n, n == USUAL_STEPS) for n in (STEPS[:5] if quick else STEPS))
        yield from _compared(f"pieces of a fibre, {view}", finest, counts, splatter, camera, runs)


def _compared(
    panel: str,
    best: Swatch,
    settings: Iterable[tuple[str, int, bool]],
    splatter: Splatter,
    camera: Camera,
    runs: int,
) -> Iterator[Row]:
    """settings: a change of the scene, its number, whether it is the default."""
    best.drawing(splatter, camera)()
    truth = {method: shown(splatter, by) for method, by in AVERAGED.items()}
    for change, number, usual in settings:
        swatch = Swatch(change)
        cost = cpu_seconds(swatch.drawing(splatter, camera), runs)
        for method, by in AVERAGED.items():
            yield Row(
                panel=panel,
                method=method,
                knob=f"{number}: {len(swatch.particles) / 1e6:.2g} M",
                value=1 / number,
                error=difference(shown(splatter, by), truth[method]),
                seconds=cost,
                default=usual,
            )


STUDY = Study(
    name="fibres",
    title="Fibre density: picture against particles",
    about="The swatch with 24 ends and 18 picks at 480 × 320. Left out of nothing but number: fewer fibres are drawn "
    "thicker, to the same area. References: all fibres that a ply really has, and 40 particles along a fibre between "
    "two crossings (at 12 fibres). Labels: the setting and particles in millions. Which fibres are drawn is chance, "
    "which single pixels show; means over 8 × 8 pixels, about a yarn, tell colour and brightness.",
    error=Axis("picture error, rms", "of 255", 1.0),
    time=Axis("CPU time of a picture", "ms", 1e3),
    rows=rows,
    why={
        f"{panel}, {view}: {method}": reason for panel, reason in WHY.items() for view in VIEWS for method in AVERAGED
    },
)
