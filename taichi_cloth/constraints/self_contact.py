"""Cloth against cloth where seams join it: key points and faces keep a thickness apart, whichever panel they belong to.

A sheet alone has `layers/`, where nothing passes through anything. Here threads may, between their key points.

A face is the bilinear patch S(u, v) between four key points. Three stages, ever rarer:

1. *Solve*, every second substep: contacts in a fixed order. With n, u, v of the contact the gap is n·(x − S(u, v)),
   linear in the positions. Where it is below the thickness, the point and the four corners are pushed apart by shares
   of their inverse masses times weights, so that momentum is kept. What the push takes from the speed of approach it
   takes from the steps as well (no bounce); the rest of the depth is mended in positions alone, a quarter at a time,
   so that cloth that starts too close is not thrown. Coulomb friction: at most µ × the push, at most what stops the
   sliding.
2. *Contacts*: the nearest point of each face of a pair, and the side on which the key point is. They are held for so
   many substeps (16 at most) that nothing can cross the band around the thickness in which contacts are kept.
3. *Pairs* of key points and faces within a wider margin, from a spatial grid (counting sort). Sought at the start of
   each frame, and when the key points have moved so far, apart from their common motion, that one could be missing.

So a layer does not pass through another unless two key points near each other differ in speed by more than
BAND × spacing / (5 h): 9 m/s for a spacing of 12.7 mm and 126 substeps in 1/60 s. Only key points against faces: edges
that cross between key points are not seen, and a fold tighter than the key points can show is its own neighbourhood.
Everything runs in one thread, in order: no atomics.
"""

from math import ceil, pi
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray
from scipy import ndimage

from taichi_cloth.ground.arrays import F32x1, I32x2, Int, Template
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.routine import routine
from taichi_cloth.motion.capacity import capacity_of
from taichi_cloth.motion.constraint import SharedConstraint
from taichi_cloth.motion.forces import FrameForces, SelfContact
from taichi_cloth.sheet.sheet import Sheet, SheetState

__all__ = ["ClothContact"]

BAND = 0.5
"""Contacts are kept up to the thickness and this share of the spacing."""

LEAST, MOST = 0.25, 0.75
"""Pairs are sought up to that and between these shares of the spacing, by how far the fastest key point gets in
FORESIGHT substeps: few pairs where cloth rests, few searches where it moves."""

FORESIGHT = 64

LONGEST_HOLD = 16
"""Substeps that contacts are held at most."""

_GROWTH = 1.25  # by which the fastest key point may grow faster while contacts are held
_BITS = 5  # the grid wraps around after 2⁵ cells along each axis; what meets there by chance is told apart by distance
_PAIRS, _CONTACTS = 128, 32  # room, for each key point

LENGTHS = ("thickness", "friction", "band", "near", "least", "most", "cell")
"""What `LayerFields` reads by name: see `ClothContact`, BAND, LEAST and MOST [m]; near: thickness and band together;
cell: of the spatial grid."""

MEND = 0.25
"""Share of the depth beyond the approach that is mended at a time."""


@ti.data_oriented
class LayerFields:
    """The spatial grid, pairs and contacts of key points and faces, for padded grids of up to `size` elements."""

    # Numbers of these are bounds of loops: type checkers would take them for matrices.
    start: Any
    used: Any
    pairs: Any
    contacts: Any

    def __init__(self, size: int) -> None:
        self.holder: object = None
        self.lengths = [ti.field(ti.f32, ()) for _ in LENGTHS]
        self.thickness, self.friction, self.band, self.near, self.least, self.most, self.cell = self.lengths
        # Cells of its own neighbourhood; elements of the padded grid, and the row and column of each.
        self.reach, self.used = (ti.field(ti.i32, ()) for _ in range(2))
        self.line, self.column = (ti.field(ti.i32, size) for _ in range(2))
        # The spatial grid: panel of each key point and each face (0: none), and key points in the order of their cells.
        self.panel, self.patch, self.order, self.bucket = (ti.field(ti.i32, size) for _ in range(4))
        self.start = ti.field(ti.i32, 2 ** (3 * _BITS) + 1)
        self.cursor = ti.field(ti.i32, 2 ** (3 * _BITS))
        # Where key points were when pairs were sought [m], and the margin then, beyond the band [m].
        self.reference = [ti.field(ti.f32, size) for _ in range(3)]
        self.margin = ti.field(ti.f32, ())
        # Pairs, and contacts with their normal and place on the face.
        self.pair_room, self.contact_room = _PAIRS * size, _CONTACTS * size
        self.pair_point, self.pair_face = (ti.field(ti.i32, self.pair_room) for _ in range(2))
        self.point, self.face = (ti.field(ti.i32, self.contact_room) for _ in range(2))
        self.normal = [ti.field(ti.f32, self.contact_room) for _ in range(3)]
        self.u, self.v = (ti.field(ti.f32, self.contact_room) for _ in range(2))
        # Substep up to which contacts are held, and how many of each there are or were in this frame.
        self.until, self.searches, self.pairs, self.contacts, self.most_contacts = (
            ti.field(ti.i32, ()) for _ in range(5)
        )

    @ti.kernel
    def take(self, width: Int, reach: Int, labels: I32x2, lengths: F32x1):
        """labels: (2, elements of the padded grid), panels of key points and of faces. lengths: of `LENGTHS`."""
        ti.loop_config(serialize=True)
        for p in range(labels.shape[1]):
            self.panel[p], self.patch[p] = labels[0, p], labels[1, p]
            self.line[p], self.column[p] = p // width, p % width
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.reach[None], self.used[None] = reach, labels.shape[1]
            for k, field in ti.static(enumerate(self.lengths)):
                field[None] = lengths[k]

    @ti.func
    def at(self, field: Template, p) -> Any:
        return ti.Vector([field[0][p], field[1][p], field[2][p]])

    @ti.func
    def grid(self, x) -> Any:
        return ti.floor(x / self.cell[None], ti.i32)

    @ti.func
    def hashed(self, i, j, k):
        mask = ti.static(2**_BITS - 1)
        return ((i & mask) << (2 * _BITS)) | ((j & mask) << _BITS) | (k & mask)

    @routine
    def refresh(self, points: Template, done: Int):
        """Contacts anew, and pairs where they may not be complete before the next time."""
        x, d = ti.static(points.position, points.step)
        # The common motion, of steps and since pairs were sought.
        step, shift, count = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0]), 0
        for p in range(self.used[None]):
            if self.panel[p] > 0:
                step += self.at(d, p)
                shift += self.at(x, p) - self.at(self.reference, p)
                count += 1
        step /= count
        shift /= count
        # How fast and how far the key points are at most beside it.
        fastest, farthest = 1e-20, 0.0
        for p in range(self.used[None]):
            if self.panel[p] > 0:
                fastest = ti.max(fastest, (self.at(d, p) - step).norm_sqr())
                farthest = ti.max(farthest, (self.at(x, p) - self.at(self.reference, p) - shift).norm_sqr())
        fastest, farthest = _GROWTH * ti.sqrt(fastest), ti.sqrt(farthest)
        # Contacts are held until two that approach each other could cross the band; pairs until the margin is used up.
        held = 2 * ti.cast(ti.min(ti.max(self.band[None] / (4.0 * fastest), 1.0), LONGEST_HOLD / 2), ti.i32)
        if done == 0 or 2.0 * (farthest + held * fastest) > self.margin[None]:
            self.margin[None] = ti.min(ti.max(2.0 * FORESIGHT * fastest, self.least[None]), self.most[None])
            self.search(points)
        self.meet(points)
        self.until[None] = done + held

    @routine
    def search(self, points: Template):
        """Pairs of key points and faces, in the order of the faces."""
        x = ti.static(points.position)
        self.searches[None] = self.searches[None] + 1
        # Key points in the order of the cells they are in (counting sort): how many each has, where it starts, who.
        for k in range(self.start.shape[0]):
            self.start[k] = 0
        for p in range(self.used[None]):
            if self.panel[p] > 0:
                g = self.grid(self.at(x, p))
                key = self.hashed(g[0], g[1], g[2])
                self.bucket[p] = key
                self.start[key + 1] = self.start[key + 1] + 1
                for c in ti.static(range(3)):
                    self.reference[c][p] = x[c][p]
        for k in range(1, self.start.shape[0]):
            self.start[k] = self.start[k] + self.start[k - 1]
            self.cursor[k - 1] = self.start[k - 1]
        for p in range(self.used[None]):
            if self.panel[p] > 0:
                key = self.bucket[p]
                self.order[self.cursor[key]] = p
                self.cursor[key] = self.cursor[key] + 1
        # Each face: the key points of its cells that are near enough, by the box around it and then by its plane.
        row = points.row[None]
        found = 0
        wide = self.near[None] + self.margin[None]
        for f in range(self.used[None]):
            if self.patch[f] > 0:
                a, b, c, d = (
                    self.at(x, f),
                    self.at(x, f + 1),
                    self.at(x, f + row),
                    self.at(x, f + row + 1),
                )
                low = ti.min(ti.min(a, b), ti.min(c, d)) - wide
                high = ti.max(ti.max(a, b), ti.max(c, d)) + wide
                g0, g1 = self.grid(low), ti.min(self.grid(high), self.grid(low) + 7)
                fi, fj = self.line[f], self.column[f]
                across = (b + d - a - c).cross(c + d - a - b)  # 4 × the area vector of the face
                room = wide + 0.25 * (a + d - b - c).norm()  # a face that is not flat leaves its plane by so much
                most, middle = room * room * across.norm_sqr(), 0.25 * (a + b + c + d)
                for i in range(g0[0], g1[0] + 1):  # pyright: ignore[reportIndexIssue]
                    for j in range(g0[1], g1[1] + 1):  # pyright: ignore[reportIndexIssue]
                        for k in range(g0[2], g1[2] + 1):  # pyright: ignore[reportIndexIssue]
                            key = self.hashed(i, j, k)
                            for o in range(self.start[key], self.start[key + 1]):
                                p = self.order[o]
                                di, dj = self.line[p] - fi, self.column[p] - fj
                                other = ti.max(ti.abs(2 * di - 1), ti.abs(2 * dj - 1)) > 2 * self.reach[None] + 1
                                if other or self.panel[p] != self.patch[f]:  # nested: `and` works out all of it
                                    y = self.at(x, p)
                                    if (y >= low).all() and (y <= high).all():
                                        rise = (y - middle).dot(across)
                                        if rise * rise < most:
                                            if found < self.pair_room:
                                                self.pair_point[found] = p
                                                self.pair_face[found] = f
                                            found += 1
        self.pairs[None] = found

    @routine
    def meet(self, points: Template):
        """Contacts of the pairs: the nearest point of each face by turns in u and v, and the normal towards the key
        point."""
        x = ti.static(points.position)
        row = points.row[None]
        near = self.near[None]
        found = 0
        for k in range(ti.min(self.pairs[None], self.pair_room)):
            p, f = self.pair_point[k], self.pair_face[k]
            # All against the face's first corner a: S(u, v) = u b + v c + u v d.
            a = self.at(x, f)
            b, c = self.at(x, f + 1) - a, self.at(x, f + row) - a
            y = self.at(x, p) - a
            d = self.at(x, f + row + 1) - a - b - c
            across = (2.0 * b + d).cross(2.0 * c + d)  # 4 × the area vector of the face
            rise = (y - 0.5 * (b + c) - 0.25 * d).dot(across)
            room = near + 0.25 * d.norm()
            if rise * rise < room * room * across.norm_sqr():
                # The nearest place: along u, then along v, each a line, by turns.
                u, v = 0.5, 0.5
                for _ in range(4):
                    along = b + v * d
                    u = ti.min(ti.max((y - v * c).dot(along) / ti.max(along.norm_sqr(), 1e-20), 0.0), 1.0)
                    along = c + u * d
                    v = ti.min(ti.max((y - u * b).dot(along) / ti.max(along.norm_sqr(), 1e-20), 0.0), 1.0)
                away = y - u * b - v * c - u * v * d
                length = away.norm()
                if length < near and length > 1e-9:
                    if found < self.contact_room:
                        self.point[found], self.face[found] = p, f
                        self.u[found], self.v[found] = u, v
                        for axis in ti.static(range(3)):
                            self.normal[axis][found] = away[axis] / length
                    found += 1
        self.contacts[None] = ti.min(found, self.contact_room)
        self.most_contacts[None] = ti.max(self.most_contacts[None], found)

    @routine
    def solve(self, points: Template, done: Int):
        """Every contact once, in turns from the first to the last and from the last to the first."""
        x, s, inverse = ti.static(points.position, points.step, points.inverse_mass)
        row = points.row[None]
        total = self.contacts[None]
        for k in range(total):
            m = k if done % 4 == 1 else total - 1 - k
            p, f = self.point[m], self.face[m]
            # How deep the key point is, from its place on the face: the corners' mean by w.
            n = self.at(self.normal, m)
            u, v = self.u[m], self.v[m]
            w = ti.Vector([(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v])
            patch = w[0] * self.at(x, f) + w[1] * self.at(x, f + 1)
            patch += w[2] * self.at(x, f + row) + w[3] * self.at(x, f + row + 1)
            depth = self.thickness[None] - n.dot(self.at(x, p) - patch)
            if depth > 0.0:
                # How much the pair yields to a push: Σ w²/m.
                i = ti.Vector([inverse[f], inverse[f + 1], inverse[f + row], inverse[f + row + 1]])
                yielding = inverse[p] + (i * w * w).sum()  # pyright: ignore[reportOptionalCall]
                if yielding > 0.0:
                    # Its step past that place; the push, and friction of it (Coulomb).
                    step = self.at(s, p) - w[0] * self.at(s, f) - w[1] * self.at(s, f + 1)
                    step -= w[2] * self.at(s, f + row) + w[3] * self.at(s, f + row + 1)
                    along = step.dot(n)
                    push = ti.min(depth, ti.max(-along, 0.0))
                    slide = step - along * n
                    held = ti.min(self.friction[None] * push / ti.max(slide.norm(), 1e-20), 1.0)
                    change = (push * n - held * slide) / yielding
                    move = change + MEND * (depth - push) / yielding * n
                    # The key point by its inverse mass, the corners against it by theirs.
                    for axis in ti.static(range(3)):
                        s[axis][p] = s[axis][p] + inverse[p] * change[axis]
                        x[axis][p] = x[axis][p] + inverse[p] * move[axis]
                    for corner, offset in ti.static(enumerate((0, 1, row, row + 1))):
                        share = i[corner] * w[corner]
                        for axis in ti.static(range(3)):
                            s[axis][f + offset] = s[axis][f + offset] - share * change[axis]
                            x[axis][f + offset] = x[axis][f + offset] - share * move[axis]


class ClothContact(SharedConstraint):
    """The contact of one sheet. thickness, friction: see `SelfContact`.

    Key points of the same panel within `reach` cells of a face do not touch it: they are its own neighbourhood. So
    are those on both sides of a seam. seams: bool (rows, cols), key points that are sewn to others; they and all within
    `reach` of them touch no other cloth.
    Raises InputError on a thickness that the key points of a flat sheet would already violate.
    """

    fields_of = LayerFields
    known_as = "cloth on cloth"
    answers = "self_contact"
    whole = True
    paired = True

    def __init__(self, sheet: Sheet, options: SelfContact, seams: NDArray[np.bool_] | None = None) -> None:
        s = sheet.springs
        self.options, self._spacings = options, (min(s.spacing_x, s.spacing_y), max(s.spacing_x, s.spacing_y))
        spacing = self._spacings[0]
        if options.thickness > 4 * spacing:
            raise InputError(
                f"self_contact.thickness: {options.thickness:g} m; allowed: up to 4 times the spacing "
                f"({4 * spacing:g} m)"
            )
        self.reach = 1 + ceil(pi / 2 * options.thickness / spacing)  # half a circle of that diameter is a tight fold
        self._width, self._size = sheet.width, capacity_of(sheet.padded_shape)
        labels = np.asarray(ndimage.label(sheet.cells, np.ones((3, 3)))[0])  # pyright: ignore[reportIndexIssue]
        corners = [np.pad(labels, ((i, 1 - i), (j, 1 - j))) for i in (0, 1) for j in (0, 1)]
        panels, faces = np.maximum.reduce(corners), corners[0]
        if seams is not None and seams.any():
            apart = np.logical_not(ndimage.binary_dilation(seams, np.ones((3, 3)), iterations=self.reach))
            panels = panels * apart
            faces = faces * np.pad(apart[:-1, :-1] & apart[1:, :-1] & apart[:-1, 1:] & apart[1:, 1:], ((0, 1), (0, 1)))
        self._labels = np.stack([sheet.padded(labels).astype(np.int32).ravel() for labels in (panels, faces)])

    @property
    def kind(self) -> tuple[int]:
        return (self._size,)

    def fill(self, state: SheetState) -> None:
        (spacing, widest), thickness, band = self._spacings, self.options.thickness, BAND * self._spacings[0]
        lengths = {"thickness": thickness, "friction": self.options.friction, "band": band, "near": thickness + band}
        lengths |= {"least": LEAST * spacing, "most": MOST * spacing, "cell": widest + thickness + spacing}
        named = np.array([lengths[name] for name in LENGTHS], np.float32)
        self.fields.take(self._width, self.reach, self._labels, named)

    def begin(self, state: SheetState, forces: FrameForces) -> None:
        super().begin(state, forces)
        self.fields.searches[None] = 0
        self.fields.most_contacts[None] = 0

    def end(self, state: SheetState) -> None:
        """Raises InputError where there was no room for all pairs or contacts."""
        fields = self.fields
        for name, found, room in (
            ("pairs", fields.pairs[None], fields.pair_room),
            ("contacts", fields.most_contacts[None], fields.contact_room),
        ):
            if found > room:
                raise InputError(
                    f"self contact: {found} {name}, room for {room}; the sheet lies in too many layers: "
                    "use a smaller thickness or wider spacing"
                )

    @ti.func
    def before(self, points: Template, done, n: Template):
        if done == 0 or done >= self.fields.until[None]:
            self.fields.refresh(points, done)

    @ti.func
    def correct_whole(self, points: Template, done, n: Template):
        self.fields.solve(points, done)
