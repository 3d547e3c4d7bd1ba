"""What cloth that meets cloth does between substeps, as parallel loops (`layers/layer_fields.py` has the order).

All stages are loops over key points, nodes, pairs or contacts; what is told from their outcome, once or twice in an
interval, the host decides: whether an interval is proven, or taken again, and whether a search is due. Three numbers
come back for it, which it mostly foresees (`motion/foresight.py`). Two runs on a device give the same bytes: lists are
in the order of cells, and nothing is summed by atomics but whole numbers.
"""

from collections.abc import Callable
from typing import Any

import taichi as ti

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import Float, Int
from taichi_cloth.layer_loops.contact_loops import ContactLoops
from taichi_cloth.layer_loops.pair_loops import PairLoops
from taichi_cloth.layer_loops.path_loops import PathLoops, carry
from taichi_cloth.layer_loops.piece_loops import PieceLoops
from taichi_cloth.layer_loops.proof_loops import ProofLoops
from taichi_cloth.layer_loops.search_loops import SearchLoops
from taichi_cloth.layers.certificate import BACK, LET_OFF, LOOK, PUSH, PUSHES, ROUNDS
from taichi_cloth.layers.nearest import EDGES, FACES
from taichi_cloth.motion.foresight import MOST_ANSWERS, Foresight
from taichi_cloth.motion.stencil import taking

__all__ = ["LayerLoops"]

EACH, MOST = 8, 1 << 20
"""Threads that go through lists of pairs, for each element of the padded grid; and at most."""

ANSWER = 3
"""Numbers of one."""

Told: Any = ti.types.vector(ANSWER, ti.f32)


@ti.data_oriented
class LayerLoops:
    """Of one sheet. points: the `LayerFields`, whose lists and numbers are used. loops: of the frame, a `FrameLoops`.
    there: key points of the sheet. sewn: whether it has an outline, as a garment has: pieces of cells, and points that
    are blends of key points.

    told: [question of the frame], what it was answered.
    Of a frame pushed, let_off, unproven: as of `LayerFields` and `Certificate`.
    """

    def __init__(self, points: Any, loops: Any, there: int, *, sewn: bool) -> None:
        self.points, self.loops, self.frame, self.sewn = points, loops, loops.frame, sewn
        rows, width = loops.padded_shape
        self.count = rows * width
        self.paths = PathLoops(points, self.count, width, there, sewn=sewn)
        self.search = SearchLoops(points, loops.padded_shape, min(-(-EACH * self.count // 1024) * 1024, MOST))
        self.pairs = PairLoops(self.search, sewn=sewn)
        self.pieces: Any = PieceLoops(self.pairs) if sewn else None
        self.contacts = ContactLoops(self.pairs, sewn=sewn)
        self.proof = ProofLoops(self.contacts)
        self.told = ti.field(ti.f32, (MOST_ANSWERS, ANSWER))
        self.start(1, 1, 1, 0.0, False, Foresight())

    def start(self, longest: int, free: int, substeps: int, use: float, lets: bool, seen: Foresight) -> None:
        """Before a frame: as `LayerFields.start`. seen: of the sheet."""
        self._longest, self._free, self._substeps, self._use, self._lets = longest, free, substeps, use, lets
        self.seen = seen
        seen.start(longest, free, substeps, use, lets)
        self._restart()

    def _restart(self) -> None:
        self.pushed = self.let_off = self.unproven = 0
        self._since = self._began = self._horizon = 0
        self._used, self._allowed, self._alone = 0.0, self._free, False

    def stop(self, kept: Any, done: int) -> tuple[int, int]:
        """Between two intervals, `done` substeps of the frame over. kept: planes of the state that contacts are kept
        in, or none. Returns from which substep the next goes, an earlier one where the last is taken again, and up to
        which."""
        with taking(1), runtime.plain_code(routines=True):
            if done == 0 and len(kept):
                self.contacts.load(kept)
            begun, until = self._decide(done, bool(len(kept)))
            if begun == self._substeps:
                if len(kept):
                    self.contacts.save(kept)
                self._see(bool(len(kept)))
            return begun, until

    def _decide(self, done: int, remembers: bool) -> tuple[int, int]:
        return self._open(remembers) if done == 0 else self._close(done)

    def _see(self, remembers: bool) -> None:
        """At the end of a frame, whether it went as foreseen."""
        if not self.seen.ahead:
            return self.seen.end(self.unproven == 0)
        told: Any = self.told.to_numpy().tolist()
        with self.seen.repeated(told):
            self._restart()
            begun = until = 0
            while begun < self._substeps:
                begun, until = self._decide(until, remembers)
        if self.unproven:
            self.seen.end(False)

    def _do(self, kernel: str, *numbers: float) -> None:
        if self.seen.decided(kernel, *numbers):
            getattr(self, kernel)(*numbers)

    def _ask(self, kernel: str, *numbers: float) -> Any:
        """What a kernel tells: three numbers."""
        self._do(kernel, *numbers, self.seen.row)
        return self.seen.answer(lambda row: self._read(row))

    def _open(self, remembers: bool) -> tuple[int, int]:
        if self.sewn:
            self._do("_learn")
        self._do("_arrive")
        self._look_for_all(0.0, self._substeps)
        return self._begin(0, min(self._most(), self._substeps), remembers)

    def _most(self) -> int:
        """Substeps of an interval."""
        return self._free if self._alone else self._longest

    def _look_for_all(self, span: float, left: int) -> None:
        self._do("_search", span, self._longest, left)
        if self.sewn:
            self._do("_ask_pieces")
        self._do("_keep")
        if self.sewn:
            self._do("_keep_pieces")
        faces, edges, horizon = self._ask("_list")
        self._since, self._used, self._horizon, self._alone = 0, 0.0, int(horizon), faces + edges == 0

    def _begin(self, done: int, length: int, first: bool = False) -> tuple[int, int]:
        """An interval. first: whether contacts begin with what the state remembers of them."""
        self._do("_go_on", done, length, int(first))
        self._began = done
        return done, done + length

    def _close(self, done: int) -> tuple[int, int]:
        """As `LayerFields.close`."""
        span = done - self._began
        self._since += span
        long = span > max(self._longest // 2, 1)
        self._do("_arrive")
        used, bad, deep = self._ask("_judge", self._since, LOOK)
        again, moved = long and (used > 0.999 or deep > 0), False
        if not again and used > 0.999:
            self._do("_pull", float(span))
            used, bad, _ = self._ask("_judge", self._since, LOOK)
            moved = True
        if again:
            self._since -= span
            self._do("_put_back", self._began)
            self._allowed = span // 2
            return self._begin(self._began, span // 2)
        if bad > 0:
            used, bad = self._mend_all(int(bad))
            moved = True
        if moved:
            self._do("_leave")
        self._do("_turn")
        if used > 1.0 or bad > 0:
            self.unproven += 1
        self._used = used
        self._allowed = min(self._allowed + max(1, self._allowed // 4), self._free)
        return self._next(done, span)

    def _mend_all(self, bad: int) -> tuple[float, int]:
        """As `Certificate.settle`, after a first look: pushes until all is parted, or nothing helps. Returns what of
        the paths' room is used then, and how many are not parted."""
        self.pushed += bad
        used = 0.0
        for turn in range(1, ROUNDS):
            remedy = PUSH if turn < PUSHES else BACK
            if turn == ROUNDS - 1 and self._lets:
                remedy = LET_OFF
                self.let_off += bad
            self._do("_mend", remedy)
            used, left, _ = self._ask("_judge", self._since, remedy)
            bad = 0 if remedy == LET_OFF else int(left)
            if bad == 0:
                break
        return used, bad

    def _next(self, done: int, span: int) -> tuple[int, int]:
        """As `LayerFields.go_on`, but that all is searched if anything is."""
        left = self._substeps - done
        if left == 0:
            return done, done
        rate = self._used / max(self._since, 1)
        length = min(self._most(), self._allowed, left, int(self._use / max(rate, 1e-5)))
        length = max(length, 1)
        if self._since + length > self._horizon or self._used + length * rate > self._use:
            self._look_for_all(float(span), left)
        return self._begin(done, length)

    @ti.kernel
    def _arrive(self):
        """Where key points are, from the frame."""
        for p in range(self.count):
            carry(self.frame.position, self.frame.step, self.points.position, self.points.step, p)
        self.refresh()

    @ti.func
    def refresh(self):
        """A loop: blends of key points are where these are."""
        if ti.static(self.sewn):
            self.pieces.refresh()

    @ti.kernel
    def _leave(self):
        """And back."""
        for p in range(self.count):
            self.give(p)

    @ti.func
    def give(self, p):
        if not self.paths.is_blend(p):
            carry(self.points.position, self.points.step, self.frame.position, self.frame.step, p)

    @ti.kernel
    def _search(self, span: Float, longest: Int, left: Int):
        """Of all, from paths that begin here."""
        self.paths.predict(span, longest, left)
        self.search.boxes()
        if ti.static(self.sewn):
            self.pieces.reach()
        self.search.rise()
        self.search.descend()
        self.pairs.ask_all()

    @ti.kernel
    def _learn(self):
        self.pieces.learn()

    @ti.kernel
    def _ask_pieces(self):
        self.pieces.count_up()
        self.pieces.ask_all()

    @ti.kernel
    def _keep(self):
        self.pairs.keep_all()

    @ti.kernel
    def _keep_pieces(self):
        self.pieces.keep_all()

    @ti.func
    def tell(self, row, what):
        for k in ti.static(range(ANSWER)):
            self.told[row, k] = what[k]

    @ti.kernel
    def _read(self, row: Int) -> Told:  # pyright: ignore[reportInvalidTypeForm]
        return Told([self.told[row, k] for k in ti.static(range(ANSWER))])

    @ti.kernel
    def _list(self, row: Int):
        """Of what was found: how many pairs there are of both kinds, and how many substeps that is good for."""
        self.search.settle()
        if ti.static(self.sewn):
            self.pieces.settle()
        count = ti.static(self.points.near.pairs.count)
        for _ in range(1):
            self.tell(row, Told(count[FACES], count[EDGES], self.points.horizon[None]))

    @ti.kernel
    def _go_on(self, done: Int, length: Int, first: Int):
        """An interval of so many substeps begins with substep `done`. first: as of `ContactLoops.next`."""
        self.paths.keep()
        for _ in range(1):
            self.points.began[None] = done
        self.loops.note()
        self.contacts.next(length, first)

    @ti.kernel
    def _judge(self, since: Int, remedy: Int, row: Int):
        """Which share of the paths' room is used, how many pairs are not parted, and how many of them by much."""
        self.paths.measure(since)
        self.proof.look(remedy)
        for _ in range(1):
            used, proof = self.points.paths.used[None], self.points.certificate
            self.tell(row, Told(used, proof.bad[None], proof.deep[None]))

    @ti.kernel
    def _mend(self, remedy: Int):
        self.proof.mend(remedy)
        self.refresh()

    @ti.kernel
    def _pull(self, span: Float):
        self.paths.pull_back(span)
        self.refresh()

    @ti.kernel
    def _turn(self):
        self.proof.turn()

    @ti.kernel
    def _put_back(self, done: Int):
        """To where the interval began, with substep `done`."""
        self.paths.go_back()
        for p in range(self.count):
            self.give(p)
        self.refresh()
        self.loops.recall(done)

    def response(self, mended: float, again: bool) -> Callable[..., Any]:
        """A kernel of a substep, the first time in it, or again."""
        contacts, points, loops = self.contacts, self.frame, self.loops

        @ti.kernel
        def respond():
            if ti.static(not again):
                contacts.warm(points)
                if ti.static(self.sewn):
                    self.paths.hold(points, loops)
            contacts.respond(points, mended)

        return respond
