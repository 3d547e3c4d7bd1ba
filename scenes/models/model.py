"""What every built scene answers, whatever its subject, and what it hands over to be drawn."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.cell_stream import CellStream
from taichi_cloth.detail.streaming import FabricStream
from taichi_cloth.ground.particles import FibreCloud

from ...render.data.blocks import ParticleBlocks
from ...render.data.particles import Particles
from ...render.tiles.mesh import Mesh
from ..scene.schema import Scene
from .facts import Fact

__all__ = ["FACTS", "OPACITY", "STATE", "Model", "Numbers", "Panel", "particles_of"]

OPACITY = 1.0
"""Of every particle that a model draws."""
STATE, FACTS = "state.npz", "facts.json"
"""Where a sequence keeps the state of its last frame; and where an animation of a garment keeps what it said, and of
each frame what it measured."""


@dataclass(frozen=True)
class Numbers:
    """Which yarn and which part each particle is of, (n,) int32, and what the numbers stand for. Of a panel with a
    source the particles' numbers come from that, batch by batch, and there are none here."""

    yarn: NDArray[np.int32]
    part: NDArray[np.int32]
    yarns: dict[int, dict[str, str | int]]
    parts: dict[int, str]


@dataclass(frozen=True)
class Panel:
    """One picture of a frame: its particles, the points that must be in it, the words under it, labels at
    points of the world [m], and the particles' numbers, which are made only when asked for."""

    particles: Particles | ParticleBlocks
    bounds: NDArray[np.float32]
    caption: str = ""
    labels: tuple[tuple[str, tuple[float, float, float]], ...] = ()
    numbers: Callable[[], Numbers] | None = None
    meshes: tuple[Mesh, ...] = ()
    """Surfaces among the particles, lit and shadowed with them."""
    source: FabricStream | CellStream | None = None
    """Makes what is drawn, a batch at a time; `particles` are then a sample of it, which casts its shadows."""
    shading: tuple[Mesh, ...] = ()
    """Surfaces that are not drawn with it and cast shadows on it."""
    within: "tuple[Panel, ...]" = ()
    """What is drawn before it into the same picture, in this order, each made by a source of its own: garments that are
    worn under another."""
    to_eye: float = 0.0
    """How far its fibres' normals lean to the eye (`Finish.to_eye`)."""
    scene: Scene | None = None
    """Whose fibres it shows, where that is not the model's scene."""


class Model(Protocol):
    """A built scene."""

    scene: Scene
    frames: int

    def step(self, frame: int) -> None: ...

    def panels(self) -> Sequence[Panel]: ...

    def facts(self) -> list[Fact]: ...


def particles_of(cloud: FibreCloud) -> Particles:
    """A cloud as the renderer takes it."""
    return Particles(**vars(cloud), opacity=OPACITY)
