"""The picture in the making: four fields of half rows of 8 pixels, lent to splatters and taken back.

They are fields because the raster is three times as fast on fields as on arrays: only there does LLVM know that
the four planes do not overlap. But Taichi compiles a kernel anew for every field and never frees one. So a
splatter borrows planes of a class of sizes, and when it is gone the next one of that class gets the same fields
and the same compiled kernel.
"""

import weakref
from typing import Any

import taichi as ti
from taichi.lang import impl

from taichi_cloth.ground.particles import TILE
from taichi_cloth.ground.vectors import Vec8

__all__ = ["Planes", "borrow"]


@ti.data_oriented
class Planes:
    """What is blended so far of each tile: fields (tiles, 32), two halves of 8 pixels a row."""

    def __init__(self, tiles: int) -> None:
        self.through, self.red, self.green, self.blue = (
            ti.Vector.field(TILE // 2, ti.f32, (tiles, 2 * TILE)) for _ in range(4)
        )
        """Share of light that still passes; linear colours, premultiplied."""

    @ti.func
    def clear(self, tile):
        """Nothing in front of this tile."""
        for y in range(2 * TILE):
            self.through[tile, y] = Vec8(1.0)
            self.red[tile, y] = Vec8(0.0)
            self.green[tile, y] = Vec8(0.0)
            self.blue[tile, y] = Vec8(0.0)

    @ti.func
    def most_passing(self, tile):
        """The largest share of light that passes a pixel of this tile."""
        most = self.through[tile, 0]
        for y in range(1, 2 * TILE):
            row = self.through[tile, y]
            most = ti.select(most > row, most, row)
        return most.max()  # pyright: ignore[reportOptionalCall]


_free: dict[int, list[Planes]] = {}
_program: Any = None


def borrow(owner: object, tiles: int) -> Planes:
    """Planes of at least so many tiles, until `owner` is gone.

    Only while the Taichi program lives that was started when they were made: `ti.init` throws fields away.
    """
    global _program
    program = impl.get_runtime().prog
    if program is not _program:
        _free.clear()
        _program = program
    capacity = _rounded(tiles)
    waiting = _free.setdefault(capacity, [])
    planes = waiting.pop() if waiting else Planes(capacity)
    weakref.finalize(owner, _give_back, program, capacity, planes).atexit = False
    return planes


def _rounded(tiles: int) -> int:
    """The least of 1024 (4 MB, 512 x 512 px), 2048, 4096, … that holds so many: what is compiled is for one of them."""
    return max(1024, 1 << (tiles - 1).bit_length())


def _give_back(program: Any, capacity: int, planes: Planes) -> None:
    if program is _program:
        _free.setdefault(capacity, []).append(planes)
