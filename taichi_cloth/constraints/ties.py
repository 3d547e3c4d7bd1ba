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
"""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray
from scipy.sparse import csr_array

from taichi_cloth.ground.arrays import F32x2, I32x2, Int, Template
from taichi_cloth.ground.cache import digest
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.routine import routine
from taichi_cloth.motion.capacity import class_of
from taichi_cloth.motion.constraint import SharedConstraint
from taichi_cloth.motion.forces import FrameForces
from taichi_cloth.motion.stencil import load, near, store
from taichi_cloth.sheet.sheet import LANES, PAD, Sheet, SheetState

__all__ = ["LEARNT", "Ties"]

F64 = NDArray[np.float64]
NODES = 8
SHARE = NODES
ROW = 2 * NODES
"""Numbers of a tie that stay: weights, shares w/m / Σ w²/m."""
ALLOWED = 6
USUAL = ALLOWED + 2
PATH = USUAL + 3
"""Numbers of a tie for a frame: target at its start [m] and how far it moves, width allowed at its start [m] and how
that changes, and what it is usually pushed by in a substep [m]."""

CLOSED = 2e-3
"""Gap at the start of a frame up to which a tie is closed and held so, instead of being drawn together [m]."""

SEAM, HOLD = 0.02, 0.3
"""ε of ties that take turns with the strain limit, and of holds, which often ask of one cell what cannot be."""

MOST_AT_ONCE = 1024
"""Ties up to which they are closed at once: the work grows with the square of their number."""

FRESH, PUSHED = -1, -2
"""In place of how many ties are listed, in a substep: nothing was done yet; what those before were pushed by."""

FOLLOWING = 0.1
"""Over which pushes are averaged that the next substep begins with [s]. A T-shirt that walks has 51 of its 12,000
threads beyond 3 % without, 15 at 0.1 and 8 at 0.04; but key points that stand half outside the cloth twitch in its
armpits, by 27 mm/s at 0.1 and by 140 at 0.03, and at 0.01 a curtain shakes that has a seam across."""

LEARNT = 0.004
"""Push of a substep that is too small to be learnt from, as a share of a cell. Learnt from all the same, pushes hunt:
what adds up makes a spring of what was a tie, and a T-shirt at rest trembled at 4 mm/s. With 0.008 threads of one that
walks come to 10.7 % in place of 6.4."""

SLACK = 1e-4
"""By how much a tie has to be too wide to be seen to more than once in a substep [m]: few are."""


@ti.data_oriented
class TieFields:
    """Room for so many ties, and for what they are to do in a frame."""

    wide: Any  # its number is the bound of a loop: type checkers would take it for a matrix

    def __init__(self, capacity: int, repeated: bool, at_once: bool) -> None:
        self.capacity, self.repeated, self.at_once = capacity, repeated, at_once
        self.row, self.path = ti.field(ti.f32, (capacity, ROW)), ti.field(ti.f32, (capacity + 1, PATH))
        self.node = ti.field(ti.i32, (capacity, NODES))
        self.usual = ti.field(ti.f32, (3, capacity))
        if at_once:
            self.answer, self.stride = ti.field(ti.f32, capacity * capacity), ti.field(ti.i32, ())
            self.apart, self.push = ti.field(ti.f32, 6 * capacity), ti.field(ti.f32, 6 * capacity)
        self.holder: object = None
        self.wide, self.listed = ti.field(ti.i32, ()), ti.field(ti.i32, capacity)

    @ti.kernel
    def take(self, path: F32x2):
        """For a frame; its last row is of all ties."""
        ti.loop_config(serialize=True)  # less work than to wake threads
        for i, j in ti.ndrange(path.shape[0], path.shape[1]):
            self.path[i if i < path.shape[0] - 1 else self.capacity, j] = path[i, j]
        ti.loop_config(serialize=True)
        for k in range(path.shape[0] - 1):
            for c in range(3):
                self.usual[c, k] = path[k, USUAL + c]

    @ti.kernel
    def give(self, usual: F32x2):
        """What ties are usually pushed by, (3, ties) [m]."""
        ti.loop_config(serialize=True)
        for c, k in ti.ndrange(usual.shape[0], usual.shape[1]):
            usual[c, k] = self.usual[c, k]

    @ti.kernel
    def take_constant(self, node: I32x2, row: F32x2, answer: F32x2):
        """answer: (ties, ties) in whole lanes with 0, where they are closed at once."""
        ti.loop_config(serialize=True)
        for k in range(node.shape[0]):
            for j in range(NODES):
                self.node[k, j] = node[k, j]
            for j in range(ROW):
                self.row[k, j] = row[k, j]
        if ti.static(self.at_once):
            ti.loop_config(serialize=True)
            for k in range(answer.shape[0]):
                for m in range(answer.shape[1]):
                    self.answer[k * answer.shape[1] + m] = answer[k, m]
                for c in ti.static(range(6)):
                    self.apart[c * self.capacity + k] = 0.0
            self.stride[None] = answer.shape[1]

    @routine
    def pull(self, points: Template, done: Int):
        """Every tie, the first time in a substep; from then on those that were much too wide, one after the other."""
        # How much of the frame is over.
        share = ti.cast(done + 1, ti.f32) * self.path[self.capacity, 1]
        if ti.static(points.sums and self.repeated) and self.wide[None] == FRESH:
            self.push_as_usual(points)
            self.wide[None] = PUSHED
        elif ti.static(self.at_once):
            if self.wide[None] < 0 or ti.static(points.sums and not self.repeated):  # yarns pull again at what is held
                self.close_all(points, share)
            elif ti.static(self.repeated):
                for m in range(self.wide[None]):
                    self.close(points, self.listed[m], share)
        else:
            first = self.wide[None] < 0
            count, found = ti.cast(self.path[self.capacity, 0], ti.i32) if first else self.wide[None], 0
            for m in range(count):  # pyright: ignore[reportArgumentType]
                k = m if first else self.listed[m]
                if self.close(points, k, share) and first:
                    self.listed[found] = k
                    found += 1
            if first:
                self.wide[None] = found

    @ti.func
    def push_as_usual(self, points: Template):
        """All ties by what they are usually pushed by in a substep."""
        for k in range(ti.cast(self.path[self.capacity, 0], ti.i32)):  # pyright: ignore[reportArgumentType]
            push = ti.Vector([0.0] * 6)
            for c in ti.static(range(3)):
                push[c] = push[3 + c] = self.usual[c, k]
            self.move(points, k, push)

    @ti.func
    def close_all(self, points: Template, share):
        """Closes all ties at once, and lists those that were wider than SLACK."""
        # d: how much each tie, and its steps, is to come together; six numbers.
        found, count = 0, ti.cast(self.path[self.capacity, 0], ti.i32)
        for k in range(count):  # pyright: ignore[reportArgumentType]
            push, wide = self.wanted(points, k, share)
            for c in ti.static(range(6)):
                self.apart[c * self.capacity + k] = push[c]
            if wide:
                self.listed[found] = k
                found += 1
        self.wide[None] = found
        # λ: d times the known matrix, by blocks of 8 × 8.
        blocks = (count + LANES - 1) // LANES
        for c in ti.static(range(6)):
            for k in range(blocks * LANES):
                self.push[c * self.capacity + k] = 0.0
        for b in range(2 * blocks):  # three numbers at a time, which is what registers hold
            q, at = points.lanes((b % blocks) * LANES), b // blocks * 3 * self.capacity
            for m in range(blocks):
                self.answer_to(q, points.lanes(m * LANES), at)
        for k in range(count):  # pyright: ignore[reportArgumentType]
            push = ti.Vector([self.push[c * self.capacity + k] for c in ti.static(range(6))])
            self.move(points, k, push)
            self.learn(points, k, push)

    @ti.func
    def answer_to(self, q, m, at):
        """Adds the pushes of the ties at q that answer the gaps of those at m: three of their numbers, from `at` on."""
        n = ti.static(self.capacity)
        o = at + q
        a, b, c = load(self.push, o), load(self.push, o + n), load(self.push, o + 2 * n)
        for j in ti.static(range(LANES)):
            row = load(self.answer, near((m + j) * self.stride[None] + q))
            a = a + row * self.apart[at + m + j]
            b = b + row * self.apart[at + n + m + j]
            c = c + row * self.apart[at + 2 * n + m + j]
        store(self.push, o, a)
        store(self.push, o + n, b)
        store(self.push, o + 2 * n, c)

    @ti.func
    def measure(self, points: Template, k, share):
        """How far tie k is apart after this share of the frame, and how that changed in this step [m]."""
        out, moved = ti.Vector([0.0] * 6), self.path[self.capacity, 1]
        for c in ti.static(range(3)):
            out[c] = -self.path[k, c] - share * self.path[k, 3 + c]
            out[3 + c] = -moved * self.path[k, 3 + c]
        for j in ti.static(range(NODES)):
            p, weight = self.node[k, j], self.row[k, j]
            for c in ti.static(range(3)):
                out[c] += weight * points.position[c][p]
                out[3 + c] += weight * points.step[c][p]
        return out

    @ti.func
    def move(self, points: Template, k, push):
        """Brings tie k together by so much, and its steps by so much [m]."""
        for j in ti.static(range(NODES)):
            p, f = self.node[k, j], self.row[k, SHARE + j]
            for c in ti.static(range(3)):
                points.position[c][p] -= f * push[c]
                points.step[c][p] -= f * push[3 + c]

    @ti.func
    def wanted(self, points: Template, k, share):
        """How much tie k is to come together to the width allowed after this share of the frame, and its steps [m]; and
        whether it was wider by SLACK."""
        # How wide the gap is and may be, and how fast it grows as a share of itself.
        push = self.measure(points, k, share)
        gap = ti.sqrt(push[0] ** 2 + push[1] ** 2 + push[2] ** 2)
        allowed = self.path[k, ALLOWED] + share * self.path[k, ALLOWED + 1]
        growth = (push[0] * push[3] + push[1] * push[4] + push[2] * push[5]) / ti.max(gap * gap, 1e-24)
        most = self.path[self.capacity, 2] / ti.max(gap, 1e-12) + ti.max(growth, 0.0)
        # The share of it to close: what is too wide, at most what the set speed covers.
        over = ti.min(ti.max(gap - allowed, 0.0) / ti.max(gap, 1e-12), most)
        if allowed > 0.0:  # still being drawn together: no more of the step than it grows, along the gap
            for c in ti.static(range(3)):
                push[3 + c] = ti.min(ti.max(growth, 0.0), over) * push[c]
        for c in ti.static(range(3)):
            push[c] *= over
        return push, gap > allowed + SLACK

    @ti.func
    def close(self, points: Template, k, share):
        """Closes tie k to the width allowed after this share of the frame. Returns whether it was wider by SLACK."""
        push, wide = self.wanted(points, k, share)
        self.move(points, k, push)
        self.learn(points, k, push)
        return wide

    @ti.func
    def learn(self, points: Template, k, push):
        """That tie k was pushed by so much more than usual, if that is not little, nor the tie still being drawn in."""
        if ti.static(points.sums and self.repeated) and self.path[k, ALLOWED] <= 0.0:
            size = ti.sqrt(push[3] ** 2 + push[4] ** 2 + push[5] ** 2)
            gain = self.path[self.capacity, 3] * ti.max(1.0 - self.path[self.capacity, 4] / ti.max(size, 1e-12), 0.0)
            for c in ti.static(range(3)):
                self.usual[c, k] += gain * push[3 + c]


class Ties(SharedConstraint):
    """nodes: int (n, m ≤ 8, 2) rows and columns of key points. weights: (n, m); those of a tie sum to 0, or to 1 where
    it has a place. speed: at which gaps are closed [m/s].
    places: (n, 3) [m] at rest for a tie to a place, NaN for one between two points; None: all of the latter.
    bones: (n,) the bone that carries each place, −1 for none; None: none are carried.
    repeated: in turn with the strain limit, after contact; otherwise they give way to contact.

    Raises InputError on shapes that differ or no ties.
    """

    fields_of = TieFields
    whole = True
    substeps: int
    step: float
    reach: float
    gain: float

    def __init__(
        self,
        sheet: Sheet,
        nodes: NDArray[np.int64],
        weights: F64,
        *,
        speed: float = 0.5,
        places: F64 | None = None,
        bones: NDArray[np.int64] | None = None,
        repeated: bool = True,
    ) -> None:
        n, m = weights.shape
        if nodes.shape != (n, m, 2) or m > NODES or n == 0:
            shapes = f"{nodes.shape} and {weights.shape}"
            raise InputError(f"ties: nodes and weights of shapes {shapes}; allowed: (n, m, 2) and (n, m), m at most 8")
        self.count, self.speed, self.repeated = n, speed, repeated
        self.least = LEARNT * min(sheet.springs.spacing_x, sheet.springs.spacing_y)
        self.keeps = -(-3 * n // sheet.padded(sheet.present).size) if repeated else 0
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
        self.blend = self.weight.astype(np.float64)
        self.answer = self._answer(inverse, compliance) if n <= MOST_AT_ONCE else None
        self.places = np.full((n, 3), np.nan) if places is None else np.asarray(places, np.float64)
        self.bones = np.full(n, -1) if bones is None else np.asarray(bones)
        self.held = np.asarray(np.isfinite(self.places).all(axis=1))

    @property
    def kind(self) -> tuple[int, bool, bool]:
        """Room for ties, in whole lanes; a sheet's seams and what it is held by do not share one."""
        return class_of(self.count, MOST_AT_ONCE) + 2 * LANES, self.repeated, self.answer is not None

    def _answer(self, inverse: NDArray[np.float32], compliance: F64) -> F64:
        """(n, n): from all gaps to the pushes D λ of all ties, which `share` hands on to their key points."""
        used, node = np.unique(self.index, return_inverse=True)
        at = np.repeat(np.arange(self.count), NODES), node.ravel()
        blend = csr_array((self.blend.ravel(), at), shape=(self.count, len(used)))
        mobile = csr_array(((self.blend * inverse).ravel(), at), shape=blend.shape)
        soft = (SEAM if self.repeated else HOLD) * np.where(compliance > 0, compliance, 1.0)
        return compliance * np.linalg.inv((mobile @ blend.T).toarray() + np.diag(soft[:, 0]))

    def made_of(self) -> str:
        return digest(self.index, self.weight, self.share, self.places, self.bones, self.reach, self.repeated)

    def targets(self, bones: F64 | None) -> F64:
        """Places (n, 3) [m] with the bones there, (bones, 4, 4) or None for rest; 0 for ties between two points."""
        out = np.where(self.held[:, None], self.places, 0.0)
        carried = self.held & (self.bones >= 0)
        if bones is not None and carried.any():
            moved = bones[self.bones[carried]]
            out[carried] = np.einsum("nij,nj->ni", moved[:, :3, :3], out[carried]) + moved[:, :3, 3]
        return out

    def gaps(self, state: SheetState, bones: F64 | None = None) -> F64:
        """Width of each gap (n,) [m]."""
        return self._widths(state, self.targets(bones))

    def _widths(self, state: SheetState, targets: F64) -> F64:
        flat = state.values[:3].reshape(3, -1)
        apart = np.einsum("cnk,nk->nc", flat[:, self.index], self.blend) - targets
        return np.sqrt((apart * apart).sum(axis=1))

    def join(self, substeps: int, step: float) -> None:
        self.substeps, self.step, self.reach = substeps, step, self.speed * step * substeps
        self.gain = min(step / FOLLOWING, 1.0)

    def rescale(self, state: SheetState, share: float) -> None:
        if self.keeps:
            self._usual(state)[:] *= share * share

    def pushes(self, state: SheetState) -> NDArray[np.float32]:
        """What keeps each tie closed beside what it finds open, (3, ties) [m/s²]: 0 of what is held to a place."""
        return self._usual(state) / self.step**2 if self.keeps else np.zeros((3, self.count), np.float32)

    def push(self, state: SheetState, pushes: NDArray[np.float32]) -> None:
        """Begins with `pushes` of another simulation of the same ties, so that nothing springs when it starts."""
        if self.keeps:
            self._usual(state)[:] = pushes * self.step**2

    def _usual(self, state: SheetState) -> NDArray[np.float32]:
        """What each tie is usually pushed by in a substep, a view (3, ties) [m]."""
        return state.values[-self.keeps :].reshape(-1)[: 3 * self.count].reshape(3, self.count)

    def fill(self, state: SheetState) -> None:
        row = np.concatenate([self.weight, self.share], axis=1).astype(np.float32)
        answer = np.zeros((1, 1), np.float32) if self.answer is None else self.answer.T.astype(np.float32)
        self.fields.take_constant(self.index, row, np.pad(answer, (0, -len(answer) % LANES)))

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        super().begin(state, forces)
        frame, fields = forces.body, self.fields
        start = self.targets(frame.start if frame else None)
        end = self.targets(frame.end if frame else None)
        now = self._widths(state, start)
        path = np.zeros((self.count + 1, PATH), np.float32)
        path[:-1, :3], path[:-1, 3:ALLOWED] = start, end - start
        allowed = np.where((now > CLOSED) & self.repeated, now, 0.0)
        path[:-1, ALLOWED] = allowed
        path[:-1, ALLOWED + 1] = np.maximum(allowed - self.reach, 0.0) - allowed
        if self.keeps:
            path[:-1, USUAL:] = self._usual(state).T
        most = np.inf if self.repeated else self.reach / self.substeps
        path[-1, :5] = self.count, 1.0 / self.substeps, most, self.gain, self.least
        fields.take(path)

    def end(self, state: SheetState) -> None:
        if self.keeps:
            usual = np.empty((3, self.count), np.float32)
            self.fields.give(usual)
            self._usual(state)[:] = usual

    @ti.func
    def before(self, points: Template, done, n: Template):
        self.fields.wide[None] = -1

    @ti.func
    def correct_whole(self, points: Template, done, n: Template):
        self.fields.pull(points, done)
