"""The solver's rows for a garment: the built-in skirt, from its rest, as the body sets off walking.

Its start is where it rests as the scene has it, whatever the setting, so that all runs begin alike.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...measure.moved import rms, timed
from ...measure.study import Row, microseconds
from ...prepare.garment_setup import Dressed, dress, dressed_parts, garment_simulation
from ...scene.load import load_scene

__all__ = ["SECONDS", "rows"]

SCENE = "skirt"
SECONDS = 0.3
"""Simulated time [s] after which the error is taken."""

PARTS = (1, 2, 4)
"""Into which the step that Verlet takes by itself is cut."""
FINEST = 8
SHARES = (0.125, 0.25, 0.5, 1.0)
"""Of the tensile stiffness that springs carry, beside the scene's own."""


def rows() -> Iterator[Row]:
    """Errors of all key points [m], root mean square."""
    dressed = dress(load_scene(SCENE))
    usual = dressed.garment.material.tensile_share
    panel = f"skirt, {SECONDS:g} s of walking, springs carry {usual:g}"
    best, _, step = _run(dressed, usual, FINEST)
    nearly, _, _ = _run(dressed, usual, FINEST // 2)
    yield Row(
        panel=panel, method="reference", knob="reference, step × 2", value=2 * step,
        error=rms(nearly, best), seconds=float("nan"),
    )  # fmt: skip
    for parts in PARTS:
        found, cost, step = _run(dressed, usual, parts)
        yield Row(
            panel=panel,
            method="Verlet",
            knob=microseconds(step),
            value=step,
            error=rms(found, best),
            seconds=cost,
            default=parts == 1,
        )
    whole, _, _ = _run(dressed, 1.0, PARTS[-1])
    for share in sorted({usual, *SHARES}):
        found, cost, step = _run(dressed, share, 1)
        yield Row(
            panel="skirt, share that springs carry, of all",
            method="Verlet, strain limit",
            knob=f"{share:g}: {microseconds(step)}",
            value=1 / share,
            error=rms(found, whole),
            seconds=cost,
            default=share == usual,
        )


def _run(dressed: Dressed, share: float, parts: int) -> tuple[NDArray[np.float64], float, float]:
    """Key points (n, 3) [m] at the end, CPU time [s] a simulated second, and the step [s]."""
    changes = ["body.motion=walk", f"garment.properties.tensile_share={share}", f"solver.safety={0.9 / parts}"]
    scene = load_scene(SCENE, changes)
    worn = replace(dressed, garment=dressed_parts(scene).garment)
    simulation, cost = timed(lambda: garment_simulation(scene, worn), SECONDS)
    return simulation.positions[simulation.sheet.present].astype(np.float64), cost, simulation.solver.step
