"""Checks after sewing: each finds its own failure on a garment that was put there, and none on one that lies right.

Positions are those at which panels are placed round the body, and what is made of them; nothing is sewn here. What
sewn garments come to stands in docs/garments.md; the tests of sewing ask it of each of them.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("ezdxf")

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.skin.names import JOINTS
from taichi_cloth.garment.pattern.folded import Fin
from taichi_cloth.garment.sewn import sew as sewing
from taichi_cloth.garment.sewn.lies import (
    CROSSED,
    FOLDED,
    Lie,
    _axes,
    _turns,
    crossed,
    free_loops,
    lies,
    lying_faults,
)
from taichi_cloth.garment.sewn.worn import Worn, misfit
from taichi_cloth.motion.forces import SelfContact
from taichi_cloth.scenes.prepare.garment_setup import Parts, dressed_parts
from taichi_cloth.scenes.scene.load import load_scene

SAMPLE = Path(__file__).parents[1] / "data" / "patterns" / "own_tee.dxf"


def parts(name: str, pattern: Path | None = None, key_points: int = 800) -> Parts:
    more = [] if pattern is None else [f"garment.pattern={pattern}"]
    return dressed_parts(load_scene(name, ["body.gender=female", f"garment.key_points={key_points}", *more]))


def of_panel(made: Parts, name: str) -> np.ndarray:
    """Mask (rows, cols) of a panel's key points."""
    names = [piece.panel.name for piece in made.garment.atlas.panels]
    return made.garment.atlas.owner() == names.index(name)


def faults(made: Parts, positions: np.ndarray) -> str:
    return "; ".join(lying_faults(made.garment, positions, made.primitives))


@pytest.mark.parametrize("name", ["tshirt", "skirt", "dress"])
def test_what_lies_right_has_no_fault(name):
    made = parts(name)
    assert faults(made, made.garment.atlas.start()) == ""
    assert all(
        loop.placed == loop.worn for loop in free_loops(made.garment, made.garment.atlas.start(), made.primitives)
    )


def test_loops_are_neck_hem_and_cuffs():
    made = parts("tshirt")
    loops = free_loops(made.garment, made.garment.atlas.start(), made.primitives)
    assert sorted(sorted({side.panel for side in loop.sides}) for loop in loops) == [
        ["back", "front"], ["back", "front"], ["left_sleeve"], ["right_sleeve"],
    ]  # fmt: skip
    assert [loop.worn for loop in loops] == [1, 1, 1, 1]


@pytest.mark.parametrize(("name", "way", "said"), [("skirt", -0.12, "12 cm under"), ("trousers", 0.4, "40 cm over")])
def test_what_slid_down_or_hangs_round_the_neck_has_slipped(name, way, said):
    made = parts(name)
    moved = made.garment.atlas.start() + np.array([0.0, way, 0.0])
    assert f"lies {said} where it belongs (allowed 10)" in faults(made, moved)
    assert "where it belongs" not in faults(made, made.garment.atlas.start() + np.array([0.0, way / 6, 0.0]))


def test_a_wide_cuff_goes_round_its_own_leg():
    """It starts half before the other leg; round both it would go no more once it is worn."""
    made = parts("trousers")
    t = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    names = made.body.skeleton.names
    knee = made.body.skeleton.joints[names.index("shin_l")]
    circle = np.stack([np.cos(t), 0 * t, np.sin(t)], -1)
    start = knee - [0.06, 0.1, 0] + 0.2 * circle
    [leg] = _axes(start, made.primitives, "leg_l")
    assert _turns(start, *leg) == 1
    worn = knee - [0, 0.1, 0] + 0.065 * circle
    assert _turns(worn, *leg) == 1
    assert [_turns(worn, *axis) for axis in _axes(start, made.primitives, "")] == [1, 0]
    assert _turns(worn * [-1, 1, 1], *leg) == 0


def test_a_hem_goes_round_both_legs_whether_or_not_a_fold_hangs_between_them():
    made = parts("skirt")
    t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    knee = made.body.skeleton.joints[made.body.skeleton.names.index("shin_l")]
    hem = [0, knee[1] - 0.1, knee[2]] + 0.3 * np.stack([np.sin(t), 0 * t, np.cos(t)], -1)
    axes = _axes(hem, made.primitives, "skirt")
    assert len(axes) == 2
    behind = (np.abs(hem[:, 0]) < 0.04) & (hem[:, 2] < knee[2])
    between = hem + np.where(behind, 0.35, 0.0)[:, None] * [0, 0, 1]  # 5 cm past the middle between the legs
    beside = np.where(hem[:, :1] < 0, hem * [0.01, 1, 1], hem)  # off the right one
    assert [[_turns(line, *axis) for axis in axes] for line in (hem, between, beside)] == [[1, 1], [1, 1], [1, 0]]


def test_a_sleeve_on_the_other_arm_is_astray():
    made = parts("tshirt", SAMPLE)
    moved = made.garment.atlas.start()
    sleeve = of_panel(made, "left_sleeve")
    found = {lie.panel: lie for lie in lies(made.garment, moved, made.primitives)}
    assert found["left_sleeve"].astray < 0.25
    assert "nearest to another limb" not in faults(made, moved)
    moved[sleeve] = moved[sleeve] * [-1, 1, 1]
    found = {lie.panel: lie for lie in lies(made.garment, moved, made.primitives)}
    assert found["left_sleeve"].astray > 0.7  # the rest of it beside the trunk, as a wide sleeve may
    assert "% of left_sleeve lies nearest to another limb than its own" in faults(made, moved)


def test_what_is_inside_out_is_turned():
    made = parts("skirt")
    moved = made.garment.atlas.start() * [1, 1, -1]  # the front behind, its right side to the body
    assert "has its right side to the body" in faults(made, moved)
    half = lies(made.garment, made.garment.atlas.start() * [-1, 1, -1], made.primitives)  # turned round: it may be
    assert max(lie.turned for lie in half) < 0.1


def test_a_collar_may_fold_over_and_not_be_inside_out():
    """Its back, behind a wall; and not be laid in folds."""
    made = parts("tshirt", next((SAMPLE.parent / "random").glob("1092_*")), 5000)
    start, garment = made.garment.atlas.start(), made.garment
    name = next(p.panel.name for p in garment.atlas.panels if p.panel.label == "head" and "back" in p.panel.name)
    back = of_panel(made, name)
    middle = start[back].mean(axis=0) + np.array([0.0, 0.0, 10.05])
    wall = Primitive(kind="sphere", start=middle, end=middle, radii=(10.0, 10.0), bone=JOINTS.index("neck"))

    def of_back(positions: np.ndarray) -> Lie:
        return next(lie for lie in lies(garment, positions, [wall]) if lie.panel == name)

    half, over = np.median(start[back, 1]), start.copy()
    over[back, 1] = half - abs(start[back, 1] - half)  # its upper half hangs down over the lower one
    assert of_back(over).turned < 0.2
    assert of_back(over).folded < 0.1
    assert of_back(start * [-1, 1, 1]).turned > 0.9
    assert of_back(start).turned == 0.0
    again, quarter = over.copy(), (half + over[back, 1].min()) / 2
    again[back, 1] = quarter - abs(over[back, 1] - quarter)
    assert of_back(again).folded > FOLDED  # three times


def test_half_of_a_godet_may_face_the_body():
    """It hangs in a fold: between two walls both of its halves face one, beside one wall a half does."""
    made = parts("skirt", next((SAMPLE.parent / "random").glob("1186_*")), 5000)
    start, garment = made.garment.atlas.start(), made.garment
    name = next(piece.panel.name for piece in garment.atlas.panels if isinstance(piece.panel.place, Fin))
    middle = start[of_panel(made, name)].mean(axis=0)
    walls = [
        Primitive(kind="sphere", start=at, end=at, radii=(10.0, 10.0), bone=JOINTS.index("pelvis"))
        for at in (middle + np.array([side, 0.0, 0.0]) for side in (10.04, -10.04))
    ]

    def turned(walls: list[Primitive]) -> float:
        return next(lie.turned for lie in lies(garment, start, walls) if lie.panel == name)

    assert turned(walls[:1]) < 0.1
    assert turned(walls) > 0.7


def test_what_is_laid_in_folds_is_folded():
    """Once to and fro; then twice, which is more than bunching at a waist makes."""
    made = parts("tshirt")
    moved, front = made.garment.atlas.start(), of_panel(made, "front")
    rows = np.unique(moved[front][:, 1].round(6))
    for k, (share, folds) in enumerate(((2, 1), (4, 2))):
        low = float(rows[len(rows) // share])  # along a row of key points
        below = front & (made.garment.atlas.start()[..., 1] < low)
        crease = moved[front & (np.abs(made.garment.atlas.start()[..., 1] - low) < 1e-5)][0, 1]
        moved[below, 1] = 2 * crease - moved[below, 1]
        moved[below, 2] += 0.002
        found = {lie.panel: lie for lie in lies(made.garment, moved, made.primitives)}
        assert found["front"].folded == pytest.approx(folds, abs=0.3 * folds)
        assert found["back"].folded == 0
        assert ("front has folds" in faults(made, moved)) == (k == 1)


def test_what_lies_before_the_body_goes_not_round_it():
    """As a hood that is worn as a cape, or a waistband that did not close round the waist."""
    made = parts("skirt")
    start = made.garment.atlas.start()
    moved = start.copy()
    back = of_panel(made, "back")
    moved[back, 2] = 0.45 + 0.2 * np.abs(start[back, 2])
    assert "goes 0 times round its limb, not 1" in faults(made, moved)


def test_legs_through_each_other_are_counted():
    made = parts("tshirt")
    start = made.garment.atlas.start()
    assert crossed(made.garment, start) < 0.02  # what is not sewn yet is drawn from panel to panel along its seams
    moved = start.copy()
    back = of_panel(made, "back")
    moved[back, 2] = start[of_panel(made, "front"), 2].mean() + 0.05 * np.sin(40 * start[back, 0])  # to and fro
    assert "passes through itself" in faults(made, moved)


def test_contact_in_sewing_never_makes_a_garment_worse(monkeypatch):
    """A back that waves through the front, 12 triangles of 100, sewn anew: clear of itself, but 20 mm deep, it is not
    worn; as deep as is allowed it is; and of what may not cross itself at all, 3.6 mm deep rather than through it."""
    made = parts("tshirt")
    start = made.garment.atlas.start().astype(np.float32)
    waved, back = start.copy(), of_panel(made, "back")
    over = start[..., 1] - start[back, 1].min()  # the hem
    back &= (over > 0.1) & (over < 0.3)
    waved[back, 2] = start[of_panel(made, "front"), 2].mean() + 0.05 * np.sin(40 * start[back, 0])
    tangled = Worn(positions=waved, gap=0.0, depth=0.0, stretch=0.0, taut=0.0, speed=0.0, frames=0)
    monkeypatch.setattr(sewing, "_closed", lambda *rest: (start, 1))

    def sewn(layers, allowed, **clear):
        again = replace(tangled, positions=start, **clear)
        monkeypatch.setattr(sewing, "_rest", lambda first, cloth, apart, *rest: again if apart else tangled)
        body = Colliders(primitives=tuple(made.primitives), friction=0.3, gap=0.004)
        return sewing.sew(made.garment, body, layers=layers, allowed=allowed).positions is start

    layers = SelfContact(thickness=1e-3)
    assert not sewn(layers, CROSSED, depth=0.02, gap=3.4e-3)
    assert not sewn(layers, CROSSED, depth=0.02)
    assert not sewn(layers, CROSSED, speed=0.3, taut=0.1)
    assert sewn(layers, CROSSED, depth=0.003, gap=2e-3)
    assert sewn(layers, 0.0, depth=0.0036)
    assert not sewn(None, 0.0)


def test_the_line_of_what_does_not_fit_says_it():
    made = parts("skirt")
    start = made.garment.atlas.start().astype(np.float32)
    good = Worn(positions=start, gap=0.0, depth=0.0, stretch=0.0, taut=0.0, speed=0.0, frames=0)
    assert misfit(made.garment, good, made.primitives) is None
    slid = replace(good, positions=start - np.array([0, 0.2, 0], np.float32))
    line = misfit(made.garment, slid, made.primitives)
    assert line is not None
    assert "20 cm under" in line
    assert "\n" not in line
    at = start[of_panel(made, "back")][0]
    ball = Primitive(kind="sphere", start=at, end=at, radii=(0.2, 0.2), part="left_hand")
    deep = misfit(made.garment, replace(good, depth=0.02), [*made.primitives, ball])
    assert deep is not None
    assert "back lies 20.0 mm in the left hand (allowed 3)" in deep
