"""Twist of the two zones: the schemes against the closed form (paper 2.2.3)."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from taichi_cloth.yarn.twist import transient_twist, zone_twist
from taichi_cloth.yarn.twist_field import twist_field

from ..measure.study import Axis, Row, Study, cpu_seconds

__all__ = ["STUDY", "rows"]

ZONES = {"a ≠ b": (0.3, 0.2), "a = b": (0.3, 0.3)}  # [m]
SPEED, SPIN = 0.5, 60.0  # [m/s], [turns/s]
TIMES = np.linspace(0.0, 2.0, 6)
STEPS = (0.08, 0.04, 0.02, 0.01, 0.005, 0.0025, 0.00125)  # [s]
DEFAULT = 0.02  # share of the shorter zone that the yarn moves in a step where none is named


def rows(quick: bool) -> Iterator[Row]:
    """Largest error of both zones' twist over the times asked for, as a share of the final twist s/V."""
    runs = 3 if quick else 15
    for panel, (a, b) in ZONES.items():
        machine = {"a_m": a, "b_m": b, "speed_m_s": SPEED, "spin_turns_s": SPIN}
        truth = np.array(transient_twist(TIMES, **machine))
        usual = DEFAULT * min(a, b) / SPEED

        def off(found: object, truth: np.ndarray = truth) -> float:
            return float(np.abs(np.asarray(found) - truth).max()) / (SPIN / SPEED)

        for step in sorted({*(STEPS[:5] if quick else STEPS), usual}, reverse=True):
            solve = partial(zone_twist, TIMES, **machine, max_step_s=step)
            got = solve()
            yield Row(
                panel=panel,
                method="two zones",
                knob=f"step {1e3 * step:g} ms",
                value=step,
                error=off([got.twist_a, got.twist_b]),
                seconds=cpu_seconds(solve, runs),
                default=step == usual,
            )
        for step in STEPS[1:4] if quick else STEPS[1:6]:
            along = partial(twist_field, TIMES, **machine, inertia_kg_m=0.0, stiffness_n_m2=1e-9, max_step_s=step)
            field = along()
            yield Row(
                panel=panel,
                method="all along the yarn",
                knob=f"step {1e3 * step:g} ms",
                value=step,
                error=off([field.twist_a, field.twist_b]),
                seconds=cpu_seconds(along, 1 if quick else 3),
            )


STUDY = Study(
    name="twist",
    title="Twist: numerical against closed form",
    about="A yarn of two zones, from rest through 2 s at 0.5 m/s and 60 turns/s. Reference: the closed form. "
    "“Two zones” solves their two equations, “all along the yarn” the field of twist in 64 + 64 cells, without "
    "inertia, of which the zones are the means; its cells therefore do not show in the error.",
    error=Axis("largest error of T, of the final twist", "", 1.0),
    time=Axis("CPU time for 2 s of machine", "ms", 1e3),
    rows=rows,
    why={"two zones": "what is left of the twist shows nowhere, in no yarn and no number of it"},
    claimed={"two zones": 2.0, "all along the yarn": 2.0},
)
