"""A length of yarn (paper 2.2)."""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.particles import FibreCloud
from taichi_cloth.yarn.hairs import hairs
from taichi_cloth.yarn.spin import Period, Strands, spin

from ..prepare.strands import STEPS, yarn_piece
from ..prepare.thread_colours import yarn_colours
from ..scene.schema import Scene
from .facts import Fact, yarn_facts
from .fibre_model import upright
from .model import Numbers, Panel, particles_of

__all__ = ["YarnModel"]


class YarnModel:
    """A length of yarn, standing upright so that a turntable turns it about its own axis."""

    def __init__(self, scene: Scene) -> None:
        assert scene.yarn is not None
        self.scene, self.frames = scene, 1
        piece = yarn_piece(scene)
        self.yarn, length = piece.yarn, piece.length
        period = Period.of(self.yarn, length / piece.blocks, least=piece.blocks, most=piece.blocks)
        body = spin(self.yarn, period, fibres=piece.fibres, steps=STEPS, start=0.0, stop=length, seed=scene.seed)
        parts = [body]
        if self.yarn.hairiness.ends_per_m or self.yarn.hairiness.loops_per_m:
            step = period.block_length / STEPS
            parts.append(hairs(self.yarn, length=length, step=step, seed=scene.seed + 1))
        albedo = yarn_colours(scene)[0]
        self.strands = parts
        clouds = [_strand_cloud(part, albedo) for part in parts]
        self.cloud = FibreCloud.joined(clouds)

    def step(self, frame: int) -> None:
        """A yarn at rest does not move."""

    def panels(self) -> list[Panel]:
        cloud = upright(self.cloud)
        return [Panel(particles_of(cloud), cloud.position, numbers=self.numbers)]

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


def _strand_cloud(strands: Strands, albedo: NDArray) -> FibreCloud:
    points = strands.half_length.shape[1]
    tone = np.repeat(strands.tone, points)[:, None]
    return FibreCloud(
        position=strands.position.reshape(-1, 3).astype(np.float32),
        tangent=strands.tangent.reshape(-1, 3).astype(np.float32),
        normal=strands.normal.reshape(-1, 3).astype(np.float32),
        colour=np.clip(albedo[None, :] * tone, 0, 1).astype(np.float32),
        radius=strands.radius.ravel().astype(np.float32),
        half_length=strands.half_length.ravel().astype(np.float32),
        openness=(0.25 + 0.75 * strands.depth.ravel() ** 2).astype(np.float32),
    )
