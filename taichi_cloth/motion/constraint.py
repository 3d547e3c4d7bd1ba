"""What corrects key points after the springs of a substep, inside the frame's kernel (paper 4.1): constraints.

The stencil knows neighbours at fixed offsets only. Whatever is irregular (a body, cloth against cloth, seams) is a
`Constraint`: an object with fields of its own and a Taichi function that changes positions and steps in place. They are
put together by whoever makes a solver (`constraints_for`); a solver that is given none compiles none.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import taichi as ti

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import Template
from taichi_cloth.motion.forces import FrameForces
from taichi_cloth.sheet.sheet import SheetState

__all__ = ["Constraint", "SharedConstraint", "shared_fields"]


class Constraint:
    """Base of all constraints. Each object that is made compiles a kernel of its own.

    Not `@ti.data_oriented`: constraints have no kernels, and with it each attribute that the host reads costs 1.5 µs.

    answers: the field of `Forces` that it sees to; "" for none.
    parts: it has a `correct_part`, which threads call for several parts at once (`crew.py`): calls for two parts write
    nothing in common, and neither reads what the other writes. In a kernel that threads share `x[p] += y` is atomic,
    and slow; `x[p] = x[p] + y` is not.
    whole: it has a `correct_whole`, which one thread calls.
    paired: called after every second substep (those with an odd number) instead of each, which is half the time to run
    and to compile.
    repeated: called after each substep, after those that are not, and with the others that are as often as the strain
    limit asks: what one of them changes the next answers. They are whole, and keep the sheet to one thread.
    stops: it also works between substeps, by `stop`, and may want a frame taken again, see `again`. At most one of a
    solver does.
    let_off: how often in the last frame it could not keep apart what it should, and let it through.
    pushed: how often in the last frame it had to push after its substeps what those should have kept apart.
    remembers: numbers of each key point that it keeps in the state from frame to frame, by `open` and `close`; above 0
    it has a `warm_start`. At most one constraint of a solver may.
    spreads: it has a `loop`, and so can do without the kernel that threads share. spread: whether it is to; said by the
    solver before fields are made.
    hangs: whether the cloth hangs still, and what keeps it so is known; said by the solver.
    clock: the solver's, see `KernelSolver`.
    known_as: in a line that says what a device lacks.
    keeps: planes of the state, as large as one of positions, that it uses as it likes, by `begin`, `end` and `rescale`.
    They are the last of the state, in the order of the constraints. kept_behind: planes of those after it, said by the
    solver.
    """

    answers = ""
    parts = False
    whole = False
    paired = False
    repeated = False
    stops = False
    let_off = 0
    pushed = 0
    remembers = 0
    keeps = 0
    kept_behind = 0
    spreads = False
    spread = False
    hangs = False
    clock: Any = None
    known_as = "a constraint"

    def loop(self, loops: Any, again: bool) -> Callable[..., Any] | None:
        """Where frames are parallel loops (`loops/frame_loops.py`): a kernel, a plain function without arguments, that
        does all of a substep after the springs, in loops over key points. again: once more in the same substep, as
        `correct_again`."""
        return None

    def warm_loops(self, loops: Any) -> tuple[Callable[..., Any], ...]:
        """Where frames are parallel loops: kernels like that, for `warm_start`; with `open_one` and `close_one`."""
        return ()

    def made_of(self) -> str:
        """A hash of what the motion follows from beside the sheet and the forces; "" where that is all."""
        return ""

    def join(self, substeps: int, step: float) -> None:
        """By the solver that takes the constraint, and whenever it takes other steps: `substeps` a frame, of `step`
        [s]."""

    def rescale(self, state: SheetState, share: float) -> None:
        """On the host, where steps become `share` of what they were: what is remembered in the state, in place."""

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        """On the host, before each frame. What it leaves must follow from its arguments, or a resumed run differs."""

    def end(self, state: SheetState) -> None:
        """On the host, after each frame: the place to report that a capacity was too small."""

    def stop(self, state: SheetState, done: int, loops: Any) -> tuple[int, int, bool]:
        """On the host, where `done` substeps of the frame are over, none at first: changes the state in place; where
        frames are parallel loops, key points in the fields of `loops`. Returns from which substep to go on, `done` or
        one that it has put the state back to, up to which until it is asked again, and whether it has changed the
        state; at the end of the frame the latter two do not matter."""
        return done, done, False

    def again(self) -> bool:
        """On the host, after `end`: whether the frame is to be taken again from its start, which `begin` then tells."""
        return False

    @ti.func
    def open(self, points: Template, values: Template, p):
        """What is remembered of the lanes at p, from what the host holds: the planes of values from 6 on, where
        `Frame.plane_at` says."""

    @ti.func
    def close(self, points: Template, values: Template, p):
        """And back."""

    @ti.func
    def open_one(self, values: Template, p, i, j):
        """What is remembered of element p alone, from values[6 + k, i, j]."""

    @ti.func
    def close_one(self, values: Template, p, i, j):
        """And back."""

    @ti.func
    def before(self, points: Template, done, n: Template):
        """Before the springs of substep number `done`; where `paired`, of each even one. By one thread, while others
        read positions and steps. Arguments as of `correct_part`."""

    @ti.func
    def warm_start(self, points: Template, done, n: Template):
        """Right after the springs of each substep, before all constraints. By one thread."""

    @ti.func
    def correct_part(self, points: Template, part, first, last, done, n: Template):
        """After the springs of substep number `done` of the frame, from 0.

        points: the `Frame`; elements p of its position[axis] and step[axis] [m] are what to change, and inverse_mass
        [1/kg] of p is 0 where nothing may move. p is an element of the sheet's padded grid, in one of the packets of
        lanes points.packet[e] of the part, for e from first up to last. part: its number. n: `Numbers`.
        """

    @ti.func
    def correct_again(self, points: Template, part, first, last, done, n: Template):
        """Where the frame `sums`: `correct_part` again in the same substep, after others have moved key points; it
        changes what this constraint has done in the substep, and does not do it a second time."""

    @ti.func
    def correct_whole(self, points: Template, done, n: Template):
        """The same, by one thread, after the calls of `correct_part` for all parts."""


class SharedConstraint(Constraint, ABC):
    """A constraint whose fields are made when they are first asked for, of `kind`, and shared with all of that kind.

    So constraints can be put together where Taichi does not run. And those that share fields are one to a solver: it
    needs no second kernel for them.

    fields_of: makes the object that has the fields, and the functions that work on them; it has a `holder`.
    """

    fields_of: ClassVar[Callable[..., Any]]

    @property
    @abstractmethod
    def kind(self) -> tuple[Hashable, ...]:
        """Sizes of the fields, and what the code depends on: arguments of `fields_of`."""

    @cached_property
    def fields(self) -> Any:
        return shared_fields(runtime.generation(), type(self).fields_of, *self.kind)

    def fill(self, state: SheetState) -> None:
        """Writes what does not change from frame to frame, where the fields hold that of another constraint."""

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        if self.fields.holder is not self:
            self.fill(state)
            self.fields.holder = self

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SharedConstraint) and self.fields is other.fields

    def __hash__(self) -> int:
        return id(self.fields)


@lru_cache(maxsize=48)
def shared_fields(generation: int, fields_of: Callable[..., Any], *kind: Hashable) -> Any:
    """generation: of the Taichi runtime; a new start throws all fields away."""
    out = fields_of(*kind)
    runtime.close_tree()
    return out
