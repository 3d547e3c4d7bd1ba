"""Which limbs a panel meets, and contact that spares the others. One grid of 9 × 25 serves all that run a kernel."""

from dataclasses import replace

import numpy as np
import pytest
from strips import PLAIN, simulate

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.body.primitives.distance import nearest_distance
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.skin.names import JOINTS
from taichi_cloth.garment.pattern.cut import cut
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern
from taichi_cloth.garment.sewn.limbs import LIMBS, bearer, limb_of_bones, spared
from taichi_cloth.motion.forces import Forces
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate

ROWS, COLS = 9, 25
UP = np.array([0.0, 1.0, 0.0])
CHEST, ARM, LEG = (JOINTS.index(name) for name in ("spine3", "upper_arm_l", "thigh_l"))


def upright(x: float, radius: float, bone: int, low: float = -0.5, high: float = 0.5) -> Primitive:
    start, end = np.array([x, low, 0.0]), np.array([x, high, 0.0])
    return Primitive(kind="cylinder", start=start, end=end, radii=(radius, radius), bone=bone)


CHESTED = upright(0.0, 0.15, CHEST)
ARMED = upright(0.22, 0.05, ARM)  # 20 mm between the two
LEGGED = upright(0.0, 0.1, LEG, -1.5, -0.9)


def panel_of() -> Pattern:
    square = np.array([[0.0, 0], [0.08, 0], [0.08, 0.08], [0, 0.08], [0, 0]])
    edges = tuple(square[k : k + 2] for k in range(4))
    return Pattern("patch", (Panel("front", edges, Flat(np.eye(3), np.zeros(3))),), ())


@pytest.mark.parametrize(("low", "high", "bone"), [(9, 2, LEG), (2, 9, CHEST)])
def test_what_is_held_is_carried_by_what_most_of_it_lies_on(low: int, high: int, bone: int) -> None:
    """So many points round the leg, a tenth of a metre below the chest, and so many round the chest."""
    turns = np.linspace(0.0, 2 * np.pi, low + high)
    height = np.where(np.arange(low + high) < low, -0.95, -0.45)
    places = np.stack([0.16 * np.cos(turns), height, 0.16 * np.sin(turns)], axis=-1)
    assert bearer(places, [CHESTED, LEGGED]) == bone


def meets(bits: int) -> set[str]:
    return {limb for limb, names in LIMBS.items() if not (bits >> JOINTS.index(names[0])) & 1}


@pytest.mark.parametrize(
    ("moving", "x", "z", "met"),
    [
        (False, 0.156, 0.0, {"trunk", "leg_l", "leg_r", "arm_l"}),
        (False, 0.156, 0.09, {"trunk", "leg_l", "leg_r"}),
        (False, 0.167, 0.0, {"trunk", "leg_l", "leg_r", "arm_l"}),
        (True, 0.156, 0.0, set()),
        (True, 0.167, 0.0, set()),
        (True, 0.16, 0.09, {"trunk"}),
    ],
)
def test_a_shirt_meets_the_trunk_and_slips_into_the_fold_under_an_arm(moving, x, z, met):
    """A patch before the chest meets trunk and legs; one point of it in the fold, x from the chest's middle, meets
    both at rest, within 2 cm of the arm, and nothing once the body moves; 6 cm from the arm and 3 from the chest, the
    chest."""
    atlas = cut(panel_of(), (0.01, 0.01))
    around = np.linspace(-0.5, 0.5, 9)
    at = np.stack([0.16 * np.sin(around), 0 * around, 0.16 * np.cos(around)], -1)
    positions = np.broadcast_to(at, (9, 9, 3)).copy()
    positions[..., 1] = 0.01 * np.arange(9)[:, None]
    positions[4, 4] = (x, 0.0, z)
    bits = spared(atlas, positions, (CHESTED, ARMED, LEGGED), moving=moving)
    assert bits.shape == atlas.shape
    assert meets(int(bits[4, 4])) == met
    assert meets(int(bits[0, 4])) == {"trunk", "leg_l", "leg_r"}


@pytest.mark.parametrize(("x", "met"), [(0.156, {"trunk", "leg_l", "leg_r"}), (0.167, {"arm_l"})])
def test_beside_a_sleeve_cloth_under_the_arm_meets_the_nearer(x, met):
    """The same with a second patch round the arm: the sleeve lies in the fold, too."""
    front = panel_of().panels[0]
    atlas = cut(Pattern("two", (front, replace(front, name="sleeve")), ()), (0.01, 0.01))
    around = np.linspace(-0.5, 0.5, 9)
    positions = np.zeros((*atlas.shape, 3))
    for piece, radius, middle in zip(atlas.panels, (0.16, 0.055), (0.0, 0.22), strict=True):
        own = positions[piece.row : piece.row + 9, piece.col : piece.col + 9]
        own[..., 0], own[..., 2] = middle + radius * np.sin(around), radius * np.cos(around)
    first = atlas.panels[0]
    at = first.row + 4, first.col + 4
    positions[at] = (x, 0.0, 0.0)
    assert meets(int(spared(atlas, positions, (CHESTED, ARMED, LEGGED), moving=False)[at])) == met


def test_cloth_meets_the_limb_of_another_panel_that_it_lies_on():
    """On the shoulder, where both surfaces face the same way, a point meets both; it is no fold."""
    atlas = cut(panel_of(), (0.01, 0.01))
    top = Primitive(kind="sphere", start=0.3 * UP, end=0.3 * UP, radii=(0.2, 0.2), bone=CHEST)
    tip = Primitive(kind="sphere", start=0.31 * UP, end=0.31 * UP, radii=(0.2, 0.2), bone=ARM)
    positions = np.full((9, 9, 3), 0.7) * UP
    positions[:, :3] -= 0.185 * UP  # 15 mm above the chest's ball, 5 mm above the arm's
    bits = spared(atlas, positions, (CHESTED, top, tip), moving=True)
    assert meets(int(bits[0, 0])) == {"trunk", "arm_l", "leg_l", "leg_r"}


@pytest.mark.parametrize(("x", "met"), [(0.006, "leg_l"), (-0.006, "leg_r")])
def test_cloth_between_thighs_meets_the_nearer(x, met):
    legs = (upright(0.09, 0.08, LEG), upright(-0.09, 0.08, JOINTS.index("thigh_r")))
    atlas = cut(panel_of(), (0.01, 0.01))
    positions = np.broadcast_to(np.array([0.09, 0.0, 0.09]), (9, 9, 3)).copy()
    positions[4, 4] = (x, 0.0, 0.0)
    assert meets(int(spared(atlas, positions, legs, moving=False)[4, 4])) == {met}


def test_legs_of_trousers_do_not_meet_each_other():
    legs = (upright(0.09, 0.08, LEG), upright(-0.09, 0.08, JOINTS.index("thigh_r")))
    atlas = cut(panel_of(), (0.01, 0.01))
    positions = np.broadcast_to(np.array([0.09, 0.0, 0.09]), (9, 9, 3))
    assert meets(int(spared(atlas, positions, legs, moving=True)[4, 4])) == {"leg_l"}


@pytest.mark.parametrize(("rows", "met"), [(1, {"trunk", "leg_l"}), (0, {"leg_l"})])
def test_trousers_meet_the_trunk_too(rows, met):
    """A panel along a thigh, a ninth of it beside the trunk, over the thigh's end, where normals of both lie 63° apart:
    it meets both there. One that is all on the thigh meets the thigh."""
    atlas = cut(panel_of(), (0.01, 0.01))
    positions = np.broadcast_to(np.array([0.12, -0.9, 0.06]), (9, 9, 3)).copy()
    positions[9 - rows :] = (0.156, -0.35, 0.0)
    thigh = upright(0.12, 0.05, LEG, -1.4, -0.42)
    assert meets(int(spared(atlas, positions, (CHESTED, thigh), moving=True)[8, 4])) == met


def patches(cells: np.ndarray) -> Sheet:
    material = replace(PLAIN, tensile_warp=200.0, tensile_weft=200.0, air_damping=2.0)
    return Sheet.of_cells(cells, material=material, springs=calibrate(material, spacing_x=0.01, spacing_y=0.01))


@pytest.mark.slow
def test_what_spares_a_bone_falls_through_it():
    """Two patches over one table: one lies on it, the other falls as if there were none, in blocks of 8 that both
    share."""
    cells = np.ones((ROWS - 1, COLS - 1), bool)
    cells[:, 11] = False
    sheet = patches(cells)
    positions = sheet.flat()[..., [0, 2, 1]] + [0.0, 0.3, 0.0]
    table = Primitive(kind="sphere", start=-5 * UP, end=-5 * UP, radii=(5.299, 5.299), bone=ARM)
    bits = np.zeros((ROWS, COLS), np.int32)
    bits[:, :12] = 1 << ARM
    body = Colliders(primitives=(table,), gap=0.001, spared=bits)
    simulation = simulate(sheet, forces=Forces(body=body), positions=positions)
    for _ in range(6):
        simulation.step()
    height = simulation.positions[..., 1]
    damped = 9.81 / 2.0**2 * (2.0 * 0.1 - 1 + np.exp(-2.0 * 0.1))  # 0.1 s of fall in air of 2 1/s
    np.testing.assert_allclose(height[:, :12], 0.3 - damped, atol=5e-4)
    above = nearest_distance([table], simulation.positions[:, 12:].reshape(-1, 3))[0]
    np.testing.assert_allclose(above, 0.001, atol=2e-4)


@pytest.mark.parametrize("sparing", [True, False])
def test_cloth_between_an_arm_and_the_chest_is_not_torn(sparing):
    """A patch on the chest, an arm pressed 8 mm into it that moves along it at 0.5 m/s: held by both it is stretched,
    by the chest alone it is not."""
    sheet = patches(np.ones((ROWS - 1, COLS - 1), bool))
    flat = sheet.flat()
    turn = flat[..., 1] / 0.154 - 0.26
    positions = np.stack([0.154 * np.cos(turn), flat[..., 0] - 0.12, 0.154 * np.sin(turn)], -1)
    chest, arm = upright(0.0, 0.15, CHEST, -1.0, 1.0), upright(0.192, 0.05, ARM, -0.05, 0.05)

    def motion(time: float) -> np.ndarray:
        out = np.tile(np.eye(4), (len(JOINTS), 1, 1))
        out[ARM, 1, 3] = 0.5 * time
        return out

    bits = np.full((ROWS, COLS), 1 << ARM if sparing else 0, np.int32)
    body = Colliders(primitives=(chest, arm), motion=motion, friction=0.5, gap=0.004, spared=bits)
    simulation = simulate(sheet, forces=Forces(gravity=(0.0, 0.0, 0.0), body=body), positions=positions)
    largest = 0.0
    for _ in range(10):
        simulation.step()
        largest = max(largest, *(float(s.max()) for s in simulation.sheet.stretch(simulation.positions)))
    assert (largest < 0.005) == sparing, f"{largest:.4f}"
    if not sparing:
        assert largest > 0.02


@pytest.mark.parametrize(("between", "both"), [(None, False), (5e-4, False), (5e-4, True)])
def test_limbs_that_face_each_other_give_way_to_cloth_between_them(between, both):
    """A patch lies on one limb; another, which it does not meet or meets as well, reaches 6 mm into that from above. It
    lies at the gap, or as far from the middle between both as these leave it."""
    sheet = patches(np.ones((ROWS - 1, COLS - 1), bool))
    positions = sheet.flat()[..., [0, 2, 1]] + [-0.12, 0.002, -0.04]
    chest, arm = (
        Primitive(kind="sphere", start=y * UP, end=y * UP, radii=(5.0, 5.0), bone=bone)
        for y, bone in ((-5.0, CHEST), (4.994, ARM))
    )
    bits = np.full((ROWS, COLS), 0 if both else 1 << ARM, np.int32)
    body = Colliders(primitives=(chest, arm), gap=0.001, spared=bits, between=between, limbs=limb_of_bones())
    simulation = simulate(sheet, forces=Forces(body=body), positions=positions)
    for _ in range(8):
        simulation.step()
    own, other = (nearest_distance([p], simulation.positions.reshape(-1, 3))[0] for p in (chest, arm))
    np.testing.assert_allclose(own, 0.001 if between is None else other - 2 * between, atol=1e-4)
