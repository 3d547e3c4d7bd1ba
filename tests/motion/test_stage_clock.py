"""Time stamps inside a frame's kernel: spans belong to the stage that ended with them, and change no byte."""

from dataclasses import replace

import numpy as np
import pytest
from strips import simulate, strip

from taichi_cloth.constraints.ties import Ties
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.forces import Forces, Sphere
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.motion.stage_clock import ROOM, START, StageClock
from taichi_cloth.scenes.measure.frame_parts import KERNEL_PARTS, kernel_parts
from taichi_cloth.solvers.yarns import Yarns

BALL = Forces(sphere=Sphere(centre=(0.0, -0.3, 0.0), radius=0.1))


def stamp(clock: StageClock, stamps: list[tuple[int, int]]) -> None:
    """As a kernel would: stages and times [ns]."""
    for k, (stage, when) in enumerate(stamps):
        clock._stage[k] = stage
        clock._times[k] = divmod(when, 1_000_000_000)
    clock._count[None] = len(stamps)


def test_spans_belong_to_the_stage_that_ended_with_them() -> None:
    clock = StageClock()
    a, b = clock.number("springs"), clock.number("threads")
    assert clock.number("springs") == a != b
    late = 5_000_000_000
    # Two frames; what lies between them is no stage's, a second's end may lie in a span, and two threads' stamps may
    # be out of order.
    first = [(START, late - 100), (a, late - 40), (b, late + 25), (a, late + 5), (b, late + 30)]
    stamp(clock, [*first, (START, late + 9_000), (b, late + 9_007)])
    assert clock.read() == pytest.approx({"springs": 105e-9, "threads": 32e-9}, rel=1e-6)
    assert clock.read() == {"springs": 0.0, "threads": 0.0}


def test_more_stamps_than_there_is_room_for_are_said() -> None:
    clock = StageClock()
    clock._count[None] = ROOM + 1
    with pytest.raises(InputError, match="use fewer substeps"):
        clock.read()


def compared(plain: Simulation, timed: Simulation) -> dict[str, float]:
    """The parts of three frames that are moved with and without stamps."""
    timed.solver.clock = clock = StageClock()  # pyright: ignore[reportAttributeAccessIssue]
    for one in (plain, timed):
        for _ in range(3):
            one.step()
    np.testing.assert_array_equal(plain.state.values, timed.state.values)
    parts = kernel_parts(clock.read())
    assert set(parts) <= set(KERNEL_PARTS)
    assert min(parts.values()) > 0
    assert sum(parts.values()) <= timed.solver.spent
    return parts


def test_a_frame_of_verlet_is_the_same_with_stamps() -> None:
    sheet = strip(pinned=(0,), air_damping=1.0)
    nodes = np.array([[[20, 0], [20, 2], *([[0, 0]] * 6)]])
    weights = np.array([[1.0, -1.0, *([0.0] * 6)]])
    plain, timed = (simulate(sheet, forces=Forces(), ties=(Ties(sheet, nodes, weights),)) for _ in range(2))
    assert set(compared(plain, timed)) == {"state", "springs", "seams"}


@pytest.mark.slow
@pytest.mark.parametrize("threads", [1, 2])
def test_a_frame_of_whole_yarns_is_the_same_with_stamps(threads: int) -> None:
    sheet = strip(pinned=(0,), air_damping=1.0)
    sheet = replace(sheet, material=replace(sheet.material, tensile_warp=1e5, tensile_weft=1e5))
    x = np.roll(sheet.flat(), 1, axis=-1)
    plain, timed = (Simulation(sheet, Yarns(sheet, BALL, threads=threads), forces=BALL, positions=x) for _ in range(2))
    assert set(compared(plain, timed)) == {"state", "springs", "yarns", "ball and plane"}
