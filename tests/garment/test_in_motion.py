"""Facts of the motion: how deep and how long in each frame, and in which over all of them. Nothing is simulated."""

import json

import numpy as np
import pytest

from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.garment.pattern.cut import cut
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern, Seam, Side
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.garment.sewn.in_motion import Moment, Watch
from taichi_cloth.scenes.models.facts import Fact
from taichi_cloth.scenes.models.model import FACTS
from taichi_cloth.scenes.models.motion_facts import MotionFacts
from taichi_cloth.sheet.materials import MATERIALS


def two_squares() -> Garment:
    """Side by side, 20 × 20 cm, sewn along the edge between them."""
    corner = 0.2 * np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0.0]])
    edges = tuple(corner[k : k + 2] for k in range(4))
    panels = tuple(Panel(name, edges, Flat(np.eye(3), np.array([x, 0, 0]))) for name, x in (("a", 0.0), ("b", 0.2)))
    pattern = Pattern("two", panels, (Seam(Side("a", 1), Side("b", 3)),))
    return Garment(pattern, cut(pattern, (0.02, 0.02)), MATERIALS["cotton-shirting"].linear)


def ball(x: float, bone: int, part: str) -> Primitive:
    at = np.array([x, 0.1, 0.0])
    return Primitive(kind="sphere", start=at, end=at, radii=(0.05, 0.05), part=part, bone=bone)


def test_depth_is_that_in_the_moved_body_and_says_where():
    garment = two_squares()
    flat = garment.atlas.start()
    watch = Watch(garment, [ball(0.1, 0, "arm"), ball(3.0, 1, "leg")])
    bones = np.tile(np.eye(4), (2, 1, 1))
    found = watch.at(flat, bones)
    assert found.part == "arm"
    assert found.depth == pytest.approx(0.05, abs=0.002)  # a key point lies in its middle
    bones[0, 2, 3] = 0.03  # the ball goes 3 cm before the cloth, the other comes 4 cm near
    bones[1, 0, 3], bones[1, 2, 3] = -2.7, 0.01
    found = watch.at(flat, bones)
    assert found.part == "leg"
    assert found.depth == pytest.approx(0.04, abs=0.002)
    turn = np.eye(4)
    turn[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]  # half a metre off, turned about y
    bones[:] = turn
    found = watch.at(flat, bones)
    assert (found.depth, found.part) == (0.0, "")
    assert found.stretch == pytest.approx(0.0, abs=1e-6)


def test_threads_at_a_seam_count_apart():
    garment = two_squares()
    flat = garment.atlas.start()
    watch = Watch(garment, [ball(9.0, 0, "arm")])
    longer = flat.copy()
    owner = garment.atlas.owner()
    rows, cols = np.nonzero(garment.atlas.present() & (owner == 1))
    middle = (rows == np.median(rows)) & (cols == np.median(cols))
    row, col = int(rows[middle][0]), int(cols[middle][0])
    longer[row, col, 0] += 0.002  # a tenth of a spacing, in the middle of b
    found = watch.at(longer)
    assert found.taut == pytest.approx(0.1, abs=0.01)
    assert found.panel == "b"
    sewn = flat.copy()
    at = np.argwhere(garment.sewn() & garment.atlas.present())[3]
    sewn[tuple(at)] += [0.0, 0.004, 0.0]
    found = watch.at(sewn)
    assert found.stretch > 0.15
    assert found.taut < 0.05


def test_the_deepest_and_the_longest_are_said_with_their_frames(tmp_path):
    facts = MotionFacts(tmp_path)
    assert facts.facts() == []
    for frame, (depth, taut) in enumerate([(0.0, 0.01), (0.004, 0.03), (0.002, 0.06), (0.001, 0.02)]):
        facts.moments[frame] = Moment(depth, "left upper arm" if depth else "", 2 * taut, taut, "front")
    deep, long = facts.facts()
    assert deep.value == "4.00 mm in frame 1, in left upper arm"
    assert long.value == "6.0 % in frame 2, of front; at seams 12.0 %"
    facts.write([Fact("mass of the garment", "120 g")])
    kept = json.loads((tmp_path / FACTS).read_text())
    assert kept["facts"][0]["name"] == "mass of the garment"
    assert len(kept["frames"]) == 4
    again = MotionFacts(tmp_path)  # a run that goes on from frame 2
    again.read(2)
    assert again.moments == {k: facts.moments[k] for k in range(3)}
    (tmp_path / FACTS).write_text("{}")
    again = MotionFacts(tmp_path)
    again.read(2)
    assert again.moments == {}
