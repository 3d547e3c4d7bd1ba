"""Ties: points of the cloth held together, or held to a moving place, by correcting positions after each substep.

A tie is a blend of up to eight key points, d = Σ w x (− target): the gap between two points embedded in the cloth, or
between one and its place. It is closed along d by moving its key points by −w/m · λ, which keeps the momentum of what
is tied together. All ties are closed at once in each substep:

    (G + ε D) λ = d,      G_ij = Σ_k w_ik w_jk / m_k,      D = diag G,

in which nothing changes over time, so that λ is the product of d and a matrix that is known. A small ε leaves a gap
to the next substep where ties nearly say the same of the same key points, which without it would throw them about.

Steps take the λ of d's own steps, not of d: what a gap has left over from before is mended in positions alone. Where
either is half done (by one sweep of Gauss–Seidel, say) seams shake what hangs on them without end.

Seams take turns with the strain limit; after the first turn those still too wide are closed one after the other,
λ = d / G_ii.

A whole yarn answers a seam as a rod does, and G takes its end for a free key point: what yarns pull open in each sweep
is closed again, and their last threads stay as long as that takes, by the square of the step. So among whole yarns a
substep begins with what seams were pushed by in those before, averaged over FOLLOWING, and what is left to find is how
that changes. Taken over at once and not slowly, it would act on cloth that hangs on a seam as a spring that comes too
late does, and shake it.

A gap wider than CLOSED shrinks at a set speed instead, so that panels are drawn together, and loses no
more of its steps than it grows. Holds come before contact, which has the last word: they close what a step has opened,
and draw at a set speed only beyond that.

What the body holds it holds by friction: a tie to a place bears a force up to `most`, and beyond that its place goes
along with the cloth, and stays there.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import splu

from taichi_cloth.constraints.beside_ties import LINKS, beside
from taichi_cloth.constraints.tie_fields import ALLOWED, EAGER, MOST, NODES, PATH, USUAL, TieFields
from taichi_cloth.constraints.tie_loops import TieLoops
from taichi_cloth.ground.arrays import Template
from taichi_cloth.ground.cache import digest
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.capacity import class_of
from taichi_cloth.motion.constraint import SharedConstraint
from taichi_cloth.motion.forces import FrameForces
from taichi_cloth.sheet.sheet import LANES, PAD, Sheet, SheetState

__all__ = ["LEARNT", "Ties"]

F64 = NDArray[np.float64]
TieAnswer = tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]
"""Where each row begins (n + 1,), columns and values row after row."""

MOST_AT_ONCE = 1024
"""Ties up to which a CPU closes them at once; a device however many. And up to which the matrix is made as a whole."""

BLOCK = 256
"""Rows of the matrix that are found at once."""

NEGLIGIBLE = 1e-5
"""Share of what a tie asks of itself that those are left out for that matter least to it, all together: about what
rounding leaves. A T-shirt's seams keep 22 of 214 numbers a row. With 1e-3 seams that are finer than the cells stay open
by 75 µm, of a strip thrown about, where 10 µm are left."""

CLOSED = 2e-3
"""Gap at the start of a frame up to which a tie is closed and held so, instead of being drawn together [m]."""

SEAM, HOLD = 0.02, 0.3
"""ε of ties that take turns with the strain limit, and of holds, which often ask of one cell what cannot be."""

THREADS, MANY = 4096, 1 << 20  # in the smallest class: beside ties, and of answers of more than a CPU closes at once
FOLLOWING = 0.1
"""Over which pushes are averaged that the next substep begins with [s]. A T-shirt that walks has 51 of its 12,000
threads beyond 3 % without, 15 at 0.1 and 8 at 0.04; but key points that stand half outside the cloth twitch in its
armpits, by 27 mm/s at 0.1 and by 140 at 0.03, and at 0.01 a curtain shakes that has a seam across."""

ANY = 1e9
"""More than any tie is pushed by in a substep [m]."""

LEARNT = 0.004
"""Push of a substep that is too small to be learnt from, as a share of a cell. Learnt from all the same, pushes hunt:
what adds up makes a spring of what was a tie, and a T-shirt at rest trembled at 4 mm/s. With 0.008 and 0.012 the
longest thread of one that walks comes to 3.04 and 2.98 % in place of 2.6."""

MOVING = 0.3
"""Speed of a tie from which on it learns in that time [m/s]. Slower ones learn more slowly: what keeps seams closed
changes as cloth moves, and what learns at rest hunts. Of a garment that hangs still they learn as all are closed at
once, and not from what is left then: where ties of a corner ask of its threads what cannot be, that grows as long as
it hangs, until the corner gives way."""


class Ties(SharedConstraint):
    """nodes: int (n, m ≤ 8, 2) rows and columns of key points. weights: (n, m); those of a tie sum to 0, or to 1 where
    it has a place. speed: at which gaps are closed [m/s].
    places: (n, 3) [m] at rest for a tie to a place, NaN for one between two points; None: all of the latter.
    bones: (n,) the bone that carries each place, −1 for none; None: none are carried.
    most: (n,) [N] that a tie to a place bears before that slides; None: any force.
    repeated: in turn with the strain limit, after contact; otherwise they give way to contact.

    Raises InputError on shapes that differ or no ties.
    """

    fields_of = TieFields
    whole = True
    spreads = True
    _loops: TieLoops | None = None
    substeps: int
    step: float
    reach: float
    gain: float
    _at_end: F64 | None

    def __init__(
        self,
        sheet: Sheet,
        nodes: NDArray[np.int64],
        weights: F64,
        *,
        speed: float = 0.5,
        places: F64 | None = None,
        bones: NDArray[np.int64] | None = None,
        most: F64 | None = None,
        repeated: bool = True,
    ) -> None:
        n, m = weights.shape
        if nodes.shape != (n, m, 2) or m > NODES or n == 0:
            shapes = f"{nodes.shape} and {weights.shape}"
            raise InputError(f"ties: nodes and weights of shapes {shapes}; allowed: (n, m, 2) and (n, m), m at most 8")
        self.count, self.speed, self.repeated = n, speed, repeated
        self.least = LEARNT * min(sheet.springs.spacing_x, sheet.springs.spacing_y)
        self.keeps = -(-3 * n // sheet.padded(sheet.present).size) if repeated or most is not None else 0
        self.index = np.zeros((n, NODES), np.int32)
        self.weight = np.zeros((n, NODES), np.float32)
        self.index[:, :m] = (nodes[..., 0] + PAD) * sheet.width + nodes[..., 1]
        self.weight[:, :m] = weights
        for c in range(1, m):  # a key point that a tie names twice is one: its lanes are read and written at once
            for b in range(c):
                again = self.index[:, c] == self.index[:, b]
                self.weight[again, b] += self.weight[again, c]
                self.weight[again, c] = 0.0
        self.index[self.weight == 0.0] = 0  # in the padding, where nothing is
        inverse = sheet.padded(sheet.inverse_mass).reshape(-1)[self.index]
        compliance = (self.weight.astype(np.float64) ** 2 * inverse).sum(axis=1, keepdims=True)
        self.share = self.weight * inverse / np.where(compliance > 0, compliance, np.inf)
        self.most = None if most is None else np.asarray(most, np.float64)
        self._yields, self._inverse, self._at_end = compliance[:, 0], inverse, None
        self.blend = self.weight.astype(np.float64)
        self.beside = beside(sheet, self.index, self.weight)
        self.places = np.full((n, 3), np.nan) if places is None else np.asarray(places, np.float64)
        self.bones = np.full(n, -1) if bones is None else np.asarray(bones)
        self.held = np.asarray(np.isfinite(self.places).all(axis=1))

    @property
    def kind(self) -> tuple[int, bool, int, int]:
        """Room for ties, in whole lanes, for numbers of their answers, and for threads; a sheet's seams and what it is
        held by do not share one."""
        threads = class_of(max(len(self.beside.ends), len(self.beside.tie) // LINKS), THREADS)
        room = class_of(self.count, MOST_AT_ONCE) + 2 * LANES
        numbers = room * room
        if self.count > MOST_AT_ONCE:
            numbers = class_of(len(self.answer[1]), MANY) if self.spread else 0
        return room, self.repeated, numbers, threads

    @cached_property
    def answer(self) -> TieAnswer:
        """From all gaps to the pushes D λ of all ties, which `share` hands on to their key points."""
        compliance = self._yields[:, None]
        used, node = np.unique(self.index, return_inverse=True)
        at = np.repeat(np.arange(self.count), NODES), node.ravel()
        blend = csr_array((self.blend.ravel(), at), shape=(self.count, len(used)))
        mobile = csr_array(((self.blend * self._inverse).ravel(), at), shape=blend.shape)
        soft = (SEAM if self.repeated else HOLD) * np.where(compliance > 0, compliance, 1.0)
        return answer_of(csr_array(mobile @ blend.T), soft, compliance)

    def _moves(self) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float32]]:
        """Key points that ties move (n, 2), each with where its ties begin, those ties, and by what share of their
        pushes they move it."""
        tie, node = np.nonzero(self.share)
        at = self.index[tie, node]
        order = np.argsort(at, kind="stable")
        used, begin = np.unique(at[order], return_index=True)
        points = np.stack([used, begin], axis=1).astype(np.int32)
        return points, tie[order].astype(np.int32), self.share[tie, node][order].astype(np.float32)

    def made_of(self) -> str:
        most = () if self.most is None else self.most
        return digest(self.index, self.weight, self.share, self.places, self.bones, self.reach, self.repeated, most)

    def targets(self, bones: F64 | None, state: SheetState | None = None) -> F64:
        """Places (n, 3) [m] with the bones there, (bones, 4, 4) or None for rest; 0 for ties between two points. state:
        which tells how far they have slid."""
        out = np.where(self.held[:, None], self.places, 0.0)
        if state is not None and self.most is not None:
            out += self._kept(state).T
        carried = self.held & (self.bones >= 0)
        if bones is not None and carried.any():
            moved = bones[self.bones[carried]]
            out[carried] = np.einsum("nij,nj->ni", moved[:, :3, :3], out[carried]) + moved[:, :3, 3]
        return out

    def gaps(self, state: SheetState, bones: F64 | None = None) -> F64:
        """Width of each gap (n,) [m]."""
        return self._widths(state, self.targets(bones, state))

    def _widths(self, state: SheetState, targets: F64) -> F64:
        flat = state.values[:3].reshape(3, -1)
        apart = np.einsum("cnk,nk->nc", flat[:, self.index], self.blend) - targets
        return np.sqrt((apart * apart).sum(axis=1))

    def loop(self, loops: Any, again: bool) -> Callable[..., Any]:
        if self._loops is None or self._loops.ties is not self.fields:
            self._loops = TieLoops(self.fields, self.kind[-1])
        return self._loops.kernel(loops, again)

    def join(self, substeps: int, step: float) -> None:
        self.substeps, self.step, self.reach = substeps, step, self.speed * step * substeps
        self.gain = min(step / FOLLOWING, 1.0)

    def rescale(self, state: SheetState, share: float) -> None:
        if self.repeated:
            self._kept(state)[:] *= share * share

    def pushes(self, state: SheetState) -> NDArray[np.float32]:
        """What keeps each tie closed beside what it finds open, (3, ties) [m/s²]: 0 of what is held to a place."""
        return self._kept(state) / self.step**2 if self.repeated else np.zeros((3, self.count), np.float32)

    def push(self, state: SheetState, pushes: NDArray[np.float32]) -> None:
        """Begins with `pushes` of another simulation of the same ties, so that nothing springs when it starts."""
        if self.repeated:
            self._kept(state)[:] = pushes * self.step**2

    def slid(self, state: SheetState) -> NDArray[np.float32]:
        """How far each place has slid on what carries it, in its axes at rest, (3, ties) [m]."""
        return np.zeros((3, self.count), np.float32) if self.most is None else self._kept(state)

    def slide(self, state: SheetState, slid: NDArray[np.float32]) -> None:
        """Begins with `slid` of another simulation of the same ties, so that nothing is drawn back to where it was."""
        if self.most is not None:
            self._kept(state)[:] = slid

    def _kept(self, state: SheetState) -> NDArray[np.float32]:
        """What each tie is usually pushed by in a substep, or how far its place has slid, a view (3, ties) [m]."""
        last = len(state.values) - self.kept_behind
        return state.values[last - self.keeps : last].reshape(-1)[: 3 * self.count].reshape(3, self.count)

    def fill(self, state: SheetState) -> None:
        row = np.concatenate([self.weight, self.share], axis=1).astype(np.float32)
        near = self.beside
        self.fields.beside.take(near.ends, near.numbers, near.begin, near.tie)
        none = np.zeros(1, np.int32), np.zeros(1, np.int32), np.zeros(1, np.float32)
        self.fields.take_constant(self.index, row, *self._moves(), *(self.answer if self.fields.at_once else none))

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        super().begin(state, forces)
        frame, fields = forces.body, self.fields
        start = self.targets(frame.start if frame else None, state)
        end = self.targets(frame.end if frame else None, state)
        self._at_end = frame.end if frame else None
        now = self._widths(state, start)
        path = np.zeros((self.count + 1, PATH), np.float32)
        path[:-1, :3], path[:-1, 3:ALLOWED] = start, end - start
        allowed = np.where((now > CLOSED) & self.repeated, now, 0.0)
        path[:-1, ALLOWED] = allowed
        path[:-1, ALLOWED + 1] = np.maximum(allowed - self.reach, 0.0) - allowed
        if self.repeated:
            path[:-1, USUAL:MOST] = self._kept(state).T
        path[:-1, MOST] = ANY if self.most is None else np.minimum(self.most * self._yields * self.step**2, ANY)
        most = np.inf if self.repeated else self.reach / self.substeps
        drawn = float((now <= CLOSED).all())
        path[-1, :7] = self.count, 1.0 / self.substeps, most, self.gain, self.least, drawn, 1.0 / (MOVING * self.step)
        path[-1, EAGER] = float(not (self.hangs and self.fields.at_once))
        fields.take(path)

    def end(self, state: SheetState) -> None:
        given = np.empty((3, self.count), np.float32)
        if self.repeated:
            self.fields.give(given)
            self._kept(state)[:] = given
        elif self.most is not None:
            self.fields.give_slid(given)
            carried = self.held & (self.bones >= 0)
            if self._at_end is not None and carried.any():  # back to the axes of what carries them, at rest
                turn = self._at_end[self.bones[carried], :3, :3]
                given[:, carried] = np.einsum("nji,jn->in", turn, given[:, carried])
            self._kept(state)[:] += given

    @ti.func
    def before(self, points: Template, done, n: Template):
        self.fields.wide[None] = -1

    @ti.func
    def correct_whole(self, points: Template, done, n: Template):
        self.fields.pull(points, done)


def answer_of(matrix: csr_array, soft: F64, compliance: F64) -> TieAnswer:
    """From all gaps to the pushes D λ of all ties. matrix: G (n, n); soft: ε D (n, 1); compliance: D (n, 1).

    What two ties have to do with each other falls off along a seam, so these lists grow with their number alone. Of
    many the matrix is never made as a whole, but row by row from a sparse factorization of its inverse."""
    count = len(compliance)
    if count <= MOST_AT_ONCE:
        answer = compliance * np.linalg.inv(matrix.toarray() + np.diag(soft[:, 0]))
        return _joined([_listed(answer, np.diag(answer))])
    factors, rows = splu((matrix + diags_array(soft[:, 0])).tocsc()), []
    for begin in range(0, count, BLOCK):
        here = np.arange(begin, min(begin + BLOCK, count))
        one = np.zeros((count, len(here)))
        one[here, here - begin] = 1.0
        answer = compliance[here] * factors.solve(one).T  # of a symmetric matrix columns are rows
        rows.append(_listed(answer, answer[here - begin, here]))
    return _joined(rows)


def _listed(answer: F64, own: F64) -> TieAnswer:
    """Of some rows, without what is negligible of them: the smallest, as long as they come to less than NEGLIGIBLE of
    what a tie asks of itself. own: that."""
    size = np.abs(answer)
    order = np.argsort(size, axis=1)
    below = np.cumsum(np.take_along_axis(size, order, axis=1), axis=1) > NEGLIGIBLE * own[:, None]
    kept = np.zeros(answer.shape, bool)
    np.put_along_axis(kept, order, below, axis=1)
    row, column = np.nonzero(kept)
    begin = np.searchsorted(row, np.arange(len(answer) + 1))
    return begin.astype(np.int32), column.astype(np.int32), answer[row, column].astype(np.float32)


def _joined(rows: list[TieAnswer]) -> TieAnswer:
    """Of rows one after the other."""
    sizes = np.concatenate([np.diff(begin) for begin, _, _ in rows])
    begin = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32)
    return begin, np.concatenate([one for _, one, _ in rows]), np.concatenate([one for _, _, one in rows])
