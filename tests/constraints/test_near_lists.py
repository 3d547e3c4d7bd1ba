"""What searches of some key points leave known: no two layers come near each other that are not in the lists."""

import numpy as np
import pytest
from layers import THICKNESS, layers, triangles
from numpy.typing import NDArray

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.layers.layer_contact import LayerFields
from taichi_cloth.motion.forces import Forces, SelfContact
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.sheet import PAD, Sheet
from taichi_cloth.solvers.verlet import Verlet


def from_faces(points: NDArray, faces: NDArray) -> NDArray:
    """(points, faces) distances of points (n, 3) from triangles (m, 3, 3), by the nearest of places of a fine grid on
    each: at most too large."""
    u, v = (g.ravel() for g in np.meshgrid(*(np.linspace(0, 1, 13),) * 2))
    u, v = u[u + v <= 1 + 1e-9], v[u + v <= 1 + 1e-9]
    weights = np.stack([1 - u - v, u, v])  # (3, places)
    places = np.einsum("cp,mcx->mpx", weights, faces)
    best = np.full((len(points), len(faces)), np.inf)
    for k in range(places.shape[1]):
        best = np.minimum(best, np.linalg.norm(points[:, None] - places[None, :, k], axis=-1))
    return best


def listed(fields: LayerFields, sheet: Sheet) -> set[tuple[int, ...]]:
    """The point and the corners of the face of each near pair, key points numbered row by row."""
    pairs, width = fields.near.faces, sheet.width
    at = np.stack([corner.to_numpy()[: pairs.count[None]] for corner in pairs.point], axis=1)
    number = (at // width - PAD) * sheet.shape[1] + at % width
    return {tuple(int(n) for n in row) for row in number}


@pytest.mark.parametrize("speed", [2.0, 20.0])
def test_what_comes_near_is_listed_after_searches_of_some(speed: float) -> None:
    """Two panels thrown at each other. Paths of what is not listed stay further apart than the reach: so what is nearer
    than that at the end of a frame, less what it is off its path, has to be among the near pairs."""
    sheet, x, v = layers(speed)
    forces = Forces(gravity=(0.0, 0.0, 0.0), self_contact=SelfContact(thickness=THICKNESS))
    solver = Verlet(sheet, forces, threads=2, constraints=constraints_for(sheet, forces))
    simulation = Simulation(sheet, solver, forces=forces, positions=x, velocities=v)
    fields: LayerFields = solver.constraints[0].fields  # pyright: ignore[reportAttributeAccessIssue]
    faces, cols = triangles(sheet), sheet.shape[1]
    upper = faces[:, 0] >= 18 * cols
    renewed = near = 0
    for _ in range(6):
        simulation.step()
        renewed += fields.renewals[None]
        off = np.linalg.norm([a.to_numpy()[: sheet.width * sheet.padded_shape[0]] for a in fields.paths.off], axis=0)
        off = off.reshape(sheet.padded_shape)[PAD:-PAD, : sheet.shape[1]].ravel()
        y, known = simulation.positions.reshape(-1, 3).astype(float), listed(fields, sheet)
        for above in (True, False):
            points = np.flatnonzero(sheet.present.ravel())
            points = points[(points >= 18 * cols) != above]
            others = faces[upper == above]
            closest = from_faces(y[points], y[others])
            sure = fields.reach[None] - off[points][:, None] - off[others].max(axis=1)
            for p, f in np.argwhere(closest < sure - 1e-6):
                near += 1
                assert (int(points[p]), *map(int, others[f])) in known
    assert renewed > 3
    assert near > 100
