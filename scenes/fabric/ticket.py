"""The mill's ticket of a scene: its construction, the piece, what follows from it, and what is drawn and simulated."""

from dataclasses import dataclass

from taichi_cloth.fabric.layout import FabricLayout
from taichi_cloth.ground.errors import InputError
from taichi_cloth.mechanics.construction import Construction
from taichi_cloth.mechanics.fibre_mechanics import FibreMechanics
from taichi_cloth.mechanics.presets import PRESET_KEYS, WITHIN, named_construction
from taichi_cloth.mechanics.properties import FabricProperties, woven_properties
from taichi_cloth.mechanics.quantity import Quantity
from taichi_cloth.sheet.materials import Material
from taichi_cloth.yarn.yarn import Yarn

from ..plan.plan import plan
from ..prepare.construction import Drawn, construction_of, drawn_of, with_measured
from ..prepare.thread_colours import colour_repeats
from ..scene.schema import Scene
from .piece import Piece, piece_of

__all__ = ["PieceAsked", "Ticket", "ticket_of"]


@dataclass(frozen=True)
class PieceAsked:
    """What a person asks for; None takes the scene's own size, else a metre of a metre and a half.

    length, width: finished [m]. shrinkage: of the length, the width [%]. waste: of warp [m].
    """

    length: float | None = None
    width: float | None = None
    shrinkage: tuple[float, float] = (0.0, 0.0)
    waste: float = 0.0


@dataclass(frozen=True, eq=False)
class Ticket:
    """drawn: None where nothing of the threads is drawn. simulated: of the sheet that moves, by the keys of the
    properties; empty where nothing does. notes: what a person should know."""

    title: str
    fibre: str
    construction: Construction
    properties: FabricProperties
    piece: Piece
    drawn: Drawn | None
    simulated: dict[str, Quantity]
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, object]:
        """For JSON. Each quantity says its unit and where it is from."""
        made, drawn = self.construction, self.drawn
        return {
            "title": self.title,
            "construction": {
                "fibre": self.fibre,
                "weave": made.draft.name,
                "warp": _yarn(made.warp, made.warp_fibre),
                "weft": _yarn(made.weft, made.weft_fibre),
                "ends_per_cm": made.facts.ends_per_cm,
                "picks_per_cm": made.facts.picks_per_cm,
                "finish": made.finish,
            },
            "properties": {key: quantity.as_dict() for key, quantity in self.properties.items()},
            "drawn": None
            if drawn is None
            else {
                "ends_per_cm": drawn.facts.ends_per_cm,
                "picks_per_cm": drawn.facts.picks_per_cm,
                "mass_g_per_m2": self.drawn_mass,
                "thickness_mm": drawn.facts.thickness_mm,
                "thinned": drawn.thinned,
            },
            "simulated": {key: quantity.as_dict() for key, quantity in self.simulated.items()},
            "piece": self.piece.as_dict(),
            "notes": list(self.notes),
        }

    @property
    def material(self) -> Material:
        """The sheet that moves, or what would move of a cloth that lies; with all that cloth has beside springs, also
        where the scene leaves it out."""
        found = self.simulated or self.properties
        beside = {key: one for keys in WITHIN.values() for key, one in keys.items()}
        return Material(
            **{field: found[key].value / unit for key, (field, unit) in PRESET_KEYS.items() if key in found},
            **{field: {**self.properties, **found}[key].value / unit for key, (field, unit) in beside.items()},
        )

    @property
    def drawn_mass(self) -> float | None:
        """Of the threads as drawn [g/m²]."""
        return None if self.drawn is None else self.drawn.facts.mass_gsm


def _yarn(yarn: Yarn, fibre: FibreMechanics) -> dict[str, object]:
    return {
        "fibre": fibre.name,
        "tex": yarn.folded_tex,
        "count_tex": yarn.count_tex,
        "plies": yarn.plies,
        "twist_per_m": yarn.twist_per_m,
        "fineness_dtex": yarn.fineness_dtex,
        "diameter_mm": 1e3 * yarn.woven_diameter,
    }


def ticket_of(scene: Scene, asked: PieceAsked | None = None, measured: str | None = None) -> Ticket:
    """The ticket of a scene of a fabric, a cloth or a garment. measured: a file of measured properties. Raises
    InputError."""
    asked = asked or PieceAsked()
    moving = scene.cloth or scene.garment
    if moving is None and scene.weave is None:
        raise InputError(f"fabric: a scene of a {scene.subject} has no [weave]; use a woven scene, such as swatch")
    notes: tuple[str, ...] = ()
    layout = None
    if scene.weave is not None:
        prepared = plan(scene).prepared
        layout, notes = (prepared.layout, prepared.notes) if prepared is not None else (None, ())
        made, colours = construction_of(scene, _following(scene, layout)), colour_repeats(scene)
        if scene.yarn is not None and not scene.yarn.counted:
            plies = f"{made.warp.plies} × " if made.warp.plies > 1 else ""
            notes = (*notes, f"no yarn.count is stated: {plies}{made.warp.count_tex:.3g} tex stands for it")
    else:
        assert moving is not None
        made, colours = named_construction(scene.material), colour_repeats(scene)
        notes = (f"the scene names no [weave]: this is the construction of {scene.material}; no thread is drawn",)
    if made.pressed:
        thinner = 100.0 * made.fitted.thinned
        notes = (*notes, f"threads as thick as their yarn would jam; they are pressed to {thinner:.0f} % of that")
    size = (scene.cloth.length_m, scene.cloth.width_m) if scene.cloth else (1.0, 1.5)
    piece = piece_of(
        made,
        colours,
        length=size[0] if asked.length is None else asked.length,
        width=size[1] if asked.width is None else asked.width,
        shrinkage=(0.01 * asked.shrinkage[0], 0.01 * asked.shrinkage[1]),
        waste=asked.waste,
    )
    return Ticket(
        title=scene.title,
        fibre=made.warp_fibre.name,
        construction=made,
        properties=with_measured(woven_properties(made), measured or (moving.measured if moving else None)),
        piece=piece,
        drawn=None if layout is None else drawn_of(layout),
        simulated={} if moving is None else _moved_by(scene),
        notes=notes,
    )


def _following(scene: Scene, layout: FabricLayout | None) -> tuple[float, float] | None:
    """Ends and picks a cm of threads that follow key points; None where there are none."""
    if layout is not None:
        return 0.01 / layout.warp.pitch, 0.01 / layout.weft.pitch
    if scene.cloth is None:
        return None
    from ..prepare.sheet_setup import woven_scene  # loads Taichi, which the ticket of what lies does without

    section = woven_scene(scene).fabric
    assert section is not None
    assert section.ends_per_cm is not None
    assert section.picks_per_cm is not None
    return section.ends_per_cm, section.picks_per_cm


def _moved_by(scene: Scene) -> dict[str, Quantity]:
    from ..prepare.sheet_setup import moved_by  # loads Taichi, which the ticket of what lies does without

    return moved_by(scene)
