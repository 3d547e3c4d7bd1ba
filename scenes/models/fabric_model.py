"""A woven fabric at rest (paper 2.3 and 3.3)."""

import numpy as np

from taichi_cloth.detail.streaming import FabricStream
from taichi_cloth.fabric.fabric import Fabric, build_fabric
from taichi_cloth.fabric.pose import pose_points

from ...render.data.blocks import ParticleBlocks
from ...render.data.particles import Particles
from ..prepare.drawing import LIT
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
        self.points = pose_points(prepared.layout, section.pose, amount=section.pose_amount)
        self.source = FabricStream(self.fabric, self.points, target=0) if prepared.in_batches else None

    def step(self, frame: int) -> None:
        """A fabric at rest does not move."""

    def panels(self) -> list[Panel]:
        particles = self.particles() if self.source is None else ParticleBlocks(self.source.sample(LIT))
        return [Panel(particles, particles.position, numbers=self.numbers, source=self.source)]

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
