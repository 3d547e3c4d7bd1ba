"""Lists that many threads make at once, in an order that does not depend on which of them came first."""

from typing import Any

import taichi as ti

__all__ = ["Lists", "Places", "turns"]

GROUP = 64
"""Numbers that one thread sums up."""


@ti.func
def turns(total, t, many):
    """How many of `total` numbers are thread t's of `many`, which takes each `many`-th from t on."""
    return (total - t + many - 1) // many


@ti.data_oriented
class Places:
    """Where each of up to `room` threads puts what it has found: sums of all before it, in four loops.

    of: how many each has found; after `sum_up` the place of its first. count: how many threads there are; None: as many
    as there is room for. total: of all.
    """

    def __init__(self, room: int, count: Any = None) -> None:
        self.room, self.count, self.whole = room, count, count is None
        self.groups = -(-room // GROUP)
        self.blocks = -(-self.groups // GROUP)
        self.of, self.total = ti.field(ti.i32, room), ti.field(ti.i32, ())
        self.group, self.block = ti.field(ti.i32, self.groups), ti.field(ti.i32, self.blocks)

    @ti.func
    def last(self):
        if ti.static(self.whole):
            return self.room
        else:
            return ti.min(self.count[None], self.room)

    @ti.func
    def sum_up(self):
        """Loops."""
        for g in range(self.groups):
            total = 0
            for k in range(g * GROUP, ti.min((g + 1) * GROUP, self.last())):
                total += self.of[k]
            self.group[g] = total
        for b in range(self.blocks):
            total = 0
            for g in range(b * GROUP, ti.min((b + 1) * GROUP, self.groups)):
                own = self.group[g]
                self.group[g] = total
                total += own
            self.block[b] = total
        for _ in range(1):
            total = 0
            for b in range(self.blocks):
                own = self.block[b]
                self.block[b] = total
                total += own
            self.total[None] = total
        for g in range(self.groups):
            at = self.group[g] + self.block[g // GROUP]
            for k in range(g * GROUP, ti.min((g + 1) * GROUP, self.last())):
                own = self.of[k]
                self.of[k] = at
                at += own


@ti.data_oriented
class Lists:
    """Of each of `keys` a list; room for so many entries in all. `clear`, then `count` each entry, then
    `places.sum_up`, then `put` each, then `sort`."""

    def __init__(self, keys: int, room: int) -> None:
        self.keys, self.room, self.places = keys, room, Places(keys)
        self.entry, self.size = ti.field(ti.i32, room), ti.field(ti.i32, keys)

    @ti.func
    def clear(self):
        """A loop."""
        for key in range(self.keys):
            self.places.of[key], self.size[key] = 0, 0

    @ti.func
    def count(self, key):
        ti.atomic_add(self.places.of[key], 1)

    @ti.func
    def put(self, key, entry):
        at = self.places.of[key] + ti.atomic_add(self.size[key], 1)
        if at < self.room:
            self.entry[at] = entry

    @ti.func
    def first(self, key):
        return ti.min(self.places.of[key], self.room)

    @ti.func
    def end(self, key):
        return ti.min(self.places.of[key] + self.size[key], self.room)

    @ti.func
    def sort(self):
        """A loop: each list by its entries."""
        for key in range(self.keys):
            first = self.first(key)
            for k in range(first + 1, self.end(key)):
                own, at = self.entry[k], k
                while at > first and self.entry[ti.max(at - 1, 0)] > own:
                    self.entry[at] = self.entry[at - 1]
                    at -= 1
                self.entry[at] = own
