"""Primitives wrapped round the parts of a body (paper 4.1): as few as an error bound asks for, or as many as allowed.

Least squares of the signed distance between the skin and the primitives' union. A point of the skin is answered for
by one primitive, the nearest, so that the normal matrix is one small block a primitive, and all turn at once by
Levenberg and Marquardt's method. The error that counts is the union's, so primitives may overlap, and one that sticks
out through the skin is pulled back. Part by part first; then the worst is split and all are turned again; last, what
a simpler kind stands for as well becomes one of it. Of a body that is its own mirror image one half is fitted, and what
stands in the middle stays symmetric.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.primitives.samples import mirror_plane, skin_space
from taichi_cloth.body.primitives.simpler import simpler
from taichi_cloth.body.primitives.skin_field import SkinField
from taichi_cloth.body.primitives.solids import Solid
from taichi_cloth.body.primitives.turning import Piece, Task, cost_of, nearest, turn
from taichi_cloth.ground.errors import InputError

__all__ = ["fit"]

F64 = NDArray[np.float64]
SKIN, OUTSIDE, INSIDE = 2600, 1800, 500
"""Points the fit is made from: on the skin; where no primitive is to reach; where one is to be."""
SIMPLER = {"sphere": 1.0, "cylinder": 1.6, "elliptic": 2.2}
"""A kind is taken when its cost, times this, is least: of two that fit alike, the one that contact answers sooner."""
MERGED = (
    ("lower arm", "hand"), ("head", "neck"), ("pelvis", "abdomen"), ("upper arm", "lower arm"), ("lower leg", "foot"),
    ("upper leg", "lower leg"), ("chest", "pelvis"),
)  # fmt: skip
"""For fewer primitives than parts: which part takes in which, in this order, left and right together."""


def fit(
    vertices: NDArray,
    faces: NDArray,
    labels: NDArray,
    names: Sequence[str],
    *,
    count: int = 32,
    error_mm: float | None = None,
    bones: Mapping[str, int] | None = None,
    seed: int = 0,
) -> list[Primitive]:
    """Primitives for a mesh, vertices (v, 3) [m], faces (f, 3), with the part of each face, labels (f,), into names.

    count: at most so many, 1 to 256. error_mm: stop sooner, when the mean distance between skin and union [mm] is no
    more. bones: the joint each part moves with; 0 for parts it does not name. The same input gives the same output.
    Raises InputError for values outside these, or labels that do not fit the mesh.
    """
    labels = np.asarray(labels)
    if not 1 <= count <= 256:
        raise InputError(f"count: {count}; allowed: 1 to 256 primitives")
    if error_mm is not None and not error_mm > 0:
        raise InputError(f"error_mm: {error_mm}; allowed: above 0")
    if labels.shape != (len(faces),) or labels.min() < 0 or labels.max() >= len(names):
        raise InputError(f"labels: shape {labels.shape}; allowed: ({len(faces)},), numbers of the {len(names)} names")
    mirror = mirror_plane(vertices, faces, labels, names)
    space = skin_space(vertices, faces, SKIN, OUTSIDE, INSIDE, mirror=mirror, seed=seed)
    skin = SkinField(vertices, faces)
    part = labels[space.face]
    groups = _groups([n for k, n in enumerate(names) if (part == k).any()], count)
    if mirror is not None:  # the left half will do
        half = np.flatnonzero(space.at[: len(part)] @ mirror[0] > mirror[1])
        space, part = space.part(half), part[half]
        groups = [g for g in groups if not g[0].startswith("right ")]
    task = Task(space, skin, mirror)
    pieces = []
    for group in groups:
        mine = np.flatnonzero(np.isin(part, [k for k, n in enumerate(names) if n in group]))
        if len(mine) >= 8:
            twin = mirror is not None and group[0].startswith("left ")
            pieces.append(Piece(_best(task, mine, twin), group[0], twin))
    pieces, _ = turn(pieces, task, 8)
    while (had := _count(pieces)) < count:
        distance, whose = nearest([p.solid for p in pieces], space.at)
        if error_mm is not None and np.abs(distance[space.side == 0]).mean() * 1000 <= error_mm:
            break
        grown = _split(pieces, task, distance, whose, count - had)
        if _count(grown) == had:
            break
        pieces, _ = turn(grown, task, 6)
    pieces, _ = turn(simpler(pieces, task), task, 40)
    made = []
    for piece in pieces:
        assert piece.solid.primitive is not None
        primitive = replace(piece.solid.primitive, part=piece.part, bone=(bones or {}).get(piece.part, 0))
        made.append(primitive)
        if piece.twin and mirror is not None:
            name = "right " + piece.part.removeprefix("left ") if piece.part.startswith("left ") else piece.part
            made.append(_image(primitive, mirror, name, (bones or {}).get(name, 0)))
    return made


def _count(pieces: Sequence[Piece]) -> int:
    return sum(1 + p.twin for p in pieces)


def _image(primitive: Primitive, mirror: tuple[F64, float], part: str, bone: int) -> Primitive:
    normal, level = mirror
    start, end = (x - 2 * (x @ normal - level) * normal for x in (primitive.start, primitive.end))
    across = None if primitive.across is None else primitive.across - 2 * (primitive.across @ normal) * normal
    return replace(primitive, start=start, end=end, across=across, part=part, bone=bone)


def _groups(names: list[str], count: int) -> list[list[str]]:
    """Parts that share a primitive, the one it is named after first: one each where there are enough."""
    groups = [[n] for n in names]

    def where(name: str) -> list[str] | None:
        return next((g for g in groups if name in g), None)

    for into, what in MERGED:
        if len(groups) <= count:
            break
        for side in ("", "left ", "right "):
            a, b = where(side + into), where(side + what)
            if a is not None and b is not None and a is not b:
                a += b
                groups.remove(b)
    while len(groups) > count:  # names of no person: the last two together
        groups[-2] += groups.pop()
    return groups


def _best(task: Task, mine: NDArray[np.int64], free: bool) -> Solid:
    """The kind and solid that fit the skin's points `mine` best by themselves. free: it may leave the plane."""
    space = task.space.part(mine)
    part = Task(space, task.skin, task.mirror)
    best, least = None, np.inf
    for solid in task.starts(space.at[space.side == 0], free):
        (piece,), cost = turn([Piece(solid, "")], part, 12)
        cost *= SIMPLER[solid.kind]
        if best is None or cost < least:
            best, least = piece.solid, cost
    assert best is not None
    return best


def _split(pieces: list[Piece], task: Task, distance: F64, whose: NDArray[np.int64], room: int) -> list[Piece]:
    """Two for the worst, `room` more primitives at most: those whose points cost most for each primitive they would
    take, and with them what costs nearly as much. Left and right of a body without symmetry go together."""
    space = task.space
    cost = np.bincount(whose, cost_of(space.error(distance)), len(pieces))
    on = whose[space.side == 0]
    held = np.bincount(on, minlength=len(pieces))
    family: dict[str, list[int]] = {}
    rank: dict[str, int] = {}
    for k in np.argsort(-cost, kind="stable").tolist():
        part = pieces[k].part
        rank[part] = rank.get(part, -1) + 1
        name = part.removeprefix("left ").removeprefix("right ")
        family.setdefault(f"{name} {rank[part]} {pieces[k].twin}", []).append(k)
    possible = []
    for members in family.values():
        price = _count([pieces[k] for k in members])
        whole = sum(cost[k] for k in members) * (1 if task.mirror is None else 2)
        if all(held[k] >= 24 for k in members):
            possible.append((whole / price, price, members))
    possible.sort(key=lambda m: -m[0])
    chosen: list[int] = []
    for each, price, members in possible:
        if price <= room and (each > 0.6 * possible[0][0] or not chosen):
            chosen += members
            room -= price
    out = []
    for k, piece in enumerate(pieces):
        if k not in chosen:
            out.append(piece)
            continue
        mine = np.flatnonzero(on == k)
        points = space.at[mine]
        if task.mirror is not None and not piece.twin:
            normal, level = task.mirror
            aside = points @ normal - level
            flat = points - aside[:, None] * normal
            if (aside**2).mean() > np.linalg.eigvalsh(np.cov(flat.T))[-1]:
                out.append(Piece(_best(task, mine, True), piece.part, True))
                continue
            points = flat
        first = _halves(points)
        out += [replace(piece, solid=_best(task, half, piece.twin)) for half in (mine[first], mine[~first])]
    return out


def _halves(points: F64) -> NDArray[np.bool_]:
    """Two clusters of points (n, 3), from both sides of their longest axis."""
    centred = points - points.mean(axis=0)
    first = centred @ np.linalg.svd(centred, full_matrices=False)[2][0] > 0
    for _ in range(10):
        if not 8 <= first.sum() <= len(points) - 8:
            break
        a, b = points[first].mean(axis=0), points[~first].mean(axis=0)
        new = ((points - a) ** 2).sum(axis=1) < ((points - b) ** 2).sum(axis=1)
        if (new == first).all():
            break
        first = new
    if not 8 <= first.sum() <= len(points) - 8:
        return np.arange(len(points)) < len(points) // 2
    return first
