"""What acts on key points after the stencil of a substep: a list of optional passes, inside the frame's kernel.

The stencil knows neighbours at fixed offsets only. Whatever is irregular (a body, cloth against cloth, seams) is a
`Pass`: an object with fields of its own and a Taichi function that changes positions and steps in place. A solver that
is given none compiles none.
"""

import taichi as ti

from taichi_cloth.ground.arrays import Template
from taichi_cloth.motion.forces import FrameForces
from taichi_cloth.sheet.sheet import SheetState

__all__ = ["Pass"]


class Pass:
    """Base of all passes. Each object that is made compiles a kernel of its own.

    Not `@ti.data_oriented`: passes have no kernels, and with it each attribute that the host reads costs 1.5 µs.

    parts: it has an `after`, which threads call for several parts at once (`crew.py`): calls for two parts write
    nothing in common, and neither reads what the other writes. In a kernel that threads share `x[p] += y` is atomic,
    and slow; `x[p] = x[p] + y` is not.
    whole: it has an `after_all`, which one thread calls.
    paired: called after every second substep (those with an odd number) instead of each, which is half the time to run
    and to compile.
    repeated: called after each substep, after those that are not, and with the others that are as often as the strain
    limit asks: what one of them changes the next answers. They are whole, and keep the sheet to one thread.
    remembers: numbers of each key point that it keeps in the state from frame to frame, by `open` and `close`; above 0
    it has a `ready`. At most one pass of a solver may.
    """

    parts = False
    whole = False
    paired = False
    repeated = False
    remembers = 0

    def made_of(self) -> str:
        """A hash of what the motion follows from beside the sheet and the forces; "" where that is all."""
        return ""

    def join(self, substeps: int, step: float) -> None:
        """By the solver that takes the pass, and whenever it takes other steps: `substeps` a frame, of `step` [s]."""

    def rescale(self, state: SheetState, share: float) -> None:
        """On the host, where steps become `share` of what they were: what is remembered in the state, in place."""

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        """On the host, before each frame. What it leaves must follow from its arguments, or a resumed run differs."""

    def end(self, state: SheetState) -> None:
        """On the host, after each frame: the place to report that a capacity was too small."""

    @ti.func
    def before(self, work: Template, done, n: Template):
        """Before the stencil of substep number `done`; where `paired`, of each even one. By one thread, while others
        read positions and steps. Arguments as of `after`."""

    @ti.func
    def open(self, values: Template, p, i, j):
        """What is remembered of the lanes at p, from values[6 + k, i, j + lane] of the host."""

    @ti.func
    def close(self, values: Template, p, i, j):
        """And back."""

    @ti.func
    def ready(self, work: Template, done, n: Template):
        """Right after the stencil of each substep, before all passes. By one thread."""

    @ti.func
    def after(self, work: Template, part, first, last, done, n: Template):
        """After the stencil of substep number `done` of the frame, from 0.

        work: the `Stencil`; elements p of its position[axis] and step[axis] [m] are what to change, and inverse_mass
        [1/kg] of p is 0 where nothing may move. p is an element of the sheet's padded grid, in one of the blocks of
        lanes work.block[e] of the part, for e from first up to last. part: its number. n: `Numbers`.
        """

    @ti.func
    def after_all(self, work: Template, done, n: Template):
        """The same, by one thread, after the calls of `after` for all parts."""
