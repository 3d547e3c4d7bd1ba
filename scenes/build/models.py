"""What a scene builds: one class a subject, all with the same few verbs.

model = build(scene)      everything constant, made once
model.step(frame)         move to a frame; only a twisting yarn and a cloth move
model.panels()            what is to be drawn now, side by side
model.facts()             what can be said of it, beside the textbook
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.particles import FibreCloud
from taichi_cloth.fabric.fabric import Fabric, build_fabric
from taichi_cloth.weave.colour_order import colour
from taichi_cloth.fibre.contours import contour
from taichi_cloth.fabric.layout import pose_points
from taichi_cloth.fibre.fibre import FibreParticles, particles_in
from taichi_cloth.fibre.sphere_set import sphere_set_from_rows
from taichi_cloth.fibre.sphere_surface import sphere_surface_points
from taichi_cloth.yarn.spin import (Period, Strands, hairs, spin)
from taichi_cloth.detail.streaming import FabricStream
from taichi_cloth.yarn.twisting import TwistingYarn

from ...render.data.blocks import ParticleBlocks
from ...render.data.particles import Particles
from .facts import Fact, fabric_facts, yarn_facts
from .model import Model, Numbers, Panel
from .prepare import (LIT, Prepared, fibre_kind, prepare_fabric, yarn_of)
from ..scene.schema import FabricSection, Scene

__all__ = ["FabricModel", "FibreModel", "TwistModel", "YarnModel", "build", "shown_frame"]

OPACITY = 1.0
SURFACE_POINTS = 400_000
SURFACE_COVER = 1.6
"""Radius of a point on a surface over the side of the square that it stands for: π 1.6² = 8 lie over each other."""


def build(scene: Scene, prepared: Prepared | None = None, each: Callable[[str, int, int], None] | None = None) -> Model:
    """Build a scene. `prepared` saves laying a fabric out again when that was done for `plan`. each: told the stage,
    how much of it is done and how much there is at most, where building takes long."""
    if scene.subject == "garment":
        from .garment import GarmentModel

        return GarmentModel(scene, prepared, each=each)
    if scene.subject == "cloth":
        from .cloth import ClothModel

        return ClothModel(scene, prepared)
    if scene.subject == "fabric":
        return FabricModel(scene, prepared or prepare_fabric(scene, streamed=True))
    return {"fibre": FibreModel, "yarn": YarnModel, "twist": TwistModel}[scene.subject](scene)


def shown_frame(scene: Scene, model: Model) -> int:
    """The frame that a single picture shows: the one that the scene names, or the last; a garment's is the first, in
    which it rests."""
    if scene.output.frame is not None:
        return scene.output.frame
    return 0 if scene.subject == "garment" else model.frames - 1


class FabricModel:
    """A woven fabric at rest on its key points."""

    def __init__(self, scene: Scene, prepared: Prepared) -> None:
        self.scene, self.prepared, self.frames = scene, prepared, 1
        section = scene.fabric or FabricSection()
        self.fabric: Fabric = build_fabric(prepared.layout)
        self.points = pose_points(prepared.layout, section.pose, amount=section.pose_amount)
        self.source = FabricStream(self.fabric, self.points, target=0) if prepared.in_batches else None

    def step(self, frame: int) -> None:
        """A fabric at rest does not move."""

    def panels(self) -> list[Panel]:
        particles = self.particles() if self.source is None else ParticleBlocks(self.source.sample(LIT))
        return [Panel(particles, particles.position, numbers=self.numbers, source=self.source)]

    def particles(self) -> Particles:
        """All of the fabric's."""
        return _particles(self.fabric.cloud(self.points))

    def numbers(self) -> Numbers:
        """Yarn: the warp ends, then the weft picks, each in the draft's order. Part: 0 warp, 1 weft."""
        warp = self.prepared.layout.cloth.warp_up.shape[1]
        yarn = self.fabric.threads() if self.source is None else np.zeros(0, np.int32)
        threads = len(self.fabric.thread_colour)
        yarns: dict[int, dict[str, str | int]] = {
            k: {"system": "warp", "index": k} if k < warp else {"system": "weft", "index": k - warp}
            for k in range(threads)
        }
        return Numbers(yarn, (yarn >= warp).astype(np.int32), yarns, {0: "warp", 1: "weft"})

    def facts(self) -> list[Fact]:
        layout = self.prepared.layout
        facts = yarn_facts(layout.warp.yarn, "warp yarn")
        if layout.weft.yarn != layout.warp.yarn:
            facts += yarn_facts(layout.weft.yarn, "weft yarn")
        return facts + fabric_facts(layout)


class YarnModel:
    """A length of yarn, standing upright so that a turntable turns it about its own axis."""

    def __init__(self, scene: Scene) -> None:
        assert scene.yarn is not None
        self.scene, self.frames = scene, 1
        section, kind = scene.yarn, fibre_kind(scene)
        self.yarn = yarn_of(section, kind)
        length = section.length_mm * 1e-3
        blocks = max(4, round(length / (self.yarn.diameter * 1.2)))
        period = Period.of(self.yarn, length / blocks, least=blocks, most=blocks)
        fibres = min(section.fibres, self.yarn.fibres_in_section)
        body = spin(self.yarn, period, fibres=fibres, steps=10, start=0.0, stop=length, seed=scene.seed)
        parts = [body]
        if self.yarn.hairiness.ends_per_m or self.yarn.hairiness.loops_per_m:
            step = period.block_length / 10
            parts.append(hairs(self.yarn, length=length, step=step, seed=scene.seed + 1))
        albedo = colour(section.colour) if section.colour else np.asarray(kind.colour, np.float32)
        self.strands = parts
        clouds = [_strand_cloud(part, albedo) for part in parts]
        self.cloud = FibreCloud(*(np.concatenate([getattr(c, f) for c in clouds]) for f in _FIELDS))

    def step(self, frame: int) -> None:
        """A yarn at rest does not move."""

    def panels(self) -> list[Panel]:
        upright = _upright(self.cloud)
        return [Panel(_particles(upright), upright.position, numbers=self.numbers)]

    def numbers(self) -> Numbers:
        """Yarn: every fibre piece by itself, those of the plies before the hairs. Part: the ply it is of."""
        points = [part.half_length.shape[1] for part in self.strands]
        ply = [np.repeat(part.ply, n) for part, n in zip(self.strands, points, strict=True)]
        counts = np.repeat(points, [len(part.radius) for part in self.strands])
        fibre = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
        body = len(self.strands[0].radius)
        yarns: dict[int, dict[str, str | int]] = {
            k: {"system": "fibre", "index": k} if k < body else {"system": "hair", "index": k - body}
            for k in range(len(counts))
        }
        parts = {k: f"ply {k + 1}" for k in range(self.yarn.plies)}
        return Numbers(fibre, np.concatenate(ply).astype(np.int32), yarns, parts)

    def facts(self) -> list[Fact]:
        return yarn_facts(self.yarn)


class TwistModel:
    """Two singles being twisted: the zones a and b of the paper's Figures 3 and 4."""

    def __init__(self, scene: Scene) -> None:
        assert scene.yarn is not None
        assert scene.twist is not None
        self.scene, self.frames = scene, scene.output.frames
        section = scene.twist
        self.yarn = yarn_of(scene.yarn, fibre_kind(scene))
        sign = 1.0 if scene.yarn.twist == "Z" else -1.0
        self.twisting = TwistingYarn(
            self.yarn,
            a=section.zone_a_mm * 1e-3,
            b=section.zone_b_mm * 1e-3,
            speed=section.speed_mm_per_s * 1e-3,
            spin_speed=sign * section.turns_per_s,
            duration=section.duration_s,
            feed=section.feed_mm * 1e-3,
            fibres=min(scene.yarn.fibres, self.yarn.fibres_in_section),
            construction=scene.yarn.construction,
            colours=np.stack([colour(name) for name in section.colours]),
            seed=scene.seed,
        )
        t = self.twisting
        self.nips = [_nip(x, 1.25 * self.yarn.diameter) for x in (0.0, t.a, t.a + t.b)]
        low, high = -t.feed, t.a + t.b + t.feed
        reach = 2.2 * self.yarn.diameter
        self.bounds = np.array(
            [[x - (t.a + t.b) / 2, y, 0.0] for x in (low, high) for y in (-reach, reach)], np.float32
        )

    def step(self, frame: int) -> None:
        """Twist on to the time of a frame; frames are spread evenly over the stated duration."""
        self.twisting.step_to(
            self.scene.twist.duration_s * frame / max(1, self.frames - 1) if self.scene.twist else 0.0
        )

    def panels(self) -> list[Panel]:
        t = self.twisting
        cloud = t.cloud()
        parts = [cloud, *self.nips]
        joined = FibreCloud(*(np.concatenate([getattr(c, f) for c in parts]) for f in _FIELDS))
        joined.position[:, 0] -= (t.a + t.b) / 2
        twist_a, twist_b = t.twist
        caption = (
            f"t = {t.time:5.2f} s    zone a (A-B): {1e-2 * twist_a:+6.2f} turns/cm    "
            f"zone b (B-C): {1e-2 * twist_b:+6.2f} turns/cm"
        )
        middle, below = (t.a + t.b) / 2, -1.9 * self.yarn.diameter
        places = (("A", 0.0), ("zone a", t.a / 2), ("B", t.a), ("zone b", t.a + t.b / 2), ("C", t.a + t.b))
        labels = tuple((name, (x - middle, below, 0.0)) for name, x in places)
        return [Panel(_particles(joined), self.bounds, caption, labels, self.numbers)]

    def numbers(self) -> Numbers:
        """Yarn: the single that a particle is of, none for the rings. Part: 0 yarn, 1 the rings at A, B and C."""
        ply = self.twisting.singles()
        rings = sum(len(ring.radius) for ring in self.nips)
        yarn = np.concatenate([ply, np.full(rings, -1)]).astype(np.int32)
        part = np.concatenate([np.zeros(len(ply)), np.ones(rings)]).astype(np.int32)
        yarns: dict[int, dict[str, str | int]] = {k: {"system": "single", "index": k} for k in range(self.yarn.plies)}
        return Numbers(yarn, part, yarns, {0: "yarn", 1: "rings"})

    def facts(self) -> list[Fact]:
        section = self.scene.twist
        assert section is not None
        facts = yarn_facts(self.yarn)
        if section.speed_mm_per_s > 0:
            steady = 10 * section.turns_per_s / section.speed_mm_per_s
            facts.append(Fact("twist of zone a in the end", f"{steady:.2f} turns/cm", "s/V; zone b: 0"))
        return facts


class FibreModel:
    """One fibre: its sphere set (Figure 1) beside the particles that fill it (Figure 2)."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.frames = scene, 1
        section, self.kind = scene.fibre, fibre_kind(scene)
        if section.spheres is not None:
            self.spheres = sphere_set_from_rows(section.spheres)
        else:
            self.spheres = contour(section.kind, length_m=section.length_um * 1e-6)
        self.filled: FibreParticles = particles_in(
            self.spheres, spacing_m=section.spacing_um * 1e-6, jitter=section.jitter, seed=scene.seed
        )
        self.albedo = colour(section.colour) if section.colour else np.asarray(self.kind.colour, np.float32)

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
        clouds = [_upright(shell), _upright(body)]
        bounds = np.concatenate([c.position for c in clouds])
        name = self.kind.name if self.scene.fibre.spheres is None else "own fibre"
        captions = (f"{name}: {len(self.spheres.radii):,} spheres", f"{m:,} particles")
        return [
            Panel(_particles(c), bounds, words, numbers=partial(_one_fibre, len(c.radius), k))
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


_FIELDS = tuple(FibreCloud.__dataclass_fields__)


def _one_fibre(count: int, part: int) -> Numbers:
    parts = {0: "sphere set", 1: "particles"}
    return Numbers(
        np.zeros(count, np.int32), np.full(count, part, np.int32), {0: {"system": "fibre", "index": 0}}, parts
    )


def _particles(cloud: FibreCloud) -> Particles:
    return Particles(
        position=cloud.position,
        radius=cloud.radius,
        colour=cloud.colour,
        tangent=cloud.tangent,
        normal=cloud.normal,
        half_length=cloud.half_length,
        openness=cloud.openness,
        opacity=OPACITY,
    )


def _strand_cloud(strands: Strands, albedo: NDArray) -> FibreCloud:
    points = strands.half_length.shape[1]
    tone = np.repeat(strands.tone, points)[:, None]
    return FibreCloud(
        position=strands.position.reshape(-1, 3).astype(np.float32),
        tangent=strands.tangent.reshape(-1, 3).astype(np.float32),
        normal=strands.normal.reshape(-1, 3).astype(np.float32),
        colour=np.clip(albedo[None, :] * tone, 0, 1).astype(np.float32),
        radius=np.repeat(strands.radius, points).astype(np.float32),
        half_length=strands.half_length.ravel().astype(np.float32),
        openness=(0.25 + 0.75 * strands.depth.ravel() ** 2).astype(np.float32),
    )


def _upright(cloud: FibreCloud) -> FibreCloud:
    """Turned so that the x axis stands upright and centred."""

    def turn(v: NDArray) -> NDArray:
        return np.stack([-v[:, 1], v[:, 0], v[:, 2]], -1)

    position = turn(cloud.position)
    position = position - np.array([0.0, (position[:, 1].min() + position[:, 1].max()) / 2, 0.0], np.float32)
    return FibreCloud(
        position=position,
        tangent=turn(cloud.tangent),
        normal=turn(cloud.normal),
        colour=cloud.colour,
        radius=cloud.radius,
        half_length=cloud.half_length,
        openness=cloud.openness,
    )


def _nip(x: float, radius: float, count: int = 900) -> FibreCloud:
    """A dark ring about the yarn at x: where it is fed, twisted or taken up."""
    angle = 2 * np.pi * np.arange(count) / count
    zero, one = np.zeros(count), np.ones(count)
    out = np.stack([zero, np.cos(angle), np.sin(angle)], -1).astype(np.float32)
    return FibreCloud(
        position=(out * radius + np.array([x, 0, 0])).astype(np.float32),
        tangent=np.stack([zero, -np.sin(angle), np.cos(angle)], -1).astype(np.float32),
        normal=out,
        colour=np.tile(np.array([[0.03, 0.03, 0.035]], np.float32), (count, 1)),
        radius=(0.07 * radius * one).astype(np.float32),
        half_length=(0.07 * radius * one).astype(np.float32),
        openness=one.astype(np.float32),
    )
