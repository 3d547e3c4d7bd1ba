"""Starts that no cloth survives: crumpled, shuffled, stretched tenfold, in one point. They rest before time begins.

What breaks a thread bounds what a start may ask of it: longer by half no textile fibre but elastane is whole, shorter
by half it lies in a fold that the grid cannot show, and neither threads nor shear hold more energy than tears them. Let
go, such a start would throw the sheet about at the speed of sound in its threads, a motion that nobody asked for. So
frames of the solver's own draw threads to their length as in treacle: nothing falls, and steps are forgotten at once,
so that no speed is made. Meanwhile the sheet bends like a plate, as stiff as the step allows, which smooths what is
crumpled from cell to cell and cannot be flat otherwise. The body and fixed shapes push as ever.
"""

from dataclasses import replace
from math import ceil, inf, sqrt

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.forces import FrameForces
from taichi_cloth.motion.kernel_solver import KernelSolver
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.sheet import Band, Sheet, SheetState

__all__ = ["overstrain", "settle"]

LONGEST = 0.5
"""Strain, either way. Morton & Hearle, "Physical Properties of Textile Fibres": cotton breaks at 7 %, wool and
polyester at up to 40 and 50 %."""

ROUGH = 0.02
"""Strain, either way, that every start may have: a rough mesh is drawn straight within a substep, whatever its threads
would hold."""

TEARING = 1.5e4
"""Energy [J/kg] that tears a cotton thread, at most (ibid.: work of rupture of 5 to 15 mN/tex)."""

THICK = 20.0
"""Of treacle: c h, so that e⁻²⁰ of a step is left after the next, and forces act for a twentieth of it."""

PLATE = 0.9
"""Of the stiffest bending that is stable in treacle."""

SUBSTEPS = 60_000
"""That a start may take."""

CALM = (0.1, 1e-5)
"""When it is at rest: strain, in what cloth survives, or how far key points still move in a frame, in spacings."""

LEFT = 0.1
"""Strain in a tangle that may be left to the motion itself."""

NUDGES = (1e-3, 0.1)
"""Of the spacing: by so much key points are moved at random first, for threads between two at one place have no
direction, and a sheet folded into a line no way out of it; and again, where a start has jammed."""


def survived(material: Material) -> tuple[float, float, float]:
    """Largest strain, either way, of weft, warp and diagonals that a start may have."""

    def most(stiffness: float, drawn: float, crimp: float) -> float:
        torn = sqrt(2 * TEARING * material.density / max(stiffness, drawn))
        return min(LONGEST, max(ROUGH, torn + (crimp if drawn > 0 else 0.0)))

    weft = most(material.tensile_weft, material.drawn_weft, material.crimp_weft)
    warp = most(material.tensile_warp, material.drawn_warp, material.crimp_warp)
    # A diagonal is strained by half the angle of shear.
    sheared = sqrt(TEARING * material.density / 2 / material.shear) if material.shear else inf
    return weft, warp, max(ROUGH, sheared)


def overstrain(sheet: Sheet, positions: NDArray) -> float:
    """The largest strain at positions (rows, cols, 3) [m], either way, in what cloth survives."""
    x, cell, rest = positions, sheet.weights[2][:-1, :-1] > 0, sheet.springs.diagonal_length
    sheared = [np.linalg.norm(d, axis=-1) / rest - 1 for d in (x[1:, 1:] - x[:-1, :-1], x[1:, :-1] - x[:-1, 1:])]
    parts = (*sheet.stretch(x), np.where(cell, sheared, 0.0))
    bounds = np.min([survived(cloth.material) for cloth in sheet.cloths], axis=0)
    return max(float(np.abs(part).max(initial=0.0)) / most for part, most in zip(parts, bounds, strict=True))


def _in_treacle(sheet: Sheet, step: float) -> Sheet:
    """The sheet in treacle, as a plate."""

    def plated(cloth: Band) -> Band:
        springs = cloth.springs
        if springs.law == "hinge":
            plate = PLATE * cloth.material.density * springs.spacing_x * springs.spacing_y * THICK / (16 * step**2)
            springs = replace(springs, hinge_x=max(plate, springs.hinge_x), hinge_y=max(plate, springs.hinge_y))
        return replace(cloth, springs=springs, material=replace(cloth.material, air_damping=THICK / step))

    return sheet.with_cloths(plated)


def _rests(solver: KernelSolver, sheet: Sheet, state: SheetState, still: FrameForces) -> bool:
    """Frames until the sheet is calm, or moves no more; whether it is calm."""
    spacing = min(sheet.springs.spacing_x, sheet.springs.spacing_y)
    for _ in range(ceil(SUBSTEPS / solver.substeps)):
        before = sheet.positions(state)
        sheet.set_steps(state, np.zeros_like(before))
        solver.advance(state, still)
        after = sheet.positions(state)
        if overstrain(sheet, after) < CALM[0]:
            return True
        if np.abs(np.where(sheet.present[..., None], after - before, 0.0)).max() < CALM[1] * spacing:
            break
    return False


def settle(solver: KernelSolver, state: SheetState) -> None:
    """Draws threads to their length, in place; the state is at rest then. solver: whole yarns. Raises InputError where
    they stay longer or shorter than they survive by far, as between pins that are too far apart."""
    sheet, usual = solver.sheet, solver.forces
    spacing = min(sheet.springs.spacing_x, sheet.springs.spacing_y)
    begun = overstrain(sheet, sheet.positions(state))
    random = np.random.Generator(np.random.Philox(key=23))
    free = sheet.inverse_mass[..., None] > 0
    still = replace(usual.during(0.0, 0.0), wind_start=FrameForces().wind_start, wind_end=FrameForces().wind_end)
    none = np.zeros((*sheet.shape, 3))
    solver.sheet = _in_treacle(sheet, solver.step)
    solver.forces = replace(usual, gravity=(0.0, 0.0, 0.0), strain_limit=None)
    try:
        solver.take_steps(solver.substeps)
        for nudge in NUDGES:
            noise = nudge * spacing * np.where(free, random.uniform(-1, 1, none.shape), 0.0)
            state.values[:3] = sheet.state(sheet.positions(state) + noise).values[:3]
            if _rests(solver, sheet, state, still):
                break
    finally:
        solver.sheet, solver.forces = sheet, usual
        solver.take_steps(solver.substeps)
    sheet.set_steps(state, none)
    left = overstrain(sheet, sheet.positions(state))
    weft, warp, _ = np.min([survived(cloth.material) for cloth in sheet.cloths], axis=0).tolist()
    if not left * max(weft, warp) <= max(weft, warp, LEFT):
        raise InputError(
            f"start: threads are strained by up to {begun:.3g} times what they survive ({100 * warp:.3g} % along the "
            f"warp, {100 * weft:.3g} % along the weft), and still by {left:.3g} times after a damped start; let pins "
            "be no further apart than the cloth between them, and key points lie about where their neighbours do"
        )
