"""Garments of threads at their own sett: cut by the outline, hems, prints, panels of other weaves, stitches."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.detail.cell_stream import CellStream
from taichi_cloth.fabric.cells import CellThreads
from taichi_cloth.garment.pattern.prints import Print
from taichi_cloth.garment.sewn.cell_weaving import CellWeaving
from taichi_cloth.garment.sewn.stitches import PIECES, STRANDS, Stitches
from taichi_cloth.garment.sewn.weaving import Colours
from taichi_cloth.ground.particles import COLOUR, LANES, POSITION, RADIUS, ROWS
from taichi_cloth.scenes.prepare.garment_setup import Parts, dressed_parts, prepare_garment
from taichi_cloth.scenes.prepare.weave_layout import Cells
from taichi_cloth.scenes.scene.load import load_scene
from taichi_cloth.scenes.scene.schema import Scene

SETT = ["garment.key_points=700", "fabric.ends_per_cm=6", "fabric.picks_per_cm=5"]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("tshirt", [*SETT, "garment.weaves.front=plain"])


@pytest.fixture(scope="module")
def parts(scene: Scene) -> Parts:
    return dressed_parts(scene)


@pytest.fixture(scope="module")
def cells(scene: Scene, parts: Parts) -> Cells:
    prepared = prepare_garment(scene, parts.garment.atlas)
    assert prepared is not None
    assert prepared.cells is not None
    return prepared.cells


def woven(parts: Parts, cells: Cells, *, hem: float = 0.0, prints: dict[str, Print] | None = None) -> CellWeaving:
    atlas = parts.garment.atlas
    grey = Colours(np.full((1, 3), 0.5, np.float32), np.full((1, 3), 0.5, np.float32))
    colours = {piece.panel.name: grey for piece in atlas.panels}
    made = CellWeaving(atlas, cells.per_cell, cells.repeats, {"front": 1}, colours, hem=hem, prints=prints)
    flat = np.zeros((*atlas.shape, 3))
    flat[..., 0] = atlas.spacing[0] * np.arange(atlas.shape[1])
    flat[..., 2] = -atlas.spacing[1] * np.arange(atlas.shape[0])[:, None]
    made.cloth.move(flat)
    return made


def particles(weaving: CellWeaving) -> np.ndarray:
    groups = CellStream(weaving.cloth).sample(10**8).reshape(ROWS, -1)
    return groups[:, groups[RADIUS] > 0]


def test_key_points_hold_whole_threads_at_the_sett(parts: Parts, cells: Cells) -> None:
    a, b = parts.garment.atlas.spacing
    assert cells.per_cell[0] / a == pytest.approx(600)
    assert cells.per_cell[1] / b == pytest.approx(500)
    assert parts.garment.atlas.key_points == pytest.approx(700, rel=0.1)


def test_threads_are_as_long_as_the_panels_are_large(parts: Parts, cells: Cells) -> None:
    """Length of all warp ends times their pitch, and of all weft picks times theirs: the panels' area, each."""
    cloth = woven(parts, cells).cloth
    atlas = parts.garment.atlas
    threads: CellThreads = cloth.threads
    length = np.add.reduceat(
        np.append(threads.spans[:, 1] - threads.spans[:, 0], 0.0), np.minimum(threads.first[:-1], len(threads.spans))
    )
    length[np.diff(threads.first) == 0] = 0.0
    pitch = atlas.spacing[0] / cells.per_cell[0] * atlas.spacing[1] / cells.per_cell[1]
    area = sum(piece.panel.area for piece in atlas.panels)
    for family in (0, 1):
        assert pitch * length[cloth.family_of_thread() == family].sum() == pytest.approx(area, rel=2e-3)


def test_nothing_is_drawn_beyond_the_outline(parts: Parts, cells: Cells) -> None:
    """In the atlas laid flat, each panel's particles lie in the box of its outline, a thread and a half more."""
    weaving = woven(parts, cells)
    atlas, drawn = parts.garment.atlas, particles(weaving)
    x, z = drawn[POSITION], -drawn[POSITION + 2]
    slack = 1.6e-3
    inside = np.zeros(len(x), bool)
    for piece in atlas.panels:
        outline = piece.outline() - piece.origin + np.array([piece.col, piece.row]) * atlas.spacing
        (left, low), (right, high) = outline.min(axis=0) - slack, outline.max(axis=0) + slack
        inside |= (x > left) & (x < right) & (z > low) & (z < high)
    assert inside.mean() > 0.999


def test_a_hem_is_a_second_layer_as_wide_as_it_says(parts: Parts, cells: Cells) -> None:
    weaving = woven(parts, cells, hem=0.02)
    drawn, height = particles(weaving), weaving.height
    under = drawn[POSITION + 1] < -2.0 * height  # half of its particles: the others are the sides that meet
    lengths = [
        np.linalg.norm(np.diff(piece.panel.edges[k], axis=0), axis=1).sum()
        for piece in parts.garment.atlas.panels
        for k in piece.panel.hems
    ]
    area = sum(piece.panel.area for piece in parts.garment.atlas.panels)
    assert lengths
    turned = 0.02 * sum(lengths)
    assert 2 * under.mean() == pytest.approx(turned / (area + turned), rel=0.1)


def test_a_print_dyes_the_threads_under_it(parts: Parts, cells: Cells) -> None:
    panel = next(p.panel for p in parts.garment.atlas.panels if p.panel.name == "front")
    image = np.zeros((4, 4, 4), np.float32)
    image[..., 0] = image[..., 3] = 1.0
    low, high = panel.outline.min(axis=0), panel.outline.max(axis=0)
    middle = (low + high) / 2
    weaving = woven(parts, cells, prints={"front": Print(image, (float(middle[0]), float(middle[1])), 0.1)})
    drawn = particles(weaving)
    red = (drawn[COLOUR] > 0.6) & (drawn[COLOUR + 1] < 0.1)
    whole = sum(piece.panel.area for piece in parts.garment.atlas.panels)
    assert red.mean() == pytest.approx(0.01 / whole, rel=0.1)


def test_stitches_lie_on_the_cloth_and_are_drawn_with_it(parts: Parts, cells: Cells) -> None:
    weaving = woven(parts, cells, hem=0.02)
    stitches = Stitches(parts.garment.pattern, weaving, hem=0.02, pitch=4e-3, diameter=8e-4)
    sewn = np.zeros((ROWS, -(-len(stitches) // LANES), LANES), np.float32)
    stitches.dress(sewn, np.ones(3))
    start = parts.garment.atlas.start()
    weaving.cloth.move(weaving.whole(start))
    stitches.follow(weaving.crossings(weaving.whole(start)), sewn)
    pieces = sewn.reshape(ROWS, -1)[:, : len(stitches)]
    stream = CellStream(weaving.cloth, pieces=pieces, each=STRANDS * PIECES)

    class Above:
        rotation, translation = np.diag([1.0, -1.0, -1.0]), np.array([0.0, 1.0, 4.0])
        focal, cx, cy, width, height, near = 100.0, 64.0, 64.0, 128, 128, 0.1

    seen = stream.survey(Above())
    chosen = np.arange(len(seen.patch), len(seen.counts), dtype=np.int32)
    groups, count = stream.lay(seen, chosen[seen.counts[chosen] > 0])
    assert count == len(stitches)
    assert groups.reshape(ROWS, -1)[:, :count] == pytest.approx(pieces)
    yarn, part = stream.numbers(seen, chosen)
    assert (yarn == -1).all()
    assert (part == -1).all()
    assert replace(seen, eye=None).eye is None
