"""Sizes of the fields that kernels work on: classes of capacity, so that sheets of many shapes share their kernels.

A kernel is compiled for its fields. How long the rows of a sheet are it reads when it runs (`Stencil.row`); what a
sheet leaves of the fields is not looked at.
"""

from taichi_cloth.sheet.sheet import LANES

__all__ = ["capacity_of", "class_of"]

SMALLEST, DOUBLED = 4_096, 65_536
"""The smallest class of elements of a padded grid; and up to where each class is twice the one before. Beyond, where
memory counts, classes are that far apart."""

STAGGER = 80
"""Elements by which a field is larger than its class: fields one after the other in memory, of a power of two elements
each, would all fall on the same lines of a cache."""


def class_of(count: int, smallest: int) -> int:
    """The least of `smallest`, 2 `smallest`, 4 `smallest`, … that has room for so many."""
    return smallest << max(0, -(-count // smallest) - 1).bit_length()


def capacity_of(padded_shape: tuple[int, int], smallest: int = SMALLEST) -> int:
    """Elements of the fields for a sheet of that shape, whole lanes: whole tiles of lanes fit in, and two rows more, as
    `WholeYarns` has them when its yarns are turned. smallest: class."""
    rows, width = padded_shape
    needed = -(-rows // LANES) * LANES * (width + 2)
    if needed > DOUBLED:
        return -(-needed // DOUBLED) * DOUBLED + STAGGER
    return class_of(needed, smallest) + STAGGER
