"""One fibre, as spheres and as particles (paper 2.1)."""

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fibre.fibre import FibreParticles, particles_in
from taichi_cloth.fibre.sphere_surface import sphere_surface_points
from taichi_cloth.ground.particles import FibreCloud

from ..prepare.strands import fibre_spheres
from ..prepare.thread_colours import fibre_colour
from ..prepare.yarns import fibre_kind
from ..scene.schema import Scene
from .facts import Fact
from .model import Numbers, Panel, particles_of

__all__ = ["FibreModel", "upright"]

SURFACE_POINTS = 400_000
SURFACE_COVER = 1.6
"""Radius of a point on a surface over the side of the square that it stands for: π 1.6² = 8 lie over each other."""


class FibreModel:
    """One fibre: its sphere set (Figure 1) beside the particles that fill it (Figure 2)."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.frames = scene, 1
        section, self.kind = scene.fibre, fibre_kind(scene)
        self.spheres = fibre_spheres(scene)
        self.filled: FibreParticles = particles_in(
            self.spheres, spacing_m=section.spacing_um * 1e-6, jitter=section.jitter, seed=scene.seed
        )
        self.albedo = fibre_colour(scene)

    def step(self, frame: int) -> None:
        """A fibre at rest does not move."""

    def panels(self) -> list[Panel]:
        surface = sphere_surface_points(self.spheres, SURFACE_POINTS, seed=self.scene.seed)
        points, normals = surface.positions, surface.normals
        n = len(points)
        size = SURFACE_COVER * (surface.area_m2 / n) ** 0.5
        shell = FibreCloud(
            position=points.astype(np.float32),
            tangent=np.tile(np.array([1, 0, 0], np.float32), (n, 1)),
            normal=normals.astype(np.float32),
            colour=np.tile(np.array([[0.30, 0.42, 0.60]], np.float32), (n, 1)),
            radius=np.full(n, size, np.float32),
            half_length=np.full(n, size, np.float32),
            openness=np.ones(n, np.float32),
        )
        f, size = self.filled, self.scene.fibre.particle_size * self.scene.fibre.spacing_um * 1e-6
        m = len(f.positions)
        rng = np.random.Generator(np.random.Philox(key=[self.scene.seed, 7]))
        tone = 1.0 + 0.05 * rng.standard_normal((m, 1)).clip(-2, 2)
        depth = np.clip(f.depths / max(float(f.depths.max()), 1e-12), 0.0, 1.0)
        body = FibreCloud(
            position=f.positions.astype(np.float32),
            tangent=f.tangents.astype(np.float32),
            normal=f.normals.astype(np.float32),
            colour=np.clip(self.albedo * tone, 0, 1).astype(np.float32),
            radius=np.full(m, size, np.float32),
            half_length=np.full(m, 1.6 * size, np.float32),
            openness=(1.0 - 0.8 * depth).astype(np.float32),
        )
        clouds = [upright(shell), upright(body)]
        bounds = np.concatenate([c.position for c in clouds])
        name = self.kind.name if self.scene.fibre.spheres is None else "own fibre"
        captions = (f"{name}: {len(self.spheres.radii):,} spheres", f"{m:,} particles")
        return [
            Panel(particles_of(c), bounds, words, numbers=partial(_one_fibre, len(c.radius), k))
            for k, (c, words) in enumerate(zip(clouds, captions, strict=True))
        ]

    def facts(self) -> list[Fact]:
        low, high = self.spheres.bounding_box()
        size = 1e6 * (high - low)
        return [
            Fact("fibre", self.kind.name if self.scene.fibre.spheres is None else "own sphere set"),
            Fact("size", f"{size[0]:.0f} × {size[1]:.1f} × {size[2]:.1f} µm"),
            Fact("density", f"{self.kind.density_kg_m3:.0f} kg/m³"),
            Fact("fineness", f"{self.kind.fineness_dtex:.2f} dtex"),
        ]


def _one_fibre(count: int, part: int) -> Numbers:
    parts = {0: "sphere set", 1: "particles"}
    return Numbers(
        np.zeros(count, np.int32), np.full(count, part, np.int32), {0: {"system": "fibre", "index": 0}}, parts
    )


def upright(cloud: FibreCloud) -> FibreCloud:
    """Turned so that the x axis stands upright and centred."""

    def turn(v: NDArray) -> NDArray:
        return np.stack([-v[:, 1], v[:, 0], v[:, 2]], -1)

    position = turn(cloud.position)
    position = position - np.array([0.0, (position[:, 1].min() + position[:, 1].max()) / 2, 0.0], np.float32)
    return replace(cloud, position=position, tangent=turn(cloud.tangent), normal=turn(cloud.normal))
