"""Built-in motions of a body: idle, turn, walk, arms raised, arms folded, sit. Each starts at rest in the A pose.

Signs, in the body's rest axes (x left, y up, z forward): a leg or arm is flexed forward by a turn about −x, a knee is
bent by +x, the trunk leans forward by +x, the body turns to its left by +y, the left arm is lifted by +z.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import atan2, cos, radians, sin, sqrt
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.spatial.transform import Rotation

from taichi_cloth.body.moving.legs import planted_legs, sole_height, toes_lifted
from taichi_cloth.body.skin.skeleton import JOINTS, Pose, Skeleton
from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["MOTIONS", "Motion", "MotionName", "motion"]

F64 = NDArray[np.float64]
MotionName = Literal["rest", "idle", "turn", "walk", "arms-raised", "arms-folded", "sit"]
MOTIONS = get_args(MotionName)

WALK_PERIOD = 1.15
"""Time of one stride, two steps [s]."""

GAIT = {  # share of the stride from the heel's strike: flexion [degrees]
    "hip": [(0, 28), (0.10, 25), (0.25, 9), (0.40, -6), (0.52, -11), (0.62, -3), (0.75, 20), (0.87, 31), (0.95, 29)],
    "knee": [
        (0, 5), (0.07, 11), (0.15, 18), (0.28, 10), (0.40, 5), (0.50, 12), (0.60, 34), (0.72, 60),
        (0.84, 38), (0.95, 5),
    ],
    "ankle": [(0, 0), (0.07, -5), (0.20, 3), (0.45, 10), (0.55, 0), (0.63, -17), (0.75, -4), (0.88, 1)],
}  # fmt: skip
"""Sagittal angles of level walking at a natural pace, after the mean curves of Winter, "The biomechanics and motor
control of human gait", 1991 (key values, rounded). Ankle: toes up is positive."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A pose for every time. Starts from rest at time 0 at no speed, and is the motion itself from `blend_in` on."""

    name: str
    cycle: Callable[[float], Pose]
    period: float | None
    """After this time the motion repeats [s]; None where it does not."""
    blend_in: float = 1.0
    """Time from the rest pose into the motion [s]."""
    start: float = 0.0
    """When it begins [s]; at rest before."""

    def pose(self, time: float) -> Pose:
        """The pose at a time [s]; at rest before the start. Once differentiable, at the start twice."""
        time -= self.start
        if time <= 0:
            return Pose.rest()
        pose = self.cycle(time)
        if time >= self.blend_in:
            return pose
        return Pose.rest().blended(pose, _smooth(time / self.blend_in))


def motion(name: str, skeleton: Skeleton, *, speed: float = 1.0, blend_in: float = 1.0) -> Motion:
    """A built-in motion for a skeleton. speed: 2 is twice as fast. blend_in [s]. Raises InputError."""
    if name not in MOTIONS:
        raise InputError(f"body.motion: {name!r}; known: {', '.join(MOTIONS)}{did_you_mean(str(name), MOTIONS)}")
    if not (np.isfinite(speed) and 0 < speed <= 10):
        raise InputError(f"body.motion_speed: {speed!r}; allowed: above 0, up to 10")
    if not (np.isfinite(blend_in) and blend_in > 0):
        raise InputError(f"body.blend_in_s: {blend_in!r}; allowed: above 0 s")
    build, period = _BUILDERS[name]
    cycle = build(skeleton)
    return Motion(name, lambda time: cycle(time * speed), period / speed if period else None, blend_in)


def _smooth(x: ArrayLike) -> float:
    """0 to 1 with no slope or curvature at either end."""
    x = float(np.clip(x, 0, 1))
    return x * x * x * (x * (6 * x - 15) + 10)


def _turns(*steps: tuple[str, float]) -> F64:
    """Rotation vector of turns about the named axes [degrees], the first applied first."""
    w, x, y, z = 1.0, 0.0, 0.0, 0.0  # a quaternion in plain numbers: a tenth of the time of Rotation objects
    for axis, degrees in steps:
        c, s = cos(radians(degrees) / 2), sin(radians(degrees) / 2)
        if axis == "x":
            w, x, y, z = c * w - s * x, c * x + s * w, c * y - s * z, c * z + s * y
        elif axis == "y":
            w, x, y, z = c * w - s * y, c * x + s * z, c * y + s * w, c * z - s * x
        else:
            w, x, y, z = c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w
    size = sqrt(x * x + y * y + z * z)
    if w < 0:
        w, x, y, z = -w, -x, -y, -z
    scale = 2 * atan2(size, w) / size if size > 1e-12 else 2.0
    return np.array([scale * x, scale * y, scale * z])


A_POSE = {"upper_arm": (0.7071, -0.7071, 0.03), "forearm": (0.6293, -0.7771, 0.16)}
"""Ways of the left arm's bones in the pose from which arms are turned, that of the built-in body."""


def _alike(skeleton: Skeleton) -> Callable[[dict[str, F64]], dict[str, F64]]:
    """What makes turns of arms that start from another rest pose, such as bent elbows, end at the same directions."""
    names, fits, before = list[str](), list[Rotation](), list[Rotation]()
    for side, sign in (("l", 1.0), ("r", -1.0)):
        before.append(Rotation.identity())
        for part, way in A_POSE.items():
            names.append(f"{part}_{side}")
            j = JOINTS.index(names[-1])
            fits.append(_least_turn(skeleton.tips[j] - skeleton.joints[j], np.array(way) * [sign, 1, 1]))
            before.append(fits[-1])
        before.pop()
    fit, back = Rotation.concatenate(fits), Rotation.concatenate(before).inv()

    def alike(turns: dict[str, F64]) -> dict[str, F64]:
        own = Rotation.from_rotvec([turns.get(name, np.zeros(3)) for name in names])
        return turns | dict(zip(names, (back * own * fit).as_rotvec(), strict=True))

    return alike


def _least_turn(bone: F64, way: F64) -> Rotation:
    """The rotation by the least angle that takes one direction to another."""
    a, b = bone / np.linalg.norm(bone), way / np.linalg.norm(way)
    axis = np.cross(a, b)
    sine = float(np.linalg.norm(axis))
    return Rotation.from_rotvec(axis / max(sine, 1e-12) * np.arctan2(sine, float(a @ b)))


def _arm(side: int, *, lowered: float, forward: float, bent: float, twist: float = 0.0) -> dict[str, F64]:
    """An arm of the A pose lowered, swung forward and bent at the elbow [degrees]. side: 1 left, −1 right."""
    name = "l" if side > 0 else "r"
    return {
        f"clavicle_{name}": _turns(("z", -side * 0.12 * lowered)),
        f"upper_arm_{name}": _turns(("z", -side * 0.88 * lowered), ("y", -side * twist), ("x", -forward)),
        f"forearm_{name}": _turns(("x", -bent), ("y", -side * twist)),
    }


def _rest(skeleton: Skeleton) -> Callable[[float], Pose]:
    return lambda time: Pose.rest()


def _idle(skeleton: Skeleton) -> Callable[[float], Pose]:
    alike = _alike(skeleton)
    tall = float(skeleton.tips[JOINTS.index("head"), 1])

    def cycle(time: float) -> Pose:
        a = 2 * np.pi * time / 5.0
        side, breath = np.sin(a), np.sin(2 * a + 0.6)
        shift = tall * np.array([0.011 * side, -0.002 - 0.002 * side * side, 0.003 * np.sin(2 * a)])
        pelvis = {"pelvis": _turns(("z", -1.2 * side), ("y", 2.0 * np.sin(a - 0.5)))}
        return planted_legs(
            skeleton,
            alike(
                pelvis
                | {
                    "spine1": _turns(("z", 0.9 * side), ("x", 0.5 * breath)),
                    "spine3": _turns(("z", 0.8 * side), ("x", -0.8 * breath), ("y", -1.5 * np.sin(a - 0.8))),
                    "head": _turns(("y", 4 * np.sin(a - 1.0)), ("x", 1.0 * np.sin(2 * a))),
                }
                | _arm(1, lowered=30 + breath, forward=3 * np.sin(a - 0.6), bent=10)
                | _arm(-1, lowered=30 + breath, forward=-3 * np.sin(a - 0.6), bent=10),
            ),
            shift,
        )

    return cycle


def _turn(skeleton: Skeleton) -> Callable[[float], Pose]:
    period, ramp = 6.0, 1.5
    hips = skeleton.joints[0] * [1, 0, 1]

    def cycle(time: float) -> Pose:
        x = min(time / ramp, 1.0)
        angle = 2 * np.pi / period * (ramp * (x**6 - 3 * x**5 + 2.5 * x**4) + max(time - ramp, 0))
        turn = Rotation.from_euler("y", angle)
        return Pose.of({"pelvis": turn.as_rotvec()}, turn.apply(hips) - hips)

    return cycle


def _walk(skeleton: Skeleton) -> Callable[[float], Pose]:
    alike = _alike(skeleton)
    curve = {k: _periodic(rows) for k, rows in GAIT.items()}
    tall = float(skeleton.tips[JOINTS.index("head"), 1])

    def turns(phase: float, lift: Callable[[float], float] = lambda share: 0.0) -> dict[str, F64]:
        a = 2 * np.pi * phase  # the left heel strikes at 0, the right at a half
        out = {
            "pelvis": _turns(("z", 3.0 * np.cos(a - 1.7)), ("y", -5.0 * np.cos(a)), ("x", 1.5)),
            "spine1": _turns(("z", -2.2 * np.cos(a - 1.7)), ("y", 3.0 * np.cos(a))),
            "spine2": _turns(("z", -1.4 * np.cos(a - 1.7)), ("y", 3.0 * np.cos(a)), ("x", 0.7)),
            "spine3": _turns(("y", 4.0 * np.cos(a))),
            "neck": _turns(("y", -2.5 * np.cos(a)), ("x", -1.0)),
            "head": _turns(("y", -2.5 * np.cos(a)), ("x", -1.0 + 0.8 * np.cos(2 * a))),
        }
        for side, name, shift in ((1, "l", 0.0), (-1, "r", 0.5)):
            share = (phase + shift) % 1.0
            hip, knee, ankle = (float(curve[k](share)) for k in ("hip", "knee", "ankle"))
            out[f"thigh_{name}"] = _turns(("x", -0.85 * hip), ("z", -side * 1.5), ("z", -3.0 * np.cos(a - 1.7)))
            out[f"shin_{name}"] = _turns(("x", 0.9 * knee))
            out[f"foot_{name}"] = _turns(("x", -0.9 * ankle - lift(share)))
            swing = -np.cos(2 * np.pi * share - 0.25)
            out |= _arm(side, lowered=33, forward=4 + 19 * swing, bent=14 + 9 * swing, twist=7)
        return out

    phases = np.arange(96) / 96
    up = _even([-sole_height(skeleton, Pose.of(turns(p)), toes=False) for p in phases])
    # The rear foot tips over its toes as its heel leaves the floor: they are lifted, and the body comes down by what
    # that leaves, until both feet carry it.
    tips = [toes_lifted(skeleton, Pose.of(turns(p), (0.0, up(p), 0.0)), "foot_l") for p in phases]
    wide = gaussian_filter1d(maximum_filter1d(np.degrees(tips), 5, mode="wrap"), 1.5, mode="wrap")
    lift = _periodic([*zip(phases.tolist(), wide.tolist(), strict=True)])
    up = _even([-sole_height(skeleton, Pose.of(turns(p, lift))) for p in phases])

    def cycle(time: float) -> Pose:
        phase = time / WALK_PERIOD
        sway = 0.011 * tall * np.sin(2 * np.pi * phase - 0.25)
        return Pose.of(alike(turns(phase, lift)), (sway, up(phase), 0.0))

    return cycle


def _even(heights: list[float]) -> Callable[[float], float]:
    """A smooth curve of period 1 through about these heights, alike in both steps."""
    rise = np.fft.rfft(heights) / len(heights)
    rise[9:] = 0
    rise[1::2] = 0

    def up(phase: float) -> float:
        a = 2 * np.pi * phase * np.arange(1, 9)
        return float(rise[0].real + 2 * np.sum((rise[1:9] * np.exp(1j * a)).real))

    return up


def _arms_raised(skeleton: Skeleton) -> Callable[[float], Pose]:
    alike = _alike(skeleton)

    def cycle(time: float) -> Pose:
        up = 0.5 * (1 - np.cos(2 * np.pi * time / 6.0))
        out = {}
        for side, name in ((1, "l"), (-1, "r")):
            out[f"clavicle_{name}"] = _turns(("z", side * 24 * up))
            out[f"upper_arm_{name}"] = _turns(("z", side * 82 * up), ("x", -6 * up))
            out[f"forearm_{name}"] = _turns(("z", side * 10 * up))
        return Pose.of(alike(out) | {"spine3": _turns(("x", -3 * up)), "head": _turns(("x", -4 * up))})

    return cycle


FOLDED = {
    "l": {"upper_arm": (0.2, -0.9, 0.3), "forearm": (-0.95, 0.12, 0.25)},
    "r": {"upper_arm": (-0.15, -0.85, 0.5), "forearm": (0.93, 0.25, 0.3)},
}
"""Ways of the arms' bones folded before the chest, the right forearm over the left."""


def _arms_folded(skeleton: Skeleton) -> Callable[[float], Pose]:
    turns = {}
    for side, ways in FOLDED.items():
        before = Rotation.identity()
        for part, way in ways.items():
            j = JOINTS.index(f"{part}_{side}")
            turn = _least_turn(skeleton.tips[j] - skeleton.joints[j], before.inv().apply(np.array(way)))
            turns[f"{part}_{side}"], before = turn.as_rotvec(), before * turn
    folded = Pose.of(turns)
    return lambda time: Pose.rest().blended(folded, _smooth(time / 1.4))


def _sit(skeleton: Skeleton) -> Callable[[float], Pose]:
    alike = _alike(skeleton)
    thigh = float(np.linalg.norm(skeleton.tips[JOINTS.index("thigh_l")] - skeleton.joints[JOINTS.index("thigh_l")]))

    def cycle(time: float) -> Pose:
        down = _smooth(time / 2.4)
        lean = np.sin(np.pi * down) ** 2
        shift = np.array([0, -0.93 * thigh * np.sin(0.5 * np.pi * down) ** 1.5, -0.98 * thigh * down])
        turns = {
            "pelvis": _turns(("x", 22 * lean - 6 * down)),
            "spine1": _turns(("x", 8 * lean + 4 * down)),
            "spine2": _turns(("x", 5 * lean + 2 * down)),
            "head": _turns(("x", -18 * lean)),
        }
        for side in (1, -1):
            turns |= _arm(side, lowered=26 * down, forward=26 * down + 8 * lean, bent=42 * down, twist=14 * down)
        return planted_legs(skeleton, alike(turns), shift)

    return cycle


@lru_cache(maxsize=64)
def _spline(rows: tuple[tuple[float, float], ...]) -> CubicSpline:
    table = np.array([*rows, (rows[0][0] + 1, rows[0][1])])
    return CubicSpline(table[:, 0], table[:, 1], bc_type="periodic")


def _periodic(rows: list[tuple[float, float]]) -> CubicSpline:
    """A smooth curve of period 1 through (share, value)."""
    return _spline(tuple(rows))


_BUILDERS: dict[str, tuple[Callable[[Skeleton], Callable[[float], Pose]], float | None]] = {
    "rest": (_rest, None),
    "idle": (_idle, 5.0),
    "turn": (_turn, 6.0),
    "walk": (_walk, WALK_PERIOD),
    "arms-raised": (_arms_raised, 6.0),
    "arms-folded": (_arms_folded, None),
    "sit": (_sit, None),
}
