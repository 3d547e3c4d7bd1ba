"""Sheets in motion against closed forms: hanging, bending, waves, contact, wind, led pins; saved, resumed, stopped."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from strips import COLS, NOTHING, PLAIN, ROWS, run, simulate, strip

from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.motion.forces import Forces, Plane, Sphere, Wind
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet

DOWN = Forces(gravity=(0.0, 9.81, 0.0))  # along the strip, whose rows follow y
# Wherever there is a wind, a ball or a floor there are all three, so that all run one kernel.
CALM = Wind(velocity=(0.0, 0.0, 0.0), drag=0.0, lift=0.0)
FAR = Sphere(centre=(0.0, -50.0, 0.0), radius=0.1)


def test_a_hanging_strip_is_longer_by_rho_g_l_squared_over_2k() -> None:
    """After 4 s with damping. Tolerance 1 %."""
    sheet = strip(length=1.0, pinned=(0,), tensile_warp=400.0, tensile_weft=400.0, shear=40.0, air_damping=8.0)
    x = run(simulate(sheet, forces=DOWN), 240)[-1]
    exact = 0.15 * 9.81 * 1.0**2 / (2 * 400.0)
    # Key points next to the pinned row cannot contract: the strip is a little stiffer there, as a real one.
    assert x[-1, :, 1].mean() - 1.0 == pytest.approx(exact, rel=0.01)


def test_a_longitudinal_wave_runs_at_sqrt_k_over_rho() -> None:
    """First mode of a strip held at one end: its period is 4 L / sqrt(E/ρ). Tolerance 0.5 %."""
    sheet = strip(length=0.4, pinned=(0,), shear=0.0)
    x = sheet.flat()
    x[..., 1] += 1e-3 * np.sin(np.pi * x[..., 1] / 0.8)
    period = 4 * 0.4 / (50.0 / 0.15) ** 0.5
    tip = run(simulate(sheet, positions=x, frame_rate=40 / period), 100)[:, -1, 1, 1] - 0.4
    times = np.arange(101) / 40
    crossings = [
        t0 + (times[1] - times[0]) * a / (a - b) for t0, a, b in zip(times, tip, tip[1:], strict=False) if a * b < 0
    ]
    assert np.diff(crossings).mean() * 2 == pytest.approx(1.0, rel=5e-3)


def test_halted_when_it_is_fastest_a_wave_is_gone() -> None:
    """The same wave a quarter of its period after it was let go, where all of its energy is motion. Tolerance 5 % of
    its amplitude, which it would come to if it were left alone."""
    sheet = strip(length=0.4, pinned=(0,), shear=0.0)
    x = sheet.flat()
    x[..., 1] += 1e-3 * np.sin(np.pi * x[..., 1] / 0.8)
    simulation = simulate(sheet, positions=x, frame_rate=40 / (4 * 0.4 / (50.0 / 0.15) ** 0.5))
    run(simulation, 10)
    simulation.halt()
    tip = run(simulation, 20)[:, -1, 1, 1] - 0.4
    assert np.abs(tip).max() < 5e-5


def test_slowed_it_keeps_a_share_of_what_it_moved_by() -> None:
    """A strip that flies at 1 m/s; before its first frame nothing has moved, whatever its steps are."""
    sheet = strip(length=0.4, air_damping=0.0)
    simulation = simulate(sheet, positions=sheet.flat(), velocities=np.array([0.0, 0.0, 1.0]))
    simulation.slow(0.0)
    x = run(simulation, 1)
    assert np.ptp(x[..., 2], axis=0) == pytest.approx(simulation.frame_time, rel=1e-3)
    simulation.slow(0.25)
    x = run(simulation, 1)
    assert np.ptp(x[..., 2], axis=0) == pytest.approx(0.25 * simulation.frame_time, rel=1e-2)


def test_a_slack_strip_hangs_in_a_catenary() -> None:
    """Length 0.4 m over a span of 0.3 m: the sag is a (cosh(D/2a) − 1) with L = 2a sinh(D/2a). Tolerance 0.5 %."""
    span, length = 0.3, 0.4
    stiff = {"tensile_warp": 400.0, "tensile_weft": 400.0, "shear": 0.0, "bending_warp": 0.0, "bending_weft": 0.0}
    sheet = strip(length=length, pinned=(0, ROWS - 1), air_damping=6.0, **stiff)  # pyright: ignore[reportArgumentType]
    x = sheet.flat()
    share = np.arange(ROWS) / (ROWS - 1)
    x[..., 1] = (span * share)[:, None]
    x[..., 2] = -(0.5 * (length**2 - span**2) ** 0.5 * np.sin(np.pi * share))[:, None]
    x = run(simulate(sheet, forces=Forces(gravity=(0.0, 0.0, -9.81)), positions=x), 300)[-1]
    a = brentq(lambda a: 2 * a * np.sinh(span / 2 / a) - length, 0.05, 1.0)
    exact = a * (np.cosh(span / 2 / a) - 1)  # pyright: ignore[reportOperatorIssue]
    assert -x[ROWS // 2, :, 2].mean() == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize(("load", "angle"), [(1.0, 7.10), (4.0, 25.53), (12.0, 51.10), (20.0, 61.79)])
def test_a_cantilever_hangs_at_the_chord_angle_of_the_heavy_elastica(load: float, angle: float) -> None:
    """w L³/B = load; textiles.md section 3. Tolerance 2 %.

    Two rows are held level. The hinge of the second bends the cloth between the middles of the pieces next to it, so
    the free length runs from the middle of the held piece.
    """
    rows, length = ROWS, 0.1
    free = length * (rows - 1.5) / (rows - 1)
    rigidity = 0.15 * 9.81 * free**3 / load
    slowest = 3.52 * (rigidity / 0.15 / free**4) ** 0.5  # [rad/s] of the first mode
    sheet = strip(
        length=length,
        pinned=(0, 1),
        shear=0.0,
        tensile_warp=150.0,
        tensile_weft=150.0,
        bending_warp=rigidity,
        bending_weft=rigidity,
        air_damping=2 * slowest,
    )
    frames = int(60 * 14 / slowest) + 1
    x = run(simulate(sheet, forces=Forces(gravity=(0.0, 0.0, -9.81))), frames)[-1].astype(float)
    root = (x[0, 1] + x[1, 1]) / 2
    tip = x[-1].mean(axis=0)
    got = np.degrees(np.arctan2(root[2] - tip[2], tip[1] - root[1]))
    assert got == pytest.approx(angle, rel=0.02)


def square(n: int, pinned=None, **changes) -> Sheet:
    """A sheet of 1 m × 1 m of the peers' comparison: 0.15 kg/m², 1000 N/m."""
    material = replace(PLAIN, tensile_warp=1000.0, tensile_weft=1000.0, shear=100.0, **changes)
    a = 1.0 / (n - 1)
    return Sheet.rectangle(
        n, n, material=material, springs=calibrate(material, spacing_x=a, spacing_y=a), pinned=pinned
    )


def test_a_curtain_hangs_as_far_as_its_stiffness_says() -> None:
    """1 m × 1 m held along its whole top: ρ g L²/2k = 0.736 mm at the bottom. Tolerance 2 %."""
    pins = np.zeros((21, 21), bool)
    pins[0] = True
    sheet = square(21, pins, air_damping=8.0)
    x = run(simulate(sheet, forces=DOWN), 120)[-1]
    assert x[-1, :, 1].mean() - 1.0 == pytest.approx(0.736e-3, rel=0.02)


def test_a_sheet_draped_on_a_ball_over_a_floor_stays_out_of_both() -> None:
    """Key points at the gap or outside, to 0.1 mm; stretch under 3 %; friction keeps it; the floor is reached."""
    sheet = square(21, air_damping=2.0)
    x = sheet.flat()
    x = np.stack([x[..., 0] - 0.5, np.full((21, 21), 0.26), 0.5 - x[..., 1]], axis=-1)
    forces = Forces(
        sphere=Sphere(centre=(0.0, 0.0, 0.0), radius=0.25, gap=0.005), plane=Plane(height=-0.2, gap=0.005), wind=CALM
    )
    simulation = simulate(sheet, forces=forces, positions=x)
    paths = run(simulation, 90)
    assert np.linalg.norm(paths, axis=-1).min() > 0.255 - 1e-4
    assert paths[..., 1].min() > -0.195 - 1e-4
    assert paths[-1, ..., 1].min() < -0.19
    assert max(s.max() for s in sheet.stretch(paths[-1])) < 0.03
    assert np.abs(paths[-1, 10, 10] - [0.0, 0.255, 0.0]).max() < 5e-3


@pytest.mark.parametrize("friction", [0.0, 0.3, 1.0])
def test_a_sheet_slides_down_a_slope_as_coulomb_says(friction: float) -> None:
    """Slope of 30°: a = g (sin − µ cos), 0 where µ > tan 30°. Distance after 0.5 s, tolerance 1 % of that without
    friction."""
    slope = np.radians(30.0)
    normal = (float(np.sin(slope)), float(np.cos(slope)), 0.0)
    sheet = square(21)
    u = sheet.flat()
    x = u[..., :1] * np.array([np.cos(slope), -np.sin(slope), 0.0]) + u[..., 1:2] * np.array([0.0, 0.0, 1.0])
    forces = Forces(sphere=FAR, plane=Plane(normal=normal, friction=friction), wind=CALM)
    moved = run(simulate(sheet, forces=forces, positions=x), 30)[-1] - x
    a = 9.81 * max(0.0, np.sin(slope) - friction * np.cos(slope))
    along = moved @ np.array([np.cos(slope), -np.sin(slope), 0.0])
    assert np.abs(along - a * 0.125).max() < 0.01 * 9.81 * np.sin(slope) * 0.125


def test_wind_pushes_a_plate_by_its_drag_and_lifts_a_slanted_one() -> None:
    """The first two substeps of a free strip from rest: ½ ρ U² (C_D |cos| û + C_L cos (n − cos û)) / density.
    Tolerance 1 %."""
    for angle in (0.0, 0.6):
        wind = Wind(velocity=(0.0, 6.0 * float(np.sin(angle)), 6.0 * float(np.cos(angle))), drag=1.2, lift=0.6)
        forces = Forces(gravity=(0.0, 0.0, 0.0), wind=wind, sphere=FAR, plane=Plane(height=-50.0))
        sheet = strip()
        simulation = simulate(sheet, forces=forces, frame_rate=20_000.0)
        run(simulation, 1)
        v = sheet.steps(simulation.state).astype(float) / simulation.solver.step
        momentum = (sheet.mass[..., None] * v).sum(axis=(0, 1)) * 20_000.0 / sheet.mass.sum()
        u, n = np.array([0.0, np.sin(angle), np.cos(angle)]), np.array([0.0, 0.0, 1.0])
        c = np.cos(angle)
        exact = 0.5 * 1.2 * 36 * (1.2 * c * u + 0.6 * c * (n - c * u)) / 0.15
        assert np.abs(momentum - exact).max() < 0.01 * np.linalg.norm(exact), (momentum, exact)


def test_gusts_are_seeded_and_as_strong_as_asked() -> None:
    wind = Wind(velocity=(5.0, 0.0, 0.0), gusts=0.2, seed=4)
    speeds = np.array([wind.at(t) for t in np.arange(0, 400, 0.05)])
    assert wind.at(1.25) == Wind(velocity=(5.0, 0.0, 0.0), gusts=0.2, seed=4).at(1.25)
    assert wind.at(1.25) != Wind(velocity=(5.0, 0.0, 0.0), gusts=0.2, seed=5).at(1.25)
    assert speeds.mean(axis=0) == pytest.approx([5.0, 0.0, 0.0], abs=0.05)
    assert speeds.std(axis=0) == pytest.approx([1.0, 1.0, 1.0], rel=0.03)


def led(time_of_failure: float = np.inf) -> Simulation:
    """A strip whose top is carried sideways; torn away at a time [s]."""
    sheet = strip(pinned=(0,), air_damping=1.0)
    start = sheet.flat()[0]

    def path(time: float):
        return start + np.array([0.05 * np.sin(4 * time), 0.0, 0.0 if time < time_of_failure else 500.0])

    return simulate(sheet, forces=DOWN, pins=(Pins(sheet.pinned, path),))


def test_led_pins_are_where_their_path_is() -> None:
    simulation = led()
    for _ in range(10):
        simulation.step()
        want = simulation.pins[0].at(simulation.time)
        assert simulation.positions[0] == pytest.approx(want, abs=1e-7)
    assert np.abs(simulation.positions[20, :, 0] - simulation.sheet.flat()[20, :, 0]).max() > 1e-3


def test_a_resumed_run_gives_the_same_bytes(tmp_path) -> None:
    whole = led()
    run(whole, 12)
    first = led()
    run(first, 5)
    first.save(tmp_path / "state.npz")
    second = led()
    second.restore(tmp_path / "state.npz")
    assert second.frame == 5
    run(second, 7)
    assert second.state.values.tobytes() == whole.state.values.tobytes()
    assert [p.name for p in tmp_path.iterdir()] == ["state.npz"]


def test_a_state_that_does_not_belong_is_refused(tmp_path) -> None:
    simulation = led()
    simulation.save(tmp_path / "state.npz")
    other = simulate(strip(pinned=(0,)), forces=DOWN)
    data = (tmp_path / "state.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(data[: len(data) // 2])
    (tmp_path / "text.npz").write_text("not a state")
    for one, name in ((other, "state"), (simulation, "cut"), (simulation, "text"), (simulation, "missing")):
        with pytest.raises(InputError):
            one.restore(tmp_path / f"{name}.npz")


def test_a_run_that_tears_stops_with_the_frame_and_the_place_and_keeps_the_last_good_state() -> None:
    simulation = led(time_of_failure=0.1)
    with pytest.raises(Unstable, match=r"frame 6: key point \(\d+, \d+\)") as caught:
        run(simulation, 20)
    assert caught.value.frame == 6
    assert simulation.frame == 5
    assert np.isfinite(simulation.state.values).all()


def test_pins_that_do_not_fit_are_refused() -> None:
    sheet = strip(pinned=(0,))
    nobody = np.zeros((ROWS, COLS), bool)
    for pins in (
        (Pins(nobody),),
        (Pins(nobody[:3]),),
        (Pins(sheet.pinned), Pins(sheet.pinned)),
        (Pins(sheet.pinned, lambda time: np.zeros((COLS, 3)) + 1.0),),
        (Pins(sheet.pinned, lambda time: np.zeros(3)),),
    ):
        with pytest.raises(InputError):
            simulate(sheet, pins=pins)


def test_forces_that_cannot_be_are_refused() -> None:
    for make in (
        lambda: Wind(velocity=(1.0, 0.0, float("nan"))),
        lambda: Wind(velocity=(1.0, 0.0, 0.0), gusts=-1.0),
        lambda: Sphere(centre=(0.0, 0.0, 0.0), radius=0.0),
        lambda: Plane(normal=(1.0, 1.0, 0.0)),
        lambda: Forces(gravity=(0.0, 0.0)),  # pyright: ignore[reportArgumentType]
    ):
        with pytest.raises(InputError):
            make()
    assert Verlet(strip(), NOTHING).substeps % 2 == 0
