"""From key points to fibres: the rules, and ever fewer key points, against a fabric whose every crossing is one.

The cloth is bent without stretch: along the direction s, 30° off the weft, its slope swings as θ sin(2π s/λ).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from math import pi

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.blocks import Fabric, build_fabric
from taichi_cloth.crossings import refine_points
from taichi_cloth.follow import FibreFollower
from taichi_cloth.follow_rule import FollowRule
from taichi_cloth.forces import Forces
from taichi_cloth.sheet import Sheet
from taichi_cloth.simulation import Simulation
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.springs import calibrate

from ..load import load_scene
from ..moving import material_of, woven_scene
from ..prepare import prepare_fabric
from .study import Axis, Row, Study, cpu_seconds

__all__ = ["STUDY", "bent", "bilinear", "errors", "rows"]

F64 = NDArray[np.float64]
PITCH = 1 / 78 / 4
"""Between threads [m], as in `drape`, whose key points are four of them apart."""
DEFAULT = 4
WAVE, SLOPE, COURSE = 0.2, 0.7, pi / 6  # λ [m], θ [rad], direction of s off the weft [rad]
MARGIN = 24
"""Threads from an edge from which on a particle counts as away from it."""

RULES: dict[str, tuple[bool, FollowRule]] = {
    "paper: linear, offsets in the world's axes": (False, "paper"),
    "linear, offsets in the cloth's frame": (False, "linear"),
    "smooth, offsets in the cloth's frame": (True, "smooth"),
}
"""Whether crossings lie on splines or on straight lines between key points, and the follower's rule."""


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
        "drape",
        [
            f"cloth.columns={threads}",
            f"cloth.rows={threads}",
            f"cloth.width_m={PITCH * (threads - 1)}",
            f"cloth.length_m={PITCH * (threads - 1)}",
            "cloth.threads_per_key_point=1",
        ],
    )
    return build_fabric(prepare_fabric(woven_scene(scene)).layout)


def _frame_of_simulation(points: F64, k: int) -> float:
    """CPU time [s] of a frame of 1/60 s of the key points."""
    scene = load_scene("drape")
    assert scene.cloth is not None
    material = material_of(scene.cloth)
    springs = calibrate(material, spacing_x=k * PITCH, spacing_y=k * PITCH)
    sheet = Sheet.rectangle(len(points), len(points), material=material, springs=springs)
    simulation = Simulation(sheet, Verlet(sheet, Forces()), forces=Forces(), positions=points)
    return cpu_seconds(simulation.step, 3)


def rows(quick: bool) -> Iterator[Row]:
    threads, ratios = (49, (2, 4, 8, 16)) if quick else (97, (3, 4, 6, 8, 12, 16, 24))
    exact = bent(threads)
    moving = {float(k): _frame_of_simulation(exact[::k, ::k], k) for k in ratios}
    for row in errors(threads, ratios):
        yield replace(row, seconds=row.seconds + moving[row.value])


def errors(threads: int, ratios: Sequence[int]) -> Iterator[Row]:
    """Rows of a cloth of threads × threads with a key point every so many; the time is that of following alone."""
    fabric, exact = _fabric(threads), bent(threads)
    flat = np.zeros_like(exact)
    flat[..., :2] = PITCH * np.stack(np.meshgrid(np.arange(threads), np.arange(threads)), -1)
    best = FibreFollower(fabric)
    best.follow(exact)
    truth = best.cloud().position
    best.follow(flat)
    edge = MARGIN * (threads - 1) / 96 * PITCH
    place = best.cloud().position[:, :2]
    inner = ((place > edge) & (place < PITCH * (threads - 1) - edge)).all(axis=1)
    for method, (smooth, rule) in RULES.items():
        follower = FibreFollower(fabric, rule=rule, rest=flat)
        for k in ratios:
            points = exact[::k, ::k]
            splines = partial(refine_points, points, None, k)
            # The splines' kernel is timed for all: what lines cost in NumPy says nothing of the rule.
            cost = cpu_seconds(splines) + cpu_seconds(
                partial(follower.follow, splines() if smooth else bilinear(points, k))
            )
            off = ((follower.cloud().position - truth) ** 2).sum(axis=1)
            for panel, chosen in (("whole cloth", np.ones(len(off), bool)), ("away from its edges", inner)):
                yield Row(
                    panel=panel,
                    method=method,
                    knob=f"{k} threads",
                    value=float(k),
                    error=float(np.sqrt(off[chosen].mean())),
                    seconds=cost,
                    default=k == DEFAULT and rule == "smooth",
                )


STUDY = Study(
    name="interpolation",
    title="Interpolation: from key points to fibres",
    about=f"A fabric of threads {1e3 * PITCH:.1f} mm apart, bent without stretch into waves of {1e3 * WAVE:.0f} mm, "
    "and fibres that follow ever fewer key points, which lie on the surface exactly. Reference: the fully resolved "
    "fabric, every crossing a key point. Error: root mean square over all fibre particles. Time: a frame of 1/60 s of "
    "those key points by Verlet, the crossings and the fibres.",
    error=Axis("error of fibres, rms", "µm", 1e6),
    time=Axis("CPU time a frame", "ms", 1e3),
    rows=rows,
    why={"smooth, offsets in the cloth's frame": "its error is a small part of a pixel where all of a cloth is seen"},
    claimed={
        "away from its edges: linear, offsets in the cloth's frame": 2.0,
        "away from its edges: smooth, offsets in the cloth's frame": 3.0,
    },
)
