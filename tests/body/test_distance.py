"""Signed distances against surfaces sampled by brute force, against finite differences, and on the device."""

from dataclasses import replace

import numpy as np
import pytest
import taichi as ti
from scipy.spatial import KDTree

from taichi_cloth.body.colliders.colliders import Colliders, solid_distance
from taichi_cloth.body.primitives.distance import nearest_distance, signed_distance
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.primitives.shapes import EVERYWHERE
from taichi_cloth.constraints import contact
from taichi_cloth.constraints.contact import Contact
from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x2
from taichi_cloth.motion.forces import Forces
from taichi_cloth.sheet.materials import MATERIALS
from taichi_cloth.sheet.sheet import LANES, Sheet
from taichi_cloth.sheet.springs import calibrate

RNG = np.random.Generator(np.random.Philox(key=11))
AXIS = np.array([0.36, 0.48, 0.8])
ACROSS = np.array([0.8, -0.6, 0.0])
START = np.array([0.3, -0.2, 0.1])
SHAPES = {
    "sphere": Primitive(kind="sphere", start=START, end=START, radii=(0.11, 0.11)),
    "capsule": Primitive(kind="cylinder", start=START, end=START + 0.3 * AXIS, radii=(0.05, 0.05)),
    "tapered": Primitive(kind="cylinder", start=START, end=START + 0.3 * AXIS, radii=(0.09, 0.04)),
    "widening": Primitive(kind="cylinder", start=START, end=START + 0.1 * AXIS, radii=(0.03, 0.11)),
    "swallowed": Primitive(kind="cylinder", start=START, end=START + 0.05 * AXIS, radii=(0.03, 0.09)),
    "trunk": Primitive(
        kind="elliptic", start=START, end=START + 0.3 * AXIS, radii=(0.16, 0.1), across=ACROSS, rounding=0.03
    ),
    "sharp": Primitive(kind="elliptic", start=START, end=START + 0.2 * AXIS, radii=(0.05, 0.12), across=ACROSS),
    "round": Primitive(
        kind="elliptic", start=START, end=START + 0.2 * AXIS, radii=(0.08, 0.08), across=ACROSS, rounding=0.02
    ),
}
FINE = 240
MANY = 20_000
"""Random points in and around a solid, beside those on its axis, its ends, its edges and its surface."""
SPACING = 5e-3  # no point of a surface is further from a sample [m]


def profile(primitive: Primitive) -> np.ndarray:
    """Support points of the solid in directions all over the sphere, and points of its flat parts: its surface.

    (n, 3), and no point of the surface is further than SPACING from one of them.
    """
    length = float(np.linalg.norm(primitive.end - primitive.start))
    turn = (np.arange(FINE) + 0.5) * 2 * np.pi / FINE
    if primitive.kind == "elliptic":
        a, b = (r - primitive.rounding for r in primitive.radii)
        x, y = primitive.across, np.cross(AXIS, ACROSS)
        ring = np.stack([a * np.cos(turn), b * np.sin(turn)], 1)
        normal = np.stack([np.cos(turn) / a, np.sin(turn) / b], 1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        half = length / 2 - primitive.rounding
        heights = np.linspace(-half, half, 100)
        pieces = []
        for z in heights:
            pieces.append(np.column_stack([ring + primitive.rounding * normal, np.full(FINE, z)]))
        for sign in (-1, 1):
            for angle in np.linspace(0, np.pi / 2, 20 if primitive.rounding else 1):
                edge = ring + primitive.rounding * np.cos(angle) * normal
                pieces.append(
                    np.column_stack([edge, np.full(FINE, sign * (half + primitive.rounding * np.sin(angle)))])
                )
            for share in np.linspace(0, 1, 50):
                pieces.append(np.column_stack([share * ring, np.full(FINE, sign * length / 2)]))
        local = np.concatenate(pieces)
        centre = (primitive.start + primitive.end) / 2
        return centre + local[:, :1] * x + local[:, 1:2] * y + local[:, 2:] * AXIS
    r1, r2 = primitive.radii
    if primitive.kind == "sphere" or length <= abs(r1 - r2):
        centre = primitive.start if r1 >= r2 else primitive.end
        lift = np.linspace(-np.pi / 2, np.pi / 2, FINE // 2)
        height, across = max(r1, r2) * np.sin(lift), max(r1, r2) * np.cos(lift)
    else:
        centre = primitive.start
        edge = np.arcsin((r1 - r2) / length)
        low, high = np.linspace(-np.pi / 2, edge, 90), np.linspace(edge, np.pi / 2, 90)
        height = np.concatenate([r1 * np.sin(low), length + r2 * np.sin(high)])
        across = np.concatenate([r1 * np.cos(low), r2 * np.cos(high)])
        flank = np.linspace(0, 1, 100)[:, None]
        ends = np.array([[across[89], height[89]], [across[90], height[90]]])
        line = (1 - flank) * ends[0] + flank * ends[1]
        across, height = np.concatenate([across, line[:, 0]]), np.concatenate([height, line[:, 1]])
    y = np.cross(AXIS, ACROSS)
    return centre + (
        (across[:, None, None] * (np.cos(turn)[:, None] * ACROSS + np.sin(turn)[:, None] * y))
        + height[:, None, None] * AXIS
    ).reshape(-1, 3)


def places(primitive: Primitive, count: int) -> np.ndarray:
    """Random points in and around it, and points on its axis, its ends, its edges and square to them."""
    box = np.array([primitive.start, primitive.end])
    reach = 1.6 * max(primitive.radii)
    p = RNG.uniform(box.min(0) - reach, box.max(0) + reach, (count, 3))
    on_axis = primitive.start + RNG.uniform(-1, 2, (500, 1)) * (primitive.end - primitive.start)
    across = (primitive.start + primitive.end) / 2 + RNG.uniform(-0.2, 0.2, (500, 1)) * ACROSS
    other = (primitive.start + primitive.end) / 2 + RNG.uniform(-0.2, 0.2, (500, 1)) * np.cross(AXIS, ACROSS)
    surface = profile(primitive)
    near = surface[RNG.integers(0, len(surface), 3000)] + RNG.normal(0, 1e-4, (3000, 3))
    return np.concatenate([p, on_axis, across, other, near, [primitive.start, primitive.end]])


@pytest.mark.parametrize("name", SHAPES)
def test_the_distance_is_that_to_a_sampled_surface(name: str) -> None:
    """Samples lie on the surface, none further than s from the next: |d| ≤ nearest sample ≤ |d| + s, and
    where the surface is smooth and far, ≤ |d| + s²/(2|d|) + s²/(2R). Lower bound to 1e-9 m."""
    primitive = SHAPES[name]
    p = places(primitive, MANY // 4)  # looking for the nearest sample takes all of the time
    surface = profile(primitive)
    tree = KDTree(surface)
    d, _ = signed_distance(primitive, p)
    nearest, _ = tree.query(p, workers=2)
    s = SPACING
    assert (np.abs(d) - nearest).max() < 1e-9
    assert (nearest - np.abs(d)).max() < s
    far = np.abs(d) > 0.02
    assert (nearest - np.abs(d))[far].max() < s**2 / 0.04 + s**2 / 0.06
    assert np.abs(signed_distance(primitive, surface)[0]).max() < 1e-12


@pytest.mark.parametrize("name", SHAPES)
def test_the_sign_and_the_gradient_belong_to_the_distance(name: str) -> None:
    """Unit to 1e-12; stepping back along it by the distance lands on the surface to 1e-9 m; equal to central
    differences, to their error of at most curvature times step, but across ridges inside (fewer than 1 %)."""
    primitive = SHAPES[name]
    p = places(primitive, MANY)
    d, n = signed_distance(primitive, p)
    assert np.abs(np.linalg.norm(n, axis=1) - 1).max() < 1e-12
    assert np.abs(signed_distance(primitive, p - d[:, None] * n)[0]).max() < 1e-9
    e = 1e-7
    differences = np.stack(
        [
            (signed_distance(primitive, p + v)[0] - signed_distance(primitive, p - v)[0]) / (2 * e)
            for v in e * np.eye(3)
        ],
        axis=1,
    )
    wrong = np.abs(differences - n).max(axis=1) > 1e-5 + 2 * e / np.abs(d)  # the curvature of a sharp edge is 1/d
    assert wrong[:MANY].mean() < 0.01
    assert (d[wrong] < 0).all(), "ridges of a convex solid lie inside"


def test_hand_worked_distances() -> None:
    ball = Primitive(kind="sphere", start=np.zeros(3), end=np.zeros(3), radii=(0.1, 0.1))
    assert signed_distance(ball, [0.0, 0.0, 0.3])[0] == pytest.approx([0.2], abs=1e-15)
    assert signed_distance(ball, np.zeros(3))[0] == pytest.approx([-0.1], abs=1e-15)
    trunk = Primitive(
        kind="elliptic", start=np.zeros(3), end=np.array([0, 0, 0.4]), radii=(0.2, 0.1), across=np.array([1.0, 0, 0])
    )
    points = [[0.3, 0, 0.2], [0, 0.25, 0.2], [0, 0, 0.5], [0, 0, 0.2], [0.23, 0, 0.44], [0, 0, 0.35]]
    exact = [0.1, 0.15, 0.1, -0.1, 0.05, -0.05]
    assert signed_distance(trunk, points)[0] == pytest.approx(exact, abs=1e-12)


def test_the_nearest_of_several_is_the_least() -> None:
    shapes = [SHAPES["sphere"], replace(SHAPES["capsule"], start=START + 0.2 * ACROSS)]
    p = RNG.uniform(-0.5, 0.8, (1000, 3))
    each = np.stack([signed_distance(s, p)[0] for s in shapes])
    d, n, whose = nearest_distance(shapes, p)
    assert (d == each.min(axis=0)).all()
    assert (whose == each.argmin(axis=0)).all()
    assert np.abs(np.linalg.norm(n, axis=1) - 1).max() < 1e-12


@pytest.mark.parametrize("name", SHAPES)
def test_a_wider_solid_is_as_much_nearer_to_all_that_is_outside(name: str) -> None:
    points = places(SHAPES[name], 2000)
    distance = signed_distance(SHAPES[name], points)[0]
    wider = signed_distance(SHAPES[name].wider(0.004), points)[0]
    outside = distance > 0
    assert outside.sum() > 100
    assert np.abs(distance - 0.004 - wider)[outside].max() < 1e-9


@pytest.mark.parametrize("beyond", [0.0, 0.008])
def test_points_within_the_gap_are_let_out_of_it_and_deeper_ones_are_not(beyond: float) -> None:
    """Of two balls: beyond both of them afterwards, and along the normal where only one is near. The same of two that
    are touched as if they were wider, and kept from by as much less."""
    middles = [np.array([x, 0.0, 0.0]) for x in (-0.08, 0.08)]
    balls = [Primitive(kind="sphere", start=at, end=at, radii=(0.1, 0.1)) for at in middles]
    body = Colliders(primitives=tuple(balls), gap=0.01 - beyond, beyond=(beyond,) * 2)
    turn = RNG.normal(size=(500, 3))
    points = balls[0].start + turn / np.linalg.norm(turn, axis=1, keepdims=True) * RNG.uniform(0.05, 0.13, (500, 1))
    before, out = solid_distance(balls, points), body.let_out(points)
    near = np.abs(before) < 0.01
    after = solid_distance(balls, out)
    assert (after >= before).all()
    assert (after[near] > 0.0097).mean() > 0.98  # a point between the two may stay
    assert (out[~near] == points[~near]).all()
    one = near & (signed_distance(balls[1], points)[0] > 0.03)
    assert one.sum() > 20
    assert np.abs(np.linalg.norm(out[one] - points[one], axis=1) - (0.01 - before[one])).max() < 1e-12


@ti.data_oriented
class Device:
    """Distances by the kernels' functions, for 8 points at a time."""

    def __init__(self, primitive: Primitive) -> None:
        body = Colliders(primitives=(primitive,))
        cotton = MATERIALS["cotton-shirting"].linear
        sheet = Sheet.rectangle(2, 2, material=cotton, springs=calibrate(cotton, spacing_x=0.1, spacing_y=0.1))
        self.contact = Contact(body, sheet)
        self.contact.join(2, 1e-4)
        self.contact.begin(None, Forces(body=body).during(0.0, 0.0))  # pyright: ignore[reportArgumentType]

    @ti.kernel
    def distances(self, points: F32x2, out: F32x2):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.contact.fields.follow(0)
            c = self.contact.fields.posed(0, 0)
            for b in range(points.shape[0] // LANES):
                x = ti.Vector([points[b * LANES + k, 0] - c[0] for k in ti.static(range(LANES))])
                y = ti.Vector([points[b * LANES + k, 1] - c[1] for k in ti.static(range(LANES))])
                z = ti.Vector([points[b * LANES + k, 2] - c[2] for k in ti.static(range(LANES))])
                self.contact.fields.measure(0, 0, x, y, z)
                for k in range(LANES):
                    for m in range(4):
                        out[b * LANES + k, m] = self.contact.fields.scratch[m * LANES + k]


SLENDER = replace(SHAPES["sharp"], radii=(0.015, 0.12))


@pytest.mark.parametrize("name", [*SHAPES, "slender"])
def test_the_kernel_s_distance_is_exact_to_a_micrometre(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """float32 points around the origin, against float64, to 1e-6 m. With the few steps that contact takes for an
    elliptic cylinder: within 10 mm of the surface, and beyond of the right sign and never more than the distance.
    The normal to 1e-3 (at the tips of thin and sharp ones to 1e-2)."""
    primitive = SLENDER if name == "slender" else SHAPES[name]
    primitive = replace(primitive, start=primitive.start - START, end=primitive.end - START)
    on_axis = np.linspace(-1, 2, MANY)[:, None] * (primitive.end - primitive.start)
    p = np.concatenate([places(primitive, MANY), on_axis]).astype(np.float32)
    p = p[: len(p) // LANES * LANES]
    exact, normal = signed_distance(primitive, p)
    near = np.abs(exact) < 0.01
    for everywhere in (True, False) if primitive.kind == "elliptic" else (True,):
        with monkeypatch.context() as patch:
            if everywhere:
                patch.setattr(contact, "newton_steps", lambda *_: EVERYWHERE)
            device = Device(primitive)
        out = np.zeros((len(p), 4), np.float32)
        with runtime.plain_code(routines=True):
            device.distances(p, out)
        error = out[:, 0] - exact
        assert np.abs(error[near | everywhere]).max() < 1e-6, f"{np.abs(error[near]).max():.1e}"
        assert error.max() < 1e-6
        assert ((out[:, 0] > 0) == (exact > 0))[np.abs(exact) > 1e-6].all()
        bad = np.abs(np.linalg.norm(out[:, 1:], axis=1) - 1) >= 1e-5
        if primitive.kind == "elliptic":  # on its axis itself no direction is out
            bad &= exact > exact.min() + 1e-6
        assert not bad.any()
        smooth = near & (exact > -1e-3)
        assert np.abs(out[smooth, 1:] - normal[smooth]).max() < (1e-2 if name in ("slender", "sharp") else 1e-3)
