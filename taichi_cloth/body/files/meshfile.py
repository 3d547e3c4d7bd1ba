"""A body from a mesh file: unit and axes recognised, the mesh repaired, a skeleton laid into it."""

from itertools import pairwise
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.figure.anthropometry import measures_of
from taichi_cloth.body.figure.figure import Girths, draw
from taichi_cloth.body.files.mesh_reading import read_mesh
from taichi_cloth.body.files.repair import repaired
from taichi_cloth.body.skin.names import Facing, Unit, Up
from taichi_cloth.body.skin.skeleton import JOINTS, Skeleton
from taichi_cloth.body.skin.skinning import Body, heat_weights
from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["Facing", "Unit", "Up", "body_from_file", "body_from_mesh", "laid_skeleton"]

F64 = NDArray[np.float64]

METRES = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "inch": 0.0254}
SHORTEST, TALLEST = 0.7, 2.3
"""Of a standing body, from a child that has learnt to walk on [m]."""
GROWN = 1.2
"""From here on a height tells the unit: 80 high is a man in inches rather than a child in centimetres [m]."""


def body_from_file(
    path: str | Path, *, unit: Unit | None = None, up: Up | None = None, facing: Facing | None = None
) -> Body:
    """A body from an OBJ, PLY, GLB or STL file. What is not stated is recognised. Raises InputError.

    unit: of the file's lengths. up: its vertical axis. facing: which way it looks once upright: "forward" is +z,
    "left" +x.
    """
    path = Path(path)
    vertices, faces = read_mesh(path)
    try:
        return body_from_mesh(vertices, faces, name=path.stem, unit=unit, up=up, facing=facing)
    except InputError as error:
        raise InputError(f"{path.name}: {error}") from None


def body_from_mesh(
    vertices: F64,
    faces: NDArray[np.integer],
    *,
    name: str = "mesh",
    unit: Unit | None = None,
    up: Up | None = None,
    facing: Facing | None = None,
) -> Body:
    """The same from arrays. Raises InputError for what cannot be made a standing body."""
    for key, value, known in (
        ("unit", unit, get_args(Unit)),
        ("up", up, get_args(Up)),
        ("facing", facing, get_args(Facing)),
    ):
        if value is not None and value not in known:
            raise InputError(f"body.{key}: {value!r}; known: {', '.join(known)}{did_you_mean(str(value), known)}")
    mesh = repaired(vertices, faces)
    points, notes = mesh.vertices, mesh.notes

    tall = np.ptp(points, 0)
    if up is None:
        up = "y" if tall[1] >= tall[2] else "z"
        notes.append(f"{up} is up (seen from its height)")
    if up == "z":
        points = points @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    height = float(np.ptp(points[:, 1]))
    if unit is None:
        fits = [u for low in (GROWN, SHORTEST) for u, m in METRES.items() if low <= height * m <= TALLEST]
        if not fits:
            raise InputError(
                f"mesh: {height:g} high fits no unit for a body of {SHORTEST:g} to {TALLEST:g} m; state body.unit"
            )
        unit = fits[0]  # type: ignore[assignment]
        notes.append(f"lengths in {unit} (seen from its height)")
    assert unit is not None
    points = points * METRES[unit]
    height *= METRES[unit]
    if not SHORTEST <= height <= TALLEST:
        raise InputError(f"mesh: {height:g} m high; allowed: {SHORTEST:g} to {TALLEST:g} m; state body.unit or body.up")
    points = points - [0, points[:, 1].min(), 0]
    if facing is None:
        facing = _seen_facing(points)
        if facing != "forward":
            notes.append(f"turned round: it faced {facing} (seen from its feet)")
    quarter = {"forward": 0, "left": -1, "back": 2, "right": 1}[facing]
    c, s = round(np.cos(quarter * np.pi / 2)), round(np.sin(quarter * np.pi / 2))
    points = points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]], np.float64).T
    head = points[points[:, 1] > 0.92 * height]
    middle = 0.5 * (head.max(0) + head.min(0))
    trunk = (points[:, 1] > 0.55 * height) & (points[:, 1] < 0.7 * height)
    trunk = points[trunk & (np.abs(points[:, 0] - middle[0]) < 0.09 * height)]
    if len(trunk) < 8:
        raise InputError("mesh: no trunk where a standing body has one; state body.up")
    points = points - [middle[0], 0, 0.5 * (trunk[:, 2].min() + trunk[:, 2].max())]
    width, depth = np.ptp(points[:, 0]), np.ptp(points[:, 2])
    if max(width, depth) > 1.35 * height or height < 1.2 * depth:
        raise InputError(
            f"mesh: {width:.2f} wide, {height:.2f} high, {depth:.2f} m deep is not standing; state body.up"
        )
    faces32 = mesh.faces.astype(np.int32)
    skeleton = laid_skeleton(points, faces32)
    return Body(
        name=name,
        vertices=points,
        faces=faces32,
        skeleton=skeleton,
        weights=heat_weights(points, faces32, skeleton),
        measures={"stature": height},
        notes=tuple(notes),
    )


def _seen_facing(points: F64) -> Facing:
    """Where the feet point: the lowest slice reaches further to the toes than the ankles above it."""
    height = float(points[:, 1].max())
    arms_off = points[points[:, 1] < 0.35 * height]
    feet, shins = (
        arms_off[arms_off[:, 1] < 0.035 * height],
        arms_off[(arms_off[:, 1] > 0.06 * height) & (arms_off[:, 1] < 0.2 * height)],
    )
    if len(feet) < 6 or len(shins) < 6:
        return "forward"

    def toes(axis: int) -> float:
        low, high = feet[:, axis].min(), feet[:, axis].max()
        return float((high - shins[:, axis].max()) - (shins[:, axis].min() - low))

    sideways = np.ptp(shins[:, 0]) < np.ptp(shins[:, 2])  # legs stand one behind the other along x
    if sideways:
        return "left" if toes(0) > 0 else "right"
    return "forward" if toes(2) > 0 else "back"


def laid_skeleton(points: F64, faces: NDArray[np.int32]) -> Skeleton:
    """Our skeleton in a standing body [m]: scaled to height, crotch and fingertips, drawn into the limbs."""
    tall = float(points[:, 1].max())
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = edges[points[edges[:, 0], 0] * points[edges[:, 1], 0] <= 0]
    heights = points[edges, 1].mean(1) / tall  # of the skin in the plane between left and right
    heights = heights[heights > 0.3]
    crotch = float(np.clip(heights.min(), 0.42, 0.53)) if len(heights) else 0.465
    measures = measures_of("female", {"stature": tall, "crotch_height": crotch * tall})
    ours = draw("female", measures, Girths()).skeleton
    joints, tips = ours.joints * tall, ours.tips * tall

    def index(name: str) -> int:
        return JOINTS.index(name)

    def centred(at: F64, axis: F64, radius: float, *, keep_x: bool = False) -> F64:
        """The middle of the skin round a point, in a slab square to the axis."""
        q = points - at
        along = q @ axis
        near = (np.abs(along) < 0.015 * tall) & (np.linalg.norm(q - along[:, None] * axis, axis=1) < radius * tall)
        if near.sum() < 6:
            return at
        middle = 0.5 * (points[near].max(0) + points[near].min(0))
        moved = at + (middle - at) - ((middle - at) @ axis) * axis
        if keep_x:
            moved[0] = at[0]
        return moved

    up = np.array([0.0, 1, 0])
    for name in ("pelvis", "spine1", "spine2", "spine3", "neck", "head"):
        j = index(name)
        near = points[(np.abs(points[:, 1] - joints[j, 1]) < 0.02 * tall) & (np.abs(points[:, 0]) < 0.05 * tall)]
        if len(near) > 4:
            joints[j, 2] = 0.55 * near[:, 2].min() + 0.45 * near[:, 2].max()
    for a, b in pairwise(JOINTS[:6]):
        tips[index(a)] = joints[index(b)]
    tips[index("head"), 2] = joints[index("head"), 2]
    for side, sign in (("l", 1.0), ("r", -1.0)):
        thigh, shin, foot = (index(f"{n}_{side}") for n in ("thigh", "shin", "foot"))
        joints[shin] = centred(joints[shin], up, 0.075)
        joints[foot] = centred(joints[foot] * [0, 1, 1] + [joints[shin, 0], 0, 0], up, 0.075)
        toes = points[(points[:, 1] < 0.04 * tall) & (sign * points[:, 0] > 0)]
        joints[thigh, 2] = joints[0, 2]
        tips[thigh], tips[shin] = joints[shin], joints[foot]
        if len(toes):
            tips[foot] = np.array([toes[toes[:, 2].argmax(), 0], 0.008 * tall, toes[:, 2].max() - 0.01 * tall])
        collar, upper, fore, hand = (index(f"{n}_{side}") for n in ("clavicle", "upper_arm", "forearm", "hand"))
        high = points[points[:, 1] > 0.3 * tall]
        fingers = high[(sign * high[:, 0]).argmax()]
        near = high[np.linalg.norm(high - fingers, axis=1) < 0.02 * tall]
        fingers = near.mean(0)
        shoulder = joints[upper].copy()
        shoulder[2] = joints[index("spine3"), 2]
        joints[upper] = tips[collar] = shoulder
        joints[collar, 2] = shoulder[2] + 0.01 * tall
        way = fingers - shoulder
        axis = way / np.linalg.norm(way)
        elbow = centred(shoulder + 0.42 * way, axis, 0.055)
        wrist = centred(shoulder + 0.77 * way, axis, 0.045)
        joints[fore], joints[hand] = elbow, wrist
        tips[upper], tips[fore], tips[hand] = elbow, wrist, wrist + 0.85 * (fingers - wrist)
    return Skeleton(joints, tips)
