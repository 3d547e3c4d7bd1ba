"""Motion capture in BVH files; `captured.py` maps it onto our skeleton. At rest all angles are 0."""

import io
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from taichi_cloth.body.moving.captured import Captured, child_of, leg_length
from taichi_cloth.body.moving.motion import Motion
from taichi_cloth.body.skin.skeleton import JOINTS, Skeleton
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import read_bytes

__all__ = ["Bvh", "bvh_motion", "read_bvh"]

F64 = NDArray[np.float64]

CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")
LARGEST_FILE = 50_000_000
"""Bytes; ten minutes at 120 frames a second are about 40 million."""
LONGEST_LINE = 1_000_000
MOST_JOINTS, MOST_TURNS = 1000, 5_000_000
"""Joints, and joints times frames, for which rotations are worked out."""
LARGEST_VALUE = 1e6
"""Of any number in a file: lengths in its unit, angles in degrees."""


@dataclass(frozen=True, eq=False)
class Bvh:
    """What a BVH file holds: j joints with channels, f frames."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: F64
    """Rest place of each joint against its parent, in the file's unit, shape (j, 3)."""
    channels: tuple[tuple[str, ...], ...]
    frame_time: float
    """Time between frames [s]."""
    values: F64
    """Shape (f, channels of all joints)."""
    ends: dict[int, F64] = field(default_factory=dict)
    """Offset of the end site of a last joint."""

    def rest(self) -> F64:
        """Places at rest, in the file's axes and unit, shape (j, 3)."""
        places = np.zeros_like(self.offsets)
        for j, parent in enumerate(self.parents):
            places[j] = self.offsets[j] + (places[parent] if parent >= 0 else 0)
        return places

    def turned(self) -> tuple[NDArray[np.float64], F64]:
        """World rotation of each joint, (f, j, 3, 3), and the root's place, (f, 3)."""
        frames = len(self.values)
        world = np.empty((frames, len(self.names), 3, 3))
        root = np.tile(self.offsets[0], (frames, 1))
        first = 0
        for j, channels in enumerate(self.channels):
            block = self.values[:, first : first + len(channels)]
            first += len(channels)
            local = Rotation.identity(frames)
            for c, name in enumerate(channels):
                if name.endswith("rotation"):
                    local = local * Rotation.from_euler(name[0].lower(), block[:, c : c + 1], degrees=True)
                elif j == 0:
                    root[:, "XYZ".index(name[0])] = block[:, c]
            parent = self.parents[j]
            world[:, j] = local.as_matrix() if parent < 0 else world[:, parent] @ local.as_matrix()
        return world, root


def read_bvh(path: str | Path) -> Bvh:
    """Read a BVH file. Raises InputError with the line where it is wrong."""
    data = read_bytes(path, most=LARGEST_FILE, give="a .bvh file")
    return _Reader(Path(path).name, data).read()


class _Reader:
    def __init__(self, name: str, data: bytes) -> None:
        self.name, self.at = name, 0
        self.lines = io.TextIOWrapper(io.BytesIO(data), encoding="utf-8", errors="replace")

    def fail(self, what: str) -> InputError:
        return InputError(f"{self.name}: line {self.at}: {what}")

    def words(self, expected: str) -> list[str]:
        for line in iter(lambda: self.lines.readline(LONGEST_LINE), ""):
            self.at += 1
            if len(line) >= LONGEST_LINE:
                raise self.fail(f"a line of {LONGEST_LINE:,} letters or more")
            words = line.split()
            if words:
                return words
        raise self.fail(f"the file ends where {expected} should stand")

    def numbers(self, words: list[str], count: int) -> list[float]:
        try:
            values = [float(w) for w in words]
        except ValueError:
            raise self.fail(f"not a number in {' '.join(words)[:60]!r}") from None
        if len(values) != count or not np.isfinite(values).all():
            raise self.fail(f"{len(values)} values where {count} finite ones should stand")
        if count and max(map(abs, values)) > LARGEST_VALUE:
            raise self.fail(f"{max(values, key=abs):g}; allowed: numbers up to {LARGEST_VALUE:,.0f}")
        return values

    def read(self) -> Bvh:
        if self.words("HIERARCHY")[0].upper() != "HIERARCHY":
            raise self.fail("no BVH file: the first word is not HIERARCHY")
        names: list[str] = []
        parents: list[int] = []
        offsets: list[list[float]] = []
        channels: list[tuple[str, ...]] = []
        ends: dict[int, F64] = {}
        stack: list[int | None] = []
        current: int | None = -1
        while True:
            words = self.words("MOTION")
            key = words[0].upper()
            if key in ("ROOT", "JOINT"):
                if (key == "ROOT") != (current == -1 and not names) or current is None:
                    raise self.fail(f"{key} in the wrong place; allowed: one ROOT, joints within joints")
                if len(names) >= MOST_JOINTS:
                    raise self.fail(f"more than {MOST_JOINTS} joints")
                names.append(" ".join(words[1:]) or f"joint {len(names)}")
                parents.append(current)
                offsets.append([0.0, 0.0, 0.0])
                channels.append(())
                stack.append(current)
                current = len(names) - 1
            elif key == "END":
                stack.append(current)
                ends[self.joint(current)] = np.zeros(3)
                current = None
            elif key == "{":
                continue
            elif key == "}":
                if not stack:
                    raise self.fail("a } too many")
                current = stack.pop()
            elif key == "OFFSET":
                value = self.numbers(words[1:], 3)
                if current is None:
                    ends[self.joint(stack[-1])] = np.array(value)
                else:
                    offsets[self.joint(current)] = value
            elif key == "CHANNELS":
                kinds = tuple(words[2:])
                if (
                    not 2 <= len(words) <= 2 + len(CHANNELS)
                    or words[1] != str(len(kinds))
                    or not set(kinds) <= set(CHANNELS)
                ):
                    raise self.fail(
                        f"channels {' '.join(words[1:])[:60]!r}; allowed: a count, then of {', '.join(CHANNELS)}"
                    )
                channels[self.joint(current)] = kinds
            elif key == "MOTION":
                break
            else:
                raise self.fail(f"unknown word {words[0][:40]!r} in the hierarchy")
        if not names or stack:
            raise self.fail("the hierarchy is not closed before MOTION" if names else "the hierarchy has no joint")
        frames, step = self.frames()
        width = sum(len(c) for c in channels)
        if frames * len(names) > MOST_TURNS:
            raise self.fail(f"{frames} frames of {len(names)} joints; allowed: {MOST_TURNS:,} turns of joints in all")
        rows = [np.array(self.numbers(self.words(f"frame {i + 1} of {frames}"), width)) for i in range(frames)]
        return Bvh(tuple(names), tuple(parents), np.array(offsets), tuple(channels), step, np.stack(rows), ends)

    def joint(self, current: int | None) -> int:
        if current is None or current < 0:
            raise self.fail("a property outside any joint")
        return current

    def frames(self) -> tuple[int, float]:
        words = self.words("Frames:")
        if words[0].lower() != "frames:" or len(words) != 2 or not _counts(words[1]):
            raise self.fail("after MOTION comes Frames: and their number, 1 or more")
        count = int(words[1])
        words = self.words("Frame Time:")
        if [w.lower() for w in words[:2]] != ["frame", "time:"]:
            raise self.fail("after Frames: comes Frame Time: and seconds")
        step = self.numbers(words[2:], 1)[0]
        if not 1e-4 <= step <= 10:
            raise self.fail(f"Frame Time: {step:g}; allowed: 0.0001 to 10 s")
        return count, step


def _counts(word: str) -> bool:
    """Whether a word is a number of frames; int reads no more than some thousand digits."""
    return word.isascii() and word.isdigit() and len(word) < 10 and int(word) >= 1


NAMES = {
    "pelvis": ("hips", "hip", "pelvis", "root"),
    "spine1": ("lowerback", "spine", "abdomen", "torso", "chest", "spine_01", "spine1"),
    "spine2": ("spine1", "spine", "chest2", "chest", "spine_02", "spine2"),
    "spine3": ("spine2", "spine1", "chest3", "chest2", "chest", "upperchest", "spine_03", "spine3"),
    "neck": ("neck", "neck1", "neck_01"), "head": ("head",),
    "clavicle": ("{side}shoulder", "{side}collar", "clavicle_{s}", "{side}clavicle", "{s}collar"),
    "upper_arm": ("{side}arm", "{side}uparm", "{side}upperarm", "upperarm_{s}", "{s}shldr", "{side}shoulder"),
    "forearm": ("{side}forearm", "{side}lowarm", "{side}elbow", "lowerarm_{s}", "{s}forearm", "{side}lowerarm"),
    "hand": ("{side}hand", "{side}wrist", "hand_{s}", "{s}hand"),
    "thigh": ("{side}upleg", "{side}hip", "{side}thigh", "thigh_{s}", "{s}thigh", "{side}upperleg"),
    "shin": ("{side}leg", "{side}lowleg", "{side}knee", "calf_{s}", "{s}shin", "{side}lowerleg", "{side}shin"),
    "foot": ("{side}foot", "{side}ankle", "foot_{s}", "{s}foot"),
}  # fmt: skip
"""Names of joints in the files of CMU, Mixamo, Biovision, Poser and game engines, the likeliest first."""

NEEDED = ("pelvis", "upper_arm_l", "upper_arm_r", "forearm_l", "thigh_l", "thigh_r", "shin_l", "shin_r", "foot_l")


def matched(names: tuple[str, ...]) -> dict[int, int]:
    """The file's joint for each of ours that it has; each is used once. Raises InputError when too few are known."""
    plain = [n.rsplit(":", 1)[-1].lower().replace(" ", "").replace(".", "_") for n in names]
    found: dict[int, int] = {}
    order = [j for j, name in enumerate(JOINTS) if "clavicle" not in name]
    order += [j for j in range(len(JOINTS)) if j not in order]  # "LeftShoulder" is an upper arm where no LeftArm is
    for j in order:
        stem, side = (JOINTS[j][:-2], JOINTS[j][-1]) if JOINTS[j][-2:] in ("_l", "_r") else (JOINTS[j], "")
        word = {"l": "left", "r": "right", "": ""}[side]
        for name in NAMES[stem]:
            wanted = name.format(side=word, s=side)
            if wanted in plain and plain.index(wanted) not in found.values():
                found[j] = plain.index(wanted)
                break
    missing = [name for name in NEEDED if JOINTS.index(name) not in found]
    if missing:
        raise InputError(
            f"bvh: no joint for {', '.join(missing)} among {', '.join(names[:40])}; rename them as Mixamo does"
        )
    return found


def bvh_motion(path: str | Path, skeleton: Skeleton, *, loop: bool = False, blend_in: float = 1.0) -> Motion:
    """A BVH file as a motion of our skeleton; at its end it stays, or begins again. Raises InputError."""
    bvh = read_bvh(path)
    found = matched(bvh.names)
    rest = bvh.rest()
    axes = _upright(rest, found)
    world, root = bvh.turned()
    places, order = rest @ axes.T, [found.get(j, 0) for j in range(len(JOINTS))]
    captured = Captured(
        "bvh",
        turns=(axes @ world @ axes.T)[:, order],
        bones={j: _their_bone(bvh, places, axes, found, j) for j in found},
        way=(root @ axes.T) / leg_length(places[order], "bvh"),
        frame_time=bvh.frame_time,
    )
    return captured.motion(Path(path).stem, skeleton, loop=loop, blend_in=blend_in)


def _upright(rest: F64, found: dict[int, int]) -> F64:
    """The rotation that takes the file's axes to ours: the feet below the head, the left hip to the left."""

    def at(name: str) -> F64:
        return rest[found[JOINTS.index(name)]]

    left = at("thigh_l") - at("thigh_r")
    up = 0.5 * (at("thigh_l") + at("thigh_r")) - 0.5 * (at("shin_l") + at("shin_r"))
    axis = int(np.abs(up).argmax())
    up = np.sign(up[axis]) * np.eye(3)[axis]
    left = left - (left @ up) * up
    if np.linalg.norm(left) < 1e-9:
        raise InputError("bvh: the two hips are at one place; give the joints of the file their offsets")
    left = left / np.linalg.norm(left)
    return np.stack([left, up, np.cross(left, up)])


def _their_bone(bvh: Bvh, places: F64, axes: F64, found: dict[int, int], j: int) -> F64 | None:
    """The file's bone in our axes, from its joint to the next one that both have; None where it says nothing."""
    child = child_of(j)
    if JOINTS[j] in ("pelvis", "head", "hand_l", "hand_r") or "spine" in JOINTS[j] or "clavicle" in JOINTS[j]:
        return None  # their bones lie otherwise in the body than ours, not turned
    if child is not None and child in found:
        return places[found[child]] - places[found[j]]
    following = [k for k, parent in enumerate(bvh.parents) if parent == found[j]]
    if following:
        return places[following[0]] - places[found[j]]
    return axes @ bvh.ends[found[j]] if found[j] in bvh.ends else None
