"""From key points to fibres: the rules, and ever fewer key points, against a fabric whose every crossing is one.

Once the cloth is simulated, every yarn of it: it falls on a ball and hangs in folds. What interpolation alone costs is
seen where key points are crossings of that cloth; what fewer key points cost altogether, where they are simulated too.
And once it is bent without stretch into waves that are known exactly: along the direction s, 30° off the weft, the
slope swings as θ sin(2π s/λ).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import pi

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.crossings import refine_points
from taichi_cloth.fabric.fabric import Fabric, build_fabric
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.fabric.follow_rule import FollowRule
from taichi_cloth.motion.forces import Forces, Sphere
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet

from ..measure.study import Axis, Row, Study, cpu_seconds
from ..paper.own_scenes import PAPER_DRAPE
from ..prepare.sheet_setup import material_of, woven_scene
from ..prepare.weave_layout import prepare_fabric
from ..scene.load import load_scene

__all__ = ["STUDY", "Cloth", "bent", "bilinear", "draped", "errors", "rows", "wave"]

F64 = NDArray[np.float64]
PITCH = 1 / 78 / 4
"""Between threads [m], as in Figure 9 of the paper, whose key points are four of them apart."""
DEFAULT = 4
WAVE, SLOPE, COURSE = 0.2, 0.7, pi / 6  # λ [m], θ [rad], direction of s off the weft [rad]
MARGIN = 24
"""Threads from an edge from which on a particle counts as away from it."""
BALL, FALL, AIR = 0.07, 1.0, 4.0  # radius [m], time [s] after which the cloth has come to hang, damping [1/s]

RULES: dict[str, tuple[bool, FollowRule]] = {
    "paper: linear, offsets in the world's axes": (False, "paper"),
    "linear, offsets in the cloth's frame": (False, "linear"),
    "smooth, offsets in the cloth's frame": (True, "smooth"),
}
"""Whether crossings lie on splines or on straight lines between key points, and the follower's rule."""

SMOOTH = tuple(RULES)[-1:]


@dataclass(frozen=True)
class Cloth:
    """panel: of its diagram. crossings: (threads, threads, 3) [m]. points: key points, one every so many threads.
    edges: whether particles near its edges count. methods: of `RULES`."""

    panel: str
    crossings: F64
    points: Callable[[int], F64]
    edges: bool = True
    methods: tuple[str, ...] = tuple(RULES)


def bent(threads: int) -> F64:
    """Crossings (threads, threads, 3) [m] on the bent surface, exact to 1e-9 m."""
    at = PITCH * np.arange(threads)
    x, y = at[None, :], at[:, None]
    along, across = x * np.cos(COURSE) + y * np.sin(COURSE), y * np.cos(COURSE) - x * np.sin(COURSE)
    fine = np.linspace(0, along.max(), 20_001)
    angle = SLOPE * np.sin(2 * pi * fine / WAVE)
    path = [
        np.concatenate([[0.0], np.cumsum((f[1:] + f[:-1]) / 2 * np.diff(fine))]) for f in (np.cos(angle), np.sin(angle))
    ]
    place, height = (np.interp(along, fine, one) for one in path)
    east, north = np.cos(COURSE), np.sin(COURSE)
    return np.stack([place * east - across * north, place * north + across * east, height], axis=-1)


def bilinear(points: F64, k: int) -> F64:
    """Crossings on straight lines between key points, along one direction and then the other."""
    for axis in (0, 1):
        x = np.moveaxis(points, axis, 0)
        at = np.arange((len(x) - 1) * k + 1)
        low = np.minimum(at // k, len(x) - 2)
        share = ((at - low * k) / k)[:, None, None]
        points = np.moveaxis((1 - share) * x[low] + share * x[low + 1], 0, axis)
    return points


def _fabric(threads: int) -> Fabric:
    scene = load_scene(
        PAPER_DRAPE,
        [
            f"cloth.columns={threads}",
            f"cloth.rows={threads}",
            f"cloth.width_m={PITCH * (threads - 1)}",
            f"cloth.length_m={PITCH * (threads - 1)}",
            "cloth.threads_per_key_point=1",
        ],
    )
    return build_fabric(prepare_fabric(woven_scene(scene)).layout)


def _sheet(threads: int, k: int) -> Sheet:
    """Of a cloth of threads × threads with a key point every k, as Figure 9 has it."""
    scene = load_scene(PAPER_DRAPE)
    assert scene.cloth is not None
    material = replace(material_of(scene.cloth).linear, air_damping=AIR)
    points = (threads - 1) // k + 1
    springs = calibrate(material, spacing_x=k * PITCH, spacing_y=k * PITCH)
    return Sheet.rectangle(points, points, material=material, springs=springs)


def draped(threads: int, k: int) -> F64:
    """Key points [m] of the cloth after it has fallen, level, on a ball under its middle."""
    sheet, middle = _sheet(threads, k), (threads - 1) / 2 * PITCH
    ball = Sphere(centre=(middle, middle, -BALL - 1e-3), radius=BALL)
    forces = Forces(gravity=(0.0, 0.0, -9.81), sphere=ball)
    simulation = Simulation(sheet, Verlet(sheet, forces), forces=forces, positions=sheet.flat())
    while simulation.time < FALL:
        simulation.step()
    return simulation.positions.astype(np.float64)


def _frame_of_simulation(threads: int, k: int) -> float:
    """CPU time [s] of a frame of 1/60 s of the key points."""
    sheet = _sheet(threads, k)
    simulation = Simulation(sheet, Verlet(sheet, Forces()), forces=Forces(), positions=sheet.flat())
    return cpu_seconds(simulation.step, 3)


def wave(threads: int) -> tuple[Cloth, Cloth]:
    """The bent cloth, whole and away from its edges."""
    x = bent(threads)

    def points(k: int) -> F64:
        return x[::k, ::k]

    return Cloth("bent, whole", x, points), Cloth("bent, away from its edges", x, points, edges=False)


def rows(quick: bool) -> Iterator[Row]:
    threads, ratios = (49, (2, 4, 8, 16)) if quick else (97, (3, 4, 6, 8, 12, 16, 24))
    resolved = draped(threads, 1)
    cloths = (
        Cloth("draped, key points taken from it", resolved, lambda k: resolved[::k, ::k]),
        Cloth("draped, key points simulated", resolved, partial(draped, threads), methods=SMOOTH),
        *wave(threads),
    )
    moving = {float(k): _frame_of_simulation(threads, k) for k in ratios}
    for row in errors(threads, ratios, cloths):
        yield replace(row, seconds=row.seconds + moving[row.value])


def errors(threads: int, ratios: Sequence[int], cloths: Sequence[Cloth]) -> Iterator[Row]:
    """Rows of cloths of threads × threads with a key point every so many; the time is that of following alone."""
    fabric = _fabric(threads)
    flat = np.zeros((threads, threads, 3))
    flat[..., :2] = PITCH * np.stack(np.meshgrid(np.arange(threads), np.arange(threads)), -1)
    best = FibreFollower(fabric)
    best.follow(flat)
    edge = MARGIN * (threads - 1) / 96 * PITCH
    place = best.cloud().position[:, :2]
    inner = ((place > edge) & (place < PITCH * (threads - 1) - edge)).all(axis=1)
    followers = {method: FibreFollower(fabric, rule=rule, rest=flat) for method, (_, rule) in RULES.items()}
    for cloth in cloths:
        best.follow(cloth.crossings)
        truth = best.cloud().position
        key_points = {k: cloth.points(k) for k in ratios}
        for method in cloth.methods:
            follower, (smooth, rule) = followers[method], RULES[method]
            for k, points in key_points.items():
                splines = partial(refine_points, points, None, k)
                # The splines' kernel is timed for all: what lines cost in NumPy says nothing of the rule.
                cost = cpu_seconds(splines) + cpu_seconds(
                    partial(follower.follow, splines() if smooth else bilinear(points, k))
                )
                off = ((follower.cloud().position - truth) ** 2).sum(axis=1)
                yield Row(
                    panel=cloth.panel,
                    method=method,
                    knob=f"{k} threads",
                    value=float(k),
                    error=float(np.sqrt(off.mean() if cloth.edges else off[inner].mean())),
                    seconds=cost,
                    default=k == DEFAULT and rule == "smooth",
                )


STUDY = Study(
    name="interpolation",
    title="Interpolation: from key points to fibres",
    about=f"Fibres of a fabric of threads {1e3 * PITCH:.1f} mm apart that follow ever fewer key points. Reference: the "
    "fully resolved fabric, every crossing a key point. Draped: a cloth that has fallen on a ball of "
    f"{2e3 * BALL:.0f} mm, every yarn simulated; key points are crossings taken from it, which shows what "
    "interpolation alone costs, or simulated themselves, and then folds differ too. Bent: without stretch, into waves "
    f"of {1e3 * WAVE:.0f} mm. Error: root mean square over fibre particles. Time: a frame of 1/60 s of those key "
    "points by Verlet, the crossings and the fibres.",
    error=Axis("error of fibres, rms", "µm", 1e6),
    time=Axis("CPU time a frame", "ms", 1e3),
    rows=rows,
    why={"smooth, offsets in the cloth's frame": "its error is a small part of a pixel where all of a cloth is seen"},
    claimed={
        "bent, away from its edges: linear, offsets in the cloth's frame": 2.0,
        "bent, away from its edges: smooth, offsets in the cloth's frame": 3.0,
    },
)
