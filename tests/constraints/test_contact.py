"""Cloth against bodies: friction, wrapping, carrying, fast limbs, rest, threads, pins on bones.

One grid of 41 × 41 and one set of kinds of primitives serve all of them, so that they share a kernel.
"""

import numpy as np
import pytest
from strips import NOTHING, PLAIN, replace, run, simulate

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.body.colliders.grid import DistanceGrid
from taichi_cloth.body.primitives.distance import nearest_distance
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate

N = 41
UP = np.array([0.0, 1.0, 0.0])
FAR = (
    Primitive(kind="sphere", start=50 * UP, end=50 * UP, radii=(0.1, 0.1)),
    Primitive(kind="elliptic", start=50 * UP, end=51 * UP, radii=(0.1, 0.1), across=np.array([1.0, 0, 0])),
)
TABLE = Primitive(
    kind="elliptic", start=-0.5 * UP, end=0 * UP, radii=(2.0, 2.0), across=np.array([1.0, 0, 0]), rounding=0.01
)


def touching(*primitives: Primitive, **options) -> Colliders:
    return Colliders(primitives=(*primitives, *FAR), **options)


def sheet_of(size: float, columns: int = N, pinned=None, **changes) -> Sheet:
    """A square of `size` [m], or a strip of its first columns."""
    a = size / (N - 1)
    cells = np.zeros((N - 1, N - 1), bool)
    cells[:, : columns - 1] = True
    material = replace(PLAIN, **changes)
    return Sheet.of_cells(
        cells, material=material, springs=calibrate(material, spacing_x=a, spacing_y=a), pinned=pinned
    )


def level(sheet: Sheet, height: float) -> np.ndarray:
    """Positions in a level plane, the middle of the square over the origin."""
    u = sheet.flat() - (N - 1) / 2 * np.array([sheet.springs.spacing_x, sheet.springs.spacing_y, 0.0])
    return np.stack([u[..., 0], np.full((N, N), height), -u[..., 1]], axis=-1)


def clearance(body: Colliders, positions: np.ndarray) -> float:
    """The least distance [m] to what stands at rest, less the gap."""
    return float(nearest_distance(body.primitives, positions.reshape(-1, 3))[0].min() - body.gap)


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_a_patch_slips_at_the_friction_angle(factor: float) -> None:
    """µ = 0.5. 1 % below its angle the patch stays within 0.1 mm for 0.5 s; 1 % above it slides as
    a = g (sin − µ cos) says, 6.4 mm, to 0.3 mm."""
    angle = factor * np.arctan(0.5)
    gravity = (9.81 * float(np.sin(angle)), -9.81 * float(np.cos(angle)), 0.0)
    sheet = sheet_of(0.2)
    body = touching(TABLE, friction=0.5, gap=0.002)
    x = level(sheet, 0.002)
    moved = (run(simulate(sheet, forces=Forces(gravity=gravity, body=body), positions=x), 30)[-1] - x)[..., 0]
    exact = 0.125 * 9.81 * max(0.0, float(np.sin(angle) - 0.5 * np.cos(angle)))
    assert np.abs(moved - exact).max() < (3e-4 if exact else 1e-4), f"{moved.mean():.2e} instead of {exact:.2e} m"


def test_what_starts_inside_is_let_out_and_then_lies_still() -> None:
    """4 mm too deep, without gravity or damping: out to 10 µm within 10 frames, and then no faster than 1 mm/s."""
    sheet = sheet_of(0.2)
    body = touching(TABLE, gap=0.002)
    simulation = simulate(sheet, forces=replace(NOTHING, body=body), positions=level(sheet, -0.002))
    x = run(simulation, 12)
    assert clearance(body, x[0]) == pytest.approx(-0.004, abs=1e-4)
    assert clearance(body, x[10]) > -1e-5
    assert np.abs(x[-1] - x[-2]).max() * 60 < 1e-3


def test_a_strip_pulled_over_a_cylinder_obeys_the_capstan_equation() -> None:
    """Half a turn at µ = 0.3: T₂/T₁ = e^{µπ} = 2.57 while it slides, to 5 %."""
    radius, columns = 0.05, 3
    held = np.zeros((N, N), bool)
    held[[0, -1], :columns] = True
    sheet = sheet_of(
        0.26,
        columns,
        pinned=held,
        tensile_warp=100.0,
        tensile_weft=100.0,
        shear=0.0,
        bending_warp=1e-7,
        air_damping=20.0,
    )
    span = (0.26 - np.pi * radius) / 2
    s = sheet.flat()[..., 1] - span
    turn = np.clip(s / radius, 0.0, np.pi)
    x = np.stack([-radius * np.cos(turn), radius * np.sin(turn), sheet.flat()[..., 0]], axis=-1)
    x[..., 1] += np.where(s < 0, s, 0.0) - np.where(s > np.pi * radius, s - np.pi * radius, 0.0)
    last = np.zeros_like(held)
    last[-1, :columns] = True

    def path(time: float) -> np.ndarray:
        return x[last] - np.array([0.0, 0.012 * time, 0.0])

    capstan = Primitive(
        kind="cylinder", start=np.array([0, 0, -0.2]), end=np.array([0, 0, 0.3]), radii=(radius, radius)
    )
    forces = replace(NOTHING, body=touching(capstan, friction=0.3))
    simulation = simulate(sheet, forces=forces, positions=x, pins=(Pins(held & ~last), Pins(last, path)))
    strain = np.mean([sheet.stretch(p)[1][:, 1] for p in run(simulation, 40)[25:]], axis=0)
    assert strain[-6:].mean() / strain[:6].mean() == pytest.approx(np.exp(0.3 * np.pi), rel=0.05)


BODIES = {
    "sphere": Primitive(kind="sphere", start=np.zeros(3), end=np.zeros(3), radii=(0.12, 0.12)),
    "cylinder": Primitive(kind="cylinder", start=np.array([0, 0, -0.2]), end=np.array([0, 0, 0.2]), radii=(0.1, 0.06)),
    "elliptic": Primitive(
        kind="elliptic",
        start=np.array([0, 0, -0.15]),
        end=np.array([0, 0, 0.15]),
        radii=(0.13, 0.07),
        across=np.array([1.0, 0, 0]),
        rounding=0.02,
    ),
}


@pytest.mark.parametrize("name", BODIES)
def test_a_sheet_at_rest_over_a_body_stays_outside(name: str) -> None:
    """Deepest penetration of the gap below 0.05 mm in every frame (0.5 mm is asked for), and it does rest on it."""
    sheet = sheet_of(0.5, air_damping=2.0)
    body = touching(BODIES[name], gap=0.002)
    paths = run(simulate(sheet, forces=Forces(body=body), positions=level(sheet, 0.15)), 75)
    assert min(clearance(body, p) for p in paths) > -5e-5
    assert clearance(body, paths[-1]) < 1e-4
    assert paths[-1, ..., 1].min() < 0.0
    assert max(s.max() for s in sheet.stretch(paths[-1])) < 0.15


def turned(axis: int, angle: float, shift=(0.0, 0.0, 0.0)) -> np.ndarray:
    out = np.eye(4)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    out[i, i] = out[j, j] = np.cos(angle)
    out[j, i], out[i, j] = np.sin(angle), -np.sin(angle)
    out[:3, 3] = shift
    return out


def test_a_sheet_on_a_turning_cylinder_is_carried_round() -> None:
    """µ = 0.8, so that the sheet sticks (its ends differ by less than e^{µθ}). After 0.5 rad its middle has turned by
    as much, to 2 %."""
    sheet = sheet_of(0.5, air_damping=2.0)
    spindle = replace(BODIES["cylinder"], radii=(0.1, 0.1))

    def motion(time: float) -> np.ndarray:
        return turned(2, max(0.0, time - 0.8))[None]

    body = touching(spindle, gap=0.002, friction=0.8, motion=motion)
    simulation = simulate(sheet, forces=Forces(body=body), positions=level(sheet, 0.11))
    paths = run(simulation, 78)
    angle = [np.arctan2(p[20, 20, 1], p[20, 20, 0]) for p in (paths[48], paths[-1])]
    assert angle[1] - angle[0] == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize("turning", [False, True])
def test_a_fast_limb_does_not_pass_through(turning: bool) -> None:
    """A limb of radius 30 mm hits a free sheet from below at 5 m/s, 60 frames/s: pushed or swung through it."""
    sheet = sheet_of(0.3)
    limb = Primitive(kind="cylinder", start=np.array([0, 0, -0.4]), end=np.array([0, 0, 0.4]), radii=(0.03, 0.03))

    def motion(time: float) -> np.ndarray:
        if turning:  # about a hinge 0.5 m to the side, 10 rad/s
            return (turned(2, 10 * time - 0.4) @ np.block([[np.eye(3), np.array([[0.5], [0], [0]])], [0, 0, 0, 1]]))[
                None
            ]
        return turned(0, 0.0, (0.0, 5 * time - 0.2, 0.0))[None]

    body = touching(limb, motion=motion)
    x = level(sheet, 0.0) + ([0.5, 0.0, 0.0] if turning else [0.0, 0.0, 0.0])
    simulation = simulate(sheet, forces=replace(NOTHING, body=body), positions=x)
    for _ in range(6):
        simulation.step()
        rest = np.linalg.inv(motion(simulation.time)[0])
        local = simulation.positions @ rest[:3, :3].T + rest[:3, 3]
        assert clearance(touching(limb), local) > -1e-3
        assert (local[:, 20, 1] > 0.02).all(), "the middle of the sheet is behind the limb"
    assert np.linalg.norm(simulation.positions - x, axis=-1).max() > 0.1


def test_a_limb_is_met_where_it_is_when_steps_become_shorter() -> None:
    """A limb that comes up at 1 m/s takes a sheet along. After a shorter step it is where its motion says in all
    substeps: with those of before it would be a third further at the end of a frame, 5 mm, and draw back."""
    sheet = sheet_of(0.2)

    def motion(time: float) -> np.ndarray:
        return turned(0, 0.0, (0.0, time, 0.0))[None]

    body = touching(BODIES["sphere"], motion=motion)
    simulation = simulate(sheet, forces=Forces(body=body), positions=level(sheet, 0.122))
    lows = []
    for number in range(8):
        if number == 4:
            before = simulation.solver.step
            assert simulation.solver.shorten(simulation.state, None)
            assert simulation.solver.step < 0.8 * before
        simulation.step()
        lows.append(clearance(touching(BODIES["sphere"]), simulation.positions - motion(simulation.time)[0, :3, 3]))
    assert min(lows) > -1e-4
    assert max(lows[3:]) < 1e-3, lows


@pytest.mark.slow
def test_steps_longer_than_a_limb_find_it_on_their_way() -> None:
    """A wire 1 mm thick comes at 5 m/s, more than twice its thickness a step; it meets the middle column in the middle
    of a frame and takes it along."""
    sheet = sheet_of(0.6)
    wire = Primitive(kind="cylinder", start=np.array([0, 0, -0.6]), end=np.array([0, 0, 0.6]), radii=(5e-4, 5e-4))
    body = touching(wire, motion=lambda time: turned(0, 0.0, (0.0, 5 * time - 0.04, 0.0))[None], friction=0.8)
    simulation = simulate(sheet, forces=replace(NOTHING, body=body), positions=level(sheet, 0.0))
    assert 5 * simulation.solver.step > 2e-3
    simulation.step()
    assert simulation.positions[:, N // 2, 1].min() > 5 / 60 - 0.04 - 1e-4


@pytest.mark.slow
def test_one_and_two_threads_touch_alike() -> None:
    sheet = sheet_of(0.3, air_damping=2.0)
    body = touching(BODIES["sphere"], motion=lambda time: turned(0, 3 * time, (0.0, 2 * time, 0.0))[None])
    states = [
        simulate(sheet, forces=Forces(body=body), positions=level(sheet, 0.13), threads=threads) for threads in (1, 2)
    ]
    for simulation in states:
        run(simulation, 8)
    assert states[0].state.values.tobytes() == states[1].state.values.tobytes()
    assert clearance(touching(BODIES["sphere"]), states[0].positions - [0.0, 2 * 8 / 60, 0.0]) < 1e-3


def test_a_scene_without_a_body_has_no_pass() -> None:
    assert simulate(sheet_of(0.3)).solver.constraints == ()  # pyright: ignore[reportAttributeAccessIssue]


def test_bodies_that_cannot_be_are_refused() -> None:
    for make in (
        lambda: Colliders(primitives=()),
        lambda: touching(TABLE, friction=-0.1),
        lambda: touching(TABLE, gap=float("nan")),
        lambda: touching(TABLE, beyond=(0.001, 0.001)),
        lambda: touching(TABLE, beyond=(-0.001,)),
        lambda: touching(TABLE, motion=lambda time: np.eye(4)),
        lambda: touching(TABLE, motion=lambda time: 2 * np.eye(4)[None]),
        lambda: touching(replace(TABLE, bone=1), motion=lambda time: np.eye(4)[None]),
    ):
        with pytest.raises(InputError):
            make()


def test_key_points_pinned_to_a_bone_go_where_it_goes() -> None:
    """A row carried by a bone that turns and shifts keeps its place in the bone, to 1e-6 m; the rest hangs from it."""
    held = np.zeros((N, N), bool)
    held[0] = True
    sheet = sheet_of(0.3, pinned=held, air_damping=2.0)
    x = level(sheet, 0.2)

    def motion(time: float) -> np.ndarray:
        return np.stack([np.eye(4), turned(1, 2 * time, (0.1, 0.3 * time, 0.0))])

    simulation = simulate(sheet, forces=Forces(), positions=x, pins=(Pins.on_bone(held, x, motion, 1),), threads=1)
    run(simulation, 10)
    local = [
        (p - m[:3, 3]) @ m[:3, :3] for p, m in ((x[0], motion(0.0)[1]), (simulation.positions[0], motion(1 / 6)[1]))
    ]
    assert np.abs(local[0] - local[1]).max() < 1e-6
    with pytest.raises(InputError, match=r"bone: 2"):
        Pins.on_bone(held, x, motion, 2)


@pytest.mark.slow
def test_a_sheet_rests_on_a_distance_grid_as_on_what_it_was_made_of() -> None:
    """A ball as a grid of 10 mm: trilinear values are off by up to s²/8 · 2/R = 0.2 mm, and so is the sheet."""
    radius, spacing = 0.12, 0.01
    places = spacing * np.stack(np.meshgrid(*[np.arange(-16, 17)] * 3, indexing="ij"), axis=-1)
    values = (np.linalg.norm(places, axis=-1) - radius).astype(np.float32)
    grid = DistanceGrid(places[0, 0, 0], spacing, values)
    sheet = sheet_of(0.5, air_damping=2.0)
    body = Colliders(grids=(grid,), gap=0.002)
    simulation = simulate(sheet, forces=Forces(body=body), positions=level(sheet, 0.15))
    paths = run(simulation, 60)
    distance = np.linalg.norm(paths, axis=-1) - radius - body.gap
    assert -2.5e-4 < distance.min() < 1e-4
    assert np.abs(np.sort(distance[-1].ravel())[:20]).max() < 3e-4
    assert paths[-1, ..., 1].min() < 0.0


def test_more_primitives_in_one_place_than_a_block_has_planes_for() -> None:
    """Seven balls one in the other, the largest last, and once first: the sheet lies on the largest."""
    balls = [replace(BODIES["sphere"], radii=(r, r)) for r in np.linspace(0.119, 0.12, 7).tolist()]
    sheet = sheet_of(0.5, air_damping=2.0)
    for several in (balls, balls[::-1]):
        body = touching(*several, gap=0.002)
        paths = run(simulate(sheet, forces=Forces(body=body), positions=level(sheet, 0.13)), 20)
        assert min(clearance(body, p) for p in paths) > -5e-5
        assert clearance(body, paths[-1]) < 1e-4


def test_a_state_is_not_taken_by_another_body_or_motion(tmp_path) -> None:
    sheet = sheet_of(0.3)
    x = level(sheet, 0.2)

    def moved(speed: float, **options) -> Simulation:
        body = touching(BODIES["sphere"], motion=lambda time: turned(0, 0.0, (0.0, speed * time, 0.0))[None], **options)
        return simulate(sheet, forces=Forces(body=body), positions=x)

    moved(1.0).save(tmp_path / "state.npz")
    moved(1.0).restore(tmp_path / "state.npz")
    still = simulate(sheet, forces=Forces(body=touching(BODIES["sphere"])), positions=x)
    smaller = simulate(sheet, forces=Forces(body=touching(replace(BODIES["sphere"], radii=(0.1, 0.1)))), positions=x)
    for other in (moved(1.1), moved(1.0, name="lift"), moved(1.0, gap=0.001), still, smaller):
        with pytest.raises(InputError, match="another"):
            other.restore(tmp_path / "state.npz")
