"""What a graphics device does another way, on whatever there is: a thread a pixel, and sums of thousands of chunks."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.render.data.camera import Camera
from taichi_cloth.render.data.light import Background
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.data.sprites import CRISP, SOFT, Profile, SpriteSheet, round_sprite
from taichi_cloth.render.splat import splat
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.render.stage.paint import paint
from taichi_cloth.render.tiles import sort
from taichi_cloth.render.tiles.mesh import Mesh

CAMERA = Camera(np.eye(3), np.zeros(3), 100.0, 30.0, 25.0, 61, 50)


def cloud(count: int = 3000) -> Particles:
    """Pieces of fibre of all sizes and directions, opaque ones among them, and some behind the wall."""
    rng = np.random.default_rng(3)
    along = rng.standard_normal((count, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    place = rng.uniform((-0.35, -0.3, 0.9), (0.35, 0.3, 1.4), (count, 3))
    radius = rng.uniform(0.001, 0.02, count)
    return Particles(
        place,
        radius,
        rng.uniform(0.1, 0.9, (count, 3)),
        along,
        (0, 0, -1),
        half_length=2.5 * radius,
        opacity=rng.uniform(0.3, 1.0, count),
    )


@pytest.mark.parametrize(
    ("profile", "textured", "elliptic"),
    [
        (CRISP, False, True),
        (SOFT, False, False),
        (CRISP, True, True),
        pytest.param(CRISP, False, False, marks=pytest.mark.slow),  # each compiles two kernels
        pytest.param(SOFT, False, True, marks=pytest.mark.slow),
        pytest.param(CRISP, True, False, marks=pytest.mark.slow),
    ],
)
def test_a_thread_a_pixel_draws_what_rows_of_a_tile_draw(
    profile: Profile, textured: bool, elliptic: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Within one of 255: where little light is left a tile and a pixel end elsewhere."""
    sheet = SpriteSheet(np.stack([round_sprite()])) if textured else None
    drawn = cloud() if elliptic else replace(cloud(), half_length=None)
    splatter = Splatter(61, 50, profile=profile, sprites=sheet, opaque=0.0).load(drawn)
    background = Background(top=(0.2, 0.4, 0.9), bottom=(0.6, 0.6, 0.1))
    wall = Mesh([(-9.0, -9.0, 1.2), (9.0, -9.0, 1.2), (0.0, 9.0, 1.2)], [(0, 1, 2)], (0.9, 0.1, 0.1))
    backdrop = paint(CAMERA, mesh=wall, background=background)
    for behind in (None, backdrop):
        monkeypatch.setattr(splat, "on_host", lambda: True)
        rows = splatter.render(CAMERA, background=background, backdrop=behind).astype(int)
        of_rows = splatter.linear()
        monkeypatch.setattr(splat, "on_host", lambda: False)
        pixels = splatter.render(CAMERA, background=background, backdrop=behind).astype(int)
        assert np.abs(pixels - rows).max() <= 1
        assert np.abs(splatter.linear() - of_rows).max() < 1e-5
        assert np.ptp(rows) > 100


def test_batches_leave_what_one_picture_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(splat, "on_host", lambda: False)
    drawn = cloud()
    order = np.argsort(drawn.position[:, 2])
    nearest = [
        Particles(*(getattr(drawn, name)[part] for name in ("position", "radius", "colour", "tangent", "normal")))
        for part in (order[:1500], order[1500:], order)
    ]
    splatter = Splatter(61, 50, opaque=0.0)
    whole = splatter.load(nearest[2]).render(CAMERA)
    splatter.begin(CAMERA).add(nearest[0]).add(nearest[1])
    assert np.abs(splatter.finish().astype(int) - whole).max() <= 1


def test_sums_of_many_chunks_are_those_of_one_after_another() -> None:
    rng = np.random.default_rng(8)
    for chunks, bins in ((1, 3), (70, 2048), (300, 150)):
        counts = rng.integers(0, 5, (chunks, bins)).astype(np.int32)
        one, two = counts.copy(), counts.copy()
        scan, starts = sort.Scan(chunks, bins), np.zeros((2, bins + 1), np.int32)
        parts = [np.zeros(n, np.int32) for n in ((min(64, chunks), bins), bins, -(-bins // 64))]
        total = sort._scan_at_once(chunks, bins, two, *parts, starts[1])  # pyright: ignore[reportCallIssue]
        assert scan.places(one, chunks, bins, starts[0]) == total == counts.sum()
        assert (one == two).all()
        assert (starts[0] == starts[1]).all()
        assert (starts[0][:-1] == one[0]).all()
