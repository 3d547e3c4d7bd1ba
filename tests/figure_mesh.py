"""A plain person made of primitives whose parts are known, meshed at any fineness, standing or bent."""

from functools import cache

import numpy as np

from taichi_cloth.body.figure.implicit import smooth_union
from taichi_cloth.body.figure.surface_nets import surface_nets
from taichi_cloth.body.parts.segment import segment
from taichi_cloth.body.primitives.distance import nearest_distance, signed_distance
from taichi_cloth.body.primitives.primitives import Primitive


def figure(*, bent: bool = False) -> list[Primitive]:
    """1.7 m, y up, facing +z. bent: forearms raised forward, the left knee lifted."""

    def cone(part, start, end, r0, r1):
        return Primitive(
            kind="cylinder", start=np.array(start), end=np.array(end), radii=(float(r0), float(r1)), part=part
        )

    def trunk(part, low, high, a, b):
        return Primitive(
            kind="elliptic", start=np.array([0.0, low, 0.0]), end=np.array([0.0, high, 0.0]), radii=(a, b),
            across=np.array([1.0, 0, 0]), rounding=0.04, part=part,
        )  # fmt: skip

    solids = [
        cone("head", (0, 1.56, 0.02), (0, 1.61, 0.02), 0.085, 0.09),
        cone("neck", (0, 1.36, 0), (0, 1.52, 0.01), 0.05, 0.05),
        cone("chest", (-0.13, 1.33, 0), (0.13, 1.33, 0), 0.075, 0.075),
        trunk("chest", 1.10, 1.40, 0.155, 0.105),
        trunk("abdomen", 0.96, 1.16, 0.135, 0.095),
        trunk("pelvis", 0.80, 1.02, 0.16, 0.105),
    ]
    for side, x in (("left", 1.0), ("right", -1.0)):
        hand = [(0.53, 0.905, 0.064), (0.60, 0.80, 0.09)]
        wrist = (0.52, 0.92, 0.06)
        knee, ankle, heel, toe = (0.11, 0.47, 0.01), (0.12, 0.09, -0.01), (0.12, 0.05, -0.03), (0.13, 0.035, 0.14)
        if bent:
            wrist, hand = (0.45, 1.15, 0.22), [(0.46, 1.155, 0.24), (0.50, 1.17, 0.36)]
            if side == "left":
                knee, ankle = (0.12, 0.66, 0.33), (0.13, 0.28, 0.36)
                heel, toe = (0.13, 0.24, 0.34), (0.14, 0.225, 0.51)

        def at(p, x=x):
            return (x * p[0], p[1], p[2])

        elbow, hip = (0.38, 1.10, 0.0), (0.09, 0.85, 0.0)
        solids += [
            cone(f"{side} upper arm", at((0.18, 1.34, 0)), at(elbow), 0.052, 0.042),
            cone(f"{side} lower arm", at(elbow), at(wrist), 0.042, 0.026),
            cone(f"{side} hand", at(hand[0]), at(hand[1]), 0.034, 0.022),
            cone(f"{side} upper leg", at(hip), at(knee), 0.085, 0.055),
            cone(f"{side} lower leg", at(knee), at(ankle), 0.055, 0.034),
            cone(f"{side} foot", at(heel), at(toe), 0.04, 0.03),
        ]
    return solids


def meshed(solids, spacing=0.02, blend=0.03):
    """Vertices (v, 3) and faces (f, 3) of the smooth union, on a grid that is its own mirror image in x."""
    low = np.min([np.minimum(p.start, p.end) - max(p.radii) for p in solids], axis=0) - 2.5 * spacing
    high = np.max([np.maximum(p.start, p.end) + max(p.radii) for p in solids], axis=0) + 2.5 * spacing
    low[0] = -np.ceil(max(-low[0], high[0]) / spacing) * spacing - spacing / 2
    high[0] = -low[0]
    axes = [np.arange(a, b + spacing / 2, spacing) for a, b in zip(low, high, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    value = np.full(len(nodes), 1.0)
    for p in solids:
        value = smooth_union(value, signed_distance(p, nodes)[0], blend)
    vertices, faces = surface_nets(value.reshape([len(a) for a in axes]), np.array([a[0] for a in axes]), spacing)
    return vertices, faces.astype(np.int64)


@cache
def standing():
    """The figure, its vertices and faces, and what `segment` finds of them; made once for all who only read them."""
    solids = figure()
    vertices, faces = meshed(solids)
    return solids, vertices, faces, segment(vertices, faces)


def true_parts(solids, vertices, faces):
    """The name of the part whose primitive is nearest to each face."""
    _, _, whose = nearest_distance(solids, vertices[faces].mean(axis=1))
    return np.array([p.part for p in solids])[whose]
