"""Fields of many parts become several trees: Taichi's own would hold them all, and takes 511 fields."""

from typing import Any

import taichi as ti

from taichi_cloth.ground.runtime import close_tree
from taichi_cloth.motion.constraint import shared_fields

EACH = 140


@ti.data_oriented
class Part:
    def __init__(self, _number: int) -> None:
        self.one: Any = [ti.field(ti.i32, 1) for _ in range(EACH)]

    @ti.func
    def last(self):
        return self.one[EACH - 1][0]


@ti.data_oriented
class Whole:
    def __init__(self, parts: list[Any]) -> None:
        self.parts = parts

    @ti.kernel
    def total(self) -> int:
        out = 0
        for part in ti.static(self.parts):
            out += part.last()
        return out


def test_fields_of_many_parts_that_are_made_before_a_kernel_runs_are_taken() -> None:
    parts = [shared_fields(-1, Part, k) for k in range(5)]
    assert len({part.one[0]._snode.ptr.get_snode_tree_id() for part in parts}) == len(parts)
    for k, part in enumerate(parts):
        part.one[EACH - 1][0] = 10**k
    assert Whole(parts).total() == 11111


def test_few_fields_wait_for_others() -> None:
    one = ti.field(ti.i32, 1)
    close_tree()
    two = ti.field(ti.i32, 1)
    one[0], two[0] = 1, 2
    assert one.snode.ptr.get_snode_tree_id() == two.snode.ptr.get_snode_tree_id()
