"""Stitches along hems and seams: short pieces of sewing thread that lie on the cloth and move with it.

A lockstitch shows on the right side as a row of dashes: the thread lies on the cloth for most of the pitch and dives
through it at both ends, where it locks with the thread beneath. Each dash is two twisted strands of a few particles,
placed in the frame of the cloth at its middle; the frame is that of the woven crossings' own small cell, so that a
stitch lies on the cloth that is drawn and not on the chords between key points.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.cut import CutPanel, inside, turned
from taichi_cloth.garment.pattern.pattern import Pattern
from taichi_cloth.garment.sewn.cell_weaving import CellWeaving
from taichi_cloth.garment.sewn.weaving import Weaving
from taichi_cloth.ground.particles import COLOUR, HALF_LENGTH, NORMAL, OPENNESS, POSITION, RADIUS, TANGENT

__all__ = ["PIECES", "STRANDS", "Stitches", "inset"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SHOWN = 0.8
"""Share of the pitch that lies on the cloth."""
FROM_SEAM, FROM_INNER = 2.0e-3, 2.5e-3
"""Of a row of stitches from its seam, and from the inner edge of a turned hem [m]."""
STRANDS, PIECES = 2, 6
TWIST = 1.0
"""Turns of the strands round each other in a stitch."""


class Stitches:
    """All stitches of a garment, as particles in the order of `Particles`: STRANDS · PIECES each.

    hem: width of the turned hems [m]; 0: none are stitched. pitch: from stitch to stitch [m]. diameter: of the thread
    [m]. half_length, radius: of a particle [m].
    """

    def __init__(
        self, pattern: Pattern, weaving: Weaving | CellWeaving, *, hem: float, pitch: float, diameter: float
    ) -> None:
        k = weaving.threads_per_key_point
        self._columns = weaving.present.shape[1]
        corners, shares, ways = [], [], []
        for piece in weaving.atlas.panels:
            for line in _lines(pattern, piece, hem):
                points, way = _spaced(line, pitch)
                kept = inside(piece.outline(), points)
                spacing = np.asarray(piece.spacing) / k
                at = (points[kept] - piece.origin) / spacing + np.array([piece.col, piece.row]) * k
                cell = np.clip(np.floor(at).astype(np.int64), 0, np.array(weaving.present.shape[::-1]) - 2)
                corner = cell[:, 1] * self._columns + cell[:, 0]
                nodes = corner[:, None] + np.array([0, 1, self._columns, self._columns + 1])
                there = weaving.present.ravel()[nodes].all(axis=1)
                u, v = (at - cell)[there].T
                corners.append(nodes[there])
                shares.append(np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], -1))
                ways.append((way[kept] / spacing)[there])
        self._nodes = np.concatenate(corners or [np.zeros((0, 4), np.int64)])
        self._shares = np.concatenate(shares or [np.zeros((0, 4))])
        self._ways = np.concatenate(ways or [np.zeros((0, 2))])
        self._offset, self._tangent, self._normal, self.half_length = _stitch(pitch, diameter, weaving.height)
        self.radius = 0.3 * diameter

    def __len__(self) -> int:
        """Particles."""
        return len(self._nodes) * STRANDS * PIECES

    def placed(self, crossings: NDArray) -> tuple[F32, F32, F32]:
        """Positions [m], unit tangents and unit normals (n, 3) with the crossings (picks, ends, 3) there [m]."""
        p = crossings.reshape(-1, 3)[self._nodes].astype(np.float64)
        middle = np.einsum("nk,nkc->nc", self._shares, p)
        weft, warp = p[:, 1] - p[:, 0] + p[:, 3] - p[:, 2], p[:, 2] - p[:, 0] + p[:, 3] - p[:, 1]
        normal = _unit(np.cross(weft, warp))
        way = _unit(self._ways[:, :1] * weft + self._ways[:, 1:] * warp)
        frame = np.stack([way, np.cross(normal, way), normal], axis=1)
        out = (np.einsum("ka,nac->nkc", one, frame) for one in (self._offset, self._tangent, self._normal))
        position, tangent, normals = (one.reshape(-1, 3) for one in out)
        position += np.repeat(middle, STRANDS * PIECES, axis=0)
        return position.astype(np.float32), tangent.astype(np.float32), normals.astype(np.float32)

    def dress(self, groups: F32, colour: NDArray) -> None:
        """Writes what never changes into groups of `FibreFollower.others`. colour: (3,) linear."""
        rows = {RADIUS: self.radius, HALF_LENGTH: self.half_length, OPENNESS: 1.0}
        rows |= {COLOUR + c: float(colour[c]) for c in range(3)}
        for row, value in rows.items():
            flat = np.zeros(groups.shape[1:], np.float32)
            flat.reshape(-1)[: len(self)] = value
            groups[row] = flat

    def follow(self, crossings: NDArray, groups: F32) -> None:
        """Writes where they are with the crossings there into the same groups."""
        for row, values in zip((POSITION, TANGENT, NORMAL), self.placed(crossings), strict=True):
            filled = np.pad(values, ((0, groups[0].size - len(values)), (0, 0)), mode="edge")
            groups[row : row + 3] = filled.T.reshape(3, *groups.shape[1:])


def inset(edge: F64, by: float, *, anticlockwise: bool) -> F64:
    """An edge (k, 2) of an outline that runs that way round, moved inwards [m]."""
    way = _unit(np.gradient(edge, axis=0))
    left = np.stack([-way[:, 1], way[:, 0]], -1)
    return edge + (by if anticlockwise else -by) * left


def _lines(pattern: Pattern, piece: CutPanel, hem: float) -> Iterable[F64]:
    """Rows of stitches of one panel (k, 2), in grain coordinates [m]."""
    panel = piece.panel
    ring = panel.outline
    around = float(np.sum(ring[:, 0] * np.roll(ring[:, 1], -1) - np.roll(ring[:, 0], -1) * ring[:, 1]))
    sides = [s for seam in pattern.seams for s in (seam.first, seam.second)]
    rows = {s.edge: FROM_SEAM for s in sides if s.panel == panel.name}
    if hem > 0:
        rows |= {k: max(hem - FROM_INNER, FROM_SEAM) for k in panel.hems}
    for k, by in rows.items():
        edge = panel.edges[k]
        fine = along(edge, np.linspace(0.0, 1.0, max(2, round(length(edge) / 1e-3))))
        yield turned(inset(fine, by, anticlockwise=around > 0), panel.grain)


def _spaced(line: F64, pitch: float) -> tuple[F64, F64]:
    """Middles of the stitches along a line (n, 2) [m], and its unit direction there."""
    count = max(1, round(length(line) / pitch))
    share = (np.arange(count) + 0.5) / count
    before, after = along(line, share - 0.2 / count), along(line, share + 0.2 / count)
    return along(line, share), _unit(after - before)


def _stitch(pitch: float, diameter: float, height: float) -> tuple[F64, F64, F64, float]:
    """Offsets [m], tangents and normals (STRANDS · PIECES, 3) of one stitch's particles, along, across and off the
    cloth; and their half length [m]. height: of the cloth's right side over its middle [m]."""
    u = (np.arange(PIECES) + 0.5) / PIECES
    step = SHOWN * pitch / PIECES

    def place(strand: int, u: F64) -> F64:
        turn = 2 * np.pi * (TWIST * u + strand / STRANDS)
        dive = np.clip(1 - 4 * np.minimum(u, 1 - u) / 0.7, 0.0, 1.0) ** 2
        across = 0.22 * diameter * np.cos(turn)
        off = height + 0.3 * diameter - (height + 0.6 * diameter) * dive + 0.22 * diameter * np.sin(turn)
        return np.stack([SHOWN * pitch * (u - 0.5), across, off], -1)

    middle = np.concatenate([place(s, u) for s in range(STRANDS)])
    tangent = _unit(np.concatenate([place(s, u + 0.01) - place(s, u - 0.01) for s in range(STRANDS)]))
    spine = np.tile(place(0, u) + place(1, u), (STRANDS, 1)) / 2
    out = middle - spine + np.array([0.0, 0.0, 0.2 * diameter])
    normal = _unit(out - (out * tangent).sum(axis=1, keepdims=True) * tangent)
    return middle, tangent, normal, 0.75 * step


def _unit(v: F64) -> F64:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-30)
