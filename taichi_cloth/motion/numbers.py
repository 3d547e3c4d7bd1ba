"""Constants of a step that kernels read by name: those of springs, damping, gravity, wind, and fixed shapes."""

from math import exp, expm1
from typing import Any

import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.motion.forces import Forces
from taichi_cloth.sheet.sheet import Band

__all__ = ["NUMBERS", "Numbers", "acting", "numbers_of", "take_numbers"]

SPRINGS = ("structural_x", "structural_y", "diagonal", "second_x", "second_y", "hinge_x", "hinge_y", "twist")
NUMBERS = (
    *SPRINGS,  # × h² [kg]
    *("spacing_x", "spacing_y", "diagonal_length"),  # [m]
    "kept",  # share of a step that viscous damping leaves
    "lag",  # τ/h of damping along the springs
    *("gravity_x", "gravity_y", "gravity_z"),  # × h² [m]
    *("wind_drag", "wind_lift", "rate"),  # ½ ρ C h² [kg s²/m³], the last 1/h [1/s]
    *("sphere_x", "sphere_y", "sphere_z", "sphere_radius", "sphere_friction"),  # [m], gap included
    *("plane_x", "plane_y", "plane_z", "plane_height", "plane_friction"),
    *("longest_x", "longest_y"),  # [m] that a thread between two key points may be, for the strain limit
    "sweeps",  # how often constraints that are repeated are called
)

Numbers: Any = ti.types.struct(**dict.fromkeys(NUMBERS, ti.f32))
"""In a field: changing them compiles nothing."""


@ti.func
def take_numbers(fields: Template, named: Template, cloths: Template):
    """Writes named[cloth, k] to the k-th of some fields of one number, or of one for each of several cloths."""
    for k, number in ti.static(enumerate(fields)):
        if ti.static(cloths == 1):
            number[None] = named[0, k]
        else:
            for cloth in range(named.shape[0]):
                number[cloth] = named[cloth, k]


def numbers_of(cloth: Band, forces: Forces, step: float) -> dict[str, float]:
    """The values of `Numbers` of one of a sheet's cloths for steps of `step` [s]."""
    s, m = cloth.springs, cloth.material
    h2 = step * step * acting(m.air_damping, step)
    out = {name: getattr(s, name) * h2 for name in SPRINGS}
    out |= {name: getattr(s, name) for name in ("spacing_x", "spacing_y", "diagonal_length")}
    out |= {"kept": exp(-m.air_damping * step), "lag": m.fibre_damping / step, "rate": 1 / step}
    wind, ball, plane = forces.wind, forces.sphere, forces.plane
    out["wind_drag"] = 0.5 * wind.air_density * wind.drag * h2 if wind else 0.0
    out["wind_lift"] = 0.5 * wind.air_density * wind.lift * h2 if wind else 0.0
    out["sphere_radius"] = ball.radius + ball.gap if ball else 0.0
    out["sphere_friction"] = ball.friction if ball else 0.0
    out["plane_height"] = plane.height + plane.gap if plane else 0.0
    out["plane_friction"] = plane.friction if plane else 0.0
    longest = 1 + (forces.strain_limit.strain if forces.strain_limit else 0.0)
    out |= {"longest_x": s.spacing_x * longest, "longest_y": s.spacing_y * longest}
    out["sweeps"] = float(forces.strain_limit.passes) if forces.strain_limit else 1.0
    for k, axis in enumerate("xyz"):
        out[f"gravity_{axis}"] = forces.gravity[k] * h2
        out[f"sphere_{axis}"] = ball.centre[k] if ball else 0.0
        out[f"plane_{axis}"] = plane.normal[k] if plane else 0.0
    return out


def acting(air_damping: float, step: float) -> float:
    """Share of a step for which a constant force acts, (1 − e^(−ch))/(ch): second order, and the right end speed."""
    return -expm1(-air_damping * step) / (air_damping * step) if air_damping > 0 else 1.0
