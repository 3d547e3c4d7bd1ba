"""Motion of the SMPL family of bodies (Loper et al. 2015), in NumPy archives as AMASS has them (Mahmood et al. 2019);
`captured.py` maps it onto our skeleton. Shapes and hands are not read: the body is the scene's.

`poses` (f, 72, 156 or 165) are rotation vectors of the joints against their parents, of which the first 22 are the same
in SMPL, SMPL+H and SMPL-X; `trans` (f, 3), if there is one, is the way of the pelvis [m]; frames a second are called
`mocap_framerate`, `mocap_frame_rate` or `fps`.
"""

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from taichi_cloth.body.moving.captured import Captured
from taichi_cloth.body.moving.motion import Motion
from taichi_cloth.body.skin.skeleton import JOINTS, Skeleton
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import read_bytes, shown_path

__all__ = ["smpl_motion"]

F64 = NDArray[np.float64]

GIVE = "an .npz of an SMPL motion, as AMASS has them"
LARGEST_FILE, LARGEST_ARRAY = 200_000_000, 400_000_000
"""Bytes, packed and unpacked."""
RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
LARGEST_VALUE = 1e4
"""Of a turn [rad] and of a place [m]."""

PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
"""Of SMPL's body joints."""
THEIRS = {
    "pelvis": 0, "spine1": 3, "spine2": 6, "spine3": 9, "neck": 12, "head": 15,
    "clavicle_l": 13, "upper_arm_l": 16, "forearm_l": 18, "hand_l": 20, "thigh_l": 1, "shin_l": 4, "foot_l": 7,
    "clavicle_r": 14, "upper_arm_r": 17, "forearm_r": 19, "hand_r": 21, "thigh_r": 2, "shin_r": 5, "foot_r": 8,
}  # fmt: skip
"""SMPL's joint for each of ours."""
BONES = {
    "upper_arm": (1.0, 0.02, -0.08), "forearm": (1.0, 0.0, -0.03),
    "thigh": (0.1, -1.0, 0.0), "shin": (-0.04, -1.0, -0.1), "foot": (0.25, -0.45, 0.9),
}  # fmt: skip
"""Directions of its left bones in its rest pose, a T that faces +z with y up, rounded; right ones are mirrored."""
LEG = 0.8
"""From hip to ankle of its mean bodies [m], 0.78 of women and 0.82 of men."""


def smpl_motion(path: str | Path, skeleton: Skeleton, *, loop: bool = False, blend_in: float = 1.0) -> Motion:
    """An SMPL motion as one of our skeleton, which first looks forward; at its end it stays, or begins again. Whichever
    axis most of its frames stand along is up. Raises InputError."""
    poses, way, rate = _read(path)
    joints = Rotation.from_rotvec(poses[:, : 3 * len(PARENTS)].reshape(-1, 3)).as_matrix()
    world = joints.reshape(len(poses), len(PARENTS), 3, 3)
    for j, parent in enumerate(PARENTS):
        if parent >= 0:
            world[:, j] = world[:, parent] @ world[:, j]
    axes = _forward(world[:, 0])
    captured = Captured(
        "smpl",
        turns=axes @ world[:, [THEIRS[name] for name in JOINTS]],
        bones={j: _bone(name) for j, name in enumerate(JOINTS)},
        way=way @ axes.T / LEG,
        frame_time=1.0 / rate,
    )
    return captured.motion(Path(path).stem, skeleton, loop=loop, blend_in=blend_in)


def _read(path: str | Path) -> tuple[F64, F64, float]:
    """Turns (f, 72 or more), the pelvis's place (f, 3) [m] and frames a second."""
    name = shown_path(path)
    data = read_bytes(path, most=LARGEST_FILE, give=GIVE)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            unpacked = sum(one.file_size for one in archive.infolist())
        if unpacked > LARGEST_ARRAY:
            raise InputError(f"{name}: {unpacked:,} bytes unpacked; allowed: up to {LARGEST_ARRAY:,}; give {GIVE}")
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            held = {key: archive[key] for key in ("poses", "trans", *RATES) if key in archive.files}
            keys = ", ".join(archive.files[:20])
    except InputError:
        raise
    except Exception as error:  # zipfile, zlib and NumPy raise whatever a damaged file leads them to
        raise InputError(f"{name}: cannot be read ({str(error)[:80] or type(error).__name__}); give {GIVE}") from None
    if "poses" not in held:
        raise InputError(f"{name}: no poses among {keys}; give {GIVE}")
    poses = _numbers(name, "poses", held["poses"])
    if poses.ndim != 2 or not len(poses) or poses.shape[1] < 3 * len(PARENTS) or poses.shape[1] % 3:
        raise InputError(f"{name}: poses of shape {poses.shape}; allowed: (frames, 72), (frames, 156), (frames, 165)")
    way = _numbers(name, "trans", held["trans"]) if "trans" in held else np.zeros((len(poses), 3))
    if way.shape != (len(poses), 3):
        raise InputError(f"{name}: trans of shape {way.shape}; allowed: ({len(poses)}, 3), as many as poses")
    known = [rate for rate in RATES if rate in held]
    if not known:
        raise InputError(f"{name}: no frames a second among {keys}; allowed: one of {', '.join(RATES)}")
    rates = _numbers(name, known[0], held[known[0]]).ravel()
    if len(rates) != 1 or not 0.1 <= rates[0] <= 10_000:
        raise InputError(f"{name}: {known[0]}: {rates[:3].tolist()}; allowed: one number from 0.1 to 10,000")
    return poses, way, float(rates[0])


def _numbers(name: str, key: str, value: NDArray[Any]) -> F64:
    if value.dtype.kind not in "fiu" or not np.isfinite(value).all() or np.abs(value).max(initial=0) > LARGEST_VALUE:
        raise InputError(f"{name}: {key}: not numbers up to {LARGEST_VALUE:,.0f} alone; give {GIVE}")
    return value.astype(np.float64)


def _bone(name: str) -> F64 | None:
    """Direction of one of SMPL's bones; None where they lie otherwise in the body than ours."""
    if name[:-2] not in BONES:
        return None
    return np.array(BONES[name[:-2]]) * [1.0 if name.endswith("_l") else -1.0, 1.0, 1.0]


def _forward(pelvis: F64) -> F64:
    """The rotation that takes the file's axes to ours: up is that along which the pelvis (f, 3, 3) stands most, and
    where it looks in the first frame is forward."""
    stands = pelvis[:, :, 1].mean(axis=0)
    up = np.eye(3)[int(np.abs(stands[1:]).argmax()) + 1]
    ahead = pelvis[0, :, 2] - (pelvis[0, :, 2] @ up) * up
    if np.linalg.norm(ahead) < 0.1:  # it lies: its head points forward
        ahead = pelvis[0, :, 1] - (pelvis[0, :, 1] @ up) * up
    ahead = ahead / np.linalg.norm(ahead)
    return np.stack([np.cross(up, ahead), up, ahead])
