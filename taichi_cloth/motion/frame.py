"""A frame in one kernel: the stages of a substep as papers 3.2 and 4.1 list them, gone through by threads together.

    read      positions and steps of the state, and what friction within the sheet remembers
    of each substep:
        prepare   constraints look at where the cloth is; where key points will be a lag later
        slip      what rubs and locks within the sheet, if anything does
        move      springs, gravity, wind, fixed shapes: the solver's own stages
        warm      what constraints remember acts again
        correct   ties that hold, cloth on cloth, the body; then, in turns, strain limit and seams
    write     positions and steps of the state

What is a solver's own is `move`, made of stages like these; all else is the same for every solver whose frame is a
kernel. As every key point goes through the same arithmetic the bytes do not depend on the number of threads
(`crew.py`).
"""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, Float, I32x1, Int, Template
from taichi_cloth.ground.runtime import on_host
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.crew import PARTS, Crew, parts_of
from taichi_cloth.motion.grip import Grip
from taichi_cloth.motion.numbers import NUMBERS, Numbers, take_numbers
from taichi_cloth.motion.slipping import ANCHORS, Slipping
from taichi_cloth.motion.stage_clock import StageClock
from taichi_cloth.motion.stencil import Stencil, listed, load, store
from taichi_cloth.sheet.sheet import LANES, PAD, Sheet, SheetState

__all__ = ["Frame", "cloth_of_rows", "meets_itself"]

_CHUNK = 1024  # iterations a thread: Taichi gives it 512 or more


def cloth_of_rows(sheet: Sheet) -> NDArray[np.int32]:
    """Which of its cloths each row of a padded grid is of."""
    rows = np.arange(sheet.padded_shape[0]) - PAD
    return np.searchsorted([band.row for band in sheet.bands], rows, side="right").astype(np.int32)


def meets_itself(constraints: tuple[Constraint, ...]) -> bool:
    """Whether cloth meets cloth."""
    return any(one.answers == "self_contact" for one in constraints)


@ti.data_oriented
class Frame(Stencil):
    """Fields and kernel of a frame for sheets of up to so many elements: they share them, and compile once.

    numbers: of a step. packet: 8 neighbouring key points each, by the number of their lanes in the padded grid; cut:
    which of them are whose part. holder: whose constants are in the fields, the host's to use. sums: whether it goes
    through constraints several times in a substep. clock: is told where stages end; None: nothing of it is compiled.
    slips: whether there is friction within the sheet. cloths: how many there may be in it. grid: elements of a plane of
    a state.
    """

    sums = False
    plane = 6
    """Of the state, the first of the anchors of friction within the sheet."""
    cut: Any  # its numbers are bounds of loops: type checkers would take them for matrices
    loops: Any = None
    """The frame as parallel loops (room `loops`), where it is gone through so."""

    def __init__(
        self,
        size: int,
        threads: int,
        constraints: tuple[Constraint, ...],
        clock: StageClock | None = None,
        slips: bool = False,
        cloths: int = 1,
    ) -> None:
        super().__init__(size, cloths)
        if slips:
            self.slipping = Slipping(size, cloths=cloths)
            self.plane = 6 + sum(one.remembers for one in constraints)
        if meets_itself(constraints):
            self.grip = Grip(size)
        self.constraints, self.crew = constraints, Crew(threads)
        self.clock: Any = clock  # its functions are called where it is one
        self.timed = clock is not None
        self.numbers = Numbers.field(shape=() if cloths == 1 else cloths)
        self._number = [self.numbers.get_member_field(name) for name in NUMBERS]
        self.packet, self.cut = ti.field(ti.i32, size // LANES), ti.field(ti.i32, PARTS + 1)
        self.holder: object = None
        self.grid = ti.field(ti.i32, ())

    def fill(self, sheet: Sheet, state: SheetState, numbers: list[dict[str, float]]) -> None:
        """Takes what stays the same from frame to frame. numbers: of each cloth."""
        model = np.stack([sheet.padded(v) for v in (*sheet.weights, sheet.inverse_mass)])
        named = np.array([[one[name] for name in NUMBERS] for one in numbers], np.float32)
        self._take(model, state.values, *parts_of(sheet.padded(sheet.present) > 0), named)
        if self.cloth is not None:
            self._take_cloths(np.repeat(cloth_of_rows(sheet), sheet.width // LANES))

    @ti.kernel
    def _take_cloths(self, of: I32x1):
        """of: each packet."""
        for e in range(of.shape[0]):
            self.cloth[e] = of[e]

    @ti.kernel
    def _take(self, model: F32x3, values: F32x3, packets: I32x1, cuts: I32x1, named: F32x2):
        """Weights, and the state, with what lies around the sheet. named: `Numbers` of each cloth."""
        for i in range(values.shape[1]):
            for j in range(values.shape[2]):
                p = i * values.shape[2] + j
                self.east[p] = model[0, i, j]
                self.north[p] = model[1, i, j]
                self.cell[p] = model[2, i, j]
                self.inverse_mass[p] = model[3, i, j]
                for c in ti.static(range(3)):
                    self.position[c][p] = values[c, i, j]
                    self.ahead[c][p] = values[c, i, j]
                    self.ahead[c][p + self.size] = values[c, i, j]
                    self.step[c][p] = values[3 + c, i, j]
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.row[None], self.grid[None] = values.shape[2], values.shape[1] * values.shape[2]
            for part in range(cuts.shape[0]):
                self.cut[part] = cuts[part]
            take_numbers(self._number, named, self.cloths)
        ti.loop_config(serialize=ti.static(on_host()))
        for e in range(packets.shape[0]):
            self.packet[e] = packets[e]

    @ti.func
    def shared(self):
        """The numbers of the first cloth: those that all have alike are read of it."""
        if ti.static(self.cloths == 1):
            return self.numbers[None]
        else:
            return self.numbers[0]

    @ti.func
    def own(self, p, n: Template):
        """The numbers of the lanes at p; n: those of the first cloth."""
        if ti.static(self.cloths == 1):
            return n
        else:
            return self.numbers[self.kind(p)]

    @ti.kernel
    def run(
        self,
        # in and out
        values: F32x1,
        # in
        wind_x: Float,
        wind_y: Float,
        wind_z: Float,
        change_x: Float,
        change_y: Float,
        change_z: Float,
        first: Int,
        last: Int,
        fresh: Int,
        threads: Int,
        features: Template,
    ):
        """Substeps from `first` up to `last` of a frame. values: of a `SheetState`, in a row. wind: at the start of the
        frame [m/s], and its change in a substep. fresh: 0 where values are what the last call left in fields, too.
        features: `Features`."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.crew.assemble(threads)
        ti.loop_config(serialize=ti.static(self.crew.threads == 1))
        for k in range(self.crew.threads * _CHUNK):  # of a range that is not constant all would be one thread's
            if k % _CHUNK == 0 and k // _CHUNK < threads:
                wind, change = ti.Vector([wind_x, wind_y, wind_z]), ti.Vector([change_x, change_y, change_z])
                self.stages(k // _CHUNK, values, self.shared(), wind, change, first, last, fresh, features)

    @ti.func
    def stages(self, thread, values: Template, n: Template, wind, change, first, last, fresh, features: Template):
        """Substeps of the frame, as one of its threads goes through them. stage: number of the last one; ended: parts
        of stages that have ended by then."""
        at = 0  # which buffer of what is ahead is read
        self.begins(thread)
        stage, ended = self.in_parts(self.read, thread, 0, 0, first, fresh, wind, values, n, features)
        self.ends(thread, "state")
        for done in range(first, last):
            if ti.static(not features.leads):
                stage, ended = self.in_parts(self.prepare, thread, stage, ended, done, at, wind, values, n, features)
                self.ends(thread, "ahead")
            if ti.static(features.slips):
                stage, ended = self.in_parts(self.slip, thread, stage, ended, done, at, wind, values, n, features)
                stage, ended = self.in_parts(self.spread, thread, stage, ended, done, at, wind, values, n, features)
                self.ends(thread, "friction within")
            air = wind + done * change
            stage, ended = self.move(thread, stage, ended, done, at, air, values, n, features)
            self.ends(thread, "springs")
            if ti.static(features.leads):
                at = self.size - at
            for one in ti.static([one for one in self.constraints if one.remembers]):
                stage, ended = self.warm(one, thread, stage, ended, done, n)
            for one in ti.static([one for one in self.constraints if not one.repeated]):
                if not one.paired or done % 2 == 1:
                    stage, ended = self.correct(one, thread, stage, ended, done, n)
            for _ in range(ti.cast(n.sweeps, ti.i32)):  # pyright: ignore[reportArgumentType]
                for one in ti.static([one for one in self.constraints if one.repeated]):
                    stage, ended = self.correct(one, thread, stage, ended, done, n)
        self.in_parts(self.write, thread, stage, ended, last, at, wind, values, n, features)
        self.ends(thread, "state")

    @ti.func
    def begins(self, thread: Template):
        """The first thread is about to begin the frame."""
        if ti.static(self.timed):
            self.clock.start(thread)

    @ti.func
    def ends(self, thread: Template, what: Template):
        """The first thread has left a stage. what: name of it, or the constraint."""
        if ti.static(self.timed):
            self.clock.end(what, thread)

    @ti.func
    def before_springs(self, done, n: Template):
        """What constraints do before the springs of a substep, each as often as it asks to; by one thread."""
        for one in ti.static(self.constraints):
            if not one.paired or done % 2 == 0:
                one.before(self, done, n)
            if ti.static(self.timed):
                self.clock.end(one, 0)

    @ti.func
    def in_parts(
        self, work: Template, thread, stage, ended, done, at, wind, values: Template, n: Template, features: Template
    ):
        """One stage: work(part, done, at, wind, values, n, features) for each part, by whoever takes it. Returns its
        number, and the parts ended with it."""
        here, goal = stage + 1, ended + PARTS
        for turn in range(PARTS):
            part = self.crew.take(thread, turn, here, PARTS, goal)
            if part >= 0:
                work(part, done, at, wind, values, n, features)
                self.crew.finish()
        self.crew.meet(goal)
        return here, goal

    @ti.func
    def move(self, thread, stage, ended, done, at, wind, values: Template, n: Template, features: Template):
        """The solver's own stages, by `in_parts`: steps and positions after substep `done` but for constraints; and
        what is then ahead, into the buffer that is not read, where `features.leads`."""
        return stage, ended

    @ti.func
    def read(self, part, done, at, wind, values: Template, n: Template, features: Template):
        """The state of a part's key points from what the host holds. at: 0 where that is in fields already."""
        if ti.static(features.slips):
            self.slipping.begin(part, done)
        for e in range(self.cut[part], self.cut[part + 1]):
            p = self.lanes(self.packet[e] * LANES)
            if at != 0:
                for c in ti.static(range(3)):
                    store(self.position[c], p, load(values, self.plane_at(c, p)))
                    store(self.step[c], p, load(values, self.plane_at(3 + c, p)))
                for one in ti.static([one for one in self.constraints if one.remembers]):
                    one.open(self, values, p)
                if ti.static(features.slips):
                    for k in ti.static(range(ANCHORS)):
                        store(self.slipping.anchor[k], p, load(values, self.plane_at(self.plane + k, p)))
            if ti.static(features.grips):
                self.grip.begin(self.position, p, done)
            if ti.static(features.slips):
                self.slipping.inner(self, p)
        if ti.static(features.leads):
            self.lead_part(part, n)

    @ti.func
    def write(self, part, done, at, wind, values: Template, n: Template, features: Template):
        """And back."""
        for e in range(self.cut[part], self.cut[part + 1]):
            p = self.lanes(self.packet[e] * LANES)
            if ti.static(not features.apart):
                self.settle(p, at)
            for c in ti.static(range(3)):
                store(values, self.plane_at(c, p), load(self.position[c], p))
                store(values, self.plane_at(3 + c, p), load(self.step[c], p))
            for one in ti.static([one for one in self.constraints if one.remembers]):
                one.close(self, values, p)
            if ti.static(features.slips):
                for k in ti.static(range(ANCHORS)):
                    store(values, self.plane_at(self.plane + k, p), load(self.slipping.anchor[k], p))

    @ti.func
    def plane_at(self, plane, p):
        """Where the lanes at p are in a plane of a `SheetState`, in a row; bounded, or it is one lane at a time."""
        return listed(plane * self.grid[None] + p)

    @ti.func
    def prepare(self, part, done, at, wind, values: Template, n: Template, features: Template):
        """What constraints do before the springs, by whoever has the first part; and what is ahead of a part."""
        if part == 0:
            self.before_springs(done, n)
        self.lead_part(part, n)

    @ti.func
    def slip(self, part, done, at, wind, values: Template, n: Template, features: Template):
        """What rubs within the sheet, of a part, at buffer `at` of what is ahead."""
        for e in range(self.cut[part], self.cut[part + 1]):
            p = self.lanes(self.packet[e] * LANES)
            self.slipping.find(self, features.hinges, part, self.lanes(p + at), p)

    @ti.func
    def spread(self, part, done, at, wind, values: Template, n: Template, features: Template):
        """What cells pull the hinges around them by, of a part."""
        for e in range(self.cut[part], self.cut[part + 1]):
            self.slipping.spread(self, self.lanes(self.packet[e] * LANES))

    @ti.func
    def lead_part(self, part, n: Template):
        """`lead` of a part into the first buffer."""
        for e in range(self.cut[part], self.cut[part + 1]):
            p = self.lanes(self.packet[e] * LANES)
            self.lead(p, self.own(p, n))

    @ti.func
    def warm(self, one: Template, thread, stage, ended, done, n: Template):
        """One stage, by one thread: what a constraint remembers of the substep before acts again."""
        here, goal = stage + 1, ended + 1
        if self.crew.take(thread, 0, here, 1, goal) == 0:
            one.warm_start(self, done, n)
            self.crew.finish()
        self.crew.meet(goal)
        self.ends(thread, one)
        return here, goal

    @ti.func
    def correct(self, one: Template, thread, stage, ended, done, n: Template):
        """One stage or two: a constraint for each part and then for all. Returns as `in_parts`."""
        here, goal = stage, ended
        if ti.static(one.parts):
            here, goal = here + 1, goal + PARTS
            for turn in range(PARTS):
                part = self.crew.take(thread, turn, here, PARTS, goal)
                if part >= 0:
                    one.correct_part(self, part, self.cut[part], self.cut[part + 1], done, n)
                    self.crew.finish()
            self.crew.meet(goal)
        if ti.static(one.whole):
            here, goal = here + 1, goal + 1
            if self.crew.take(thread, 0, here, 1, goal) == 0:
                one.correct_whole(self, done, n)
                self.crew.finish()
            self.crew.meet(goal)
        self.ends(thread, one)
        return here, goal
