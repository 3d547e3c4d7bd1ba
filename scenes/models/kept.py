"""Runs that can be gone on with: the state of every frame is kept in the folder of its pictures."""

from abc import ABC, abstractmethod
from pathlib import Path

from taichi_cloth.motion.simulation import Simulation

__all__ = ["STATE", "KeptRun"]

STATE = "state.npz"
"""Where a sequence keeps the state of its last frame."""


class KeptRun(ABC):
    """Base of models that move by a simulation: a step to any frame, and the state on disk once `keep` was called."""

    simulation: Simulation
    _kept: Path | None = None

    @abstractmethod
    def at_start(self) -> Simulation:
        """The simulation at frame 0, made anew."""

    def keep(self, folder: Path, first: int) -> None:
        """Keep the state of every frame in a folder, and go on from the one there unless it is beyond frame `first`.

        Raises InputError when what is there is not of this scene.
        """
        self._kept = folder / STATE
        if self._kept.exists():
            self.simulation.restore(self._kept)
            if self.simulation.frame > first:
                self.simulation = self.at_start()
        self._save()

    def step(self, frame: int) -> None:
        """On to a frame of the video; frame 0 is the start. Raises Unstable."""
        if frame < self.simulation.frame:
            self.simulation = self.at_start()
        while self.simulation.frame < frame:
            self.simulation.step()
            self._save()

    def _save(self) -> None:
        if self._kept is not None:
            self.simulation.save(self._kept)
