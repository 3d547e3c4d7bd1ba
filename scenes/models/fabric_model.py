"""A woven fabric at rest (paper 2.3 and 3.3)."""

from dataclasses import replace

import numpy as np

from taichi_cloth.detail.streaming import FabricStream
from taichi_cloth.fabric.fabric import Fabric, build_fabric
from taichi_cloth.fabric.pose import pose_points
from taichi_cloth.yarn.thick_fibres import leaning

from ...render.data.blocks import ParticleBlocks
from ...render.data.particles import Particles
from ..prepare.drawing import LIT
from ..prepare.fibre_count import few_of
from ..prepare.weave_layout import Prepared
from ..scene.schema import FabricSection, Scene
from .facts import Fact, fabric_facts, yarn_facts
from .model import Numbers, Panel, particles_of

__all__ = ["FabricModel"]


class FabricModel:
    """A woven fabric at rest on its key points."""

    def __init__(self, scene: Scene, prepared: Prepared) -> None:
        self.scene, self.prepared, self.frames = scene, prepared, 1
        section = scene.fabric or FabricSection()
        self.fabric: Fabric = build_fabric(prepared.layout)
        self.points = pose_points(prepared.layout, section.pose, amount=section.pose_amount, bent=section.bent)
        layout = prepared.layout
        self.source = self._casting = None
        if prepared.in_batches:
            detail = few_of(layout.detail, len(layout.blocks.kind), self.fabric.particles, LIT)
            few = build_fabric(replace(layout, detail=detail))
            self.source = FabricStream(self.fabric, self.points, target=0)
            self._casting = FabricStream(few, self.points, target=0)
        leans = [leaning(one.yarn.as_one, layout.detail.fibres) for one in (layout.warp, layout.weft)]
        self.to_eye = sum(leans) / len(leans)
        """How far normals lean to the eye."""

    def step(self, frame: int) -> None:
        """A fabric at rest does not move."""

    def panels(self) -> list[Panel]:
        # What comes in batches takes its light from threads of few fibres, which lie in the yarns that all are of: from
        # some of all, enlarged to as much, the others stand deep in shadow.
        if self.source is None or self._casting is None:
            particles = self.particles()
            bounds = particles.position
        else:
            particles = ParticleBlocks(self._casting.sample(LIT))
            bounds = ParticleBlocks(self.source.sample(LIT)).position
        return [Panel(particles, bounds, numbers=self.numbers, source=self.source, to_eye=self.to_eye)]

    def particles(self) -> Particles:
        """All of the fabric's."""
        return particles_of(self.fabric.cloud(self.points))

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
