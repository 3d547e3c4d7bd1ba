"""A small sheet in every state that no one would wish for, and what became of it after five seconds."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import nan

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.motion.forces import StrainLimit
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.energy import Links, elastic_energy, kinetic_energy, links
from taichi_cloth.sheet.materials import Material, named_material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.choice import choose
from taichi_cloth.solvers.named import named_solver

from .outcome import NEITHER, STABLE, Outcome, refused
from .starts import FREE, STARTS, WORKING, pins_of, start_of

__all__ = ["Cell", "cells", "energy_made", "ran"]

F64 = NDArray[np.float64]
SIDE, POINTS, SECONDS = 0.3, 12, 5.0
STIFFNESS = tuple(10.0**k for k in range(9))
STEPS = (1 / 240, 1 / 60, 1 / 10)  # [s]
RATIOS = (1e3, 1e6)
SPACINGS = (1e-4, 1e-3, 1e-2)  # [m]
FEW = (1.0, 1e4, 1e8)
SOME = ("held", "crumpled", "twisted", "dropped", "wind", "pulled")
"""Starts that are tried with one modulus alone made stiff."""

SHARE, LIMIT = 0.25, StrainLimit(strain=0.03, passes=3)
"""For cells that are `limited`."""

AT_REST = 0.05
"""Mean speed [m/s] below which a sheet counts as at rest: a pendulum's swing of 1 cm."""

FASTEST = 20.0
"""Mean speed [m/s] after all that time beyond which a sheet has made its motion itself: a fall of 10 m ends at 14."""

MADE = 0.05
"""Share of its energy that a run may make and still count as stable."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """solver: by name; "": the one that a scene gets that names none. stiffness: of threads and shear, × cotton
    shirting; threads, shear, bending: of these alone, × that. frame: time between two frames [s]. ratio: of the
    heaviest and the lightest key point's mass. spacing: of key points [m]. limited: springs carry a quarter of the
    tensile stiffness, and a strain limit holds the rest."""

    solver: str = ""
    start: str = "held"
    stiffness: float = 1.0
    threads: float = 1.0
    shear: float = 1.0
    bending: float = 1.0
    frame: float = 1 / 60
    ratio: float = 1.0
    spacing: float = SIDE / (POINTS - 1)
    limited: bool = False

    @property
    def what(self) -> str:
        def power(number: float) -> str:
            return f"{number:.0e}".replace("e+0", "e")

        words = [self.start, f"{power(self.stiffness)} × cotton"]
        words += [
            f"{name} {power(value)} ×"
            for name in ("threads", "shear", "bending")
            if (value := getattr(self, name)) != 1
        ]
        words.append(f"frame 1/{round(1 / self.frame)} s")
        if self.ratio != 1:
            words.append(f"masses 1 to {power(self.ratio)}")
        if self.spacing in SPACINGS:
            words.append(f"spacing {1e3 * self.spacing:g} mm")
        if self.limited:
            words.append("limited")
        return ", ".join(words)


def cells(quick: bool = False) -> list[Cell]:
    """The matrix: starts × stiffness, steps × stiffness, masses × stiffness, spacings × stiffness; one modulus alone
    made stiff; all with a strain limit; and Verlet with cotton as it is, for which it was made."""
    return list(dict.fromkeys(_quick() if quick else _all()))


def _quick() -> Iterator[Cell]:
    for start, k in product(STARTS, (1.0, 1e8)):
        yield Cell(start=start, stiffness=k)
    yield Cell(stiffness=1e8, frame=1 / 240)
    yield Cell(stiffness=1e8, frame=1 / 10)
    yield Cell(stiffness=1e4, ratio=1e3)
    yield Cell(shear=100.0)
    yield Cell(solver="verlet")


def _all() -> Iterator[Cell]:
    for start, k in product(STARTS, FEW):
        yield Cell(start=start, stiffness=k)
    for k, h in product(STIFFNESS, STEPS):
        yield Cell(stiffness=k, frame=h)
    for k, r in product((*FEW, 1e6), RATIOS):
        yield Cell(stiffness=k, ratio=r)
    for k, a in product((1.0, 1e8), SPACINGS):
        yield Cell(stiffness=k, spacing=a)
    for start in SOME:
        for k in (1e2, 1e4, 1e6):
            yield Cell(start=start, threads=k)
        yield Cell(start=start, threads=1e4, shear=1e2)
        for k in (1e2, 1e4):
            yield Cell(start=start, bending=k)
    yield Cell(shear=1e2)
    for k in (1e6, 1e8):
        yield Cell(bending=k)
    for start, k in product(STARTS, (1.0, 1e2, 1e4)):
        yield Cell(start=start, stiffness=k, limited=True)
    for start in STARTS:
        yield Cell(solver="verlet", start=start)
    for h in STEPS:
        yield Cell(solver="verlet", frame=h)


@dataclass(frozen=True, eq=False)
class _Loaded(Sheet):
    """A sheet whose masses are × factor (rows, cols)."""

    factor: F64 = None  # pyright: ignore[reportAssignmentType]

    @cached_property
    def mass(self) -> F64:
        return super().mass * self.factor


def _material(cell: Cell) -> Material:
    base = named_material("cotton-shirting").linear
    tensile = cell.stiffness * cell.threads * (SHARE if cell.limited else 1.0)
    factors = {
        "tensile_warp": tensile,
        "tensile_weft": tensile,
        "shear": cell.stiffness * cell.shear,
        "bending_warp": cell.bending,
        "bending_weft": cell.bending,
    }
    scaled = {name: factor * getattr(base, name) for name, factor in factors.items()}
    density = 0.0 if cell.start == "no mass" else base.density
    if cell.start == "pulled":  # diagonals that are stiffer than threads turn towards the pull
        scaled["tensile_warp"] = scaled["tensile_weft"]
        scaled["shear"] = 3 * cell.shear * scaled["tensile_weft"]
    return replace(base, **scaled, density=density, air_damping=4.0)


def _sheet(cell: Cell) -> Sheet:
    material = _material(cell)
    held = np.zeros((POINTS, POINTS), bool)
    held[0] = cell.start not in FREE
    held[-1] = cell.start == "pulled"
    a = 0.0 if cell.start == "no rest length" else cell.spacing
    springs = calibrate(material, spacing_x=a, spacing_y=a)
    sheet = Sheet.rectangle(POINTS, POINTS, material=material, springs=springs, pinned=held)
    if cell.ratio == 1:
        return sheet
    heavy = np.random.Generator(np.random.Philox(key=3)).uniform(size=sheet.shape) < 0.5
    return _Loaded(sheet.cells, material, springs, sheet.pinned, factor=np.where(heavy, cell.ratio, 1.0))


def simulation_of(cell: Cell) -> Simulation:
    """Raises InputError."""
    sheet = _sheet(cell)
    x, velocity, forces = start_of(cell.start, sheet)
    if cell.limited:
        forces = replace(forces, strain_limit=LIMIT)
    kind = named_solver(cell.solver or choose(sheet, forces).name)
    constraints = constraints_for(sheet, forces, answered=kind.answers)
    solver = kind(sheet, forces, frame_rate=1 / cell.frame, constraints=constraints)
    pins = pins_of(cell.start, sheet, x) if sheet.pinned.any() else ()
    return Simulation(sheet, solver, forces=forces, positions=x, velocities=velocity, pins=pins)


def ran(cell: Cell, seconds: float = SECONDS) -> Outcome:
    """Runs a cell. Taichi has been started."""
    begin = time.process_time()
    part = f"sheet, {cell.solver}" if cell.solver else "sheet"
    try:
        simulation = simulation_of(cell)
        sheet, reach = simulation.sheet, float(np.abs(simulation.positions).max())
        settled = simulation.solver.overstrained(simulation.state)
        energies = [] if settled else [_energy(simulation)]
        for _ in range(round(seconds / cell.frame)):
            simulation.step()
            energies.append(_energy(simulation))
    except (InputError, Unstable) as error:
        return refused(part, cell.what, error, time.process_time() - begin)
    totals, inner, held = np.array(energies).T
    held = np.maximum(held - _told_apart(_solved(simulation), reach), 0.0)
    made = energy_made(totals, held) - _told_apart(links(simulation.solver.explicit), reach)
    drift = nan if cell.start in WORKING else max(0.0, made) / max(float(inner.max()), 1e-30)
    speed = float(np.linalg.norm(sheet.steps(simulation.state), axis=-1).mean()) / simulation.solver.step
    strain = np.concatenate([part.ravel() for part in sheet.stretch(simulation.positions)])
    long = "pulled" if cell.start == "pulled" else "tangled"
    recovered = "moving" if speed > AT_REST else "yes" if np.percentile(np.abs(strain), 95) < 0.1 else long
    line = ""
    if not np.isfinite(simulation.state.values).all():
        line = "not finite"
    elif drift > MADE:
        line = f"made {100 * drift:.2g} % of its energy"
    elif speed > FASTEST:
        line = f"flies about at {speed:.3g} m/s"
    return Outcome(
        part=part,
        what=cell.what,
        verdict=NEITHER if line else STABLE,
        drift=drift,
        stretch=float(strain.max()),
        speed=speed,
        recovered=recovered,
        line=line,
        seconds=time.process_time() - begin,
    )


def energy_made(totals: F64, held: F64) -> float:
    """The most that the total energy rose above an earlier value [J]; what threads give back is not made.

    totals: without what threads hold that are solved whole; held: at most what those hold, from how long they are,
    both (frames,). A blow that contact turns away leaves threads longer than it had energy for: so what they hold
    counts only as far as the rest has lost it before.
    """
    store, rises, least = 0.0, 0.0, float(totals[0])
    for before, now, most in zip(totals, totals[1:], held[1:], strict=False):
        store = min(max(store + float(before - now), 0.0), float(most))
        least = min(least, float(now) + store)
        rises = max(rises, float(now) + store - least)
    return rises


def _told_apart(springs: Iterable[Links], reach: float) -> float:
    """Elastic energy [J] that lies in the rounding of positions to float32: no less can be told of a state. The spread
    of a length is that of two ends, ulp²/6; 3 for the largest of some hundred frames."""
    ulp = float(np.spacing(np.float32(reach)))
    return 3 * sum(0.5 * float(link.constant.sum()) for link in springs) * ulp**2 / 6


def _solved(simulation: Simulation) -> list[Links]:
    """The springs that the solver solves whole."""
    pairs = zip(links(simulation.sheet), links(simulation.solver.explicit), strict=True)
    return [replace(one, constant=one.constant - rest.constant) for one, rest in pairs]


def _held(simulation: Simulation, x: F64) -> float:
    """Energy of the springs that are solved whole [J]; at a strain limit they hold no more than at its edge."""
    limit, total = simulation.forces.strain_limit, 0.0
    for link in _solved(simulation):
        grown = np.linalg.norm(x[link.two] - x[link.one], axis=-1) - link.rest
        if limit is not None and 0.0 in link.direction:  # of threads, not of diagonals
            grown = np.minimum(grown, limit.strain * link.rest)
        total += 0.5 * float(np.sum(link.constant * grown**2))
    return total


def _energy(simulation: Simulation) -> tuple[float, float, float]:
    """Total with that of gravity; kinetic and elastic alone; and what threads hold that are solved whole, which is in
    neither [J]."""
    sheet, x = simulation.sheet, simulation.positions.astype(np.float64)
    v = np.where(
        sheet.pinned[..., None], 0.0, sheet.steps(simulation.state).astype(np.float64) / simulation.solver.step
    )
    inner = elastic_energy(simulation.solver.explicit, x) + kinetic_energy(sheet, v)
    total = inner - float((sheet.mass[..., None] * x * simulation.forces.gravity).sum())
    return total, inner, _held(simulation, x)
