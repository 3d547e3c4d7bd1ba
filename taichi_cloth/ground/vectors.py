"""Types of the arguments of kernels that take 8 or 16 particles, or 16 pixels of a tile's row, at once.

The same functions serve a graphics device, which takes one particle a thread: then `of_group` gives a vector of one.
And what is done to the vectors of one particle, in more than one room.
"""

from typing import TYPE_CHECKING, Any

import taichi as ti

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import Template
from taichi_cloth.ground.particles import LANES, OCTET

__all__ = [
    "CHUNK_STEPS",
    "Blocks",
    "Octets",
    "Vec8",
    "Vec16",
    "chunk_count",
    "chunk_steps",
    "each",
    "in_octets",
    "keep",
    "lanes",
    "leant",
    "of_group",
    "of_row",
    "set_row",
]  # fmt: skip

Vec8: Any = ti.types.vector(OCTET, ti.f32)
Vec16: Any = ti.types.vector(LANES, ti.f32)

CHUNK_STEPS, WARP = 1024, 32
"""Iterations of a loop for each chunk of work on a CPU, which gives a thread at least 512 of them; and threads of a
device that go the same way together."""

if TYPE_CHECKING:
    Blocks = Any
    Octets = Any
else:
    Blocks = ti.types.ndarray(Vec16, 2)  # groups of particles (rows, groups): each element 16 neighbours
    Octets = ti.types.ndarray(Vec8, 2)  # the same, in halves


@ti.func
def keep(array: Template, at: Template, size):
    """What a kernel leaves of `array` stays what it was. at: any element; size: a number that is never below 0.

    A graphics device is sent only arrays that are read there, and sends back whole what is written. Needed where a
    kernel writes some elements and reads none.
    """
    if size < 0:
        array[at] += 1


def in_octets(blocks: Any) -> Any:
    """`Blocks` as `Octets`, in the same memory: (rows, groups, LANES) as (rows, 2 groups, OCTET), and so of light."""
    return blocks.reshape(blocks.shape[0], 2 * blocks.shape[1], OCTET)


def lanes() -> int:
    """Particles at once, in what is being compiled: OCTET on a CPU, 1 a thread of a device."""
    return OCTET if runtime.on_host() else 1


def chunk_steps() -> int:
    """Iterations of a loop over chunks of work for each chunk, of which the first does all of it; on a device threads
    that go different ways are best in warps of their own."""
    return CHUNK_STEPS if runtime.on_host() else WARP


def chunk_count(usual: int) -> int:
    """Chunks of work: `usual` on a CPU, thousands where a device holds the arrays."""
    return max(usual, 4096) if runtime.resident() else usual


@ti.func
def leant(normal, along, place, eye, by):
    """A normal, moved by so much of the way from its place to an eye [m] that is square to its fibre, see
    `render.light.lean`."""
    way = (eye - place) / ti.max((eye - place).norm(), 1e-12)
    out = normal + by * (way - way.dot(along) * along)
    return out / ti.max(out.norm(), 1e-12)


@ti.func
def of_group(groups: Template, row, b):
    """A row (rows, octets) of eight particles, the b-th; on a device of particle number b."""
    if ti.static(lanes() == OCTET):
        return groups[row, b]
    else:
        return ti.Vector([groups[row, b // OCTET][b % OCTET]])


@ti.func
def of_row(groups: Template, b, row):
    """The same of (groups, 2 rows): two halves of a group, row by row."""
    if ti.static(lanes() == OCTET):
        return groups[b // 2, 2 * row + b % 2]
    else:
        return ti.Vector([groups[b // LANES, 2 * row + b // OCTET % 2][b % OCTET]])


@ti.func
def set_row(groups: Template, b, row, value):
    """Writes what `of_row` reads."""
    if ti.static(lanes() == OCTET):
        groups[b // 2, 2 * row + b % 2] = value
    else:
        groups[b // LANES, 2 * row + b // OCTET % 2][b % OCTET] = value[0]


@ti.func
def each(value):
    """That number for each of the particles at once."""
    return ti.Vector([value for _ in range(ti.static(lanes()))])
