"""A yarn being twisted (paper 2.2.4): parallel singles whose particles are moved, step by step, by the twist equations.

Step 1 lays the singles side by side (`spin.spin` unfolded, or a sphere set's particles shared evenly, as the paper
does). Step 2 moves every particle: with the yarn along x, and about the yarn's axis by what the twist in front of it
has grown, dφ = φ(x + V·dt, t + dt) − φ(x, t), φ = 2π∫T dx from A. Step 3, the seeded perturbation, is in the singles.
"""

from math import ceil

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.fibre.fibre import particles_in
from taichi_cloth.fibre.sphere_set import SphereSet
from taichi_cloth.ground.arrays import F32x2, Float
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.particles import FibreCloud
from taichi_cloth.yarn.spin import Period, drawn_radius, spin
from taichi_cloth.yarn.twist import zone_twist
from taichi_cloth.yarn.yarn import Yarn

__all__ = ["TwistingYarn"]

F32 = NDArray[np.float32]
LARGEST_TURN = 0.05  # turns that a particle may make in one step; keeps chords of its circle short


class TwistingYarn:
    """A yarn fed at A, twisted at B, taken up at C, shown from `feed` before A to `feed` behind C.

    a, b, feed: [m]. speed V: [m/s] ≥ 0. spin_speed: [turns/s], positive Z. duration: how long it will be run [s].
    fibres: drawn a ply. construction: "fibres" or "lattice". colours: linear, one a ply, repeated.
    Raises InputError as `zone_twist` does, and when stepped beyond `duration`.
    """

    def __init__(
        self,
        yarn: Yarn,
        *,
        a: float,
        b: float,
        speed: float,
        spin_speed: float,
        duration: float,
        feed: float,
        fibres: int,
        construction: str,
        colours: NDArray,
        seed: int,
    ) -> None:
        self.yarn, self.a, self.b, self.speed, self.feed = yarn, a, b, speed, feed
        steps = max(200, ceil(duration * (abs(spin_speed) / LARGEST_TURN + speed / (0.02 * min(a, b)))))
        self.times = np.linspace(0.0, duration, steps + 1)
        zones = zone_twist(self.times, a_m=a, b_m=b, speed_m_s=speed, spin_turns_s=spin_speed)
        self.twist_a, self.twist_b = zones.twist_a, zones.twist_b
        self.at = 0
        start, stop = -feed - speed * duration, a + b + feed
        singles = _fibre_singles if construction == "fibres" else _lattice_singles
        self.position, self.tangent, self.normal, self.half_length, self.radius, self.tone, self.ply = singles(
            yarn, start, stop, fibres, seed
        )
        self.axis_depth = np.clip(np.hypot(self.position[:, 1], self.position[:, 2]) / (yarn.diameter / 2), 0.0, 1.0)
        colours = np.asarray(colours, np.float32)
        self.colour = np.clip(colours[self.ply % len(colours)] * self.tone[:, None], 0.0, 1.0).astype(np.float32)

    @property
    def time(self) -> float:
        return float(self.times[self.at])

    @property
    def twist(self) -> tuple[float, float]:
        """Twist in zones a and b now [turns/m]."""
        return float(self.twist_a[self.at]), float(self.twist_b[self.at])

    def step_to(self, time: float) -> None:
        """Move all particles, step by step, to the step nearest `time` [s]; never backwards."""
        target = int(np.searchsorted(self.times, time - 0.5 * (self.times[1] - self.times[0])))
        if not self.at <= target < len(self.times):
            raise InputError(
                f"twist: cannot step to {time:g} s; from {self.time:g} to {self.times[-1]:g} s is possible"
            )
        while self.at < target:
            k = self.at
            _move(
                self.position, self.normal, self.tangent, self.a, self.a + self.b,
                self.speed * (self.times[k + 1] - self.times[k]),
                self.twist_a[k], self.twist_b[k], self.twist_a[k + 1], self.twist_b[k + 1],
            )  # fmt: skip
            self.at += 1

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which of all particles are in view now, in the order of `cloud`."""
        x = self.position[:, 0]
        return (x >= -self.feed) & (x <= self.a + self.b + self.feed)

    def singles(self) -> NDArray[np.int32]:
        """The single that each particle of `cloud` is of."""
        return self.ply[self.seen].astype(np.int32)

    def cloud(self) -> FibreCloud:
        """The particles in view now; their tangents follow the helix that the twist makes of a straight fibre."""
        seen, x = self.seen, self.position[:, 0]
        twist_a, twist_b = self.twist
        local = np.where(x < 0, 0.0, np.where(x < self.a, twist_a, twist_b))[seen, None] * 2 * np.pi
        p, t = self.position[seen], self.tangent[seen]
        about = np.stack([np.zeros(len(p)), -p[:, 2], p[:, 1]], -1)
        t = t + t[:, :1] * local * about
        length = np.linalg.norm(t, axis=1, keepdims=True)
        return FibreCloud(
            position=p,
            tangent=(t / length).astype(np.float32),
            normal=self.normal[seen],
            colour=self.colour[seen],
            radius=self.radius[seen],
            half_length=(self.half_length[seen] * length[:, 0]).astype(np.float32),
            openness=(0.25 + 0.75 * self.axis_depth[seen] ** 2).astype(np.float32),
        )


def _fibre_singles(yarn: Yarn, start: float, stop: float, fibres: int, seed: int) -> tuple[NDArray, ...]:
    """Parallel singles of continuous fibres, in rows flattened to particles."""
    step = yarn.diameter / 5
    count = ceil((stop - start) / step)
    length = stop - start
    twist = yarn.singles_twist_per_m * length * (1 if yarn.singles_twist == "Z" else -1)
    period = Period(length / count, count, 0, round(twist))
    s = spin(yarn, period, fibres=fibres, steps=1, start=0.0, stop=length, seed=seed, folded=False)
    rows, points = s.half_length.shape
    position = s.position.reshape(-1, 3)
    position[:, 0] += start
    each = np.repeat(np.arange(rows), points)
    return (
        np.ascontiguousarray(position, np.float32),
        np.ascontiguousarray(s.tangent.reshape(-1, 3), np.float32),
        np.ascontiguousarray(s.normal.reshape(-1, 3), np.float32),
        s.half_length.ravel().astype(np.float32),
        s.radius.ravel().astype(np.float32),
        s.tone[each],
        s.ply[each],
    )


def _lattice_singles(yarn: Yarn, start: float, stop: float, fibres: int, seed: int) -> tuple[NDArray, ...]:
    """The paper's Step 1: the particles of one sphere set, shared evenly between parallel segments.

    The spheres stand in a row along the yarn, as wide as a single; the lattice is as fine as `fibres` a section.
    """
    r = yarn.single_diameter / 2
    centres = np.arange(start, stop, r / 2)
    row = SphereSet(np.stack([centres, 0 * centres, 0 * centres], -1), np.full(len(centres), r))
    spacing = r * float(np.sqrt(np.pi / (fibres * yarn.plies)))
    filled = particles_in(row, spacing_m=spacing, seed=seed)
    order = np.argsort(filled.positions[:, 0], kind="stable")
    ply = np.empty(len(order), np.int32)
    ply[order] = np.arange(len(order)) % yarn.plies  # dealt out along the yarn: as many to each, all along it
    position = filled.positions.copy()
    angle = 2 * np.pi / yarn.plies * ply
    position[:, 1] += yarn.ply_offset * np.cos(angle)
    position[:, 2] += yarn.ply_offset * np.sin(angle)
    n = len(position)
    rng = np.random.Generator(np.random.Philox(key=[seed, 5]))
    return (
        np.ascontiguousarray(position, np.float32),
        np.tile(np.array([1, 0, 0], np.float32), (n, 1)),
        np.ascontiguousarray(filled.normals, np.float32),
        np.full(n, 1.2 * spacing, np.float32),
        np.full(n, max(0.5 * spacing, drawn_radius(yarn, fibres) / 2), np.float32),
        1.0 + 0.06 * rng.standard_normal(n).clip(-2, 2),
        ply,
    )


@ti.func
def _turned(x: Float, a: Float, c: Float, twist_a: Float, twist_b: Float) -> Float:
    """φ(x) = 2π∫T from A [rad]; nothing turns before A or behind C."""
    return 2 * ti.math.pi * (twist_a * ti.math.clamp(x, 0.0, a) + twist_b * ti.math.clamp(x - a, 0.0, c - a))


@ti.kernel
def _move(
    position: F32x2,
    normal: F32x2,
    tangent: F32x2,
    a: Float,
    c: Float,
    advance: Float,
    twist_a0: Float,
    twist_b0: Float,
    twist_a1: Float,
    twist_b1: Float,
):
    for p in range(position.shape[0]):
        x0 = position[p, 0]
        x1 = x0 + advance
        position[p, 0] = x1
        if x0 < c:
            turn = _turned(x1, a, c, twist_a1, twist_b1) - _turned(x0, a, c, twist_a0, twist_b0)
            cs, sn = ti.cos(turn), ti.sin(turn)
            for v in ti.static((position, normal, tangent)):
                y, z = v[p, 1], v[p, 2]
                v[p, 1] = cs * y - sn * z
                v[p, 2] = sn * y + cs * z
