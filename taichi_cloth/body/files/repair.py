"""A found mesh made whole: one closed, outward surface, with a line for each thing that was done to it."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components

from taichi_cloth.ground.errors import InputError

__all__ = ["Repaired", "boundary_loops", "repaired"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

LONGEST_HOLE = 0.8
"""A hole is closed when it is shorter round than this share of the body's height: a neck, a sole, a lost finger."""

FARTHEST = 1e6
"""Of any coordinate, in the file's unit: beyond, single precision no longer tells a finger."""
FEWEST = 100
"""Faces of a body."""


@dataclass
class Repaired:
    """The mesh so far, and what was done to it."""

    vertices: F64
    faces: I64
    notes: list[str] = field(default_factory=list)


def repaired(vertices: F64, faces: NDArray[np.integer]) -> Repaired:
    """One closed manifold surface whose normals point out. Raises InputError, in one line, where that is not safe."""
    mesh = Repaired(np.asarray(vertices, np.float64).copy(), np.asarray(faces, np.int64).copy())
    _drop_broken(mesh)
    _merge_doubles(mesh)
    _drop_loose_parts(mesh)
    _cut_crowded_edges(mesh)
    _split_pinches(mesh)
    _drop_loose_parts(mesh)  # what hung on by a crowded edge or a single vertex
    _orient(mesh)
    _close_holes(mesh)
    _turn_outwards(mesh)
    _forget_unused(mesh)
    return mesh


def _edges(faces: I64) -> I64:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _areas(mesh: Repaired) -> F64:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def _few(count: int, one: str, more: str) -> str:
    return f"1 {one}" if count == 1 else f"{count:,} {more}"


def _drop_broken(mesh: Repaired) -> None:
    if len(mesh.faces) and (mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices)):
        raise InputError("mesh: a face names a vertex that is not there; export it again")
    good = np.asarray(np.isfinite(mesh.vertices).all(1))
    kept = good[mesh.faces].all(1) if len(mesh.faces) else np.zeros(0, bool)
    if (~kept).any():
        mesh.notes.append(f"dropped {_few(int((~kept).sum()), 'face', 'faces')} with a corner that is not a number")
        mesh.faces = mesh.faces[kept]
    mesh.vertices[~good] = 0
    farthest = float(np.abs(mesh.vertices).max(initial=0.0))
    if farthest > FARTHEST:
        raise InputError(f"mesh: a corner at {farthest:.3g}; allowed: up to {FARTHEST:,.0f}; move it to the origin")
    _require_faces(mesh)


def _require_faces(mesh: Repaired) -> None:
    if len(mesh.faces) < FEWEST:
        raise InputError(f"mesh: {len(mesh.faces)} faces with an area; a body needs {FEWEST} or more")


def _merge_doubles(mesh: Repaired) -> None:
    used = mesh.vertices[mesh.faces.ravel()]
    grain = 1e-6 * float(np.ptp(used, 0).max() or 1.0)
    _, first, number = np.unique(np.round(mesh.vertices / grain), axis=0, return_index=True, return_inverse=True)
    doubles = len(mesh.vertices) - len(first)
    if doubles:
        mesh.notes.append(f"merged {_few(doubles, 'vertex', 'vertices')} that lay on another")
        mesh.vertices, mesh.faces = mesh.vertices[first], number.ravel()[mesh.faces]
    f = mesh.faces
    flat = (f[:, 0] == f[:, 1]) | (f[:, 1] == f[:, 2]) | (f[:, 2] == f[:, 0])
    _, unique = np.unique(np.sort(f, 1), axis=0, return_index=True)
    again = np.ones(len(f), bool)
    again[unique] = False
    for gone, what in ((flat, "without an area"), (again & ~flat, "that stood there twice")):
        if gone.any():
            mesh.notes.append(f"dropped {_few(int(gone.sum()), 'face', 'faces')} {what}")
    mesh.faces = f[~flat & ~again]
    _require_faces(mesh)


def _drop_loose_parts(mesh: Repaired) -> None:
    n = len(mesh.vertices)
    edges = _edges(mesh.faces)
    graph = csr_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    label = connected_components(graph, directed=False)[1][mesh.faces[:, 0]]
    parts, at = np.unique(label, return_inverse=True)
    if len(parts) == 1:
        return
    area = np.bincount(at.ravel(), _areas(mesh))
    largest = int(area.argmax())
    kept = at.ravel() == largest
    whole, mine = (
        np.ptp(mesh.vertices[mesh.faces.ravel()], 0).max(),
        np.ptp(mesh.vertices[mesh.faces[kept].ravel()], 0).max(),
    )
    if area[largest] < 0.5 * area.sum() or mine < 0.7 * whole:
        raise InputError(f"mesh: in {len(parts)} parts of which none is the body; join them into one surface first")
    mesh.notes.append(f"dropped {_few(len(parts) - 1, 'loose part', 'loose parts')} ({int((~kept).sum()):,} faces)")
    mesh.faces = mesh.faces[kept]


def _cut_crowded_edges(mesh: Repaired) -> None:
    """Where more than two faces meet at an edge, those go that end in the air, else the smallest."""
    dropped = 0
    for _ in range(20):
        edges = np.sort(_edges(mesh.faces), 1)
        _, number, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
        crowded = (count[number.ravel()] > 2).reshape(3, -1).any(0)
        if not crowded.any():
            break
        fins = crowded & (count[number.ravel()] == 1).reshape(3, -1).any(0)
        smallest = np.flatnonzero(crowded)[_areas(mesh)[crowded].argsort()]
        gone = np.flatnonzero(fins) if fins.any() else smallest[: max(1, len(smallest) // 4)]
        dropped += len(gone)
        mesh.faces = np.delete(mesh.faces, gone, axis=0)
    else:
        raise InputError("mesh: too many edges where more than two faces meet; remesh it first")
    if dropped:
        if dropped > 0.02 * len(mesh.faces):
            raise InputError(f"mesh: {dropped:,} faces crowd at edges that have two already; remesh it first")
        mesh.notes.append(f"dropped {_few(dropped, 'face', 'faces')} at edges where more than two met")
        _drop_loose_parts(mesh)


def _split_pinches(mesh: Repaired) -> None:
    """A vertex where two fans of faces only touch becomes two vertices."""
    faces = mesh.faces
    m = len(faces)
    corner = np.arange(3 * m).reshape(m, 3)
    edges = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    ends = np.concatenate([corner[:, [k, (k + 1) % 3]] for k in range(3)])
    turned = edges[:, 0] > edges[:, 1]
    edges[turned], ends[turned] = edges[turned, ::-1], ends[turned, ::-1]
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    same = (edges[order[1:]] == edges[order[:-1]]).all(1)
    a, b = ends[order[:-1]][same].ravel(), ends[order[1:]][same].ravel()
    fans = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(3 * m, 3 * m)), directed=False)[1]
    first = np.full(fans.max() + 1, -1)
    first[fans] = faces.ravel()
    split = len(first) - len(np.unique(first))
    if split:
        mesh.notes.append(f"split {_few(split, 'vertex', 'vertices')} where two surfaces only touched")
        mesh.vertices, mesh.faces = mesh.vertices[first], fans.reshape(m, 3).astype(np.int64)


def _orient(mesh: Repaired) -> None:
    """Neighbours turned the same way round, from the first face outwards."""
    m = len(mesh.faces)
    edges = _edges(mesh.faces)
    face = np.tile(np.arange(m), 3)
    key = np.sort(edges, 1)
    order = np.lexsort((key[:, 1], key[:, 0]))
    same = (key[order[1:]] == key[order[:-1]]).all(1)
    one, other = order[:-1][same], order[1:][same]
    against = (edges[one] == edges[other]).all(1)  # both run along the edge the same way: one of them is inverted
    if not against.any():
        return
    pair = np.stack([face[one], face[other]], 1)
    graph = csr_matrix((np.ones(2 * len(pair)), (pair.ravel(), pair[:, ::-1].ravel())), shape=(m, m))
    weight = csr_matrix(
        (np.tile(against + 1.0, 2), (np.r_[pair[:, 0], pair[:, 1]], np.r_[pair[:, 1], pair[:, 0]])), (m, m)
    )
    turned = np.zeros(m, bool)
    todo = np.ones(m, bool)
    while todo.any():
        chain, parent = breadth_first_order(graph, int(np.flatnonzero(todo)[0]), directed=False)
        todo[chain] = False
        step = np.asarray(weight[parent[chain[1:]], chain[1:]]).ravel() > 1.5
        for f, flips in zip(chain[1:], step, strict=True):
            turned[f] = turned[parent[f]] ^ flips
    if turned.mean() > 0.5:
        turned = ~turned
    wrong = (turned[pair[:, 0]] ^ turned[pair[:, 1]]) != against
    if wrong.any():
        raise InputError("mesh: its surface has no inside (it is one-sided); remesh it first")
    mesh.faces[turned] = mesh.faces[turned][:, ::-1]
    mesh.notes.append(f"turned {_few(int(turned.sum()), 'inverted face', 'inverted faces')}")


def boundary_loops(faces: NDArray[np.integer]) -> list[I64]:
    """Vertex numbers round each hole, in the order that closes it with the surface's own turn."""
    edges = _edges(np.asarray(faces, np.int64))
    key = np.sort(edges, 1)
    _, number, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    open_edges = edges[count[number.ravel()] == 1][:, ::-1]
    after: dict[int, list[int]] = {}
    for a, b in open_edges.tolist():
        after.setdefault(a, []).append(b)
    loops = []
    while after:
        start = at = next(iter(after))
        loop = []
        while at in after:
            loop.append(at)
            following = after[at].pop()
            if not after[at]:
                del after[at]
            at = following
            if at == start:
                break
        loops.append(np.array(loop))
    return loops


def _close_holes(mesh: Repaired) -> None:
    loops = boundary_loops(mesh.faces)
    if not loops:
        return
    height = float(np.ptp(mesh.vertices[mesh.faces.ravel()], 0).max())
    for loop in loops:
        ring = mesh.vertices[loop]
        around = float(np.linalg.norm(ring - np.roll(ring, 1, 0), axis=1).sum())
        if around > LONGEST_HOLE * height:
            raise InputError(
                f"mesh: a hole {around / height:.2f} body heights round; allowed: {LONGEST_HOLE:g}; close it first"
            )
        following = np.roll(loop, -1)
        if len(loop) == 3:
            mesh.faces = np.concatenate([mesh.faces, loop[None]])
            continue
        middle = len(mesh.vertices)
        mesh.vertices = np.concatenate([mesh.vertices, ring.mean(0)[None]])
        fan = np.stack([loop, following, np.full(len(loop), middle)], 1)
        mesh.faces = np.concatenate([mesh.faces, fan])
    mesh.notes.append(f"closed {_few(len(loops), 'hole', 'holes')}")
    if boundary_loops(mesh.faces):
        raise InputError("mesh: holes are left that cannot be closed safely; close them first")


def _turn_outwards(mesh: Repaired) -> None:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    volume = float((a * np.cross(b, c)).sum() / 6)
    size = float(np.ptp(mesh.vertices[mesh.faces.ravel()], 0).max())
    if abs(volume) < 1e-4 * size**3:
        raise InputError("mesh: it encloses no volume; give a solid body, not a sheet")
    if volume < 0:
        mesh.faces = mesh.faces[:, ::-1].copy()
        mesh.notes.append("turned all faces outwards")


def _forget_unused(mesh: Repaired) -> None:
    used = np.unique(mesh.faces)
    number = np.full(len(mesh.vertices), -1)
    number[used] = np.arange(len(used))
    mesh.vertices, mesh.faces = mesh.vertices[used], number[mesh.faces]
