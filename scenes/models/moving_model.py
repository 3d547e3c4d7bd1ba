"""What sheets and garments share: they move by a simulation, whose state can be kept on disk, and are drawn as a mesh
or as the fibres that follow it (paper, Figure 9)."""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.cell_stream import CellStream
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.fabric.layout import drawn_density
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.simulation import Simulation

from ...render.data.blocks import ParticleBlocks
from ...render.data.particles import Particles
from ...render.tiles.mesh import Mesh
from ..prepare.construction import fabric_properties
from ..prepare.sheet_setup import moved_by
from ..prepare.weave_layout import Prepared
from ..scene.schema import Scene
from .facts import Fact, fabric_facts, yarn_facts
from .model import STATE, Numbers, Panel

__all__ = ["Fibres", "MovingModel", "nothing"]

F32 = NDArray[np.float32]


class Fibres(Protocol):
    """The fibres of a moving cloth."""

    prepared: Prepared

    def follow(self, positions: F32) -> ParticleBlocks:
        """As they lie on key points (rows, columns, 3) [m], to be drawn."""
        ...


class MovingModel(ABC):
    """A cloth in motion.

    simulation: moves the key points. fibres: what is drawn of it; None where that is a mesh. bounds: points that every
    picture frames, (n, 3) [m].
    """

    scene: Scene
    frames: int
    simulation: Simulation
    fibres: Fibres | None
    bounds: F32
    misfit: str | None = None
    """Why what is worn does not fit who wears it, in one line."""
    _kept: Path | None = None

    @abstractmethod
    def at_start(self) -> Simulation:
        """The simulation at frame 0, made anew."""

    @abstractmethod
    def mesh(self) -> Mesh:
        """The cloth as triangles, as it is now."""

    @abstractmethod
    def solids(self) -> tuple[Mesh, ...]:
        """What the cloth meets, as it is drawn now."""

    @abstractmethod
    def numbers(self) -> Numbers:
        """Yarn and part of every place of a particle; -1 for places that are not drawn."""

    @abstractmethod
    def cloth_facts(self) -> list[Fact]:
        """What can be said of it beside its yarns and its weave."""

    def framed(self) -> F32:
        """What a picture frames now, (n, 3) [m]."""
        return self.bounds

    @property
    def follower(self) -> FibreFollower | None:
        """What moves the fibres, where all of them are held."""
        return getattr(self.fibres, "follower", None)

    @property
    def source(self) -> CellStream | None:
        """What makes the fibres, where they are made as a camera needs them."""
        return getattr(self.fibres, "source", None)

    def panels(self) -> list[Panel]:
        solids, framed = self.solids(), self.framed()
        if self.fibres is None:
            return [Panel(nothing(), framed, meshes=(self.mesh(), *solids))]
        drawn = self.fibres.follow(self.simulation.positions)
        return [Panel(drawn, framed, numbers=self.numbers, meshes=solids, source=self.source)]

    def facts(self) -> list[Fact]:
        """The weight once: as it moves, and beside that as it is drawn."""
        weight = f"{1e3 * self.simulation.sheet.material.density:.0f} g/m²"
        drawn = f"{1e3 * self.drawn_density():.0f} as drawn" if self.fibres is not None else ""
        facts = [*self.cloth_facts(), Fact("weight", weight, drawn)]
        if fabric_properties(self.scene) is not None:
            moved = moved_by(self.scene)
            facts += [Fact(q.name, q.shown, q.provenance) for key, q in moved.items() if key != "areal_density"]
        if self.fibres is not None:
            layout = self.fibres.prepared.layout
            facts += yarn_facts(layout.warp.yarn, "warp yarn")
            facts += [fact for fact in fabric_facts(layout) if fact.name != "mass"]
        return facts

    def drawn_density(self) -> float:
        """Mass of the cloth as it is drawn [kg/m²]; what moves has its material's."""
        assert self.fibres is not None
        return drawn_density(self.fibres.prepared.layout)

    def substeps_fact(self) -> Fact:
        solver = self.simulation.solver
        return Fact("substeps a frame", f"{solver.substeps} of {1e6 * solver.step:.1f} µs")

    def yarn_of_places(self) -> NDArray[np.int32]:
        """Thread of every place of a particle, -1 for those that are not drawn."""
        assert self.follower is not None
        yarn = np.full(self.follower.slots, -1, np.int32)
        yarn[self.follower.particle_slots] = self.follower.threads
        return yarn

    def keep(self, folder: Path, first: int) -> None:
        """Keep the state of every frame in a folder, and go on from the one there unless it is beyond frame `first`.

        Raises InputError when what is there is not of this scene.
        """
        self._kept = folder / STATE
        if self._kept.exists():
            try:
                self.simulation.restore(self._kept)
            except InputError as error:
                raise InputError(f"--resume: {error}; delete {self._kept} and the motion is computed again") from None
            if self.simulation.frame > first:
                self.simulation = self.at_start()
        self._save()

    def motion_facts(self) -> list[Fact]:
        """What can be said of the motion itself, once it has been kept."""
        return []

    def step(self, frame: int) -> None:
        """On to a frame of the video; frame 0 is the start. Raises Unstable."""
        if frame < self.simulation.frame:
            self.simulation = self.at_start()
        while self.simulation.frame < frame:
            self.simulation.step()
            self._save()

    def _save(self) -> None:
        if self._kept is not None:
            # Not what it leaves to be worked out: with that it would say some things twice.
            self.simulation.save(self._kept, about=self.scene.model_dump_json(exclude_unset=True))


def nothing() -> Particles:
    none = np.zeros((0, 3), np.float32)
    return Particles(position=none, radius=none[:, 0], colour=none, tangent=none, normal=none)
