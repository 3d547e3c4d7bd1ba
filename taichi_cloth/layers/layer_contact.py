"""Cloth that meets cloth, as a constraint of a sheet (what it does is in `layer_fields.py`).

A frame with an interval that could not be proven is taken again with intervals half as long, down to single substeps.
What cannot be parted even then is let off, as is what passes through itself at the start, and drawn apart from frame to
frame (`tangles.py`); `let_off` counts such pairs, and intervals after which key points had left their room.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground import runtime
from taichi_cloth.ground.arrays import Template
from taichi_cloth.ground.device_memory import require_device_memory
from taichi_cloth.ground.errors import InputError
from taichi_cloth.layers.contacts import AWAKE, PUSHED, SAVED, SLID
from taichi_cloth.layers.layer_fields import MOVED, NUMBERS, SHIFT, UNPROVEN, LayerFields
from taichi_cloth.layers.outline import Outline, Tables
from taichi_cloth.layers.paths import HOLD, POINT
from taichi_cloth.layers.tangles import Tangles
from taichi_cloth.layers.tree import levels_of
from taichi_cloth.motion.capacity import capacity_of, class_of
from taichi_cloth.motion.constraint import SharedConstraint
from taichi_cloth.motion.forces import FrameForces, SelfContact
from taichi_cloth.motion.foresight import Foresight
from taichi_cloth.motion.repeated import Repeated
from taichi_cloth.motion.stage_clock import StageClock
from taichi_cloth.sheet.sheet import PAD, Sheet, SheetState

__all__ = ["LayerContact"]

LONGEST, FREE = 2.4e-3, 5.6e-3
"""Of an interval, and of one where nothing is near [s]."""
SKIN, COARSE = 0.2, 0.16
"""Shares of the spacing: half of what pairs are sought within beyond their thickness, and how much more for blocks."""
FOLD = 0.1
"""Of the spacing, that layers are kept apart where cloth is bent, at most: so far chords from one key point to the next
leave a fold whose radius is 5/4 of it, the tightest that they follow."""
USE = 0.7
"""Share of its room that a search is used for."""
MEND_SUMMED, MEND = 0.06, 0.05
"""Share of the depth that is mended in each turn of a substep among whole yarns, and in each of Verlet's substeps."""
LEAST, FEWEST = 16_384, 4_096
"""Elements, and blends of them, that there is room for at least, some 70 MB: all sheets and garments up to that share
the kernel between substeps, which takes long to compile."""
TORN = 1.0
"""Strain of a thread that no cloth comes near."""
HALVINGS, CAREFUL = 4, 0.7
"""Times that intervals are halved for a frame that could not be proven, and what is left of the use with each."""
LEAST_SLACK = (0.25, 0.25, 0.3, 0.4)
"""Shares of their length by which the threads of a patch may turn at least, by its level and from the last on: those of
one with less are looked at more closely."""


class LayerContact(SharedConstraint):
    """The contact of one sheet with itself. options: see `SelfContact`. outline: of a sheet whose cells are not all
    whole, or that is sewn. keeps: contacts from frame to frame, where no other constraint keeps anything. loops_of:
    makes `LayerLoops`. Raises InputError on a thickness that is more than key points can keep."""

    fields_of = LayerFields
    known_as = "cloth on cloth"
    answers = "self_contact"
    whole = True
    stops = True

    def __init__(
        self,
        sheet: Sheet,
        options: SelfContact,
        outline: Outline | None = None,
        *,
        keeps: bool = False,
        loops_of: Any = None,
    ) -> None:
        s, self._sheet, self._tangles, self._tangled = sheet.springs, sheet, Tangles(sheet, outline), True
        spacing = min(s.spacing_x, s.spacing_y)
        if options.thickness > 4 * spacing:
            raise InputError(
                f"self_contact.thickness: {options.thickness:g} m; allowed: up to 4 times the spacing "
                f"({4 * spacing:g} m)"
            )
        most = max(options.thickness, FOLD * spacing)
        self._size, self._levels = capacity_of(sheet.padded_shape, LEAST), levels_of(*sheet.padded_shape)
        self._width, self._longest, self._free, self._halved = sheet.width, 1, 1, 0
        self._torn, self._unproven = False, False
        self._substeps, self._step, self._remembered = 1, 0.0, np.zeros(0, np.float32)
        named = {
            "thickness": options.thickness,
            "friction": options.friction,
            "reach": (1 + AWAKE) * most + 2 * SKIN * spacing,
            "coarse": COARSE * spacing,
            "margin": AWAKE * most,
            "spacing_x": s.spacing_x,
            "spacing_y": s.spacing_y,
            "most": most,
            "held": HOLD if outline is not None and options.held else 1.0,
        }
        named |= {str(level): least for level, least in enumerate(LEAST_SLACK)}
        self._numbers = np.array([named[name] for name in NUMBERS], np.float32)
        self.keeps = SAVED if keeps else 0
        self._loops_of, self.spreads, self._sewn = loops_of, loops_of is not None, outline is not None
        self._told: Any = None  # what told of the last frame, where loops did
        self._seen = Foresight()  # of what it tells
        # What met where a frame began, at key points `_looked`, and how these were moved; which triangles alone may
        # meet where it ended, at key points `_ended`.
        self._found: Any = None
        self._looked, self._ended, self._moves = np.zeros(0), np.zeros(0), np.zeros((*sheet.shape, 3))
        self._open: NDArray[np.bool_] | None = None
        self._inverse, self._tables = sheet.padded(sheet.inverse_mass).ravel(), Tables(sheet, outline, self._size)

    @property
    def kind(self) -> tuple[int, int, StageClock | None]:
        return self._size, class_of(len(self._tables.at), FEWEST), self.clock

    def join(self, substeps: int, step: float) -> None:
        self._substeps, self._step = substeps, step
        self._longest, self._free = (max(1, round(time / step)) for time in (LONGEST, FREE))

    def fill(self, state: SheetState) -> None:
        labels = np.stack([self._tables.has, self._tables.panel])
        self.fields.take(self._width, labels, self._inverse, self._levels, self._numbers)
        self.fields.take_outline(len(self._tables.at), *self._tables.arrays())
        self._tangled = True  # as far as is known

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        super().begin(state, forces)
        if self._tangled:
            self._untangle(state)
        share = 2**self._halved
        self._use = USE * CAREFUL**self._halved
        self._most, self._free_most = max(1, self._longest // share), max(1, self._free // share)
        self.fields.start(self._most, self._free_most, self._substeps, self._use, int(self._halved == HALVINGS))
        kept = len(state.values) - self.keeps if self.keeps else -1
        self._stop, self._unproven = Repeated(self.fields.stop, state.in_a_row, 0, kept), False

    def rescale(self, state: SheetState, share: float) -> None:
        if self.keeps:
            state.values[PUSHED - self.keeps : SLID - self.keeps] *= share * share

    def _untangle(self, state: SheetState) -> None:
        """Lets off what passes through other cloth, and moves it a little towards where it does not."""
        positions = self._sheet.positions(state)
        if not np.array_equal(positions, self._looked):  # else the frame is taken again
            goes_on = np.array_equal(positions, self._ended)
            self._found = self._tangles.find(positions, self._open if goes_on else None)
            self._looked = positions
        found = self._found
        self._tangled = found.count > 0
        labels = self._tangles.labels(found) if self._tangled else np.zeros(self._sheet.shape, np.int32)
        padded = np.zeros(self._sheet.padded_shape, np.int32)
        inside = np.s_[PAD:-PAD, : self._sheet.shape[1]]
        padded[inside] = labels
        self.fields.take_tangles(padded.ravel())
        self._moves = np.zeros_like(positions)
        if self._tangled:
            self._moves = self._tangles.moves(found, positions, self._substeps * self._step)
            state.values[:3][:, *inside] += np.moveaxis(self._moves, -1, 0).astype(np.float32)

    def end(self, state: SheetState) -> None:
        """Cloth that flies apart, as on steps that are too long for it, has no room for what it meets: it is left so
        that the solver sees it, and takes shorter ones."""
        self.pushed = int(self.fields.certificate.pushed[None]) if self._told is None else self._told.pushed
        self._ended, self._open = self._sheet.positions(state), None
        self._torn = bool(self._full()) and not self._whole(state)
        if self._torn:
            state.values[:3] = np.nan

    def _whole(self, state: SheetState) -> bool:
        return bool(max(strain.max() for strain in self._sheet.stretch(self._sheet.positions(state))) < TORN)

    def again(self) -> bool:
        """Raises InputError where there was no room for all pairs or contacts, however short intervals are."""
        if self._seen.wrong:
            return True
        full = self._full()
        if self._torn:
            self._halved = 0
            return False
        unproven = self.fields.unproven[None] if self._told is None else self._told.unproven
        proven = unproven == 0 and not full
        if proven or self._halved == HALVINGS:
            self._halved = 0
            if full:
                raise InputError(full)
            self.let_off = unproven
            self.let_off += self.fields.certificate.let_off[None] if self._told is None else self._told.let_off
            self._tangled |= self.let_off > 0  # perhaps: the next frame looks
            if not unproven:
                self._open = self._tangles.none
                if self._tangled:
                    self._open = self._tangles.open(self._cells_let_off(), self._moves)
            return False
        self._halved += 1
        return True

    def _cells_let_off(self) -> NDArray[np.int32]:
        """(rows, cols), above 0 where a cell was not held apart from others in the last frame."""
        shape = self._sheet.padded_shape
        tangles = self.fields.near.tangle.to_numpy()[: shape[0] * shape[1]].reshape(shape)
        return tangles[PAD:-PAD, : self._sheet.shape[1]]

    def _full(self) -> str:
        """What there was no room for in the last frame."""
        fields = self.fields
        contacts = ("contacts", fields.contacts), ("contacts of pieces", fields.contacts.blended)
        for name, part in (("cells", fields.search), ("near pairs", fields.near), *contacts):
            if part.overflow[None]:
                return (
                    f"cloth on cloth: no room for {part.overflow[None]} {name}; the sheet lies in too many layers: "
                    "use a smaller forces.self_contact.thickness_mm, wider spacing, or forces.self_contact=false"
                )
        return ""

    def over(self, loops: Any) -> Any:
        """What it does as parallel loops, over those of a frame."""
        there = int(((self._tables.has & POINT) != 0).sum())

        def made(loops: Any) -> Any:
            out = self._loops_of(self.fields, loops, there, sewn=self._sewn)
            if not runtime.on_host():
                require_device_memory("cloth on cloth", there, (out,), (self.fields, loops.frame, loops))
            return out

        return loops.kernel(("layers", id(self.fields), self._sewn), made)

    def loop(self, loops: Any, again: bool) -> Callable[..., Any]:
        return self.over(loops).response(MEND_SUMMED if loops.frame.sums else MEND, again)

    def stop(self, state: SheetState, done: int, loops: Any) -> tuple[int, int, bool]:
        if self._unproven and self._halved < HALVINGS:
            return done, self._substeps, False  # it will be taken again
        if loops is not None:
            if done == 0:
                self._told = self.over(loops)
                self._told.start(
                    self._most, self._free_most, self._substeps, self._use, self._halved == HALVINGS, self._seen
                )
            begun, until = self._told.stop(state.values[len(state.values) - self.keeps :], done)
            self._unproven = self._told.unproven > 0
            return begun, until, True
        said, begun = divmod(self._stop(done=done), SHIFT)
        said, until = divmod(said, SHIFT)
        moved, self._unproven = bool(said & MOVED), bool(said & UNPROVEN)
        # What is remembered of key points beside where they are, and their steps.
        remembered = state.values[6 : len(state.values) - self.keeps]
        if remembered.size and begun < done:
            remembered[:] = self._remembered
        elif remembered.size:
            self._remembered = remembered.copy()
        return begun, until, moved

    @ti.func
    def before(self, points: Template, done, n: Template):
        self.fields.contacts.turns[None] = 0

    @ti.func
    def correct_whole(self, points: Template, done, n: Template):
        contacts = self.fields.contacts
        if contacts.turns[None] == 0:
            contacts.warm(points)
            if self.fields.paths.held[None] < 1.0:
                self.fields.paths.hold_all(points, done + 1 - self.fields.began[None])
        contacts.turns[None] = 1
        contacts.respond(points, MEND_SUMMED if ti.static(points.sums) else MEND)
