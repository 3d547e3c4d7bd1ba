"""Cloth against a body (paper 4.1): key points are kept out of its primitives, with Coulomb friction, no restitution.

Once a frame the bounding boxes of the body's tree follow it (`body/hierarchy.py`), each swept over the whole frame.
Every 16 milliseconds each packet of 8 neighbouring key points walks the tree and lists the primitives that it can reach
before the next walk, and from when on. From then it measures its distance from them, again when it has slid over them,
which leaves a plane for each key point (`contact_planes.py`); every substep it meets only these
(`contact_response.py`).

Response of a key point that stands deeper than the gap: out along the normal, which takes the velocity towards the
surface and no more, and against its slip over the moving surface by at most µ times that. What was deep before is let
out at `recovery`, in positions alone.

Where steps are so long that a limb could be crossed in one, the way of the step is searched in pieces shorter than half
the thinnest primitive.
"""

from collections.abc import Callable, Hashable
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.body.colliders.colliders import BoneFrame, Colliders, Solid
from taichi_cloth.body.colliders.grid import DistanceGrid
from taichi_cloth.body.colliders.hierarchy import build, corners
from taichi_cloth.body.primitives.distance import newton_steps
from taichi_cloth.constraints.contact_response import Response
from taichi_cloth.constraints.contact_surface import CONE, ELLIPTIC, GRID, SETTINGS, Row
from taichi_cloth.ground.arrays import Template
from taichi_cloth.motion.capacity import capacity_of, class_of
from taichi_cloth.motion.constraint import SharedConstraint
from taichi_cloth.motion.forces import FrameForces
from taichi_cloth.sheet.sheet import LANES, PAD, Sheet, SheetState

__all__ = ["Contact"]

F64 = NDArray[np.float64]

LONGEST_WAIT = 16e-3  # [s] between two walks of the tree
LEAST_WAIT = 1.1e-3  # [s] between two looks at one primitive
RAREST = 16  # substeps at most between two looks
SPARE = 0.5  # [m/s] that a key point may gain meanwhile, beside a quarter of its speed; what gains more is met late
SLIDE = 0.01  # of the least radius of curvature a key point may slide while a plane lasts
FLAT = 0.03  # [m] of radius for which an edge between flank and cap counts at least
TURN = 0.05  # [rad] that a plane may turn from its look on, to second order: 2 µm at 0.1 m from the anchor
SOLIDS, NODES = 64, 1 << 16  # in the smallest class: primitives and grids, and values of all grids
FASTEST = 20.0  # [m/s] past the body, for which a step is called short


class Contact(SharedConstraint):
    """The contact of one sheet with a body."""

    fields_of = Response
    answers = "body"
    parts = True
    spreads = True
    known_as = "contact with a body"
    _long_steps: bool | None = None

    def __init__(self, body: Colliders, sheet: Sheet) -> None:
        self.body = body = body.touched
        self._size = capacity_of(sheet.padded_shape)
        spared = np.zeros(sheet.shape, np.int32) if body.spared is None else body.spared
        self._spared = np.full(sheet.padded_shape, -1, np.int32)
        self._spared[PAD:-PAD, : sheet.shape[1]] = spared
        solids = body.solids
        self._constant = _shapes(body)
        self._thinnest = min(_thickness(row) for row in self._constant)
        self._points, self._radii = corners(solids)
        self._tree = build(self._points.mean(axis=1))
        self._bones = np.array([p.bone for p in solids])
        self._constant[:, Row.BONE] = 0 if body.spared is None else self._bones
        self._constant[:, Row.LIMB] = np.array(body.limbs)[self._bones] if body.limbs else 0
        self._anchors = np.stack([_anchor(p) for p in solids])
        self._axes = np.stack([np.stack(_axes(p)) for p in solids])
        self._capsules = np.array([_capsule(row) for row in self._constant])
        self._reach = np.linalg.norm(self._points - self._anchors[:, None], axis=2).max(axis=1) + self._radii.max(
            axis=1
        )

    @property
    def kind(self) -> tuple[Hashable, ...]:
        assert self._long_steps is not None, "a solver takes it first"
        body = self.body
        kinds = ((CONE, ELLIPTIC) if body.primitives else ()) + ((GRID,) if body.grids else ())
        nodes = class_of(sum(g.values.size for g in body.grids), NODES) if body.grids else 1
        parts = (self._size // LANES, 1) if self.spread else ()  # a packet each
        return self._size, class_of(len(body.solids), SOLIDS), kinds, self._long_steps, nodes, *parts

    def loop(self, loops: Any, again: bool) -> Callable[..., Any]:
        fields, points, packets = self.fields, loops.frame, loops.packets

        @ti.kernel
        def meet():
            if ti.static(not again):
                for i in range(fields.capacity):
                    if i < int(fields.solids[None]) and loops.now() % int(fields.every[None]) == 0:
                        fields.follow_one(i, loops.now())
            for e in range(packets):
                if ti.static(again):
                    fields.touch_again(points, e, e, loops.now())
                else:
                    fields.touch(points, e, e, e + 1, loops.now())

        return meet

    def join(self, substeps: int, step: float) -> None:
        if self._long_steps is None:  # it is compiled for these; later steps are shorter, and may be taken for long
            self._long_steps = bool(step * FASTEST > self._thinnest / 2)
        wait = max(2, int(LONGEST_WAIT / step))
        wait = wait // RAREST * RAREST if wait >= RAREST else 1 << (wait.bit_length() - 1)
        every = 1 if self._long_steps else min(wait, RAREST)
        while every > 1 and every * step > LEAST_WAIT:
            every //= 2
        body = self.body
        self.substeps = substeps
        self._settings = {
            "solids": len(body.solids),
            "wait": wait,
            "spare_step": SPARE * step,
            "gap": body.gap,
            "recovery": body.recovery * step,
            "thinnest": self._thinnest,
            "every": every,
            "friction": body.friction,
            "most_turn": TURN,
            "between": -1.0 if body.between is None else body.between,
        }

    def fill(self, state: SheetState) -> None:
        values = [g.values.astype(np.float32).ravel() for g in self.body.grids] or [np.zeros(1, np.float32)]
        self.fields.take_constant(np.concatenate(values), self._spared.ravel())

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        super().begin(state, forces)
        frame = forces.body or self.body.during(0.0, 0.0)
        rows = np.zeros((self.fields.capacity * 3 + 1, Row.COUNT), np.float32)
        rows[: len(self._constant)] = self._rows(frame)
        nodes = len(self._tree.skip)
        rows[self.fields.capacity : self.fields.capacity + nodes, 0] = self._tree.skip
        rows[self.fields.capacity : self.fields.capacity + nodes, 1] = self._tree.leaf
        rows[-1, : len(SETTINGS)] = [{**self._settings, "boxes": nodes}[name] for name in SETTINGS]
        self.fields.take(rows)

    def _rows(self, frame: BoneFrame) -> F64:
        """(primitives, Row.COUNT), see `Row`."""
        out = self._constant.copy()
        start, end = frame.start[self._bones], frame.end[self._bones]
        first = _moved(start, self._anchors)
        shift = (_moved(end, self._anchors) - first) / self.substeps
        turn = _turns(start[:, :3, :3], end[:, :3, :3])
        axes = self._axes @ start[:, :3, :3].transpose(0, 2, 1)
        columns = {Row.ANCHOR: first, Row.AXIS: axes[:, 0], Row.ACROSS: axes[:, 1], Row.SHIFT: shift}
        columns |= {Row.TURN: turn / self.substeps, Row.RADIUS: self._capsules}
        angle = np.linalg.norm(turn, axis=1)
        both = np.concatenate([_moved(t[:, None], self._points) for t in (start, end)], axis=1)
        bulge = self._reach * (1 - np.cos(np.minimum(angle, np.pi) / 2))  # of an arc over its chord
        radii = np.concatenate([self._radii] * 2, axis=1)[..., None] + (bulge + 1e-5)[:, None, None]
        columns |= {Row.BOX: (both - radii).min(axis=1), Row.BOX + 3: (both + radii).max(axis=1)}
        for at, values in columns.items():
            out[:, at : at + 3] = values
        return out

    @ti.func
    def before(self, points: Template, done, n: Template):
        if done % int(self.fields.every[None]) == 0:
            self.fields.follow(done)

    @ti.func
    def correct_again(self, points: Template, part, first, last, done, n: Template):
        self.fields.touch_again(points, part, first, done)

    @ti.func
    def correct_part(self, points: Template, part, first, last, done, n: Template):
        self.fields.touch(points, part, first, last, done)


def _anchor(p: Solid) -> F64:
    if isinstance(p, DistanceGrid):
        return p.origin + p.spacing * (np.array(p.values.shape) - 1) / 2
    if p.kind == "elliptic":
        return (p.start + p.end) / 2
    swallowed = p.kind == "cylinder" and p.radii[1] - p.radii[0] >= np.linalg.norm(p.end - p.start)
    return p.end if swallowed else p.start


def _axes(p: Solid) -> tuple[F64, F64]:
    """Axis and across, unit; across along the longer semi-axis. Of a grid z and x."""
    if isinstance(p, DistanceGrid):
        return np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    span = p.end - p.start
    length = float(np.linalg.norm(span))
    axis = span / length if length > 0 else np.array([0.0, 1.0, 0.0])
    if p.kind == "elliptic":
        assert p.across is not None
        return axis, p.across if p.radii[0] >= p.radii[1] else np.cross(p.across, axis)
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    return axis, across / np.linalg.norm(across)  # pyright: ignore[reportReturnType]


def _shapes(body: Colliders) -> F64:
    """(primitives, Row.COUNT): what of `Row` never changes: kind, sizes and slide."""
    out = np.zeros((len(body.primitives) + len(body.grids), Row.COUNT))
    begin = 0
    for row, grid in zip(out[len(body.primitives) :], body.grids, strict=True):
        row[:6] = GRID, begin, grid.spacing, *grid.values.shape
        row[6] = -2 * grid.values.min()
        begin += grid.values.size
    for row, p in zip(out, body.primitives, strict=False):
        length = float(np.linalg.norm(p.end - p.start)) if p.kind != "sphere" else 0.0
        r1, r2 = p.radii
        if p.kind == "elliptic":
            long, short = max(r1, r2) - p.rounding, min(r1, r2) - p.rounding
            steps = newton_steps(long, short, p.rounding)
            row[:6] = ELLIPTIC, long, short, length / 2 - p.rounding, p.rounding, steps
        elif p.kind == "sphere" or length <= abs(r1 - r2):
            row[:5] = CONE, r1 if p.kind == "sphere" else max(r1, r2), 0.0, 0.0, 0.0
        else:
            sine = (r1 - r2) / length
            row[:5] = CONE, r1, sine, sine / np.sqrt(1 - sine**2), length
    out[:, Row.SLIDE] = [SLIDE * _sharpness(row) for row in out]
    return out


def _capsule(row: F64) -> F64:
    """Radius, and where its two ends are along the axis from the anchor [m]."""
    if row[0] == GRID:
        x, y, z = (row[2] * (row[3:6] - 1) / 2).tolist()
        return np.array([np.hypot(x, y), -z, z])
    if row[0] == CONE:
        return np.array([max(row[1], row[1] - row[2] * row[4]), 0.0, row[4]])
    return np.array([row[1] + row[4], -row[3], row[3]])


def _sharpness(row: F64) -> float:
    """Least radius of curvature of a primitive [m]; of a grid four spacings."""
    if row[0] == GRID:
        return float(4 * row[2])
    if row[0] == CONE:
        return float(row[1] - max(row[2], 0.0) * row[4])
    return float(min(row[2] ** 2 / row[1] + row[4], max(row[4], FLAT)))


def _thickness(row: F64) -> float:
    """Of the thinnest place of a primitive [m]."""
    if row[0] == GRID:
        return max(float(row[6]), 1e-3)
    if row[0] == CONE:
        return float(2 * (row[1] - max(row[2], 0.0) * row[4]))
    return float(2 * min(row[2], row[3]) + 2 * row[4])


def _moved(transform: F64, points: F64) -> F64:
    return np.einsum("...ij,...j->...i", transform[..., :3, :3], points) + transform[..., :3, 3]


def _turns(start: F64, end: F64) -> F64:
    """Rotation vectors (n, 3) [rad] in the world that lead from one set of axes to another; not half a turn."""
    r = end @ start.transpose(0, 2, 1)
    v = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=1) / 2
    sine = np.linalg.norm(v, axis=1)
    angle = np.arctan2(sine, (np.trace(r, axis1=1, axis2=2) - 1) / 2)
    return v * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 1.0)[:, None]
