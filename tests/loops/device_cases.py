"""Small pieces of cloth that are moved on any device: for tests, and as a program that writes where they came to.

python device_cases.py CASE ARCH FILE.npy
"""

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.constraints.ties import Ties
from taichi_cloth.crossings.crossings import find_crossings
from taichi_cloth.garment.pattern.cut import cut
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern, Seam, Side
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.ground import runtime
from taichi_cloth.layers.outline import crossings_of
from taichi_cloth.motion.forces import Forces, Plane, SelfContact, Sphere, StrainLimit, Wind
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import named_material
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import Yarns

N = 21
CASES = {
    "verlet, wind": (Verlet, {"wind": True}),
    "verlet, friction within": (Verlet, {"within": True}),
    "yarns, wind": (Yarns, {"wind": True}),
    "yarns, limit": (Yarns, {"limit": 1e-4}),
    "yarns, chains": (Yarns, {"wind": True, "chains": True}),
    "yarns, table": (Yarns, {"body": True}),
    "verlet, table": (Verlet, {"body": True}),
    "verlet, thin": (Verlet, {"body": True, "thin": 1}),
    "verlet, many thin": (Verlet, {"body": True, "thin": 9}),
    "yarns, seam": (Yarns, {"wind": True, "seam": True, "most": None}),
    "verlet, seam": (Verlet, {"wind": True, "seam": True, "most": 0.008, "limit": 5e-4}),
    "yarns, drape": (Yarns, {"drape": True}),
    "verlet, layers": (Verlet, {"layers": True}),
    "yarns, layers": (Yarns, {"layers": True}),
    "verlet, sack": (Verlet, {"sack": True}),
    "yarns, sack": (Yarns, {"sack": True}),
}
"""Hanging from their top edge in wind, falling on a table, sewn of two halves and hung from places, folding over a
ball, two panels thrown at each other over a floor, a sack that falls on it. Only the last five buckle."""
WHOLE = "yarns, drape", "verlet, layers", "yarns, layers", "verlet, sack", "yarns, sack"
"""Of which no key point is an oracle, but the whole is."""
WITHIN = {"yarns, limit": 3e-6, "verlet, seam": 5e-5}
"""How far from a CPU's places may be [m], of those where rounding decides what is held and what slides; else 1e-6."""


def simulation(case: str, *, n: int = N, long: int = 0) -> Simulation:
    """A square of 0.3 m with n × n key points, or with `long` rows of the same spacing."""
    solver, asked = CASES[case]
    if asked.get("layers"):
        return thrown(solver)
    if asked.get("sack"):
        return dropped(solver)
    straight = {} if solver is Yarns else dict.fromkeys(("drawn_warp", "drawn_weft", "crimp_warp", "crimp_weft"), 0.0)
    material = replace(named_material("cotton-shirting"), air_damping=1.0, fibre_damping=5e-5, **straight)
    if asked.get("within"):
        material = replace(material, couple_warp=1e-4, couple_weft=1e-4, shear_friction=0.3)
    rows, spacing = long or n, 0.3 / (n - 1)
    springs = calibrate(material, spacing_x=spacing, spacing_y=spacing)
    lies = asked.get("body") or asked.get("drape")
    held = np.zeros((rows, n), bool)
    held[-1] = not lies
    cells = np.ones((rows - 1, n - 1), bool)
    cells[:, n // 2] = not asked.get("seam")
    held[-1] = held[-1] & (not asked.get("seam"))
    sheet = Sheet.of_cells(cells, material=material, springs=springs, pinned=held)
    forces = Forces(
        wind=Wind(velocity=(0.3, 0.0, 1.5), gusts=0.3) if asked.get("wind") else None,
        sphere=Sphere(centre=(0.15, -0.11, -0.15), radius=0.1) if asked.get("drape") else None,
        plane=Plane(height=-0.15) if asked.get("drape") else None,
        strain_limit=StrainLimit(strain=asked["limit"], passes=1) if "limit" in asked else None,
        body=table(0.02 if asked.get("thin") else 0.05, asked.get("thin", 1)) if asked.get("body") else None,
    )
    x = sheet.flat()
    if lies:
        x = x[..., [0, 2, 1]] * np.array([1.0, 1.0, -1.0])
        x[..., 1] += 0.01 * x[..., 0]  # one edge arrives first, and nothing is decided by rounding
    ties = sewn_and_hung(sheet, asked["most"]) if asked.get("seam") else ()
    if ties:
        x[:, n // 2 + 1 :, 0] -= spacing
    held_by = constraints_for(sheet, forces, ties=ties, answered=solver.answers)
    chains = {"chains": True} if asked.get("chains") else {}
    made = solver(sheet, forces, frame_rate=60, constraints=held_by, **chains)
    return Simulation(sheet, made, forces=forces, positions=x, pins=() if lies or ties else (Pins(held),))


def thrown(solver: type[Verlet | Yarns]) -> Simulation:
    """Two panels that meet themselves and each other, the upper one coming down at 2 m/s."""
    sys.path.append(str(Path(__file__).parents[1]))
    from layers import THICKNESS, layers

    sheet, x, v = layers(2.0)
    forces = Forces(plane=Plane(height=-0.05), self_contact=SelfContact(thickness=THICKNESS))
    made = solver(sheet, forces, frame_rate=60, constraints=constraints_for(sheet, forces))
    return Simulation(sheet, made, forces=forces, positions=x, velocities=v)


@cache
def sack() -> Garment:
    """Two panels of 234 key points sewn along three sides that no thread follows: pieces of cells all round."""
    corner = 0.2 * np.array([[0.03, 0.0], [1.02, 0.06], [0.91, 1.0], [0.08, 0.97], [0.03, 0.0]])
    edges = tuple(corner[k : k + 2] for k in range(4))
    lean = np.array([[1.0, 0.0, 0.0], [0.0, 0.94, -0.34], [0.0, 0.34, 0.94]])
    lean /= np.linalg.norm(lean, axis=0)
    panels = tuple(Panel(name, edges, Flat(lean, np.array([0, 0, z]))) for name, z in (("a", 0.006), ("b", -0.006)))
    pattern = Pattern("sack", panels, tuple(Seam(Side("a", k), Side("b", k)) for k in (1, 2, 3)))
    return Garment(pattern, cut(pattern, (0.02, 0.02)), named_material("cotton-shirting").linear)


def dropped(solver: type[Verlet | Yarns]) -> Simulation:
    """The sack: its seams close in the first frame, and it folds on a floor."""
    forces = Forces(plane=Plane(height=-0.02), self_contact=SelfContact(thickness=0.001))
    return sack().simulation(forces, sack().atlas.start(), solver=solver.__name__.lower())


def through(case: str, moving: Simulation) -> int:
    """How many triangles of its cloth pass through others, by the exact test."""
    if CASES[case][1].get("sack"):
        return crossings_of(sack().outline, moving.positions).count
    return find_crossings(moving.positions.reshape(-1, 3), moving.sheet.triangles).count


def sewn_and_hung(sheet: Sheet, most: float | None) -> tuple[Ties, Ties]:
    """A seam down the middle, closed, and places of the top edge as it is then, which slide beyond `most` [N]."""
    rows, n = sheet.shape
    row, column = np.arange(rows), np.arange(n)
    seam = np.stack([np.stack([row, np.full(rows, n // 2 + side)], axis=1) for side in (0, 1)], axis=1)
    top = np.stack([np.full(n, rows - 1), column], axis=1)[:, None]
    places = sheet.flat()[-1].copy()
    places[n // 2 + 1 :, 0] -= sheet.springs.spacing_x
    return (
        Ties(sheet, seam, np.tile([1.0, -1.0], (rows, 1))),
        Ties(sheet, top, np.ones((n, 1)), places=places, most=np.full(n, most) if most else None, repeated=False),
    )


def table(radius: float, bars: int) -> Colliders:
    """A round table 5 mm below the cloth, and in it a bar [m], 2 mm below; from 4 cm on it is not thin. bars: so many,
    each within 1 mm of the next."""
    up, away = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 0.4])
    middle = np.array([0.15, 0.0, -0.15])
    top = Primitive(
        kind="elliptic",
        start=middle - 0.3 * up,
        end=middle - 0.005 * up,
        radii=(0.5, 0.5),
        across=np.array([1.0, 0.0, 0.0]),
        rounding=0.01,
    )
    axis = middle - (radius + 0.002) * up
    beside = [np.array([0.001 * (k - bars // 2), 0.0, 0.0]) for k in range(bars)]
    ends = [(axis + way - away, axis + way + away) for way in beside]
    each = [Primitive(kind="cylinder", start=one, end=other, radii=(radius, radius)) for one, other in ends]
    return Colliders(primitives=(top, *each), friction=0.4, gap=0.001)


def moved(case: str, frames: int) -> NDArray[np.float32]:
    """Positions (frames, rows, columns, 3) [m]."""
    moving, out = simulation(case), []
    for _ in range(frames):
        moving.step()
        out.append(moving.positions)
    return np.stack(out)


if __name__ == "__main__":
    name, arch, file = sys.argv[1:]
    runtime.start(arch)  # pyright: ignore[reportArgumentType]
    np.save(Path(file), moved(name, 12))
