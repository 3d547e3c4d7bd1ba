"""The sky seen through particles: kernels of the maps that ambient occlusion reads (see `occlusion`).

A map looks along one direction and answers for both of its ends. Layers are laid between the first and the last
depth of each texel, fine near both: with f behind the first, g before the last and a length h

    k = 16 w(f) / (w(f) + w(g)),   w(d) = d / (d + h)

is even through a thin cloth and fine at both of its walls where the map looks through a whole garment. A piece of
fibre of area A and opacity a takes the optical depth DENSITY a A / texel^2, laid at points along its axis and shared
bilinearly between four texels. A direction belongs to one thread.
"""

from dataclasses import dataclass
from typing import Literal

import taichi as ti

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, Float, I32x2, Int, Template
from taichi_cloth.ground.particles import LANES, NORMAL, OCTET, POSITION, RADIUS, TANGENT
from taichi_cloth.ground.vectors import CHUNK_STEPS, Blocks, Octets, Vec16, keep

from ..data.light_sizes import LAYERS
from ..tiles.sort import share
from .deep_map import AWAY, EMPTY, ORIGIN, RIGHT, SCALE, UP, deepen, laid, lift, lower
from .fibre import decay
from .map_place import LEANT

__all__ = ["Looking", "fill", "look", "look_at"]


@dataclass(frozen=True)
class Looking:
    """How maps are read: a compile-time switch. walled: there is a mesh, met first and left last at the depths `walls`.
    bulk: also what a cloth sees around, see `_seen`. part: of bulk, that "cloth" alone, what a particle sees its "own",
    with the other known, or "all"."""

    walled: bool
    bulk: bool
    part: Literal["all", "cloth", "own"] = "all"


OFFSET, FINE, BEYOND, BLIND, YARNS = range(5)
"""Numbers by which maps are read: how far a place is moved out along its normal, and towards the sky, before it reads
[m]; length by which layers are laid [m]; and of bulk, see `_seen`; the last of them in yarns a metre."""

OPEN_BEHIND = 0.42, 0.52
"""Of how much more than a cloth's interstices, and of how much a yarn is open behind that nothing crosses (`_seen`): of
a plain weave 0.24 to 0.40 of the sky, from crowns to interstices, of a satin as much, of a yarn alone 0.54 to 0.59."""

DENSITY = 1.6
"""Optical depth of a texel covered once by an opaque fibre: spread evenly, as a fibre that covers its middle is."""

MOST_POINTS = 12.0
APART = 2.0
"""Distance between the points of a fibre [texels]."""


@ti.func
def _coordinate(f, g, h):
    """Layer coordinate 0..16."""
    front = f * (g + h)
    return ti.min(16.0 * front / (front + g * (f + h) + 1e-30), 16.0)


@ti.func
def _place(layout: Template, stretch, particles: Octets, b, axes: F32x3, m, placed: Octets, out):
    """Eight particles on map m, as row `out` of the scratch: its place, its points, and the optical depth of each."""
    texels = axes[m, SCALE, 0]
    px = particles[POSITION, b]
    py = particles[POSITION + 1, b]
    pz = particles[POSITION + 2, b]
    size = particles[RADIUS, b] * texels
    u = px * axes[m, RIGHT, 0] + py * axes[m, RIGHT, 1] + pz * axes[m, RIGHT, 2] - axes[m, ORIGIN, 0]
    v = px * axes[m, UP, 0] + py * axes[m, UP, 1] + pz * axes[m, UP, 2] - axes[m, ORIGIN, 1]
    placed[out, 0] = u * texels - 0.5
    placed[out, 1] = v * texels - 0.5
    placed[out, 2] = px * axes[m, AWAY, 0] + py * axes[m, AWAY, 1] + pz * axes[m, AWAY, 2] - axes[m, ORIGIN, 2]
    optical = size * size * (3.1416 * DENSITY * stretch)
    if ti.static(layout.elliptic):
        tx = particles[TANGENT, b]
        ty = particles[TANGENT + 1, b]
        tz = particles[TANGENT + 2, b]
        half = 0.5 * stretch * particles[layout.half_length_row, b]
        e_x = (tx * axes[m, RIGHT, 0] + ty * axes[m, RIGHT, 1] + tz * axes[m, RIGHT, 2]) * half
        e_y = (tx * axes[m, UP, 0] + ty * axes[m, UP, 1] + tz * axes[m, UP, 2]) * half
        e_z = (tx * axes[m, AWAY, 0] + ty * axes[m, AWAY, 1] + tz * axes[m, AWAY, 2]) * half
        long = ti.sqrt(e_x * e_x + e_y * e_y) * texels
        points = ti.min(ti.max(ti.floor(long * (2.0 / APART) + 1.0), 1.0), MOST_POINTS)
        spacing = 2.0 / points
        placed[out, 4] = e_x * texels * spacing
        placed[out, 5] = e_y * texels * spacing
        placed[out, 6] = e_z * spacing
        placed[out, 7] = points
        optical = size * ti.sqrt(size * size + long * long) * (3.1416 * DENSITY) / points
    if ti.static(layout.opacity):
        optical *= ti.min(ti.max(particles[layout.opacity_row, b], 0.0), 1.0)
    else:
        optical *= axes[m, SCALE, 1]
    placed[out, 3] = optical


@ti.func
def _lay(
    layout: Template, turn, placed: Octets, b, lane, maps: I32x2, m, fine, ends: F32x2, depth_out: Blocks, counts: I32x2
):
    """One particle, point by point: into the first and last depths, then into the layers between them."""
    begin = maps[m, 0]
    width = maps[m, 1]
    high = maps[m, 2]
    optical = placed[b, 3][lane]
    if optical > 0.0:
        points = 1
        u = placed[b, 0][lane]
        v = placed[b, 1][lane]
        depth = placed[b, 2][lane]
        if ti.static(layout.elliptic):
            points = ti.cast(placed[b, 7][lane], ti.i32)
            back = 0.5 * (points - 1.0)
            u -= back * placed[b, 4][lane]
            v -= back * placed[b, 5][lane]
            depth -= back * placed[b, 6][lane]
        for _ in range(points):  # pyright: ignore[reportArgumentType]
            left = ti.min(ti.max(ti.cast(u, ti.i32), 0), width - 2)
            top = ti.min(ti.max(ti.cast(v, ti.i32), 0), high - 2)
            cell = begin + top * width + left
            if turn == 0:
                for j in ti.static(range(4)):
                    c = cell + (j // 2) * width + j % 2
                    lower(ends, (0, c), depth)
                    lift(ends, (1, c), depth)
            else:
                f = u - left
                g = v - top
                for j in ti.static(range(4)):
                    c = cell + (j // 2) * width + j % 2
                    part = (f if ti.static(j % 2 == 1) else 1.0 - f) * (g if ti.static(j // 2 == 1) else 1.0 - g)
                    k = _coordinate(depth - ends[0, c], ends[1, c] - depth, fine)
                    layer = ti.min(ti.cast(k, ti.i32), LAYERS - 1)
                    deepen(depth_out, counts, c, layer, optical * part)
            if ti.static(layout.elliptic):
                u += placed[b, 4][lane]
                v += placed[b, 5][lane]
                depth += placed[b, 6][lane]


@ti.kernel
def fill(
    layout: Template,
    chunks: Int,
    stretch: Float,
    particles: Octets,
    octet_count: Int,
    axes: F32x3,
    maps: I32x2,
    fine: Float,
    # scratch of a chunk:
    placed: Octets,
    # out, all maps one after another:
    ends_out: F32x2,
    depth_out: Blocks,
    counts: I32x2,
):
    """First and last depth [m] and optical depth up to the end of each layer, shape (2, texels), (texels, 1, 16).

    axes: (maps, 5, 3) as in `deep_map`; maps: rows (first texel, width, height). stretch: each piece stands
    for so many, and is that much longer. counts: zeros (texels, 16), see `deepen`.
    """
    if ti.static(runtime.resident()):
        for cell in range(ends_out.shape[1]):
            ends_out[0, cell] = EMPTY
            ends_out[1, cell] = -EMPTY
        for t in range(maps.shape[0] * octet_count):
            _place(layout, stretch, particles, t % octet_count, axes, t // octet_count, placed, t)
        for turn in ti.static(range(2)):
            for i in range(maps.shape[0] * octet_count * OCTET):
                t = i // OCTET
                _lay(layout, turn, placed, t, i % OCTET, maps, t // octet_count, fine, ends_out, depth_out, counts)
        for cell in range(ends_out.shape[1]):
            if ends_out[0, cell] < EMPTY:
                _sum_up(cell, depth_out, counts)
    else:
        for step in range(chunks * CHUNK_STEPS):
            if step % CHUNK_STEPS != 0:
                continue
            chunk = step // CHUNK_STEPS
            at = chunk * octet_count
            for m in range(share(maps.shape[0], chunk, chunks), share(maps.shape[0], chunk + 1, chunks)):  # pyright: ignore[reportArgumentType]
                begin = maps[m, 0]
                width = maps[m, 1]
                high = maps[m, 2]
                for b in range(octet_count):
                    _place(layout, stretch, particles, b, axes, m, placed, at + b)
                for cell in range(begin, begin + width * high):
                    ends_out[0, cell] = EMPTY
                    ends_out[1, cell] = -EMPTY
                # First where anything stands, then what each layer takes of the light; at last summed front to back.
                for turn in range(2):
                    for i in range(octet_count * OCTET):
                        t = at + i // OCTET
                        _lay(layout, turn, placed, t, i % OCTET, maps, m, fine, ends_out, depth_out, counts)
                    for cell in range(begin, begin + width * high):
                        if ends_out[0, cell] < EMPTY:
                            if turn == 0:
                                depth_out[cell, 0] = Vec16(0.0)
                            else:
                                _sum_up(cell, depth_out, counts)


@ti.func
def _sum_up(cell, depth_out: Blocks, counts: I32x2):
    """Optical depths of a texel up to the end of each layer."""
    row = laid(depth_out, counts, cell)
    total = 0.0
    for k in ti.static(range(LAYERS)):
        total += row[k]
        row[k] = total
    depth_out[cell, 0] = row


@ti.func
def _passing(how: Template, front, depth, cell, width, near, far, fine, depth_of: F32x2, walls: F32x2):
    """What passes between a depth [m] and the nearer ends of the four texels from `cell` on, or their farther ones: as
    of whole layers. near, far: those ends [m]."""
    through = ti.Vector([1.0, 1.0, 1.0, 1.0])
    f, g = depth - near, far - depth
    inside = f
    if not front:
        inside = g
    if inside.max() > 0.0:  # mostly not outside a cloth, and never where all four are empty
        k = _coordinate(ti.max(f, 0.0), ti.max(g, 0.0), fine)
        k = ti.min(ti.max(k + (-1.0 if front else 1.0), 0.0), 16.0)
        low = ti.min(ti.cast(k, ti.i32), ti.static(LAYERS - 1))
        optical = ti.Vector([0.0, 0.0, 0.0, 0.0])
        for j in ti.static(range(4)):
            c = cell + j // 2 * width + j % 2
            layer = low[j]  # pyright: ignore[reportIndexIssue]
            before = depth_of[c, ti.max(layer - 1, 0)] * ti.cast(layer > 0, ti.f32)
            optical[j] = before + (k[j] - layer) * (depth_of[c, layer] - before)  # pyright: ignore[reportIndexIssue]
            if not front:
                optical[j] = depth_of[c, LAYERS - 1] - optical[j]
        through = ti.select(inside > 0.0, decay(optical), 1.0)
    if ti.static(how.walled):
        for j in ti.static(range(4)):
            c = cell + j // 2 * width + j % 2
            if (front and depth > walls[0, c]) or (not front and depth < walls[1, c]):
                through[j] = 0.0  # pyright: ignore[reportIndexIssue]
    return through


@ti.func
def _seen(
    how: Template, place, normal, outward, lag, around, reading: F32x1, axes: F32x3, maps: I32x2,
    ends: F32x2, depth_of: F32x2, walls: F32x2,
):  # fmt: skip
    """The share of the sky, by the cosine to the normal, that is seen from a place moved `outward` [m] along it; and in
    bulk the mean direction of what is open before it (3), and, read BEYOND [m] farther out where the cloth that it is
    in hides nothing, the share of the sky seen by a surface that faces that way, and by its other side: with the sky's
    mean m and its mean m1 times direction, m + 2 m1 . n, which is exact where the sky is linear in the direction. Last,
    how closed the cloth is behind, 1, or how far it is a yarn alone, 0: by the mean over the directions of
    1 / (1 + (g / d)^2), where the last thing behind a place stands g behind it, and d is a yarn's diameter.

    around: m and 2 m1 of the cloth and how closed it is, where they are known (`Looking.part`), (5,); of "cloth" they
    are what is given back.
    lag: how far towards each end of a map it is moved before it reads [m]. BLIND: how far the maps do not show what
    hides what within a cloth, 0 to 1 (see `map_place.blind`): as far, a fibre sees all of the sky that the cloth does,
    on the side that is more open unless it faces the other, and what is open to it lies between there and its normal.
    """
    total, weight, mean = 0.0, 0.0, around[0]
    leaning = ti.Vector([around[1], around[2], around[3]])
    near_behind, closed = 0.0, around[4]
    open_way = ti.Vector([0.0, 0.0, 0.0])
    nx, ny, nz = normal[0], normal[1], normal[2]
    px = place[0] + outward * nx
    py = place[1] + outward * ny
    pz = place[2] + outward * nz
    for m in range(maps.shape[0]):
        # Where the place lies on the map, and which of its ends the surface faces.
        cosine = -(nx * axes[m, AWAY, 0] + ny * axes[m, AWAY, 1] + nz * axes[m, AWAY, 2])
        front = cosine > 0.0
        cosine = ti.abs(cosine)
        texels = axes[m, SCALE, 0]
        width = maps[m, 1]
        high = maps[m, 2]
        u = (px * axes[m, RIGHT, 0] + py * axes[m, RIGHT, 1] + pz * axes[m, RIGHT, 2] - axes[m, ORIGIN, 0]) * texels
        v = (px * axes[m, UP, 0] + py * axes[m, UP, 1] + pz * axes[m, UP, 2] - axes[m, ORIGIN, 1]) * texels
        depth = px * axes[m, AWAY, 0] + py * axes[m, AWAY, 1] + pz * axes[m, AWAY, 2] - axes[m, ORIGIN, 2]
        # How the depth of a surface varies over a texel: 1 + tan of the angle, up to 4.
        moved = lag * (1.0 + ti.min(ti.sqrt(ti.max(1.0 - cosine * cosine, 0.0)) / ti.max(cosine, 0.05), 3.0))
        moved = moved if front else -moved
        farther = reading[BEYOND] if front else -reading[BEYOND]
        u = ti.min(ti.max(u - 0.5, 0.0), width - 1.001)
        v = ti.min(ti.max(v - 0.5, 0.0), high - 1.001)
        left = ti.cast(u, ti.i32)
        top = ti.cast(v, ti.i32)
        s = u - left
        t = v - top
        # What passes on the way out there, of four texels.
        cell = maps[m, 0] + top * width + left
        part = ti.Vector([(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t])
        near = ti.Vector([ends[0, cell], ends[0, cell + 1], ends[0, cell + width], ends[0, cell + width + 1]])
        far = ti.Vector([ends[1, cell], ends[1, cell + 1], ends[1, cell + width], ends[1, cell + width + 1]])
        at = depth - moved
        away = ti.Vector([axes[m, AWAY, k] for k in ti.static(range(3))])
        way = -away if front else away
        if ti.static(how.part != "cloth"):
            passing = part.dot(_passing(how, front, at, cell, width, near, far, reading[FINE], depth_of, walls))
            total += cosine * passing
            weight += cosine
            open_way += passing * way
        if ti.static(how.bulk and how.part != "own"):
            at -= farther
            outside = part.dot(_passing(how, front, at, cell, width, near, far, reading[FINE], depth_of, walls))
            at = depth + moved + farther
            opposite = part.dot(_passing(how, not front, at, cell, width, near, far, reading[FINE], depth_of, walls))
            mean += (0.5 / maps.shape[0]) * (outside + opposite)
            leaning += (outside - opposite) / maps.shape[0] * way
            inner = (far - depth).max() if front else (depth - near).max()  # -1e30 where nothing stands
            inner = ti.max(inner, 0.0) * reading[YARNS]
            near_behind += 1.0 / (1.0 + inner * inner)
    seen, before, behind = total / ti.max(weight, 1e-6), 1.0, 1.0
    if ti.static(how.bulk and how.part != "own"):
        low, high = ti.static(OPEN_BEHIND)
        closed = ti.math.clamp((high - near_behind / maps.shape[0]) * ti.static(1.0 / (high - low)), 0.0, 1.0)
    if ti.static(how.part == "cloth"):
        seen, open_way = mean, leaning
    elif ti.static(how.bulk):
        # Where nothing is open the normal stands for it.
        open_way = (open_way + 0.05 * normal).normalized()
        lean = leaning.dot(open_way)
        before = ti.math.clamp(mean + lean, 0.0, 1.0)
        behind = ti.math.clamp(mean - lean, 0.0, 1.0)
        if reading[BLIND] > 0.0:
            side = leaning.norm()
            side *= ti.math.clamp(1.0 + 2.0 * leaning.dot(normal) / (side + 1e-6), -1.0, 1.0)
            of_cloth = ti.math.clamp(mean + side, 0.0, 1.0)
            seen += reading[BLIND] * (of_cloth - seen)
            before += reading[BLIND] * (of_cloth - before)
            behind += reading[BLIND] * (ti.math.clamp(mean - side, 0.0, 1.0) - behind)
            open_way = (open_way + (LEANT * reading[BLIND]) * (normal - open_way)).normalized()
            closed += reading[BLIND] * (1.0 - closed)
    return seen, before, behind, open_way, closed


@ti.kernel
def look(
    how: Template,
    # maps:
    axes: F32x3,
    maps: I32x2,
    reading: F32x1,
    ends: F32x2,
    depth_of: F32x2,
    walls: F32x2,
    # in:
    particles: F32x3,
    row: Int,
    # out:
    light_out: F32x3,
):
    """light_out[block, row, lane]: the share of the sky that packed particles see, 0..1; in bulk, in the rows after it
    what the cloth at their place sees before it and behind it, the direction (3) of what is open to them, and how
    closed the cloth is behind (`_seen`). Of the "cloth" alone its mean, in place of that direction how it leans, and
    how closed it is; of a particle's "own" these are there.

    reading: numbers by which they are read, `OFFSET` and so on.
    """
    keep(light_out, (0, 0, 0), row)
    for i in range(particles.shape[1] * LANES):
        b = i // LANES
        lane = i % LANES
        size = particles[RADIUS, b, lane]
        if size > 0.0:
            place = ti.Vector([particles[POSITION + k, b, lane] for k in ti.static(range(3))])
            normal = ti.Vector([particles[NORMAL + k, b, lane] for k in ti.static(range(3))])
            outward = reading[OFFSET] + 0.5 * size
            lag = reading[OFFSET] + 0.25 * size
            around = ti.Vector([0.0, 0.0, 0.0, 0.0, 1.0])
            if ti.static(how.part == "own"):
                around = ti.Vector([light_out[b, row + k, lane] for k in ti.static((0, 3, 4, 5, 6))])
            value, before, behind, way, closed = _seen(
                how, place, normal, outward, lag, around, reading, axes, maps, ends, depth_of, walls
            )
            light_out[b, row, lane] = value
            if ti.static(how.bulk):
                light_out[b, row + 1, lane] = before
                light_out[b, row + 2, lane] = behind
                for k in ti.static(range(3)):
                    light_out[b, row + 3 + k, lane] = way[k]
                light_out[b, row + 6, lane] = closed
        else:
            for k in ti.static(range(7 if how.bulk else 1)):
                light_out[b, row + k, lane] = 1.0


@ti.kernel
def look_at(
    how: Template,
    # maps:
    axes: F32x3,
    maps: I32x2,
    reading: F32x1,
    ends: F32x2,
    depth_of: F32x2,
    walls: F32x2,
    # in:
    points: F32x2,
    normals: F32x2,
    # out:
    light_out: F32x1,
):
    """light_out[i]: the share of the sky that points (n, 3) [m] with normals (n, 3) see. reading: as of `look`."""
    for i in range(points.shape[0]):
        place = ti.Vector([points[i, k] for k in ti.static(range(3))])
        normal = ti.Vector([normals[i, k] for k in ti.static(range(3))])
        none = ti.Vector([0.0, 0.0, 0.0, 0.0, 1.0])
        value, _, _, _, _ = _seen(
            how, place, normal, reading[OFFSET], reading[OFFSET], none, reading, axes, maps, ends, depth_of, walls
        )
        light_out[i] = value
