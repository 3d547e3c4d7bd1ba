"""Timing of drawing: the splatter's paths and stages on the swatch, and how cost grows from 10⁵ particles on."""

import resource
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from taichi_cloth.detail.streaming import FabricStream
from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.layout import Detail, Threads, lay_out
from taichi_cloth.fabric.pose import pose_points
from taichi_cloth.ground import runtime
from taichi_cloth.weave.crimp import Interlacing
from taichi_cloth.yarn.yarn import Yarn

from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import box_corners, frame
from ...render.data.light import Lighting
from ...render.data.particles import Particles
from ...render.data.sprites import CRISP, SOFT, Profile
from ...render.splat.splat import Splatter
from ...render.splat.stream import StreamStats, stream
from ..models.build import build
from ..scene.load import load_scene

__all__ = ["render_profile_lines", "scaling_source"]

WIDTH, HEIGHT = 1280, 720
PER_BLOCK = 24
"""Particles of a block in the scaling table: 2 plies of 4 fibres in 3 steps."""
ONE_SIZE = 1e6
"""Particles of the cloth that fills WIDTH × HEIGHT where all are seen from its distance."""


def scaling_source(particles: float, *, target: float = 0.0) -> FabricStream:
    """A square plain-woven cloth of about that many particles, ready to stream."""
    side = max(8, round((particles / (2 * PER_BLOCK)) ** 0.5))
    yarn = Yarn(count_tex=20, plies=2, twist_per_m=700)
    d = yarn.woven_diameter
    spacing, thick = np.full(side, 2.2 * d), np.full(side, 0.7 * d)
    cloth = Interlacing(
        warp_up=(np.add.outer(np.arange(side), np.arange(side)) % 2 == 0),
        warp_spacing_m=spacing,
        weft_spacing_m=spacing,
        warp_diameter_m=thick,
        weft_diameter_m=thick,
        warp_flat_m=0.6 * thick,
        weft_flat_m=0.6 * thick,
        periodic=False,
    )
    place = np.asarray(np.arange(side) * 2.2 * d, np.float64)
    families = [
        Threads(place, thick, 1.6 * thick, np.tile(np.asarray(shade, np.float32), (side, 1)), yarn)
        for shade in ((0.05, 0.12, 0.4), (0.7, 0.65, 0.5))
    ]
    layout = lay_out(cloth, *families, detail=Detail(fibres=4, steps=3, variants=4, fringe=0))
    return FabricStream(build_fabric(layout), pose_points(layout, "wave", amount=0.5), target=target)


def render_profile_lines(
    name: str,
    overrides: list[str] | None = None,
    *,
    largest: float = 1e7,
    repeats: int = 9,
    arch: Any = "cpu",
    threads: int | None = None,
) -> Iterator[str]:
    """Medians of the ways to draw a scene, their stages, and the scaling table up to `largest` particles."""
    scene = load_scene(name, overrides)
    runtime.start(arch, threads=threads, pin=True)
    model = build(scene)
    particles = model.panels()[0].particles
    cameras = [
        frame(particles.position, width=WIDTH, height=HEIGHT, elevation=45, azimuth=2.0 * k) for k in range(repeats + 1)
    ]
    yield f"{name}: {len(particles):,} particles, {WIDTH} × {HEIGHT} px, medians of {repeats}"
    yield f"{'':<16}{'ms':>8}{'project':>9}{'sort':>7}{'bin':>7}{'raster':>8}{'tile entries':>14}"
    round_ones = replace(particles, half_length=None)
    plain, full = Lighting(), Lighting(shadows=True, occlusion=True, key_follows_camera=False)
    ways: tuple[tuple[str, Particles | ParticleBlocks, Profile, Lighting], ...] = (
        ("round, soft", round_ones, SOFT, plain),
        ("round, crisp", round_ones, CRISP, plain),
        ("elliptic, soft", particles, SOFT, plain),
        ("elliptic, crisp", particles, CRISP, plain),
        ("shadows, sky", particles, CRISP, full),
        ("light turning", particles, CRISP, replace(full, key_follows_camera=True)),  # a shadow map a view
    )
    for label, drawn, profile, lighting in ways:
        splatter = Splatter(WIDTH, HEIGHT, profile=profile).load(drawn)
        splatter.render(cameras[0], lighting=lighting)
        rows, entries = [], 0
        for camera in cameras[1:]:
            begin = time.perf_counter()
            splatter.render(camera, lighting=lighting)
            total = 1e3 * (time.perf_counter() - begin)
            s = splatter.stats
            assert s is not None
            rows.append((total, s.project_ms, s.sort_ms, s.bin_ms, s.raster_ms))
            entries = s.tile_entries
        ms = np.median(rows, axis=0)
        yield f"{label:<16}{ms[0]:8.1f}{ms[1]:9.1f}{ms[2]:7.1f}{ms[3]:7.1f}{ms[4]:8.1f}{entries:14,}"
    yield f"{'no particles':<16}{_empty(WIDTH, HEIGHT, repeats):8.1f}"
    yield from _scaling_lines(largest, repeats)


def _scaling_lines(largest: float, repeats: int) -> Iterator[str]:
    """The same woven square with more and more threads, every particle drawn: filling one picture, where few particles
    are large ones, and at one size of a particle, on a picture that grows with the cloth."""
    for words, grows in (("that fills the picture", False), ("seen from one distance", True)):
        yield ""
        yield f"streamed, every particle drawn: a woven square {words}"
        yield (
            f"{'particles':>13}{'picture':>13}{'radius px':>10}{'ms':>9}{'fixed ms':>9}{'ns each':>9}{'CPU ns':>8}"
            f"{'batches':>8}{'peak RSS MB':>12}{'thinned ms':>11}"
        )
        n = 1e5
        while n <= largest * 1.01:
            source = scaling_source(n)
            larger = (n / ONE_SIZE) ** 0.5 if grows else 1.0
            width, height = round(WIDTH * larger), round(HEIGHT * larger)
            fixed = _empty(width, height, repeats if n < 5e6 else 1)
            wall, cpu, pixels, stats = _streamed(source, width, height, repeats if n < 5e6 else 1)
            source.target = 0.5
            thinned = _streamed(source, width, height, 1)[0]
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            each, busy = (1e6 * ms / max(stats.particles, 1) for ms in (wall - fixed, cpu - fixed))
            yield (
                f"{stats.particles:13,}{f'{width} × {height}':>13}{pixels:10.3f}{wall:9.0f}{fixed:9.1f}{each:9.1f}"
                f"{busy:8.1f}{stats.batches:8,}{peak:12,.0f}{thinned:11.0f}"
            )
            n *= 10


def _empty(width: int, height: int, repeats: int) -> float:
    """Median milliseconds of a picture of nothing: what every frame costs whatever it shows."""
    camera = frame(np.zeros((1, 3)), width=width, height=height, radius=1.0)
    splatter, took = Splatter(width, height), []
    for _ in range(repeats + 1):
        begin = time.perf_counter()
        splatter.render(camera)
        took.append(1e3 * (time.perf_counter() - begin))
    return float(np.median(took[1:]))


def _streamed(source: FabricStream, width: int, height: int, repeats: int) -> tuple[float, float, float, StreamStats]:
    """Median milliseconds of a picture that the cloth fills, by the clock and of all threads, the mean radius of a
    particle [px], and what it took."""
    points = source.arrays.point
    camera = frame(
        box_corners(points.min(axis=0), points.max(axis=0)), width=width, height=height, elevation=60, margin=0.0
    )
    splatter, took = Splatter(width, height), []
    _, stats = stream(splatter, camera, source)
    for _ in range(repeats):
        begin, busy = time.perf_counter(), time.process_time()
        _, stats = stream(splatter, camera, source)
        took.append((1e3 * (time.perf_counter() - begin), 1e3 * (time.process_time() - busy)))
    wall, cpu = np.median(took, axis=0)
    away = float(np.mean(camera.project(points[:: max(1, len(points) // 1000)])[:, 2]))
    return float(wall), float(cpu), float(source.fabric.bank.radius.mean()) * camera.focal / away, stats
