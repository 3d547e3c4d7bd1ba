"""The solver's rows for a garment: the built-in skirt, from its rest, as the body sets off walking."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...measure.moved import rms, timed
from ...measure.study import Row, microseconds
from ...prepare.garment_setup import Dressed, dress, garment_simulation
from ...scene.load import load_scene

__all__ = ["SECONDS", "rows"]

SCENE, ALONE = "skirt", "forces.self_contact=false"
SECONDS = 0.3
"""Simulated time [s] after which the error is taken."""

PARTS = (1, 2, 4)
"""Into which the step that whole yarns take by themselves is cut."""
FINEST = 8


def rows() -> Iterator[Row]:
    """Errors of all key points [m], root mean square."""
    dressed = dress(load_scene(SCENE, [ALONE]))
    own = garment_simulation(load_scene(SCENE, [ALONE]), dressed).solver.step
    panel = f"skirt, {SECONDS:g} s of walking"
    best, _, _ = _run(dressed, own / FINEST)
    nearly, _, step = _run(dressed, 2 * own / FINEST)
    yield Row(
        panel=panel, method="reference", knob="reference, step × 2", value=step,
        error=rms(nearly, best), seconds=float("nan"),
    )  # fmt: skip
    for parts in PARTS:
        found, cost, step = _run(dressed, own / parts)
        yield Row(
            panel=panel,
            method="whole yarns",
            knob=microseconds(step),
            value=step,
            error=rms(found, best),
            seconds=cost,
            default=parts == 1,
        )


def _run(dressed: Dressed, step: float) -> tuple[NDArray[np.float64], float, float]:
    """Key points (n, 3) [m] at the end, CPU time [s] a simulated second, and the step [s]."""
    scene = load_scene(SCENE, [ALONE, "body.motion=walk", f"solver.step_ms={1e3 * step}"])
    simulation, cost = timed(lambda: garment_simulation(scene, dressed), SECONDS)
    return simulation.positions[simulation.sheet.present].astype(np.float64), cost, simulation.solver.step
