"""Störmer–Verlet against closed forms, against itself in float64, and at its limit."""

from dataclasses import replace

import numpy as np
import pytest
from strips import COLS, NOTHING, PLAIN, ROWS, run, simulate, strip

from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.forces import Forces, FrameForces
from taichi_cloth.sheet.energy import elastic_energy, elastic_forces, hinges, kinetic_energy, links
from taichi_cloth.sheet.springs import BendingLaw
from taichi_cloth.solvers import stability
from taichi_cloth.solvers.stability import FrequencyBound, _pulls, _stiffness_times, highest_frequency, longest_step
from taichi_cloth.solvers.verlet import Verlet

RNG = np.random.Generator(np.random.Philox(key=5))


def shaken(sheet, amount=0.05):
    """Rest positions with every key point off by some share of the spacing."""
    noise = RNG.standard_normal((ROWS, COLS, 3)) * amount * sheet.springs.spacing_y
    return sheet.flat() + noise


@pytest.mark.parametrize("bending", ["hinge", "spring"])
@pytest.mark.parametrize("tau", [0.0, 2e-4])
def test_the_kernel_is_verlet_of_the_reference_forces(bending, tau: float) -> None:
    """Two substeps against the same scheme in float64: within 2e-6 of the distance between key points."""
    sheet = strip(pinned=(0,), bending=bending, fibre_damping=tau, air_damping=2.0)
    x = shaken(sheet)
    steps = RNG.standard_normal(x.shape) * 1e-4 * sheet.springs.spacing_y
    solver = Verlet(sheet, Forces(), frame_rate=20_000.0)
    assert solver.substeps == 2
    state = sheet.state(x)
    sheet.set_steps(state, steps)
    x, d = sheet.positions(state).astype(float), sheet.steps(state).astype(float)
    solver.advance(state, FrameForces())
    h, free = solver.step, sheet.inverse_mass[..., None] > 0
    for _ in range(2):
        force = elastic_forces(sheet, x)
        if tau > 0:  # the rate of the elastic force along the springs, by a difference along the last step
            force += damping_of_springs(sheet, x, d) * (tau / h)
        a = force * sheet.inverse_mass[..., None] + np.array([0.0, -9.81, 0.0])
        d = np.where(free, np.exp(-2.0 * h) * d + a * h**2, d)
        x = x + d
    error = np.abs(sheet.positions(state) - x).max() / sheet.springs.spacing_y
    assert error < 2e-5 * (1 if tau else 0.5), f"error {error:.2e}"


def damping_of_springs(sheet, x, d):
    """Σ k (Δd·n) n for springs, and the hinge force of d: what fibre damping adds, times τ/h."""
    out = np.zeros_like(x)
    for link in links(sheet):
        r, v = x[link.two] - x[link.one], d[link.two] - d[link.one]
        n = r / np.maximum(np.linalg.norm(r, axis=-1, keepdims=True), 1e-30)
        pull = link.constant[..., None] * (v * n).sum(-1, keepdims=True) * n
        out[link.one] += pull
        out[link.two] -= pull
    for before, at, after, beta in hinges(sheet):
        bend = beta[..., None] * (d[before] - 2 * d[at] + d[after])
        out[before] -= bend
        out[at] += 2 * bend
        out[after] -= bend
    return out


def test_free_fall_is_exact() -> None:
    """y = −g t²/2 after a second, to 1e-5 (float32)."""
    sheet = strip()
    x = run(simulate(sheet, forces=Forces()), 60)[-1]
    assert np.abs(x - (sheet.flat() - [0.0, 9.81 / 2, 0.0])).max() < 1e-5 * 9.81 / 2


def one_spring(share: float) -> float:
    """Error of a mass on a spring after 2 periods, as a share of the amplitude, with a step of `share` of the limit."""
    sheet = strip(rows=2, length=0.02, pinned=(0,), shear=0.0, bending_warp=0.0, bending_weft=0.0, tensile_weft=10.0)
    s = sheet.springs
    omega = (s.structural_y * sheet.weights[1][0, 0] / sheet.mass[1, 0]) ** 0.5
    amplitude = 0.02 * s.spacing_y
    x = sheet.flat()
    x[1, :, 1] += amplitude
    period = 2 * np.pi / omega
    longest = Verlet(sheet, NOTHING, frame_rate=1 / period).choice.limit
    out = (
        run(simulate(sheet, positions=x, frame_rate=1.25 / period, step=share * longest), 3)[-1, 1, 0, 1] - s.spacing_y
    )
    time = 3 * period / 1.25  # 2.4 periods: where the error of the phase shows
    return abs(out - amplitude * np.cos(omega * time)) / amplitude


def test_one_spring_has_its_period_and_a_phase_error_of_second_order() -> None:
    errors = [one_spring(share) for share in (0.1, 0.05, 0.025)]
    slopes = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 0.01
    assert np.abs(slopes - 2).max() < 0.15, f"slopes {slopes}, errors {errors}"


def test_energy_of_undamped_verlet_does_not_drift_in_a_hundred_thousand_steps() -> None:
    sheet = strip(pinned=(0,), shear=5.0)
    x = sheet.flat()
    x[..., 1] += 0.004 * np.sin(np.pi * x[..., 1] / 0.8)  # first longitudinal mode, 1.6 % at the root
    x[..., 2] += 1e-3 * (x[..., 1] / 0.4) ** 2
    simulation = simulate(sheet, positions=x, safety=0.5)
    frames = -(-100_000 // simulation.solver.substeps)
    h, energies = simulation.solver.step, []
    for k in range(frames):
        simulation.step()
        if k % 5 == 0 or k > frames - 30:
            x = simulation.positions.astype(float)
            a = elastic_forces(sheet, x) * sheet.inverse_mass[..., None]
            v = sheet.steps(simulation.state) / h + a * h / 2
            energies.append(elastic_energy(sheet, x) + kinetic_energy(sheet, v))
    start, all_ = energies[0], np.array(energies) / energies[0] - 1
    assert start > 0
    assert np.abs(all_).max() < 0.02, f"largest deviation {np.abs(all_).max():.2e}"
    assert abs(all_[-20:].mean() - all_[:20].mean()) < 0.005, f"drift {all_[-20:].mean() - all_[:20].mean():.2e}"


def test_momentum_is_conserved_without_external_forces() -> None:
    """Linear and angular momentum of a shaken free strip after 20 frames; 1e-4 of Σ m |v| (× L)."""
    sheet = strip()
    simulation = simulate(sheet, positions=shaken(sheet), velocities=RNG.standard_normal((ROWS, COLS, 3)) * 0.1)
    m, h = sheet.mass[..., None], simulation.solver.step

    def momenta():
        v = sheet.steps(simulation.state) / h
        x = simulation.positions.astype(float) - v * h / 2
        return (m * v).sum((0, 1)), (m * np.cross(x, v)).sum((0, 1)), float((m * np.abs(v)).sum())

    before = momenta()
    run(simulation, 20)
    after = momenta()
    assert np.abs(after[0] - before[0]).max() < 1e-4 * before[2]
    assert np.abs(after[1] - before[1]).max() < 1e-4 * before[2] * 0.4


@pytest.mark.parametrize("tau", [0.0, 2e-4])
def test_the_stable_limit_is_two_over_the_highest_frequency(monkeypatch: pytest.MonkeyPatch, tau: float) -> None:
    """By experiment: 1.5 % below it a small disturbance stays small, 1.5 % above it grows."""
    grown = {}
    for factor in (0.985, 1.015):

        def stretched(*args, factor=factor, **options):
            return factor * longest_step(*args, **options)

        monkeypatch.setattr(stability, "longest_step", stretched)
        sheet = strip(pinned=(0,), shear=20.0, fibre_damping=tau)
        limit = stretched(highest_frequency(sheet), fibre_damping=tau)
        solver = Verlet(sheet, NOTHING, frame_rate=1 / (2000 * limit * (1 - 1e-9)), safety=1.0)
        assert solver.substeps == 2000
        state = sheet.state(
            sheet.flat() + 1e-5 * sheet.springs.spacing_y * np.sign(RNG.standard_normal((ROWS, COLS, 3)))
        )
        sheet.set_steps(state, np.zeros((ROWS, COLS, 3)))
        solver.advance(state, FrameForces())
        off = sheet.positions(state)[..., :2] - sheet.flat()[..., :2]
        grown[factor] = float(np.nan_to_num(np.abs(off).max(), nan=1e9, posinf=1e9) / sheet.springs.spacing_y)
    assert grown[0.985] < 1e-3, grown
    assert grown[1.015] > 0.02, grown


def test_the_highest_frequency_lies_under_its_bound_and_near_the_dense_one() -> None:
    for changes in ({}, {"shear": 30.0}, {"bending_warp": 1e-3}, {"tensile_weft": 500.0}):
        sheet = strip(rows=9, pinned=(0,), **changes)  # pyright: ignore[reportArgumentType]
        size = ROWS * COLS * 3
        pulls = list(_pulls(sheet, None))
        k = np.stack([_stiffness_times(sheet, pulls, row.reshape(3, ROWS, COLS)).ravel() for row in np.eye(size)])
        root = np.sqrt(np.tile(sheet.inverse_mass.ravel(), 3))
        dense = np.linalg.eigvalsh(root[:, None] * k * root)[-1] ** 0.5
        assert highest_frequency(sheet) == pytest.approx(dense, rel=2e-3)
        assert dense <= FrequencyBound(sheet).at() < 1.03 * dense


def test_of_a_large_sheet_the_bound_stands_for_the_frequency(monkeypatch: pytest.MonkeyPatch) -> None:
    sheet = strip()
    exact = highest_frequency(sheet)
    monkeypatch.setattr(stability, "LARGE", 10)
    assert exact / 1.001 < highest_frequency(sheet) < 1.03 * exact


def test_a_step_that_is_too_long_is_refused_with_the_one_that_would_do() -> None:
    sheet = strip()
    allowed = 0.9 * Verlet(sheet, NOTHING).choice.limit
    with pytest.raises(InputError, match=f"{allowed:.4g} s"):
        Verlet(sheet, NOTHING, step=allowed * 1.01)
    assert Verlet(sheet, NOTHING, step=allowed).step <= allowed
    for options in ({"frame_rate": 0.0}, {"safety": 1.5}, {"step": -1.0}):
        with pytest.raises(InputError):
            Verlet(sheet, NOTHING, **options)  # pyright: ignore[reportArgumentType]


def test_one_and_two_threads_give_the_same_bytes() -> None:
    sheet = strip(pinned=(0,))
    x = shaken(sheet)
    states = [simulate(sheet, forces=Forces(), positions=x, threads=threads) for threads in (1, 2, 1, 2)]
    assert [s.solver.threads for s in states] == [1, 2, 1, 2]  # pyright: ignore[reportAttributeAccessIssue]
    for simulation in states:
        run(simulation, 3)
    assert all(s.state.values.tobytes() == states[0].state.values.tobytes() for s in states[1:])


def test_half_the_spacing_gives_the_same_motion() -> None:
    """A strip led from rest by gravity, clamped level: the tip of 11, 21 and 41 rows; differences fall by 3 or more."""
    tips = []
    for rows in (11, 21, 41):
        sheet = strip(rows=rows, length=0.2, spacing_x=0.02, pinned=(0,), bending_warp=2e-4, shear=0.0)
        x = sheet.flat()
        paths = run(simulate(sheet, forces=Forces(gravity=(0.0, 0.0, -9.81)), positions=x), 12)
        tips.append(paths[:, rows - 1, 1])
    first, second = np.abs(tips[0] - tips[2]).max(), np.abs(tips[1] - tips[2]).max()
    assert second < 0.004, f"{second:.2e} m of 0.2 m"
    assert first > 2.5 * second


def test_the_paper_s_spring_has_no_stiffness_near_the_flat_state() -> None:
    """The force of a small bow grows with its cube with springs, in proportion with hinges."""
    laws: tuple[tuple[BendingLaw, float], ...] = (("hinge", 1.0), ("spring", 3.0))
    for bending, power in laws:
        sheet = strip(bending=bending, length=0.8, shear=0.0)
        forces = []
        for amount in (1e-3, 2e-3):
            x = sheet.flat()
            x[..., 2] = amount * np.cos(np.pi * np.arange(ROWS) / 4)[:, None]
            forces.append(np.abs(elastic_forces(replace_structural(sheet), x)[20, 1, 2]))
        assert np.log2(forces[1] / forces[0]) == pytest.approx(power, abs=0.1)


def replace_structural(sheet):
    """The sheet with nothing but its bending law."""
    springs = replace(sheet.springs, structural_x=0.0, structural_y=0.0, diagonal=0.0)
    return replace(sheet, springs=springs, material=PLAIN)
