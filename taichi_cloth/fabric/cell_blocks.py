"""Fibre blocks of cells, worked out where a kernel asks for them: where each lies, what it is made of, its colour."""

import taichi as ti

from taichi_cloth.fabric.cells import (
    AHEAD_ENDS,
    AHEAD_PICKS,
    COL,
    COLS,
    DEEP,
    END,
    ENDS,
    FINE,
    PER_CELL_ENDS,
    PER_CELL_PICKS,
    PICK,
    PICKS,
    REPEAT_ENDS,
    REPEAT_PICKS,
    ROW,
    SHADE,
    SHIFT_END,
    SHIFT_PICK,
    TABLE,
    VARIANTS,
)
from taichi_cloth.fabric.surface import surface_at
from taichi_cloth.ground.arrays import F32x2, Template
from taichi_cloth.ground.mixing import ASLANT, colour_in_kernel, lit_among, sent_back_in_kernel, under_sky
from taichi_cloth.yarn.places import hashed, thick_at, wider_at
from taichi_cloth.yarn.unevenness import COVER, MOST_COVERED, SHIFT
from taichi_cloth.yarn.unevenness import ROWS as UNEVEN

__all__ = [
    "OPENED", "cell_block", "cell_crossing", "cell_inside", "cell_mean", "cell_shades", "cell_span", "cell_template",
    "cell_thick", "cell_turned_in", "cell_widths",
]  # fmt: skip

MIXED = 0.7
"""Of what threads lose among darker ones, what the mean of a sheet of them loses: by stripes from far and near."""
OPENED = 1.5
"""Power by which openness follows what is asked of a sheet's light, most of which is of the sky."""
SOME_THREADS = 3
"""By which threads it is told how thick many are."""
MOST_THREADS = 16
"""Threads of which the mean colour is taken; of more, every so many."""


@ti.func
def _repeated(cloth: Template, p, i, j):
    """Pick and end of its repeat that pick i and end j of panel p are."""
    pick = (i + cloth.panel[p, SHIFT_PICK]) % cloth.panel[p, REPEAT_PICKS]
    end = (j + cloth.panel[p, SHIFT_END]) % cloth.panel[p, REPEAT_ENDS]
    return pick, end


@ti.func
def _thick(cloth: Template, family, thread, last, first, along):
    """Of `thick_at`, of a thread of a panel counted from its first, which are so many."""
    out = 0.0
    if thread >= 0 and thread < last:
        out = thick_at(cloth.uneven, family, cloth.begin[first + thread], along)
    return out


@ti.func
def _aside(cloth: Template, family, thread, last, first, along):
    """How far the thick places of the threads on both sides push one [threads]."""
    before = _thick(cloth, family, thread - 1, last, first, along)
    after = _thick(cloth, family, thread + 1, last, first, along)
    return cloth.uneven[UNEVEN * family + SHIFT] * (before - after)


@ti.func
def cell_widths(cloth: Template, family, yarn, along):
    """How wide a thread is over its mean at a crossing and at the next."""
    seed = cloth.begin[yarn]
    return wider_at(cloth.uneven, family, seed, along), wider_at(cloth.uneven, family, seed, along + 1)


@ti.func
def _mean_thick(cloth: Template, family, at, room, last, first, along):
    """Of the threads of a panel between at ± room / 2, by some of them."""
    count = ti.math.clamp(ti.cast(ti.ceil(room), ti.i32), 1, SOME_THREADS)
    out = 0.0
    for n in range(count):
        thread = ti.cast(ti.floor(at + room * ((n + 0.5) / count - 0.5) + 0.5), ti.i32)
        out += _thick(cloth, family, ti.math.clamp(thread, 0, last - 1), last, first, along)
    return out / ti.sqrt(count * ti.max(room, ti.cast(count, ti.f32)))


@ti.func
def cell_thick(cloth: Template, p, i, j, tall, broad):
    """By how much of their width warp ends and weft picks are wider than on average at i picks and j ends of panel p,
    in the mean over so many picks and ends; and what is covered there over what is on average, as the area of surfels
    that cover as much (see `surfels`)."""
    warp = _mean_thick(cloth, 0, j, broad, cloth.panel[p, ENDS], cloth.panel[p, END], i)
    weft = _mean_thick(cloth, 1, i, tall, cloth.panel[p, PICKS], cloth.panel[p, PICK], j)
    a, b = cloth.uneven[COVER], cloth.uneven[UNEVEN + COVER]
    left = ti.max(1.0 - a * (1.0 + warp), 1.0 - MOST_COVERED) * ti.max(1.0 - b * (1.0 + weft), 1.0 - MOST_COVERED)
    return warp, weft, ti.log(left) / ti.log((1.0 - a) * (1.0 - b))


@ti.func
def cell_place(cloth: Template, p, cell, i, j):
    """Where pick i and end j of panel p cross, in shares of cell `cell` along the weft and the warp."""
    cols = cloth.grid[COLS]
    pick, end = _repeated(cloth, p, i, j)
    x = j + cloth.ahead[cloth.panel[p, AHEAD_ENDS] + end]
    y = i + cloth.ahead[cloth.panel[p, AHEAD_PICKS] + pick]
    x += _aside(cloth, 0, j, cloth.panel[p, ENDS], cloth.panel[p, END], i)
    y += _aside(cloth, 1, i, cloth.panel[p, PICKS], cloth.panel[p, PICK], j)
    u, v = x / cloth.grid[PER_CELL_ENDS], y / cloth.grid[PER_CELL_PICKS]
    return u - (cell % cols - cloth.panel[p, COL]), v - (cell // cols - cloth.panel[p, ROW])


@ti.func
def cell_crossing(cloth: Template, p, cell, i, j):
    """Place of pick i and end j of panel p [m], and slopes there along the weft and the warp, from cell `cell`."""
    u, v = cell_place(cloth, p, cell, i, j)
    return surface_at(cloth.node, cell, cloth.grid[COLS], u, v)


@ti.func
def cell_template(cloth: Template, p, family, i, j):
    """Of the fibre block of a family (0 warp, 1 weft) that begins at pick i and end j of panel p: its thread, its place
    along it, and its template at the finest level, −1 where the thread ends there."""
    pick, end = _repeated(cloth, p, i, j)
    kind = cloth.table[family, cloth.panel[p, TABLE] + pick * cloth.panel[p, REPEAT_ENDS] + end]
    yarn, along, last = cloth.panel[p, END] + j, i, cloth.panel[p, PICKS]
    if family == 1:
        yarn, along, last = cloth.panel[p, PICK] + i, j, cloth.panel[p, ENDS]
    phase = (cloth.begin[yarn] + along) % cloth.phases[kind]
    made = cloth.first[kind] + phase * cloth.grid[VARIANTS] + hashed(yarn, along) % cloth.grid[VARIANTS]
    return yarn, along, made if along + 1 < last else -1


@ti.func
def cell_block(cloth: Template, p, cell, family, i, j):
    """Both ends of that block: places p0, p1, directions of the yarn a0, a1, normals n0, n1."""
    x0, by_u, by_v = cell_crossing(cloth, p, cell, i, j)
    n0 = by_u.cross(by_v).normalized()  # pyright: ignore[reportOptionalMemberAccess]
    a0 = by_v.normalized() if family == 0 else by_u.normalized()
    x1, on_u, on_v = cell_crossing(cloth, p, cell, i + (1 - family), j + family)
    n1 = on_u.cross(on_v).normalized()  # pyright: ignore[reportOptionalMemberAccess]
    a1 = on_v.normalized() if family == 0 else on_u.normalized()
    return x0, x1, a0, a1, n0, n1


@ti.func
def cell_dye(cloth: Template, p, i, j):
    """What pick i and end j of panel p are dyed in where they cross, in place of their threads; below 0 for nothing."""
    out = ti.Vector([-1.0, -1.0, -1.0])
    at = cloth.panel[p, SHADE]
    if at >= 0:
        dyed = cloth.shade[at + i * cloth.panel[p, ENDS] + j]
        if dyed >= 0:
            root = ti.Vector([dyed >> 20, (dyed >> 10) & 1023, dyed & 1023]) / DEEP
            out = root * root
    return out


@ti.func
def cell_shades(cloth: Template, p, family, yarn, i, j, alone: F32x2):
    """Colours of a thread of a family at pick i and end j of panel p, as it looks on the right side and on the wrong
    one, beside the thread that crosses it there. alone: (panels, 4) of a warp end and of a weft pick on the right side,
    then on the wrong one, see `mixing`."""
    right = cell_dye(cloth, p, i, j)
    wrong = right
    if right[0] < 0.0:  # pyright: ignore[reportIndexIssue]
        other = cloth.panel[p, PICK] + i if family == 0 else cloth.panel[p, END] + j
        right = ti.Vector([cloth.colour[yarn, 0], cloth.colour[yarn, 1], cloth.colour[yarn, 2]])
        wrong = right
        for c in ti.static(range(3)):
            if alone[p, family] < 1.0 or alone[p, 2 + family] < 1.0:
                mine, beside = sent_back_in_kernel(cloth.colour[yarn, c]), sent_back_in_kernel(cloth.colour[other, c])
                right[c] = colour_in_kernel(lit_among(mine, beside, alone[p, family]))
                wrong[c] = colour_in_kernel(lit_among(mine, beside, alone[p, 2 + family]))
    return right, wrong


@ti.func
def _sent_back(cloth: Template, first, last, at, room):
    """Mean of what threads send back of light (see `mixing`), of those from number `first` to `last` between at ±
    room / 2, counted from the first."""
    low, high = at - 0.5 * room, at + 0.5 * room
    one = ti.math.clamp(ti.cast(ti.floor(low + 0.5), ti.i32), 0, last - first)
    two = ti.math.clamp(ti.cast(ti.floor(high + 0.5), ti.i32), 0, last - first)
    each = 1 + (two - one) // MOST_THREADS
    out, total = ti.Vector([0.0, 0.0, 0.0]), 1e-6
    for n in range((two - one) // each + 1):
        k = one + n * each
        weight = ti.min(high, k + 0.5) - ti.max(low, k - 0.5) if each == 1 else 1.0
        weight = ti.max(weight, 1e-6)
        thread = first + k
        own = ti.Vector([cloth.colour[thread, 0], cloth.colour[thread, 1], cloth.colour[thread, 2]])
        out += weight * sent_back_in_kernel(own)
        total += weight
    return out / total


@ti.func
def cell_mean(cloth: Template, p, i, j, tall, broad, warp, weft, warp_alone, weft_alone, open_warp, open_weft):
    """Colour of the cloth at i picks and j ends of panel p, over so many picks and ends: that which sends back `warp`
    times what its warp ends do among its weft picks and `weft` times what those do; of a print as its middle does. And
    its openness, of which warp and weft have one each: by what of its light is whose, and by what both send back of a
    sky over what a cloth of their mean does. It is one for three colours: of a colour that is more of the family that
    sees less than the others are, less is sent back, by the root of how much. And what of its light its warp ends send
    back. warp_alone, weft_alone: see `mixing`."""
    end, pick = cloth.panel[p, END], cloth.panel[p, PICK]
    ends, picks = cloth.panel[p, ENDS], cloth.panel[p, PICKS]
    out = cell_dye(cloth, p, ti.min(ti.cast(i + 0.5, ti.i32), picks - 1), ti.min(ti.cast(j + 0.5, ti.i32), ends - 1))
    both = ti.max(warp + weft, 1e-6)
    opening, by_warps = (warp * open_warp + weft * open_weft) / both, warp / both
    if out[0] < 0.0:  # pyright: ignore[reportIndexIssue]
        by_warp = _sent_back(cloth, end, end + ends - 1, j, broad)
        by_weft = _sent_back(cloth, pick, pick + picks - 1, i, tall)
        warp_alone, weft_alone = 1.0 - MIXED * (1.0 - warp_alone), 1.0 - MIXED * (1.0 - weft_alone)
        warps, wefts = lit_among(by_warp, by_weft, warp_alone), lit_among(by_weft, by_warp, weft_alone)
        out = warp * warps + weft * wefts
        each, whole = out, 0.0
        for c in ti.static(range(3)):
            of_warp, of_weft = warp * warps[c], weft * wefts[c]
            sent = ti.max(out[c], 1e-6)
            apart = of_warp * under_sky(warps[c], ASLANT) + of_weft * under_sky(wefts[c], ASLANT)
            under = apart / (sent * under_sky(sent / both, ASLANT))
            each[c] = (of_warp * open_warp + of_weft * open_weft) / sent * under**OPENED
            whole += out[c] * each[c]
        opening = whole / ti.max(out.sum(), 1e-6)
        by_warps = warp * warps.sum() / ti.max(out.sum(), 1e-6)
        for c in ti.static(range(3)):
            out[c] *= ti.sqrt(ti.max(each[c], 1e-6) / ti.max(opening, 1e-6))
    else:
        out = both * sent_back_in_kernel(out)
    return colour_in_kernel(out), ti.min(opening, 1.0), by_warps


@ti.func
def _share_inside(cloth: Template, thread, at, room):
    """How much of a thread between at ± room / 2 is not cut away."""
    total = 0.0
    for s in range(cloth.span_first[thread], cloth.span_first[thread + 1]):
        total += ti.max(0.0, ti.min(cloth.span[s, 1], at + 0.5 * room) - ti.max(cloth.span[s, 0], at - 0.5 * room))
    return ti.min(total / room, 1.0)


@ti.func
def cell_inside(cloth: Template, p, i, j, tall, broad):
    """What an outline leaves of the cloth at i picks and j ends of panel p, over so many picks and ends, 0 to 1."""
    end = ti.min(ti.cast(j + 0.5, ti.i32), cloth.panel[p, ENDS] - 1)
    pick = ti.min(ti.cast(i + 0.5, ti.i32), cloth.panel[p, PICKS] - 1)
    return ti.min(
        _share_inside(cloth, cloth.panel[p, END] + end, i, tall),
        _share_inside(cloth, cloth.panel[p, PICK] + pick, j, broad),
    )


@ti.func
def cell_turned_in(cloth: Template, p, cell, i, j):
    """Whether a hem is turned in under pick i and end j of panel p."""
    u, v = cell_place(cloth, p, cell, i, j)
    x, y = FINE * (cell % cloth.grid[COLS] + u), FINE * (cell // cloth.grid[COLS] + v)
    c = ti.math.clamp(ti.cast(ti.floor(x), ti.i32), 0, cloth.hem.shape[1] - 2)
    r = ti.math.clamp(ti.cast(ti.floor(y), ti.i32), 0, cloth.hem.shape[0] - 2)
    s, t = x - c, y - r
    low = (1.0 - s) * cloth.hem[r, c] + s * cloth.hem[r, c + 1]
    high = (1.0 - s) * cloth.hem[r + 1, c] + s * cloth.hem[r + 1, c + 1]
    return (1.0 - t) * low + t * high < 0.0


@ti.func
def cell_span(cloth: Template, yarn, along):
    """From where to where a block of a thread is not cut away, as shares of it: the longest piece; from 1 to 0 for
    none."""
    low, high = 1.0, 0.0
    for s in range(cloth.span_first[yarn], cloth.span_first[yarn + 1]):
        a = ti.math.clamp(cloth.span[s, 0] - along, 0.0, 1.0)
        b = ti.math.clamp(cloth.span[s, 1] - along, 0.0, 1.0)
        if b - a > ti.max(high - low, 1e-6):
            low, high = a, b
    return low, high
