"""The figure a body is cut from: sections of trunk, limbs and head (outline.py), what is laid on them, and its joints.

In shares of stature. How thick each part is comes from the girths, through `Girths`.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from taichi_cloth.body.figure.anthropometry import Gender, Measures
from taichi_cloth.body.figure.implicit import Ellipsoid, Part, RoundCone, Tube
from taichi_cloth.body.figure.outline import FACE, FOOT, FOREARM, HAND, LEG, TRUNK, UPPER_ARM
from taichi_cloth.body.skin.skeleton import JOINTS, Skeleton

__all__ = ["FACTORS", "Figure", "Girths", "Section", "draw", "thickened"]

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Girths:
    """Factors on the thickness of the figure's parts, one for each girth that a tape reads."""

    bust: float = 1.0
    underbust: float = 1.0
    waist: float = 1.0
    hip: float = 1.0
    neck: float = 1.0
    upper_arm: float = 1.0
    forearm: float = 1.0
    wrist: float = 1.0
    thigh: float = 1.0
    knee: float = 1.0
    calf: float = 1.0
    ankle: float = 1.0


FACTORS = tuple(f.name for f in fields(Girths))
"""Names of the girths that are fitted."""


@dataclass(frozen=True, eq=False)
class Section:
    """Where a tape goes: a point within the part and the normal of the plane."""

    point: F64
    normal: F64


@dataclass(frozen=True, eq=False)
class Figure:
    """Parts, sections and joints in shares of the stature."""

    parts: tuple[Part, ...]
    sections: dict[str, Section]
    skeleton: Skeleton
    fine: tuple[tuple[F64, float], ...]
    """Balls (middle, radius) in which the mesh is twice as fine: head, hands, toes."""


def draw(gender: Gender, measures: Measures, girths: Girths) -> Figure:
    """The figure with its lengths from the measures and its thickness from the factors."""
    return _Drawing(gender, measures, girths).figure()


class _Drawing:
    def __init__(self, gender: Gender, measures: Measures, girths: Girths) -> None:
        self.gender: Gender = gender
        self.male = gender == "male"
        self.g = girths
        tall = measures.stature
        self.trunk_crotch = 0.466 if self.male else 0.462
        self.height_of = PchipInterpolator(
            [0, 0.04, self.trunk_crotch, 0.82, 1.0], [0, 0.04, measures.crotch_height / tall, 0.82, 1.0]
        )
        self.shoulder = np.array([0.45 * measures.shoulder_breadth / tall, 0.797 if self.male else 0.790, -0.012])
        arm = measures.arm_length / tall
        upper, fore = 0.545 * arm, 0.455 * arm
        down = np.array([np.sin(np.radians(45)), -np.cos(np.radians(45)), 0.03])
        self.arm_axis = down / np.linalg.norm(down)
        bent = np.array([np.sin(np.radians(39)), -np.cos(np.radians(39)), 0.16])
        self.fore_axis = bent / np.linalg.norm(bent)
        self.elbow = self.shoulder + upper * self.arm_axis
        self.wrist = self.elbow + fore * self.fore_axis
        self.hand_axis = self.fore_axis + np.array([-0.05, -0.05, 0.06])
        self.hand_axis /= np.linalg.norm(self.hand_axis)
        self.upper, self.fore = upper, fore

    def at(self, x: float, y: float, z: float) -> F64:
        """A place of the figure, at the height its legs' length gives it."""
        return np.array([x, float(self.height_of(y)), z])

    def column(self, rows: ArrayLike, factors: ArrayLike | None = None, middle: float = 0.45) -> Tube:
        """Horizontal sections, thickened about their middles by factors given as rows (height, factor)."""
        rows = np.array(sorted(np.asarray(rows, np.float64).tolist()))
        if factors is not None:
            rows = thickened(rows, np.asarray(factors, np.float64), middle)
        rows[:, 0] = self.height_of(rows[:, 0])
        return Tube(np.zeros(3), np.array([0.0, 1, 0]), np.array([1.0, 0, 0]), _facing_front(rows), 1 - middle)

    def figure(self) -> Figure:
        parts = [*self._trunk(), *self._legs(), *self._arms(), *self._head()]
        fine = [(np.array([0, 0.930, 0.008]), 0.080)]
        for side in (-1, 1):
            fine.append(((self.wrist + 0.060 * self.hand_axis) * [side, 1, 1], 0.072))
            fine.append((np.array([side * 0.084, 0.012, 0.086]), 0.036))
        return Figure(tuple(parts), self._sections(), self._skeleton(), tuple(fine))

    def _trunk(self) -> list[Part]:
        g, male = self.g, self.male
        up = 0.006 if male else 0.0
        chest = 0.5 * (g.underbust + 1)
        factors = [
            (0.45, g.hip), (0.52, g.hip), (0.58, 0.5 * (g.hip + g.waist)), (0.638 + up, g.waist),
            (0.69, g.underbust), (0.73, 0.2 * chest + 0.8 * g.underbust), (0.785, chest), (0.84, 1),
        ]  # fmt: skip
        parts = [Part(self.column(TRUNK[self.gender], factors), 0.02)]
        seat = np.array([0.050, 0.056, 0.046]) * g.hip
        parts.append(Part(Ellipsoid(self.at(0.045, 0.508, -0.030 * g.hip), seat), 0.030, True, 0.014))
        b, root = g.bust, np.sqrt(g.bust)
        if male:
            breast = Ellipsoid(
                self.at(0.050, 0.748, 0.036 * b), np.array([0.056, 0.040, 0.022]) * b, _tilted(0.25, 0.25)
            )
            parts.append(Part(breast, 0.045, True, 0.020))
        else:
            slope = RoundCone(self.at(0.050, 0.780, 0.022), self.at(0.0465, 0.727, 0.040 * b), 0.014, 0.032 * root)
            ball = Ellipsoid(self.at(0.0465, 0.721, 0.043 * b), np.array([0.036 * root, 0.036 * root, 0.033 * b]))
            parts += [Part(slope, 0.040, True, 0.016), Part(ball, 0.016, True, 0.012)]
        return parts

    def _legs(self) -> list[Part]:
        g = self.g
        factors = [
            (0.0, 1), (0.035, g.ankle), (0.08, g.ankle), (0.19, g.calf), (0.283, g.knee),
            (0.37, 0.5 * (g.knee + g.thigh)), (0.44, g.thigh), (0.5, 0.5 * (g.thigh + g.hip)),
        ]  # fmt: skip
        thin = np.array(sorted(LEG))
        rows = thickened(thin, np.array(factors), 0.45)
        apart = rows[:, 0] > 0.3  # thicker thighs stand further apart
        rows[apart, 1] += 0.8 * (rows[apart, 2] - thin[apart, 2]) * np.clip((rows[apart, 0] - 0.3) / 0.08, 0, 1)
        leg = self.column(rows)
        turn = np.radians(7)
        along, across = np.array([np.sin(turn), 0, np.cos(turn)]), np.array([np.cos(turn), 0, -np.sin(turn)])
        foot = Tube(np.array([0.0732, 0, -0.006]), along, -across, _facing_front(np.array(FOOT)), 0.62)
        kneecap = Ellipsoid(self.at(0.0705, 0.289, 0.026 * g.knee), np.array([0.019, 0.026, 0.013]))
        return [Part(leg, 0.048, True, 0.010), Part(kneecap, 0.016, True), Part(foot, 0.016, True)]

    def _arms(self) -> list[Part]:
        g, wide = self.g, 1.08 if self.male else 1.0
        upper = _limb(
            self.shoulder, self.arm_axis, self.upper, UPPER_ARM, [(0, g.upper_arm), (0.6, g.upper_arm), (1, g.forearm)]
        )
        fore = _limb(self.elbow, self.fore_axis, self.fore, FOREARM, [(0, g.forearm), (0.4, g.forearm), (1, g.wrist)])
        hand = _limb(self.wrist, self.hand_axis, 1.0, HAND, [(0, g.wrist), (0.04, wide), (0.1, wide)])
        u = fore.across
        thumb = self.wrist + 0.022 * self.hand_axis + np.array([0, 0, 0.014])
        tip = self.wrist + 0.066 * self.hand_axis + np.array([-0.004, -0.004, 0.033])
        middle = 0.5 * (thumb + tip) + np.array([0, 0, 0.004])
        point, drop = self.shoulder, 0.0275 * g.upper_arm
        top = 0.022 * (1.05 if self.male else 1.0)
        rise = 0.006 if self.male else 0.0
        collar = np.array([0.026, 0.834 + rise, -0.022])
        cap = point + np.array([-0.006, 0.003, -0.004])
        deltoid = point + 0.30 * self.upper * self.arm_axis + 0.003 * u
        front = np.array([0.6 * point[0], point[1] - 0.008, 0.004])
        return [
            Part(RoundCone(collar, cap, 0.0175, top), 0.034, True, 0.01),
            Part(RoundCone(front, point + np.array([0, -0.006, 0.004]), 0.024, 0.027), 0.030, True, 0.02),
            Part(upper, 0.030, True),
            Part(
                RoundCone(point + 0.06 * self.upper * self.arm_axis, deltoid, drop, 0.0268 * g.upper_arm), 0.030, True
            ),
            Part(fore, 0.016, True),
            Part(hand, 0.010, True),
            Part(RoundCone(thumb, middle, 0.0115 * wide, 0.0095 * wide), 0.012, True),
            Part(RoundCone(middle, tip, 0.0095 * wide, 0.0078 * wide), 0.006, True),
        ]

    def _head(self) -> list[Part]:
        male = self.male
        neck_low, neck_high = np.array([0, 0.815, -0.018]), np.array([0, 0.905, 0.008])
        along = (neck_high - neck_low) / np.linalg.norm(neck_high - neck_low)
        thick = self.g.neck * (1.06 if male else 1.0)
        length = float(np.linalg.norm(neck_high - neck_low))
        rows = [
            (0, 0, 0.037, 0.030, -0.033, 2), (0.35 * length, 0, 0.031, 0.029, -0.031, 2),
            (0.65 * length, 0, 0.0295, 0.029, -0.0305, 2), (length, 0, 0.032, 0.030, -0.034, 2),
        ]  # fmt: skip
        table = np.array(rows, np.float64)
        table[:, 2:5] *= thick
        neck = Tube(neck_low, along, np.array([1.0, 0, 0]), _facing_front(table), 0.5)
        jaw = np.array(FACE)
        jaw[:, 2] *= 1.06 if male else 0.97
        skull = Ellipsoid(np.array([0, 0.9420, 0.0015]), np.array([0.0445, 0.0580, 0.0580]))
        return [
            Part(neck, 0.030),
            Part(skull, 0.010),
            Part(self.column(jaw), 0.024),
            Part(
                Ellipsoid(np.array([0.0200, 0.9290, 0.0710]), np.array([0.0140, 0.0080, 0.0105])),
                0.012,
                True,
                carve=True,
            ),
            Part(RoundCone(np.array([0, 0.9320, 0.0570]), np.array([0, 0.9075, 0.0660]), 0.0055, 0.0068), 0.012),
            Part(Ellipsoid(np.array([0.0425, 0.9220, 0.0000]), np.array([0.0065, 0.0165, 0.0095])), 0.009, True),
        ]

    def _sections(self) -> dict[str, Section]:
        up = np.array([0.0, 1, 0])
        neck = np.array([0, 0.09, 0.026])
        thigh = self.trunk_crotch - 0.030

        def flat(x: float, y: float, z: float = -0.005) -> Section:
            return Section(self.at(x, y, z), up)

        return {
            "bust": flat(0, 0.728 if self.male else 0.722),
            "underbust": flat(0, 0.690 if self.male else 0.674),
            "waist": flat(0, 0.642 if self.male else 0.638),
            "hip": flat(0, 0.512, -0.01),
            "neck": Section(np.array([0, 0.862 + (0.002 if self.male else 0), -0.0045]), neck / np.linalg.norm(neck)),
            "upper_arm": Section(self.shoulder + 0.55 * self.upper * self.arm_axis, self.arm_axis),
            "forearm": Section(self.elbow + 0.22 * self.fore * self.fore_axis, self.fore_axis),
            "wrist": Section(self.elbow + 0.96 * self.fore * self.fore_axis, self.fore_axis),
            "thigh": flat(0.0625, thigh, 0.0),
            "knee": flat(0.0702, 0.283, 0.005),
            "calf": flat(0.0722, 0.195, -0.012),
            "ankle": flat(0.0732, 0.075, -0.010),
        }

    def _skeleton(self) -> Skeleton:
        at = self.at
        hip = at(0.056, 0.512, -0.006)
        knee, ankle = at(0.0702, 0.283, 0.004), np.array([0.0732, 0.042, -0.010])
        toes = np.array([0.084, 0.008, 0.085])
        low, mid, high, neck = (
            at(0, 0.575, -0.012),
            at(0, 0.635, -0.006),
            at(0, 0.705, -0.010),
            np.array([0, 0.835, -0.014]),
        )
        skull, crown = np.array([0, 0.895, 0.004]), np.array([0, 0.985, 0.008])
        clavicle = np.array([0.016, 0.812, -0.004])
        fingers = self.wrist + 0.10 * self.hand_axis
        ends = {
            "pelvis": (at(0, 0.530, -0.010), low), "spine1": (low, mid), "spine2": (mid, high), "spine3": (high, neck),
            "neck": (neck, skull), "head": (skull, crown),
            "clavicle": (clavicle, self.shoulder), "upper_arm": (self.shoulder, self.elbow),
            "forearm": (self.elbow, self.wrist), "hand": (self.wrist, fingers),
            "thigh": (hip, knee), "shin": (knee, ankle), "foot": (ankle, toes),
        }  # fmt: skip
        joints, tips = np.zeros((len(JOINTS), 3)), np.zeros((len(JOINTS), 3))
        for j, name in enumerate(JOINTS):
            stem = name[:-2] if name[-2:] in ("_l", "_r") else name
            side = np.array([-1.0 if name.endswith("_r") else 1.0, 1, 1])
            joints[j], tips[j] = ends[stem][0] * side, ends[stem][1] * side
        return Skeleton(joints, tips)


def _tilted(yaw: float, roll: float) -> F64:
    """Axes turned by yaw about y, then by roll about z [rad]: what lies flat on the left half of a chest."""
    a, b = np.cos(yaw), np.sin(yaw)
    c, d = np.cos(roll), np.sin(roll)
    return np.array([[c, d, 0], [-d, c, 0], [0, 0, 1]]) @ np.array([[a, 0, -b], [0, 1, 0], [b, 0, a]])


def thickened(rows: F64, factors: F64, middle: float) -> F64:
    """Rows with width, front and back scaled about the middle of each section."""
    rows = rows.copy()
    factor = PchipInterpolator(factors[:, 0], factors[:, 1])(np.clip(rows[:, 0], factors[0, 0], factors[-1, 0]))
    centre = rows[:, 4] + middle * (rows[:, 3] - rows[:, 4])
    rows[:, 2] *= factor
    rows[:, 3] = centre + factor * (rows[:, 3] - centre)
    rows[:, 4] = centre + factor * (rows[:, 4] - centre)
    return rows


def _facing_front(rows: F64) -> F64:
    """Rows for a tube whose v axis (axis × across) points to the back: front and back change places."""
    turned = rows.copy()
    turned[:, 3], turned[:, 4] = -rows[:, 4], -rows[:, 3]
    return turned


def _limb(start: F64, axis: F64, length: float, rows: ArrayLike, factors: ArrayLike) -> Tube:
    """Rows along an arm: `across` lies in the plane of the arm, v points forward."""
    forward = np.array([0.0, 0, 1])
    across = np.cross(forward, axis)
    across /= np.linalg.norm(across)
    table = thickened(np.array(rows, np.float64), np.asarray(factors, np.float64), 0.5)
    table[:, 0] *= length
    return Tube(start, axis, across, table, 0.5)
