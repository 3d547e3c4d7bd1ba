"""The fibres of moving cloth with a sett: made where a camera looks, in batches, from cells of key points."""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.cell_stream import CellStream
from taichi_cloth.fabric.cells import CellCloth, sheet_of_cells
from taichi_cloth.weave.draft import Draft

from ...render.data.blocks import ParticleBlocks
from ..prepare.drawing import LIT
from ..prepare.thread_colours import colour_repeats
from ..prepare.weave_layout import Prepared
from ..scene.schema import Scene
from .model import Numbers

__all__ = ["CellFibres", "sheet_fibres"]

F32 = NDArray[np.float32]


class CellFibres:
    """The fibres of a cloth woven on cells."""

    def __init__(self, prepared: Prepared, cloth: CellCloth, source: CellStream) -> None:
        self.prepared, self.cloth, self.source = prepared, cloth, source

    @property
    def draft(self) -> Draft:
        return self.prepared.draft

    def follow(self, positions: F32) -> ParticleBlocks:
        """Lays them on key points (rows, columns, 3) [m]; a sample of them, which casts their light."""
        self.cloth.move(positions)
        return ParticleBlocks(self.source.sample(LIT))

    def numbers(self) -> Numbers:
        """As of a sheet: the warp ends, then the weft picks; part 0 warp, 1 weft. Those of the particles come from the
        source."""
        ends = int(self.cloth.counts[0, 0])
        yarns: dict[int, dict[str, str | int]] = {
            k: {"system": "warp", "index": k} if k < ends else {"system": "weft", "index": k - ends}
            for k in range(len(self.cloth.threads.colour))
        }
        none = np.zeros(0, np.int32)
        return Numbers(none, none, yarns, {0: "warp", 1: "weft"})


def sheet_fibres(scene: Scene, prepared: Prepared) -> CellFibres:
    """Of a [cloth] that `on_cells` gave."""
    assert scene.cloth is not None
    assert prepared.cells is not None
    colours = tuple(
        repeat[np.arange(count) % len(repeat)]
        for repeat, count in zip(colour_repeats(scene), prepared.cells.woven, strict=True)
    )
    shape = scene.cloth.rows, scene.cloth.columns
    repeat = prepared.cells.repeats[0]
    cloth = sheet_of_cells(shape, prepared.cells.per_cell, repeat, (colours[0], colours[1]), seed=scene.seed)
    return CellFibres(prepared, cloth, CellStream(cloth))
