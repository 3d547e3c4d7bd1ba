"""Fewer particles for light: every so many along a fibre, and what was found for those, for all between them.

Where neighbours in a block follow one another along a fibre and overlap (`chain_step`), light hardly differs from one
to the next. Where a fibre ends and another begins among the 16 of a block the distance says so: what lies between two
samples takes theirs by 1 / distance^2.

Pieces of a sheet, as wide as they are long, are near one another too, but lean to all sides in turn: what light gets
to one says little of the next, and with every eighth one's the sheet has checks as wide as its cells. So they are no
chains.
"""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import F32x3, Int, Template
from taichi_cloth.ground.copies import every
from taichi_cloth.ground.particles import LANES, POSITION, RADIUS
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.ground.vectors import keep

from ..data.blocks import Layout

__all__ = ["chain_step", "spread", "thin"]


def chain_step(layout: Layout, blocks: NDArray[np.float32]) -> float | None:
    """From one to the next of a chain [m], the median of up to 64 blocks, spread evenly; None where not most neighbours
    are nearer than half their length, or a radius, or some are pieces of a sheet."""
    if not blocks.shape[1]:
        return None
    sample = every(blocks, max(1, blocks.shape[1] // 64))
    if layout.elliptic and ((sample[RADIUS] > 0) & (sample[RADIUS] == sample[layout.half_length_row])).any():
        return None
    there = (sample[RADIUS, :, 1:] > 0) & (sample[RADIUS, :, :-1] > 0)
    apart = np.linalg.norm(np.diff(sample[POSITION : POSITION + 3], axis=2), axis=0)[there]
    near = apart < sample[layout.half_length_row if layout.elliptic else RADIUS, :, 1:][there]
    return float(np.median(apart[near])) if len(near) and near.mean() > 0.5 else None


def thin(stride: int, particles: F32x3, thin_out: F32x3) -> None:
    """Every stride-th particle, packed again: thin_out (rows, ceil(blocks / stride), 16), zeros, so that what is left
    at the end has a radius of 0."""
    if on_host():
        some = particles.reshape(len(particles), -1)[:, ::stride]
        thin_out.reshape(len(particles), -1)[:, : some.shape[1]] = some
    else:
        _thin(stride, len(particles), particles, thin_out)


@ti.kernel
def _thin(stride: Template, rows: Int, particles: F32x3, thin_out: F32x3):
    """The same on a device."""
    for b in range(thin_out.shape[1]):
        # Only in the last blocks may a lane ask for what is not there.
        whole = (b + 1) * stride <= particles.shape[1]
        for row in range(rows):
            for lane in ti.static(range(LANES)):
                source = b * stride + lane * stride // LANES
                value = 0.0
                if whole or source < particles.shape[1]:
                    value = particles[row, source, ti.static(lane * stride % LANES)]
                thin_out[row, b, lane] = value


@ti.kernel
def spread(stride: Template, count: Template, particles: F32x3, found: F32x3, row: Int, light_out: F32x3):
    """light_out[block, row…, lane] of what was found (thin blocks, count, 16) for every stride-th particle."""
    keep(light_out, (0, 0, 0), row)
    most = particles.shape[1] * LANES
    for b in range(particles.shape[1]):
        for lane in range(LANES):
            # The sample at or before this particle, and the one after it.
            i = b * LANES + lane
            one = i // stride
            two = one
            share = 0.0
            if i % stride != 0 and (one + 1) * stride < most:
                # The squares of both distances,
                two = one + 1
                near = 0.0
                far = 0.0
                j = one * stride
                k = two * stride
                for c in ti.static(range(3)):
                    here = particles[POSITION + c, b, lane]
                    x = particles[POSITION + c, j // LANES, j % LANES] - here
                    y = particles[POSITION + c, k // LANES, k % LANES] - here
                    near += x * x
                    far += y * y
                # and the mean by 1 / distance^2; a sample of radius 0 is none.
                if particles[RADIUS, k // LANES, k % LANES] > 0.0:
                    if particles[RADIUS, j // LANES, j % LANES] <= 0.0:
                        near = 1e20
                    share = near / (near + far + 1e-20)
            for r in ti.static(range(count)):
                value = found[one // LANES, r, one % LANES]
                value += share * (found[two // LANES, r, two % LANES] - value)
                light_out[b, row + r, lane] = value
