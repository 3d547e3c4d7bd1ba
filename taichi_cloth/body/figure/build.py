"""The built-in body: a figure whose girths are fitted to the measures, meshed, smoothed and bound to its skeleton."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from taichi_cloth.body.figure.anthropometry import Gender, Measures, measures_of, tape
from taichi_cloth.body.figure.figure import FACTORS, Figure, Girths, Section, draw
from taichi_cloth.body.figure.implicit import Part, field, gradient
from taichi_cloth.body.figure.surface_nets import surface_nets
from taichi_cloth.body.skin.skeleton import Skeleton
from taichi_cloth.body.skin.skinning import Body, heat_weights
from taichi_cloth.ground.cache import digest, kept

__all__ = ["built_in_body", "fitted", "girth_sections", "girths_of"]

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

VERSION = 1
"""Of meshes kept on disk: raised whenever the same figure would be meshed otherwise."""

RAYS, STEPS, REACH = 40, 44, 0.18
"""Rays of a section, steps along each, and how far they go in shares of the stature."""

SWELL = 0.0015
"""How far outside the skin it is meshed first, in shares of the stature: so the grid resolves what is thin."""

BAND = 5.0
"""Grid points are looked at closely where a coarse look found the skin nearer than this [spacings]."""


def built_in_body(measures: Measures | None = None, *, gender: Gender = "female", spacing: float = 0.0092) -> Body:
    """A watertight body in an A pose. spacing: of the grid it is meshed on, as a share of the stature.

    measures: default the standard ones of the gender, which also picks the shape of the figure. A girth that the figure
    cannot meet within 2 % (a bust so full that its tape meets the arms) is named in the body's notes.
    """
    return _built(measures or measures_of(gender), gender, spacing)


@lru_cache(maxsize=8)
def _built(measures: Measures, gender: Gender, spacing: float) -> Body:
    figure = fitted(gender, measures)
    made_of = digest(VERSION, figure.parts, figure.fine, spacing)
    mesh, _ = kept("figure", made_of, lambda: _largest(*_meshed(figure, spacing)))
    vertices, faces = mesh["vertices"], mesh["faces"]
    low, high = vertices[:, 1].min(), vertices[:, 1].max()
    scale = measures.stature / (high - low)
    move = np.array([0, -low, 0])
    vertices = (vertices + move) * scale
    skeleton = Skeleton((figure.skeleton.joints + move) * scale, (figure.skeleton.tips + move) * scale)
    weights = heat_weights(vertices, faces, skeleton)
    read = girths_of(vertices, faces, girth_sections(gender, measures))
    off = [
        f"{name} came out at {100 * girth:.1f} cm where {100 * getattr(measures, name):.1f} were asked for"
        for name, girth in read.items()
        if not abs(girth / getattr(measures, name) - 1) < 0.02
    ]
    return Body(
        name=f"built-in {gender}",
        vertices=vertices,
        faces=faces,
        skeleton=skeleton,
        weights=weights,
        measures={"stature": measures.stature, **read},
        notes=tuple(off),
    )


def girth_sections(gender: Gender, measures: Measures) -> dict[str, Section]:
    """Where a tape reads each girth on the built-in body [m]."""
    drawn = draw(gender, measures, Girths()).sections
    return {k: Section(s.point * measures.stature, s.normal) for k, s in drawn.items()}


def girths_of(vertices: F64, faces: I32, sections: dict[str, Section]) -> dict[str, float]:
    """What a tape reads on a mesh at each section [m]."""
    return {name: tape(vertices, faces, s.point, s.normal) for name, s in sections.items()}


def fitted(gender: Gender, measures: Measures, *, rounds: int = 7) -> Figure:
    """The figure whose girths are the measures': each factor is corrected by its own girth, in turn all at once."""
    girths = Girths()
    for _ in range(rounds):
        figure = draw(gender, measures, girths)
        read = _field_girths(figure)
        change = {}
        for name in FACTORS:
            ratio = getattr(measures, name) / measures.stature / read[name]
            gain = 2.0 if name == "bust" else 1.0
            change[name] = float(np.clip(getattr(girths, name) * ratio**gain, 0.5, 1.6 if name == "bust" else 2.5))
        girths = replace(girths, **change)
    return draw(gender, measures, girths)


def _field_girths(figure: Figure) -> dict[str, float]:
    """Tape round each section of the field: the hull of where rays from its middle leave the solid."""
    turn = 2 * np.pi * np.arange(RAYS) / RAYS
    out = np.linspace(0, REACH, STEPS + 1)[1:]
    rings, places = [], []
    for section in figure.sections.values():
        u, v = np.linalg.svd(section.normal[None])[2][1:]
        ray = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * v
        places.append(section.point + out[:, None, None] * ray)
        rings.append((u, v, section.point))
    values = field(figure.parts, np.concatenate([p.reshape(-1, 3) for p in places]))
    on_limb = np.repeat([s.point[0] > 0.03 for s in figure.sections.values()], STEPS * RAYS)
    across = on_limb & (np.concatenate([p[..., 0].ravel() for p in places]) < 0)
    values[across] = np.maximum(values[across], 1e-3)  # a thigh ends where the other begins
    girths = {}
    for name, value in zip(figure.sections, values.reshape(len(rings), STEPS, RAYS), strict=True):
        first = np.argmax(value > 0, axis=0)
        first = np.where((value > 0).any(0), first, STEPS - 1)
        first = np.maximum(first, 1)
        a, b = np.take_along_axis(value, first[None] - 1, 0)[0], np.take_along_axis(value, first[None], 0)[0]
        radius = out[first - 1] + (out[1] - out[0]) * np.clip(a / np.where(a == b, 1, a - b), 0, 1)
        ring = radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], 1)
        girths[name] = float(ConvexHull(ring).area)
    return girths


def _meshed(figure: Figure, spacing: float) -> tuple[F64, I32]:
    """Surface nets on a grid symmetric in x, then relaxed along the surface and pulled onto it."""
    parts = figure.parts
    half = int(np.ceil(0.5 / spacing))
    x = (np.arange(half) + 0.5) * spacing
    y = np.arange(-0.015, 1.02, spacing)
    z = np.arange(-0.13, 0.20, spacing)
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), -1)
    coarse = field(parts, points[::3, ::3, ::3].reshape(-1, 3)).reshape(points[::3, ::3, ::3].shape[:3])
    values = coarse.repeat(3, 0).repeat(3, 1).repeat(3, 2)[: len(x), : len(y), : len(z)]
    near_skin = np.abs(values) < BAND * spacing
    values[near_skin] = field(parts, points[near_skin])
    both = np.concatenate([values[::-1], values])
    vertices, faces = surface_nets(both - SWELL, np.array([-x[-1], y[0], z[0]]), spacing)
    vertices = _relaxed(parts, vertices, faces, spacing, (0.6, 0.6, 0.6, 0.4, 0.0))
    inside = np.zeros(len(vertices), bool)
    for middle, radius in figure.fine:
        inside |= ((vertices - middle) ** 2).sum(1) < radius**2
    vertices, faces = refined(vertices, faces, inside)
    return _relaxed(parts, vertices, faces, spacing / 2, (0.5, 0.5, 0.3, 0.0)), faces


def _largest(vertices: F64, faces: I32) -> dict[str, NDArray]:
    """Vertices and faces of the largest connected piece: on a coarse grid the tip of a thumb can come off."""
    n = len(vertices)
    near = sparse.csr_matrix((np.ones(len(faces) * 2), (faces[:, :2].ravel(), faces[:, 1:].ravel())), shape=(n, n))
    label = connected_components(near, directed=False)[1]
    whole = label == np.bincount(label).argmax()
    number = np.cumsum(whole) - 1
    return {"vertices": vertices[whole], "faces": number[faces[whole[faces[:, 0]]]].astype(np.int32)}


def _relaxed(parts: tuple[Part, ...], vertices: F64, faces: I32, reach: float, shares: tuple[float, ...]) -> F64:
    """Each vertex drawn to the mean of its neighbours by a share, then pulled back onto the surface, in turns."""
    n = len(vertices)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    near = sparse.csr_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    near = near.maximum(near.T)
    near = sparse.diags(1 / np.asarray(near.sum(1)).ravel()) @ near
    for share in shares:
        vertices = vertices + share * (near @ vertices - vertices)
        slope = gradient(parts, vertices)
        step = field(parts, vertices)[:, None] * slope / np.maximum((slope**2).sum(1), 0.1)[:, None]
        vertices = vertices - np.clip(step, -reach, reach)
    return vertices


def refined(vertices: F64, faces: I32, chosen: NDArray[np.bool_]) -> tuple[F64, I32]:
    """Edges between two chosen vertices halved, and the triangles beside them cut to fit; stays watertight."""
    sides = np.stack([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]], 1)
    edges, number = np.unique(np.sort(sides.reshape(-1, 2), 1), axis=0, return_inverse=True)
    halved = chosen[edges].all(1)
    middle = np.where(halved, len(vertices) + np.cumsum(halved) - 1, -1)[number.ravel()].reshape(-1, 3)
    vertices = np.concatenate([vertices, vertices[edges[halved]].mean(1)])
    count = (middle >= 0).sum(1)
    out = [faces[count == 0]]
    f, m = faces[count == 3], middle[count == 3]
    out += [np.stack(t, 1) for t in (
        (f[:, 0], m[:, 2], m[:, 1]), (m[:, 2], f[:, 1], m[:, 0]),
        (m[:, 1], m[:, 0], f[:, 2]), (m[:, 0], m[:, 1], m[:, 2]),
    )]  # fmt: skip
    for k in range(3):  # one edge, the one across from corner k (two cannot be: then all three corners are chosen)
        one = (count == 1) & (middle[:, k] >= 0)
        f, m = faces[one], middle[one, k]
        a, b, c = f[:, k], f[:, (k + 1) % 3], f[:, (k + 2) % 3]
        out += [np.stack([a, b, m], 1), np.stack([a, m, c], 1)]
    return vertices, np.concatenate(out).astype(np.int32)
