"""Tridiagonal systems of whole yarns in pieces, so that there are enough threads for a device.

A yarn of n threads is n steps one after the other, and a sheet has n yarns: too few for a device. So each line is cut
into pieces of PIECE, whose last thread is left out at first. What is within a piece is factorised by itself (L d Lᵀ, as
`WholeYarns.down`), with one number more for each thread: f, how the thread before the piece is felt there. What is left
are the ends of the pieces, a tridiagonal system 1/PIECE as long (a Schur complement, and so as definite as the whole),
one device thread a line; and then pieces are filled in backwards from their ends, all at once again. It is an exact
elimination in another order: the answer is that of the whole line but for rounding (Wang 1981, "A parallel method for
tridiagonal equations", in the form for symmetric systems).

Where there is no thread the diagonal is 1 and all else 0, so lines are those of the padded grid, whatever the outline.
"""

from typing import Any

import taichi as ti

__all__ = ["PIECE", "LineSystems"]

PIECE = 16
"""Threads a piece."""

LEAST = 1e-6
"""As in `WholeYarns`."""

ACROSS = 4
"""Numbers of the end of a piece: its diagonal and right side as the piece before it leaves them, and by how much those
of the end before are less for this piece."""


@ti.data_oriented
class LineSystems:
    """Of one family of the yarns in the fields of `WholeYarns`.

    family: its number. lines, length: how many, and key points of each. first: element of the first one's first key
    point; next_line, next_point: elements from one to the next. wide: whether neighbouring threads of a device take
    neighbouring lines, which lie side by side in memory, or neighbouring pieces.
    fill: f of each thread. linked, pivot: of the end of each piece, how it is coupled with the end before, and 1/d of
    their factorisation; both are kept for sweeps that use old factors. across: see ACROSS.
    """

    def __init__(self, yarns: Any, family: int, lines: int, length: int, steps: tuple[int, int, int]) -> None:
        self.yarns, self.family, self.lines, self.length = yarns, family, lines, length
        self.first, self.next_line, self.next_point = steps
        self.pieces, self.wide = -(-length // PIECE), self.next_line == 1
        self.base, self.count = family * yarns.size, self.pieces * lines
        self.fill = ti.field(ti.f32, yarns.size)
        self.linked, self.pivot = (ti.field(ti.f32, self.count) for _ in range(2))
        self.across = ti.field(ti.f32, ACROSS * self.count)

    @ti.func
    def element(self, line, k):
        """Of key point k of a line."""
        return self.first + line * self.next_line + k * self.next_point

    @ti.func
    def line(self, p):
        """That element p is in."""
        out = (p - self.first) // self.next_line
        if ti.static(self.wide):
            out = (p - self.first) % self.next_point
        return out

    @ti.func
    def piece_of(self, t) -> Any:
        """Line and piece that iteration t is of."""
        line, piece = t // self.pieces, t % self.pieces
        if ti.static(self.wide):
            line, piece = t % self.lines, t // self.lines
        return line, piece

    @ti.func
    def reach(self, piece) -> Any:
        """First and last key point of a piece in its line; the last is its end."""
        return piece * PIECE, ti.min((piece + 1) * PIECE, self.length) - 1

    @ti.func
    def slot(self, line, piece):
        """Where the numbers of the end of a piece stand."""
        out = line * self.pieces + piece
        if ti.static(self.wide):
            out = piece * self.lines + line
        return out

    @ti.func
    def down(self, t, anew):
        """Of piece t: factors where `anew`, z of all but its end, and what is left for the ends on both sides."""
        line, piece = self.piece_of(t)
        begin, end = self.reach(piece)
        pivot, z, f, less, right_less = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(begin, end):
            p = self.element(line, k)
            s = self.base + p
            if anew:
                self.yarns.beside[s] = self.yarns.coupling[p]
            beside = self.yarns.beside[s]
            z = self.yarns.right[p] - beside * pivot * z  # pivot: of the thread before; 0 before the first
            f = -beside * pivot * f
            if k == begin and piece > 0:
                z, f = self.yarns.right[p], beside
            if anew:
                inside = ti.select(k > begin, beside * beside * pivot, 0.0)
                self.yarns.pivot[s] = 1.0 / ti.max(self.yarns.diagonal[p] - inside, LEAST)
                self.fill[p] = f
            pivot, f = self.yarns.pivot[s], self.fill[p]
            self.yarns.change[p] = z
            less += f * f * pivot
            right_less += f * z * pivot
        # The end: coupled with the thread before it in the piece, and through that with the end before.
        p = self.element(line, end)
        s, o = self.base + p, self.slot(line, piece)
        if anew:
            self.yarns.beside[s] = self.yarns.coupling[p]
        beside = self.yarns.beside[s]
        within = end > begin
        if anew:
            self.linked[o] = ti.select(within, -beside * pivot * f, beside)
            self.across[o] = self.yarns.diagonal[p] - ti.select(within, beside * beside * pivot, 0.0)
            self.across[2 * self.count + o] = less
        self.across[self.count + o] = self.yarns.right[p] - ti.select(within, beside * pivot * z, 0.0)
        self.across[3 * self.count + o] = right_less

    @ti.func
    def join(self, line, anew):
        """The ends of all pieces of a line."""
        n = ti.static(self.count)
        before, z = 0.0, 0.0
        for piece in range(self.pieces):
            o = self.slot(line, piece)
            diagonal, right = self.across[o], self.across[n + o]
            if piece + 1 < self.pieces:
                after = self.slot(line, piece + 1)
                diagonal, right = diagonal - self.across[2 * n + after], right - self.across[3 * n + after]
            linked = ti.select(piece > 0, self.linked[o], 0.0)
            if anew:
                self.pivot[o] = 1.0 / ti.max(diagonal - linked * linked * before, LEAST)
            z = right - linked * before * z
            before = self.pivot[o]
            self.across[n + o] = z
        x, link = 0.0, 0.0
        for back in range(self.pieces):
            piece = self.pieces - 1 - back
            o = self.slot(line, piece)
            x = self.pivot[o] * (self.across[n + o] - link * x)
            link = self.linked[o]
            self.yarns.change[self.element(line, ti.min((piece + 1) * PIECE, self.length) - 1)] = x

    @ti.func
    def up(self, t):
        """Δλ within piece t, those of the ends done."""
        line, piece = self.piece_of(t)
        begin, end = self.reach(piece)
        left = 0.0
        if piece > 0:
            left = self.yarns.change[self.element(line, begin - 1)]
        after = self.element(line, end)
        x, beside = self.yarns.change[after], self.yarns.beside[self.base + after]
        for back in range(end - begin):
            p = self.element(line, end - 1 - back)
            s = self.base + p
            x = self.yarns.pivot[s] * (self.yarns.change[p] - self.fill[p] * left - beside * x)
            self.yarns.change[p] = x
            beside = self.yarns.beside[s]
