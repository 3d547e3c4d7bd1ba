"""What lies behind a mesh is not made, and what may lie before any of it is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.render.data.backdrop import OPEN, Backdrop, tiled
from taichi_cloth.render.data.camera import Camera
from taichi_cloth.render.splat.hidden import not_hidden


@dataclass(frozen=True)
class Boxes:
    boxes: NDArray[np.int16]
    depth: NDArray[np.float32]


def test_only_what_lies_behind_all_of_a_mesh_is_left_out() -> None:
    """A wall 1 m away fills the left half of 8 × 8 tiles. A piece of one tile, 16 pixels of 1 mm at 1 m, reaches up
    to 8 mm towards the eye."""
    depth = np.full((128, 128), OPEN, np.float32)
    depth[:, :64] = 1.0
    backdrop = Backdrop(np.zeros((128, 128, 3), np.float32), tiled(depth))
    camera = Camera(np.eye(3), np.zeros(3), 1000.0, 64.0, 64.0, 128, 128)
    cases = {
        "before": ((2, 2, 2, 2), 0.99, True),
        "reaches": ((2, 2, 2, 2), 1.005, True),
        "behind": ((2, 2, 2, 2), 1.02, False),
        "half beside": ((3, 4, 2, 2), 1.5, True),
        "beside": ((5, 5, 2, 2), 1.5, True),
        "at the edge": ((0, 1, 2, 2), 1.5, True),
        "large": ((1, 3, 1, 6), 1.5, True),
    }
    boxes = np.array([box for box, _, _ in cases.values()], np.int16)
    seen = Boxes(boxes, np.array([z for _, z, _ in cases.values()], np.float32))
    ids = np.arange(len(cases), dtype=np.int32)
    kept = not_hidden(seen, ids, camera, backdrop)
    assert [name for name, (_, _, want) in cases.items() if want] == [list(cases)[k] for k in kept]
    assert len(not_hidden(seen, ids, camera, None)) == len(ids)
