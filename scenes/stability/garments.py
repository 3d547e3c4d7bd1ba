"""Garments where bodies do what none can, and worn as no one would: each comes to rest on its body, or says no."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.moving.motion import Motion
from taichi_cloth.body.skin.skeleton import Pose

from ..prepare.garment_setup import dress, garment_simulation
from ..scene.load import load_scene

__all__ = ["garment_cases"]

F32 = NDArray[np.float32]
POINTS = 800
"""Key points of a garment: a coarse one."""

FINE = "garment.key_points=2000"
"""For what comes near many thin limbs at once: of a coarser garment too many springs would have to be looked at."""

STIR, SECONDS = 1.0, 2.5
"""What happens is over after that time [s]; from then on the body stands still until the end."""

LONG, FAST, LAST = 0.1, 0.05, 0.5
"""Strain that 99 % of the threads stay below at the end, and root mean square speed from frame to frame [m/s] over so
long before it [s]. (Not of the last substep: ties and skin mend there in positions what threads take back.)"""

STIFF = (
    "garment.properties.tensile_warp_n_per_m={0:g}", "garment.properties.tensile_weft_n_per_m={0:g}",
)  # fmt: skip


def _still(time: float) -> Pose:
    return Pose.rest()


def _jumps(time: float) -> Pose:
    """A metre aside within a frame, and back."""
    return Pose.of({}, (1.0, 0.0, 0.5) if 0.3 <= time < 0.6 else (0.0, 0.0, 0.0))


def _spins(time: float) -> Pose:
    """Three turns a second."""
    return Pose.of({"pelvis": (0.0, 6 * np.pi * min(time, STIR), 0.0)})


def _share(time: float) -> float:
    """0, up to 1 in the middle of what happens, and back."""
    return float(np.sin(np.pi * min(time / STIR, 1.0)) ** 2)


def _arms_through(time: float) -> Pose:
    """Both arms through the trunk, and each other."""
    turn = np.radians(75) * _share(time)
    return Pose.of({"upper_arm_l": (0.0, 0.0, -turn), "upper_arm_r": (0.0, 0.0, turn)})


def _legs_through(time: float) -> Pose:
    """Each thigh through the other."""
    turn = np.radians(25) * _share(time)
    return Pose.of({"thigh_l": (0.0, 0.0, -turn), "thigh_r": (0.0, 0.0, turn)})


def _inside_out(x: F32) -> F32:
    """Front and back change places, through the body."""
    middle = np.nanmean(x[..., 2])
    return np.concatenate([x[..., :2], 2 * middle - x[..., 2:]], axis=-1).astype(np.float32)


def _crumpled(x: F32) -> F32:
    """A ball at the chest."""
    random = np.random.Generator(np.random.Philox(key=5)).standard_normal(x.shape)
    return (np.array([0.0, 1.25, 0.3]) + 0.05 * random).astype(np.float32)


def _worn(
    name: str,
    *changes: str,
    cycle: Callable[[float], Pose] | None = None,
    start: Callable[[F32], F32] | None = None,
) -> str:
    """cycle: poses at times [s], instead of the scene's motion. start: key points (rows, cols, 3) [m] from worn."""
    scene = load_scene(name, [f"garment.key_points={POINTS}", "forces.self_contact=false", *changes])
    dressed = dress(scene)
    if start is not None:
        dressed = replace(dressed, worn=replace(dressed.worn, positions=start(dressed.worn.positions)))
    moves = cycle and Motion(cycle.__name__, cycle, None, blend_in=1e-9)
    simulation = garment_simulation(scene, dressed, moves=moves, settled=start is None)
    frames = round(SECONDS / simulation.frame_time)
    sheet, squares = simulation.sheet, []
    for k in range(frames):
        before = simulation.positions
        simulation.step()
        if (frames - k) * simulation.frame_time <= LAST:
            moved = (simulation.positions - before)[sheet.present].astype(np.float64)
            squares.append(np.square(moved).sum(axis=-1).mean())
    threads = np.concatenate([part.ravel() for part in sheet.stretch(simulation.positions)])
    threads = threads[threads != 0]
    speed = float(np.sqrt(np.mean(squares))) / simulation.frame_time
    long = float(np.percentile(threads, 99))
    text = f"99 % of threads within {100 * long:.2g} %, {speed:.2g} m/s"
    assert np.isfinite(speed), "not finite"
    assert long < LONG, text
    assert speed < FAST, text
    return text


def garment_cases(quick: bool = False) -> list[tuple[str, str, Callable[[], str]]]:
    """Part, case and what it runs."""
    shirt = partial(_worn, "tshirt")
    cases: list[tuple[str, str, Callable[[], str]]] = [
        ("garment", "T-shirt, the body teleports", partial(shirt, cycle=_jumps)),
        ("garment", "T-shirt, inside out", partial(shirt, cycle=_still, start=_inside_out)),
    ]
    if not quick:
        cases += [
            (
                "garment",
                f"T-shirt, threads of {k:g} N/m",
                partial(shirt, *(one.format(k) for one in STIFF), cycle=_still),
            )
            for k in (1e5, 1e7, 1e9)
        ]
        cases += [
            ("garment", "T-shirt, the body spins", partial(shirt, cycle=_spins)),
            ("garment", "T-shirt, arms through the trunk", partial(shirt, cycle=_arms_through)),
            ("garment", "T-shirt, crumpled to a ball", partial(shirt, FINE, cycle=_still, start=_crumpled)),
            (
                "garment",
                "T-shirt, shear × 100",
                partial(
                    shirt, *(one.format(1e6) for one in STIFF), "garment.properties.shear_n_per_m=3000", cycle=_still
                ),
            ),
            ("garment", "T-shirt, frames of 1/5 s", partial(shirt, "output.fps=5", cycle=_still)),
            ("garment", "skirt, legs through each other", partial(_worn, "skirt", cycle=_legs_through)),
            ("garment", "dress, the body teleports", partial(_worn, "dress", FINE, cycle=_jumps)),
        ]
    return cases
