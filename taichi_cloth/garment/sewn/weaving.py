"""Weaving a garment's panels (paper 2.3 and 4): threads between key points, that end where the outline ends.

The atlas is woven as one cloth with k threads a key point; each panel keeps the fibre blocks that are its own, up to
its outline, and has threads of its own, counted from the panel's own origin, so that stripes of panels that are sewn
together can meet.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from taichi_cloth.fabric.crossings import refine_points, refined_mask
from taichi_cloth.fabric.fabric import Fabric
from taichi_cloth.fabric.layout import BODY
from taichi_cloth.garment.pattern.cut import Atlas, CutPanel, intervals, turned
from taichi_cloth.garment.pattern.hems import from_hems
from taichi_cloth.garment.pattern.prints import Print
from taichi_cloth.ground.errors import InputError

__all__ = ["Colours", "Weaving", "crossings_shape"]

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Colours:
    """Repeats of thread colours, each (n, 3) linear: of the warp along the panel's x, of the weft along its y."""

    warp: F32
    weft: F32


def crossings_shape(of: Atlas | CutPanel, k: int) -> tuple[int, int]:
    """(picks, ends) of the cloth that a garment is cut from, or of a panel's rectangle, with k threads a key point."""
    rows, cols = of.shape
    return (rows - 1) * k + 1, (cols - 1) * k + 1


class Weaving:
    """A garment's threads.

    cloth: the atlas as one woven fabric of `crossings_shape`. colours: of panels by name; a panel that is not named
    keeps the cloth's. hem: width that the panels' hems are turned inwards [m]: a second layer of the same threads lies
    under the first along them. prints: pictures on panels by name. Raises InputError on a cloth of another size or a
    panel that is not there.

    fabric: the cloth with its threads numbered panel by panel. spans: (blocks, 2) from and to where along each of its
    blocks there is cloth, from > to for none. present: (picks, ends) crossings that exist. panel: (threads,) number of
    the panel each thread is of. height: from the middle of the cloth to its right side [m]. shades: (blocks, 3) linear,
    the colours of printed blocks, NaN for those that keep their thread's; None where nothing is printed.
    """

    def __init__(
        self,
        atlas: Atlas,
        cloth: Fabric,
        k: int,
        colours: Mapping[str, Colours] | None = None,
        *,
        hem: float = 0.0,
        prints: Mapping[str, Print] | None = None,
    ) -> None:
        shape = cloth.layout.cloth.warp_up.shape
        if shape != crossings_shape(atlas, k):
            raise InputError(f"garment: cloth of {shape} crossings; allowed: {crossings_shape(atlas, k)}")
        names = [p.panel.name for p in atlas.panels]
        for name in colours or {}:
            if name not in names:
                raise InputError(f"garment.colours: no panel {name!r}; known: {', '.join(names)}")
        self.atlas, self.threads_per_key_point = atlas, k
        places, nodes, shares = atlas.ghosts()
        cols = atlas.shape[1]
        self._ghost_places = places[:, 0] * cols + places[:, 1]
        starts = np.arange(0, shares.size + 1, shares.shape[1])
        self._ghost_blends = csr_array(
            (shares.astype(np.float32).ravel(), (nodes[..., 0] * cols + nodes[..., 1]).ravel(), starts),
            shape=(len(places), atlas.shape[0] * cols),
        )
        self._mask = atlas.present()
        self._mask[tuple(places.T)] = True
        self.present = refined_mask(self._mask, k)
        blocks, kinds = cloth.layout.blocks, cloth.layout.kinds
        row, col = np.divmod(blocks.key0, shape[1])
        last_row, last_col = np.divmod(blocks.key1, shape[1])
        warp = kinds.family[blocks.kind] == 0
        woven = (kinds.section[blocks.kind] == BODY) & self.present[row, col] & self.present[last_row, last_col]
        self.spans = np.tile(np.array([1.0, 0.0], np.float32), (len(row), 1))
        thread = np.zeros(len(row), np.int32)
        middle = np.full((len(row), 2), np.nan)  # of each block, in its panel's grain coordinates [m]
        turned_in = np.zeros(len(row), bool)
        self.shades: F32 | None = np.full((len(row), 3), np.nan, np.float32) if prints else None
        shades, owners = [], []
        count = 0
        for number, piece in enumerate(atlas.panels):
            top, left = piece.row * k, piece.col * k
            high, wide = crossings_shape(piece, k)
            i, j = row - top, col - left
            mine = woven & (i >= 0) & (last_row - top < high) & (j >= 0) & (last_col - left < wide)
            for along_warp, n, at, place in ((True, wide, j, i), (False, high, i, j)):
                chosen = np.flatnonzero(mine & (warp == along_warp))
                self.spans[chosen] = _spans(piece, k, along_warp, at[chosen], place[chosen])
                thread[chosen] = count + at[chosen]
                own = cloth.thread_colour[left : left + n] if along_warp else cloth.thread_colour[shape[1] + top :][:n]
                if colours and piece.panel.name in colours:
                    repeat = colours[piece.panel.name]
                    own = _repeated(repeat.warp if along_warp else repeat.weft, piece, k, along_warp, n)
                shades.append(own)
                owners.append(np.full(n, number, np.int32))
                count += n
                if hem > 0 or prints:
                    half = np.array([0.0, 0.5] if along_warp else [0.5, 0.0])
                    middle[chosen] = (np.stack([j, i], -1)[chosen] + half) * piece.spacing / k + piece.origin
            if hem > 0:
                turned_in |= _in_hem(piece, hem, np.where(mine[:, None], middle, np.nan))
            if prints and piece.panel.name in prints:
                assert self.shades is not None
                self.shades[mine] = prints[piece.panel.name].at(turned(middle[mine], -piece.panel.grain))
        self.panel = np.concatenate(owners)
        layout = replace(cloth.layout, blocks=replace(blocks, thread=thread))
        self.fabric = replace(cloth, layout=layout, thread_colour=np.concatenate(shades).astype(np.float32))
        self.height = float(np.quantile(np.abs(cloth.bank.offset[:, 2]), 0.98))  # of its yarns, not of hairs
        if turned_in.any():
            self._turn_in(np.flatnonzero(turned_in))

    def _turn_in(self, chosen: NDArray[np.int64]) -> None:
        """A second layer of some blocks under the first, its wrong side up: z goes to −z − 2 · height. Its threads lie
        half a thread beside those of the first: no two layers of cloth have their pores in one line."""
        fabric, bank, blocks = self.fabric, self.fabric.bank, self.fabric.layout.blocks
        used, first, own = np.unique(bank.template[chosen], return_index=True, return_inverse=True)
        family = fabric.layout.kinds.family[blocks.kind[chosen[first]]]
        apart = np.asarray(self.atlas.spacing)[family] / self.threads_per_key_point
        sizes = np.diff(bank.start)
        rows = np.concatenate([np.arange(int(bank.start[t]), int(bank.start[t + 1])) for t in used.tolist()])
        old = bank.properties()
        new = {name: values[rows].copy() for name, values in old.items()}
        for name in ("offset", "tangent", "normal"):
            new[name][:, 2] *= -1
        new["offset"][:, 2] -= 2 * self.height
        new["offset"][:, 1] += np.repeat(apart / 2, sizes[used])
        bank = replace(
            bank,
            start=np.concatenate([bank.start, bank.start[-1] + np.cumsum(sizes[used])]),
            template=np.concatenate([bank.template, len(sizes) + own]).astype(np.int32),
            **{name: np.concatenate([values, new[name]]) for name, values in old.items()},
        )
        both = {f.name: getattr(blocks, f.name) for f in fields(blocks)}
        blocks = replace(blocks, **{name: np.concatenate([v, v[chosen]]) for name, v in both.items()})
        layout = replace(fabric.layout, blocks=blocks)
        self.fabric = replace(fabric, layout=layout, bank=bank, particle_start=bank.particle_start)
        self.spans = np.concatenate([self.spans, self.spans[chosen]])
        if self.shades is not None:  # the wrong side is not printed
            self.shades = np.concatenate([self.shades, np.full((len(chosen), 3), np.nan, np.float32)])

    def crossings(self, positions: NDArray) -> F32:
        """Crossings (picks, ends, 3) float32 [m] of key points (rows, cols, 3) [m]."""
        points = np.array(positions, np.float32)
        flat = points.reshape(-1, 3)
        flat[self._ghost_places] = self._ghost_blends @ flat
        return refine_points(points, self._mask, self.threads_per_key_point)


def _in_hem(piece: CutPanel, width: float, points: F64) -> NDArray[np.bool_]:
    """Which points (n, 2) in grain coordinates, NaN for none, lie within `width` of a panel's hems [m]."""
    out = np.zeros(len(points), bool)
    known = np.isfinite(points).all(axis=1)
    out[known] = from_hems(piece, points[known], width) < width
    return out


def _spans(piece: CutPanel, k: int, along_warp: bool, thread: NDArray, place: NDArray) -> F32:
    """(n, 2) from and to, as shares of the way from crossing `place` to the next, where thread number `thread` of a
    panel is inside its outline: the longest piece of it."""
    outline = piece.outline()
    across, along = (0, 1) if along_warp else (1, 0)
    pitch = np.asarray(piece.spacing) / k
    out = np.tile(np.array([1.0, 0.0]), (len(thread), 1))
    order = np.argsort(thread, kind="stable")
    starts = np.searchsorted(thread[order], np.arange(thread.max(initial=-1) + 2))
    for number in range(len(starts) - 1):
        rows = order[starts[number] : starts[number + 1]]
        value = piece.origin[across] + number * pitch[across]
        for low, high in (intervals(outline, value, across) - piece.origin[along]) / pitch[along]:
            a, b = np.clip(low - place[rows], 0.0, 1.0), np.clip(high - place[rows], 0.0, 1.0)
            longer = b - a > np.maximum(out[rows, 1] - out[rows, 0], 1e-6)
            out[rows[longer], 0], out[rows[longer], 1] = a[longer], b[longer]
    return out.astype(np.float32)


def _repeated(repeat: F32, piece: CutPanel, k: int, along_warp: bool, count: int) -> F32:
    """(count, 3) colours of a panel's threads, counted from the one nearest the panel's own origin."""
    axis = 0 if along_warp else 1
    first = round(float(piece.origin[axis]) / (piece.spacing[axis] / k))
    return np.asarray(repeat, np.float32)[(first + np.arange(count)) % len(repeat)]
