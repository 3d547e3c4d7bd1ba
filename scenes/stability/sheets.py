"""A small sheet in every state that no one would wish for, and what became of it after five seconds."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import nan

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.motion.forces import Forces, Plane, Sphere, StrainLimit, Wind
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.energy import elastic_energy, kinetic_energy, links
from taichi_cloth.sheet.materials import Material, named_material
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.named import named_solver

from .outcome import NEITHER, STABLE, Outcome, refused

__all__ = ["SOLVERS", "STARTS", "Cell", "cells", "ran"]

F64 = NDArray[np.float64]
SIDE, POINTS, SECONDS = 0.3, 12, 5.0
SOLVERS = ("verlet", "yarns")
STIFFNESS = tuple(10.0**k for k in range(9))
STEPS = (1 / 240, 1 / 60, 1 / 10)  # [s]
RATIOS = (1e3, 1e6)
SPACINGS = (1e-4, 1e-3, 1e-2)  # [m]
STARTS = (
    "held", "point", "line", "shuffled", "stretched", "inverted", "twisted", "dropped", "thrown", "teleport", "wind",
    "pulled", "no rest length", "no mass",
)  # fmt: skip
SHARE, LIMIT = 0.25, StrainLimit(strain=0.03, passes=3)
"""As of the built-in skirt, for cells that are `limited`."""

WORKING = ("teleport", "wind", "pulled")
"""Starts in which something outside does work, so that energy tells nothing."""

AT_REST = 0.05
"""Mean speed [m/s] below which a sheet counts as at rest: a pendulum's swing of 1 cm."""

MADE = 0.05
"""Share of its energy that a run may make and still count as stable."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """stiffness: × cotton shirting. frame: time between two frames [s]. ratio: of the heaviest and the lightest key
    point's mass. spacing: of key points [m]. limited: springs carry a quarter of the tensile stiffness, and a strain
    limit holds the rest, as in garments."""

    solver: str
    start: str = "held"
    stiffness: float = 1.0
    frame: float = 1 / 60
    ratio: float = 1.0
    spacing: float = SIDE / (POINTS - 1)
    limited: bool = False

    @property
    def what(self) -> str:
        words = [self.start, f"{self.stiffness:.0e} × cotton".replace("e+0", "e")]
        words.append(f"frame 1/{round(1 / self.frame)} s")
        if self.ratio != 1:
            words.append(f"masses 1 to {self.ratio:.0e}".replace("e+0", "e"))
        if self.spacing in SPACINGS:
            words.append(f"spacing {1e3 * self.spacing:g} mm")
        if self.limited:
            words.append("limited")
        return ", ".join(words)


def cells(quick: bool = False) -> list[Cell]:
    """The matrix: starts × stiffness, steps × stiffness, masses × stiffness, spacings × stiffness, by both solvers."""
    few = (1.0, 1e8)
    out = []
    for solver in SOLVERS:
        out += [
            Cell(solver=solver, start=s, stiffness=k) for s, k in product(STARTS, few if quick else (1.0, 1e4, 1e8))
        ]
        out += [
            Cell(solver=solver, stiffness=k, frame=h)
            for k, h in product(few if quick else STIFFNESS, STEPS[::2] if quick else STEPS)
        ]
        out += [Cell(solver=solver, stiffness=k, ratio=r) for k, r in product(few, RATIOS)]
        out += [Cell(solver=solver, stiffness=k, spacing=a) for k, a in product(few, SPACINGS)]
    out += [
        Cell(solver="verlet", start=s, stiffness=k, limited=True)
        for s, k in product(STARTS, few[:1] if quick else (1.0, 1e2, 1e4))
    ]
    return list(dict.fromkeys(out))


@dataclass(frozen=True, eq=False)
class _Loaded(Sheet):
    """A sheet whose masses are × factor (rows, cols)."""

    factor: F64 = None  # pyright: ignore[reportAssignmentType]

    @cached_property
    def mass(self) -> F64:
        return super().mass * self.factor


def _material(cell: Cell) -> Material:
    base = named_material("cotton-shirting").linear
    names = ("tensile_warp", "tensile_weft", "shear", "bending_warp", "bending_weft")
    scaled = {name: cell.stiffness * getattr(base, name) for name in names}
    if cell.limited:
        scaled |= {name: SHARE * scaled[name] for name in ("tensile_warp", "tensile_weft")}
    density = 0.0 if cell.start == "no mass" else base.density
    if cell.start == "pulled":  # diagonals that are stiffer than threads turn towards the pull
        scaled["tensile_warp"] = scaled["tensile_weft"]
        scaled["shear"] = 3 * scaled["tensile_weft"]
    return replace(base, **scaled, density=density, air_damping=4.0)


def _sheet(cell: Cell) -> Sheet:
    material = _material(cell)
    held = np.zeros((POINTS, POINTS), bool)
    held[0] = cell.start not in ("dropped", "thrown", "teleport")
    held[-1] = cell.start == "pulled"
    a = 0.0 if cell.start == "no rest length" else cell.spacing
    springs = calibrate(material, spacing_x=a, spacing_y=a)
    sheet = Sheet.rectangle(POINTS, POINTS, material=material, springs=springs, pinned=held)
    if cell.ratio == 1:
        return sheet
    heavy = np.random.Generator(np.random.Philox(key=3)).uniform(size=sheet.shape) < 0.5
    return _Loaded(sheet.cells, material, springs, sheet.pinned, np.where(heavy, cell.ratio, 1.0))


def _start(cell: Cell, sheet: Sheet) -> tuple[F64, float | Sequence[float], Forces]:
    """Positions [m], velocities [m/s] and forces. A flat sheet lies level, held along its first row where it is."""
    u, v = sheet.flat()[..., 0], sheet.flat()[..., 1]
    side = float(u.max())
    flat = np.stack([u, 0.0 * u, v], axis=-1)
    floor, ball = Plane(height=-0.5), Sphere(centre=(0.14, -0.3, 0.16), radius=0.1)
    forces, speed, x = Forces(), 0.0, flat
    rng = np.random.Generator(np.random.Philox(key=7))
    if cell.start == "point":
        x = 0.0 * flat
    elif cell.start == "line":
        x = flat * [1.0, 0.0, 0.0]
    elif cell.start == "shuffled":
        x = rng.permutation(flat.reshape(-1, 3)).reshape(flat.shape)
    elif cell.start == "stretched":
        x = 10.0 * flat
    elif cell.start == "inverted":
        x = -flat
    elif cell.start == "twisted":
        turn = 20 * np.pi * v / side
        x = np.stack([side / 2 + (u - side / 2) * np.cos(turn), (u - side / 2) * np.sin(turn), v], axis=-1)
    elif cell.start == "dropped":
        x, forces = flat + np.array([0.0, 10.0, 0.0]), Forces(sphere=ball, plane=floor)
    elif cell.start == "thrown":
        speed, forces = (0.0, -50.0, 0.0), Forces(sphere=ball, plane=floor)
    elif cell.start == "teleport":
        forces = Forces(plane=floor, body=_jumping())
    elif cell.start == "wind":
        forces = Forces(wind=Wind(velocity=(60.0, 0.0, 80.0), gusts=0.2))
    if cell.limited:
        forces = replace(forces, strain_limit=LIMIT)
    x = x.copy()
    x[sheet.pinned] = flat[sheet.pinned]
    return x, speed, forces


def _pins(cell: Cell, sheet: Sheet, start: F64) -> tuple[Pins, ...]:
    """Held still; where the sheet is pulled the last row moves away by a fifth of its length within two seconds."""
    if cell.start != "pulled":
        return (Pins(sheet.pinned),)
    first, last = sheet.pinned.copy(), sheet.pinned.copy()
    first[-1], last[0] = False, False
    away = 0.2 * (start[-1] - start[0])
    return Pins(first), Pins(last, lambda time: start[-1] + min(time / 2, 1.0) * away)


def _jumping() -> Colliders:
    """A ball under the sheet that is somewhere else every half second."""
    places = np.random.Generator(np.random.Philox(key=11)).uniform(-0.3, 0.3, (16, 3))

    def motion(seconds: float) -> F64:
        out = np.eye(4)[None].copy()
        out[0, :3, 3] = places[int(seconds / 0.5) % 16]
        return out

    centre = np.array([0.15, -0.11, 0.15])
    ball = Primitive(kind="sphere", start=centre, end=centre, radii=(0.1, 0.1))
    return Colliders(primitives=(ball,), motion=motion, name="jumping")


def ran(cell: Cell, seconds: float = SECONDS) -> Outcome:
    """Runs a cell. Taichi has been started."""
    begin = time.process_time()
    part = f"sheet, {cell.solver}"
    drift = stretch = speed = nan
    try:
        sheet = _sheet(cell)
        x, velocity, forces = _start(cell, sheet)
        kind = named_solver(cell.solver)
        constraints = constraints_for(sheet, forces, answered=kind.answers)
        solver = kind(sheet, forces, frame_rate=1 / cell.frame, constraints=constraints)
        pins = _pins(cell, sheet, x) if sheet.pinned.any() else ()
        simulation = Simulation(sheet, solver, forces=forces, positions=x, velocities=velocity, pins=pins)
        energies = [_energy(simulation)]
        for _ in range(round(seconds / cell.frame)):
            simulation.step()
            energies.append(_energy(simulation))
        reach = float(np.abs(x).max())
        largest = max(inner for _, inner in energies)
        totals = np.array([total for total, _ in energies])
        made = float((totals - np.minimum.accumulate(totals)).max()) - _told_apart(simulation, reach)
        drift = max(0.0, made) / max(largest, 1e-30)
        stretch = float(max(part.max() for part in sheet.stretch(simulation.positions)))
        speed = float(np.linalg.norm(sheet.steps(simulation.state), axis=-1).mean()) / solver.step
    except (InputError, Unstable) as error:
        return refused(part, cell.what, error, time.process_time() - begin)
    if cell.start in WORKING:
        drift = nan
    strain = np.concatenate([np.abs(part).ravel() for part in sheet.stretch(simulation.positions)])
    long = "pulled" if cell.start == "pulled" else "tangled"
    recovered = "moving" if speed > AT_REST else "yes" if np.percentile(strain, 95) < 0.1 else long
    finite = np.isfinite(simulation.state.values).all()
    line = ""
    if not finite or drift > MADE:
        line = "not finite" if not finite else f"made {100 * drift:.2g} % of its energy"
    return Outcome(
        part=part,
        what=cell.what,
        verdict=NEITHER if line else STABLE,
        drift=drift,
        stretch=stretch,
        speed=speed,
        recovered=recovered,
        line=line,
        seconds=time.process_time() - begin,
    )


def _told_apart(simulation: Simulation, reach: float) -> float:
    """Elastic energy [J] that lies in the rounding of positions to float32: no less can be told of a state. The spread
    of a length is that of two ends, ulp²/6; 3 for the largest of some hundred frames."""
    ulp = float(np.spacing(np.float32(reach)))
    return 3 * sum(0.5 * float(link.constant.sum()) for link in links(simulation.sheet)) * ulp**2 / 6


def _energy(simulation: Simulation) -> tuple[float, float]:
    """Total with that of gravity, and kinetic and elastic alone [J]."""
    sheet, x = simulation.sheet, simulation.positions.astype(np.float64)
    v = np.where(
        sheet.pinned[..., None], 0.0, sheet.steps(simulation.state).astype(np.float64) / simulation.solver.step
    )
    inner = elastic_energy(sheet, x) + kinetic_energy(sheet, v)
    return inner - float((sheet.mass[..., None] * x * simulation.forces.gravity).sum()), inner
