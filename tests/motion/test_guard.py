"""The stencil is vector code: read from what LLVM made of it, not from a clock."""

import pytest
from vector_guard import roots

from taichi_cloth.sheet.sheet import LANES


@pytest.mark.slow
def test_the_springs_of_the_stencil_are_vector_code() -> None:
    """8 springs to neighbours (hinges take no root) and 6 roots of `stiffest.py` for each lane.

    At most a twentieth may be left single: LLVM 15 packs one spring of the eight as 4 + 2 + 1 + 1 lanes.
    """
    found = roots()
    assert found.packed + found.single == 14 * LANES, found
    assert found.single <= LANES * 8 // 20, found
