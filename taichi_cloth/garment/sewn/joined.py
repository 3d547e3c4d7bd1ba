"""Seams as one line: both outlines are cut wherever either of them crosses the lattice of its panel, so that they have
the same points one to one, and points that are sewn together are one.

Those that would lie within WIDE of a cell of each other along a seam are taken together, and so are points within
BESIDE of it with those next to them: pieces of cells become no narrower than that. At free edges points become one,
too, those of the outline within ALONG of each other, and others within NEAR of one of these, on the outline.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.cut import Atlas, CutPanel, turned
from taichi_cloth.garment.pattern.pattern import Pattern
from taichi_cloth.garment.sewn.clip import crossed_at

__all__ = ["Joined", "SeamLine", "cut_outlines", "joined", "seam_distance", "seam_lines"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
I64 = NDArray[np.int64]

WIDE = 0.35
"""Of points along a seam that are taken together, at most, in cells; half of it where that is the end of a seam."""
BESIDE = 0.15
"""Of a point to a seam, in cells, up to which it is one with those of the seam next to it: no more is known of where a
seam is than by how much the cells beside it are warped."""
ALONG, NEAR = 0.06, 0.15
"""Of a point to another at a free edge, in cells, up to which the two become one, where it is at the edge itself and
where not: a smaller piece of a cell hangs on the same key points as the whole triangle beside it, and contact cannot
keep the two apart."""
FINER = 32
"""Places along a seam for each cell, by which points are known to be beside it."""
FOUND = 0.006
"""Of a point to where an outline was cut, in cells, up to which it is that point: key points attract what is near."""
THIN = 0.05
"""Height of a triangle, in cells, below which its diagonal is turned."""


@dataclass(frozen=True, eq=False)
class SeamLine:
    """A seam. panels: numbers of both sides'. edges: of them. lines: (k, 2) of both, from the same end of the seam, in
    grain coordinates [m]. back: whether a line runs against its edge."""

    panels: tuple[int, int]
    edges: tuple[int, int]
    lines: tuple[F64, F64]
    back: tuple[bool, bool]

    @property
    def long(self) -> float:
        """Of the longer side [m]."""
        return max(length(line) for line in self.lines)


@dataclass(frozen=True, eq=False)
class Joined:
    """own: (n,) number of the point that each point of a panel has become. same: (n,) points of one number are sewn
    together. share: (n,) of points in where that is, 0 or 1. faces: (m, 3) triangles of what points have become.
    cells: (m,) of theirs."""

    own: I64
    same: I64
    share: F64
    faces: I64
    cells: I64


def seam_lines(pattern: Pattern, atlas: Atlas) -> list[SeamLine]:
    """Of all seams."""
    names, out = [piece.panel.name for piece in atlas.panels], []
    for seam in pattern.seams:
        sides = (seam.first, seam.second)
        panels = [atlas.panels[names.index(side.panel)].panel for side in sides]
        lines = [turned(panel.edges[side.edge], panel.grain) for panel, side in zip(panels, sides, strict=True)]
        back = (False, not pattern.is_alike(seam))
        one, other = (line[::-1] if turn else line for line, turn in zip(lines, back, strict=True))
        numbers = names.index(sides[0].panel), names.index(sides[1].panel)
        out.append(SeamLine(numbers, (sides[0].edge, sides[1].edge), (one, other), back))
    return out


def seam_distance(seams: list[SeamLine], panel: I32, flat: F64, cell: float) -> F64:
    """(n,) how far points of panels (n,) are from the nearest seam of theirs, in the flat pattern [m]; ∞ in one
    without. cell: least spacing [m]."""
    out = np.full(len(flat), np.inf)
    for seam in seams:
        for number, line in zip(seam.panels, seam.lines, strict=True):
            mine = np.flatnonzero(panel == number)
            out[mine] = np.minimum(out[mine], KDTree(_fine(line, cell)[1]).query(flat[mine])[0])
    return out


def cut_outlines(atlas: Atlas, seams: list[SeamLine]) -> tuple[list[F64], list[F64]]:
    """(k, 2) outlines of all panels, in grain coordinates [m], where edges are sewn cut where either side crosses the
    lattice; and shares of its length at which each seam is cut, from 0 to 1."""
    cuts: dict[tuple[int, int], list[F64]] = {}
    shares = []
    for seam in seams:
        sides = [_crossed(line, atlas.panels[k]) for k, line in zip(seam.panels, seam.lines, strict=True)]
        at = np.unique(np.concatenate([[0.0, 1.0], *sides]))
        least = 1e-4 * min(atlas.spacing) / seam.long
        at = at[np.concatenate([[True], np.diff(at) > least])]
        at[-1] = 1.0
        shares.append(at)
        for panel, edge, back in zip(seam.panels, seam.edges, seam.back, strict=True):
            cuts.setdefault((panel, edge), []).append(1 - at[::-1] if back else at)
    outlines = []
    for number, piece in enumerate(atlas.panels):
        ring = []
        for edge, points in enumerate(piece.panel.edges):
            found = cuts.get((number, edge))
            line = points if found is None else along(points, np.unique(np.concatenate(found)))
            ring.append(turned(line, piece.panel.grain)[:-1])
        outlines.append(np.concatenate(ring))
    return outlines, shares


def joined(
    atlas: Atlas, seams: list[SeamLine], shares: list[F64], panel: I32, flat: F64, faces: I64, cells: I64
) -> Joined:
    """What points (n) of panels become one. flat: (n, 2) in grain coordinates [m]. faces: (m, 3) of cells (m,)."""
    cell = min(atlas.spacing)
    groups = [_groups(at * seam.long / cell) for seam, at in zip(seams, shares, strict=True)]
    made = _joined(cell, seams, shares, groups, panel, flat, faces)
    corners = made.own[faces]
    kept = _differ(corners)
    corners, of = _turned(corners[kept], cells[kept], mean_of(made.own, made.share) @ flat, THIN * cell)
    return replace(made, faces=corners, cells=of)


def _joined(
    cell: float, seams: list[SeamLine], shares: list[F64], groups: list[I64], panel: I32, flat: F64, faces: I64
) -> Joined:
    n, made, none = len(flat), 0, np.zeros(0, np.int64)
    share, sewn = np.zeros(n), np.zeros(n, bool)
    points, own, same, near = [], [], [], []
    for seam, at, group in zip(seams, shares, groups, strict=True):
        inner = (group > 0) & (group < group[-1])
        inner[[0, -1]] = True  # an end of a seam is where it ends
        for side, (number, line) in enumerate(zip(seam.panels, seam.lines, strict=True)):
            mine = np.flatnonzero(panel == number)
            apart, found = map(np.asarray, KDTree(flat[mine]).query(along(line, at)))
            there = apart < FOUND * cell
            on = mine[found[there]]
            share[on] = np.maximum(share[on], inner[there])
            sewn[on] = True
            points.append(on)
            own.append(made + 2 * group[there] + side)
            same.append(made + 2 * group[there])
            near.append((mine, at, line, made + 2 * group + side, made + 2 * group))
        made += 2 * int(group[-1]) + 2
    for mine, at, line, of_own, of_same in near:  # beside a seam
        off = mine[~sewn[mine]]
        fine, places = _fine(line, cell)
        apart, found = map(np.asarray, KDTree(places).query(flat[off]))
        close = apart < BESIDE * cell
        at_cut = np.abs(fine[found[close]][:, None] - at).argmin(axis=1)
        points.append(off[close])
        own.append(of_own[at_cut])
        same.append(of_same[at_cut])
    pairs, outline = _near_the_outline(faces, flat, np.concatenate([*points, none]), cell)
    share[outline] = 1.0  # it stays where it is
    number = np.repeat(made + np.arange(len(pairs)), 2)
    made += len(pairs)
    points.append(pairs.ravel())
    own.append(number)
    same.append(number)
    on = np.concatenate(points)
    numbers = [_connected(n, made, on, np.concatenate(to)) for to in (own, same)]
    alone = np.bincount(numbers[0], share)[numbers[0]] == 0
    return Joined(numbers[0], numbers[1], np.where(alone, 1.0, share), none, none)


def _connected(n: int, groups: int, points: I64, group: I64) -> I64:
    """(n,) numbers of points, alike where they are in one group or in groups that have a point in common."""
    graph = coo_array((np.ones(len(points)), (points, n + group)), shape=(n + groups, n + groups))
    found = np.asarray(connected_components(graph, directed=False)[1])[:n]
    return np.unique(found, return_inverse=True)[1].ravel().astype(np.int64)


def _near_the_outline(faces: I64, flat: F64, at_seams: I64, cell: float) -> tuple[I64, I64]:
    """Pairs (k, 2) of points that become one, and all points at free edges but those `at_seams`, which are in no pair.
    Pairs are joined by a side of a triangle (m, 3), with both within ALONG of a `cell` [m] at free edges or one within
    NEAR of that; the nearest come first, and a point is in one pair at most: those along an edge are not all drawn into
    one."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], -1).reshape(-1, 2), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    free, sewn = np.zeros(len(flat), bool), np.zeros(len(flat), bool)
    free[edges[count == 1]], sewn[at_seams] = True, True
    free &= ~sewn
    edges = edges[free[edges].any(axis=1) & ~sewn[edges].any(axis=1)]
    apart = np.linalg.norm(flat[edges[:, 0]] - flat[edges[:, 1]], axis=1)
    close = apart < cell * np.where(free[edges].all(axis=1), ALONG, NEAR)
    used: set[int] = set()
    pairs = []
    for pair in edges[close][np.argsort(apart[close], kind="stable")].tolist():
        if used.isdisjoint(pair):
            used.update(pair)
            pairs.append(pair)
    return np.array(pairs, np.int64).reshape(-1, 2), np.flatnonzero(free)


def _differ(faces: I64) -> NDArray[np.bool_]:
    """(m,) triangles (m, 3) with three corners."""
    a, b, c = faces.T
    return (a != b) & (b != c) & (c != a)


def _turned(faces: I64, cells: I64, place: F64, least: float) -> tuple[I64, I64]:
    """Triangles that turn left (m, 3) of cells (m,), where such as are lower than `least` [m] have the diagonal that
    they share with the one beyond their longest edge turned, if that is better: three points of a seam are one line.
    place: (n, 2) of points [m]."""
    made, of = [tuple(face) for face in faces.tolist()], cells.tolist()
    beside = {edge: k for k, face in enumerate(made) for edge in pairwise((*face, face[0]))}

    def height(a: int, b: int, c: int) -> float:
        """0 or less where it turns over."""
        p, q, r = place[a], place[b], place[c]
        twice = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        return float(twice / max(np.hypot(*(q - p)), np.hypot(*(r - q)), np.hypot(*(p - r))))

    p, q, r = (place[faces[:, k]] for k in range(3))
    long = np.max([np.linalg.norm(one, axis=1) for one in (q - p, r - q, p - r)], axis=0)
    twice = (q[:, 0] - p[:, 0]) * (r[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (r[:, 0] - p[:, 0])
    thin, gone = np.flatnonzero(twice < least * long).tolist(), set()
    for k in [*thin, *thin, *thin]:
        face = made[k]
        if k in gone or height(*face) >= least:
            continue
        turns = [(face[i], face[i - 2], face[i - 1]) for i in range(3)]
        a, b, c = max(turns, key=lambda turn: float(np.hypot(*(place[turn[1]] - place[turn[0]]))))
        other = beside.get((b, a))
        if other is None:
            if height(*face) < 1e-3 * least:  # no wider than a line, at the end of the cloth
                gone.add(k)
            continue
        d = next(v for v in made[other] if v not in (a, b))
        if d == c:  # both have the same corners
            continue
        if min(height(a, d, c), height(d, b, c)) > min(height(*face), height(*made[other])):
            made[k], made[other], of[k] = (a, d, c), (d, b, c), of[other]
            for t in (k, other):
                for edge in pairwise((*made[t], made[t][0])):
                    beside[edge] = t
            del beside[a, b], beside[b, a]
    left = [k for k in range(len(made)) if k not in gone]
    return np.array([made[k] for k in left], np.int64).reshape(-1, 3), np.array([of[k] for k in left], np.int64)


def mean_of(number: I64, share: F64) -> csr_array:
    """(numbers, n) the mean of the points (n,) of each number, by shares."""
    weight = share / np.bincount(number, share)[number]
    return csr_array((weight, (number, np.arange(len(number)))), shape=(int(number.max()) + 1, len(number)))


def _crossed(line: F64, piece: CutPanel) -> F64:
    """Shares of the length of a line (k, 2) at which it crosses a panel's lattice: rows, columns and diagonals."""
    at = (line - piece.origin) / np.asarray(piece.spacing)
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    walked = np.concatenate([[0.0], np.cumsum(steps)])
    out = []
    for f in (at[:, 0], at[:, 1], at[:, 0] - at[:, 1]):
        out += [walked[k] + crossed_at(a, b) * steps[k] for k, (a, b) in enumerate(pairwise(f.tolist()))]
    return np.clip(np.concatenate(out) / walked[-1], 0.0, 1.0)


def _groups(at: F64) -> I64:
    """Numbers of what is taken together of places along a seam (n,), in cells, rising from 0 to its length."""
    end = min(WIDE / 2, at[-1] / 3)
    out, begin = np.zeros(len(at), np.int64), 0.0
    for k in range(1, len(at)):
        anew = at[k] > end if out[k - 1] == 0 else at[k] - begin > WIDE
        last = at[-1] - at[k] <= end
        anew = at[-1] - at[k - 1] > end if last else anew
        out[k] = out[k - 1] + anew
        begin = at[k] if anew else begin
    return out


def _fine(line: F64, cell: float) -> tuple[F64, F64]:
    """Shares of a line's length, and places there (k, 2), FINER to a cell."""
    share = np.linspace(0.0, 1.0, max(2, int(np.ceil(FINER * length(line) / cell)) + 1))
    return share, along(line, share)
