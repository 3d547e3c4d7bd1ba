"""How long building and drawing take here: a scene's own stages, and two fixed pieces of work to compare by.

The fixed work: a woven fabric of at least 500,000 particles built from its layout, and a T-shirt's worth of
particles (the paper's Table 1: 377,508) drawn at 1280 × 720 while the camera turns.
"""

from collections.abc import Callable, Iterator
from math import cos, pi, sin
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.pose import pose_points
from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError

from ...render.data.camera import Camera, look_at
from ...render.data.particles import Particles
from ...render.data.sprites import SOFT
from ...render.splat.splat import Splatter
from ..commands.device import cpu_for
from ..models.build import build
from ..models.fabric_model import FabricModel
from ..picture.view import View
from ..prepare.weave_layout import prepare_fabric
from ..scene.load import load_scene, make_scene
from ..scene.schema import Scene
from .machine import cores, cpu_name

__all__ = ["garment", "profile_lines", "woven_of_at_least"]

SIZE = (1280, 720)
FABRIC_PARTICLES = 500_000
GARMENT_PARTICLES = 377_508
GARMENT_RADIUS_PX = 2.5
DISTANCE = 1.25  # from the camera to the garment's middle [m]
FOCAL = 1142.0  # [px]
VIEWS = 36


def profile_lines(
    name: str, overrides: list[str] | None = None, *, repeats: int = 15, arch: Any = "cpu", threads: int | None = None
) -> Iterator[str]:
    """Time a scene and the fixed work, `repeats` runs of each; kernels are compiled before. Starts Taichi.

    Gives lines: medians with the least and the greatest. Raises InputError before Taichi starts for bad input.
    """
    if not 1 <= repeats <= 10_000:
        raise InputError(f"--repeats: {repeats}; allowed: 1 to 10000")
    scene = load_scene(name, overrides)
    if scene.subject == "fabric":
        prepare_fabric(scene)
    if scene.subject in ("cloth", "garment"):
        arch = cpu_for("profile of cloth in motion", arch)
    started = runtime.start(arch, threads=threads, pin=True)
    yield f"{cpu_name()}, {cores()} cores; Taichi on {started.arch}, {started.threads} threads"
    yield f"medians of {repeats} (least to greatest)"
    if scene.subject == "cloth":
        from .profile_cloth import cloth_profile_lines

        yield f"scene {name}"
        yield from cloth_profile_lines(scene, repeats=repeats)
        return
    yield from _scene_lines(scene, name, repeats)
    yield from _fabric_lines(repeats)
    yield from _garment_lines(repeats)


def _scene_lines(scene: Scene, name: str, repeats: int) -> Iterator[str]:
    """The stages of building this scene, then those of drawing it."""
    yield f"scene {name}"
    if scene.subject == "fabric":
        pose = scene.fabric.pose if scene.fabric else "flat"
        yield _line("lay out", _times(lambda: prepare_fabric(scene), repeats))
        prepared = prepare_fabric(scene)
        yield _line("templates", _times(lambda: build_fabric(prepared.layout), repeats))
        model = build(scene, prepared)
        assert isinstance(model, FabricModel)
        fabric = model.fabric
        yield _line("key points", _times(lambda: pose_points(prepared.layout, pose), repeats))
        times = _times(lambda: fabric.cloud(model.points), repeats)
        yield _line("particles", times, f"{fabric.particles:,} particles, {_rate(fabric.particles, times)}")
    else:
        yield _line("build", _times(lambda: build(scene), repeats))
        model = build(scene)
    model.step(model.frames - 1)
    particles = sum(len(panel.particles) for panel in model.panels())
    view = View(model, SIZE)
    stages: list[list[float]] = []
    total: list[float] = []
    frames = view.turntable(repeats + 1, list(range(repeats + 1)))
    next(frames)
    for _ in range(repeats):
        begin = perf_counter()
        next(frames)
        total.append(1e3 * (perf_counter() - begin))
        stages.append(
            [sum(getattr(s, f"{stage}_ms") for s in view.stats) for stage in ("project", "sort", "bin", "raster")]
        )
    for stage, times in zip(("project", "sort", "bin", "raster"), zip(*stages, strict=True), strict=True):
        yield _line(stage, list(times))
    yield _line("frame", total, f"{particles:,} particles at {SIZE[0]} × {SIZE[1]}, {_rate(particles, total)}")


def _fabric_lines(repeats: int) -> Iterator[str]:
    """A fabric of at least 500,000 particles, from its layout to the particles, templates included."""
    scene = woven_of_at_least(FABRIC_PARTICLES)
    prepared = prepare_fabric(scene)
    points = pose_points(prepared.layout)
    times = _times(lambda: build_fabric(prepared.layout).cloud(points), repeats)
    yield f"a fabric of at least {FABRIC_PARTICLES:,} particles; wanted: under 1000 ms"
    words = f"{prepared.particles:,} particles, {_rate(prepared.particles, times)}"
    yield _line("built", times, f"{words}; {_verdict(times, 1000.0)}")


def _garment_lines(repeats: int) -> Iterator[str]:
    """A T-shirt's worth of round splats, the camera turning each frame."""
    splatter = Splatter(*SIZE, profile=SOFT).load(garment())
    image = np.empty((SIZE[1], SIZE[0], 3), np.uint8)
    cameras = [_turned(k) for k in range(VIEWS)]
    drawn = 0

    def one() -> None:
        nonlocal drawn
        splatter.render(cameras[drawn % VIEWS], out=image)
        drawn += 1

    times = _times(one, repeats)
    yield f"a garment of {GARMENT_PARTICLES:,} particles, {GARMENT_RADIUS_PX} px, at {SIZE[0]} × {SIZE[1]}"
    yield _line("drawn", times, _rate(GARMENT_PARTICLES, times))


def woven_of_at_least(particles: int) -> Scene:
    """The swatch with as few threads as give that many particles."""
    threads = 8
    while True:
        own = [f"weave.ends={threads}", f"weave.picks={threads}", "yarn.fibres=12", "fabric.pose=flat"]
        scene = load_scene("swatch", own)
        made = prepare_fabric(scene).particles
        if made >= particles:
            return scene
        threads = max(threads + 2, int(0.98 * threads * (particles / made) ** 0.5))


def garment(count: int = GARMENT_PARTICLES, *, seed: int = 7) -> Particles:
    """Exactly `count` particles of a plain weave of ours, hung as a tube of a T-shirt's size (1 m round, 0.62 m high).

    Two particles abreast and three along between crossings, as coarse as the count asks. Round splats, whose
    radius is 2.5 px in the mean for the profile's camera.
    """
    around, high = 1.0, 0.62
    picks = round((1.02 * count / 12 * high / around) ** 0.5)
    ends = round(picks * around / high)
    scene = make_scene(
        {
            "seed": seed,
            "yarn": {"count_tex": 1500, "plies": 2, "fibres": 1, "twist_per_m": 60, "hairiness": {"ends_per_m": 0}},
            "weave": {"draft": "plain", "ends": ends, "picks": picks},
            "fabric": {"ends_per_cm": 0.01 * ends / around, "picks_per_cm": 0.01 * picks / high, "steps": 3},
        }
    )
    fabric = build_fabric(prepare_fabric(scene).layout)
    angle, height = -2 * pi * np.arange(ends) / ends, high * np.arange(picks)[::-1] / (picks - 1)
    points = np.empty((picks, ends, 3), np.float32)
    points[..., 0], points[..., 2] = 0.19 * np.sin(angle), 0.125 * np.cos(angle)
    points[..., 1] = height[:, None]
    cloud = fabric.cloud(points)
    rng = np.random.Generator(np.random.Philox(seed))
    kept = np.sort(rng.permutation(len(cloud))[:count])
    mean = GARMENT_RADIUS_PX * DISTANCE / FOCAL
    return Particles(
        position=cloud.position[kept],
        radius=_spread(rng, count) * np.float32(mean),
        colour=cloud.colour[kept],
        tangent=cloud.tangent[kept],
        normal=cloud.normal[kept],
    )


def _spread(rng: np.random.Generator, count: int) -> NDArray[np.float32]:
    return np.clip(1.0 + 0.15 * rng.standard_normal(count), 0.5, 1.6).astype(np.float32)


def _turned(k: int) -> Camera:
    """View k of the garment."""
    turn, up = 2 * pi * k / VIEWS, 0.12
    at = np.array([0.0, 0.30, 0.0])
    eye = at + DISTANCE * np.array([sin(turn) * cos(up), sin(up), cos(turn) * cos(up)])
    fov = 2 * np.degrees(np.arctan(SIZE[1] / 2 / FOCAL))
    return look_at(eye, at, width=SIZE[0], height=SIZE[1], fov=float(fov))


def _times(work: Callable[[], object], repeats: int) -> list[float]:
    """Milliseconds of each of `repeats` runs, after one that is not timed."""
    work()
    times = []
    for _ in range(repeats):
        begin = perf_counter()
        work()
        times.append(1e3 * (perf_counter() - begin))
    return times


def _line(stage: str, times: list[float], words: str = "") -> str:
    median = f"{np.median(times):.1f}"
    return f"  {stage:<10} {median:>8} ms  ({min(times):.1f} to {max(times):.1f})  {words}".rstrip()


def _rate(particles: int, times: list[float]) -> str:
    return f"{particles / np.median(times) / 1e3:.1f} million particles/s"


def _verdict(times: list[float], limit_ms: float) -> str:
    return "met" if np.median(times) < limit_ms else "not met"
