"""Key points that are held: still, or led along a path."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError

__all__ = ["Pins"]

Path = Callable[[float], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Pins:
    """mask: bool (rows, cols), the key points held. path: time [s] → where they are, (points, 3) [m], in the order of
    `positions[mask]`; None holds them where the sheet starts. At time 0 it has to give where they start."""

    mask: NDArray[np.bool_]
    path: Path | None = None

    @classmethod
    def on_bone(cls, mask: NDArray[np.bool_], positions: ArrayLike, motion: Path, bone: int) -> "Pins":
        """Key points attached rigidly to a bone and carried with it, without contact (paper 4.1: the shoulders).

        positions: (rows, cols, 3) [m] where the sheet starts. motion: time [s] → (bones, 4, 4), as of `Colliders`.
        Raises InputError on a bone that is not there.
        """
        first = np.asarray(motion(0.0), np.float64)
        if not 0 <= bone < len(first):
            raise InputError(f"pins.bone: {bone}; allowed: 0 to {len(first) - 1}")
        start = np.asarray(positions, np.float64)[mask]
        back = np.linalg.inv(first[bone])
        local = start @ back[:3, :3].T + back[:3, 3]

        def path(time: float) -> NDArray[np.float64]:
            there = np.asarray(motion(time), np.float64)[bone]
            return local @ there[:3, :3].T + there[:3, 3]

        return cls(mask, path)

    def at(self, time: float) -> NDArray[np.float64]:
        """Where the path is at a time [s]. Raises InputError where it gives something else than finite points."""
        if self.path is None:
            raise InputError("pins: no path; these key points stay where the sheet starts")
        out = np.asarray(self.path(time), np.float64)
        if out.shape != (int(self.mask.sum()), 3) or not np.isfinite(out).all():
            raise InputError(
                f"pins.path: {out.shape} at {time:g} s; allowed: {(int(self.mask.sum()), 3)}, finite, a row a pin"
            )
        return out
