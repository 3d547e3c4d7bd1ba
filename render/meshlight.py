"""What a mesh does to the light of others: its first depths on the map of a light, and points that stand for it.

Seen from a distant light a triangle's depth, and the shares b0, b1, b2 of its corners, are linear in the texel's
place; it covers the texels in whose middle no share is negative.
"""

# In kernels a name stands for a Taichi expression, which type checkers cannot follow.
# pyright: reportIndexIssue=false, reportArgumentType=false, reportOptionalCall=false, reportReturnType=false

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from .arrays import LANES, Floats1, Floats2, Int, Ints2
from .blocks import COLOUR, NORMAL, POSITION, RADIUS, TANGENT, Layout
from .fit import Fit
from .mesh import Mesh
from .transmittance import EMPTY

__all__ = ["first_depths", "stand_ins"]


def first_depths(mesh: Mesh, at: Fit) -> NDArray[np.float32]:
    """Depth [m] at which the light of a map first meets a mesh, EMPTY where it does not, shape (texels,)."""
    place = mesh.vertices.astype(np.float64) @ at.frame.T - at.origin
    place[:, :2] = place[:, :2] / at.texel - 0.5
    finite = np.isfinite(place).all(axis=1)[mesh.faces].all(axis=1)
    v = np.nan_to_num(place[mesh.faces], posinf=0, neginf=0)  # (f, corners, u v depth)
    one, two = v[:, 1] - v[:, 0], v[:, 2] - v[:, 0]
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    low = np.ceil(v[..., :2].min(axis=1)).clip(0)
    high = np.floor(v[..., :2].max(axis=1)).clip(-1, (at.width - 1, at.height - 1))
    used = finite & (np.abs(area) > 1e-12) & (high >= low).all(axis=1)
    v, one, two, area, low, high = (a[used] for a in (v, one, two, area, low, high))
    slope = np.stack(
        [
            np.stack([two[:, 1], -two[:, 0]], 1) / area[:, None],
            np.stack([-one[:, 1], one[:, 0]], 1) / area[:, None],
        ],
        1,
    )  # of b1 and b2, along u and v
    rows = np.concatenate([v[:, 0], slope.reshape(-1, 4), one[:, 2:], two[:, 2:]], 1).astype(np.float32)
    boxes = np.concatenate([low, high], 1).astype(np.int32)
    wall = np.full(at.width * at.height, EMPTY, np.float32)
    _walls(len(rows), at.width, rows, boxes, wall)
    return wall


@ti.kernel
def _walls(count: Int, width: Int, rows: Floats2, boxes: Ints2, wall_out: Floats1):
    """rows: u, v, depth of a corner; d b1 / du, dv; d b2 / du, dv; what b1 and b2 add to the depth."""
    ti.loop_config(serialize=True)
    for i in range(count):
        for y in range(boxes[i, 1], boxes[i, 3] + 1):
            for x in range(boxes[i, 0], boxes[i, 2] + 1):
                u = x - rows[i, 0]
                v = y - rows[i, 1]
                b1 = rows[i, 3] * u + rows[i, 4] * v
                b2 = rows[i, 5] * u + rows[i, 6] * v
                if b1 >= -1e-5 and b2 >= -1e-5 and b1 + b2 <= 1.00001:
                    depth = rows[i, 2] + b1 * rows[i, 7] + b2 * rows[i, 8]
                    wall_out[y * width + x] = ti.min(wall_out[y * width + x], depth)


def stand_ins(mesh: Mesh, layout: Layout, spacing: float, most: int) -> NDArray[np.float32]:
    """Blocks of opaque discs that cover a mesh, about `spacing` [m] apart, at most about `most`, always the same."""
    corner = mesh.vertices[mesh.faces].astype(np.float64)
    good = np.isfinite(corner).all(axis=(1, 2))
    corner = corner[good]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) / 2
    area = np.linalg.norm(cross, axis=1)
    total = float(area.sum())
    if not total > 0:
        return np.zeros((0, layout.rows, LANES), np.float32)
    count = max(LANES, min(most, int(total / spacing**2)))
    random = np.random.Generator(np.random.Philox(key=[0, 12]))
    pick = np.searchsorted(np.cumsum(area), (np.arange(count) + 0.5) / count * total).clip(0, len(area) - 1)
    a, b = random.random((2, count, 1))
    a, b = np.where(a + b > 1, 1 - a, a), np.where(a + b > 1, 1 - b, b)
    place = corner[pick, 0] + a * (corner[pick, 1] - corner[pick, 0]) + b * (corner[pick, 2] - corner[pick, 0])
    columns = np.zeros((layout.rows, -(-count // LANES) * LANES), np.float32)
    columns[POSITION : POSITION + 3, :count] = place.T
    columns[RADIUS, :count] = radius = (1.5 * total / count) ** 0.5
    columns[COLOUR : COLOUR + 3], columns[TANGENT] = 0.5, 1.0
    columns[NORMAL : NORMAL + 3, :count] = (cross[pick] / np.maximum(area[pick], 1e-30)[:, None]).T
    if layout.elliptic:
        columns[layout.half_length_row] = radius
    if layout.openness:
        columns[layout.openness_row] = 1.0
    if layout.opacity:
        columns[layout.opacity_row] = 1.0
    return np.ascontiguousarray(columns.reshape(layout.rows, -1, LANES).transpose(1, 0, 2))
