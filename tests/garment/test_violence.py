"""Violence: a flag in a gale, a T-shirt dropped as a heap, a body that folds its arms. Nothing passes through anything
in any frame, and threads stay as long as cloth is."""

import numpy as np
import pytest

from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.scenes.measure.crossing_check import Skin, skin_of
from taichi_cloth.scenes.prepare.garment_setup import dress, dropped
from taichi_cloth.scenes.scene.load import load_scene


def course(cloth: tuple[Skin, Simulation], frames: int) -> tuple[list[int], float, float]:
    """Triangles through others in each of so many frames, the largest strain of a thread, and how fast key points
    moved from frame to frame in the mean, the median of the last twenty frames [m/s]."""
    through, longest, speeds, (skin, simulation) = [], 0.0, [], cloth
    for _ in range(frames):
        before = simulation.positions
        simulation.step()
        positions = simulation.positions
        through.append(skin.crossings(positions).count)
        longest = max(longest, *(float(strain.max()) for strain in simulation.sheet.stretch(positions)))
        moved = np.linalg.norm(positions - before, axis=-1)[simulation.sheet.present]
        speeds.append(float(moved.mean()) / simulation.frame_time)
    return through, longest, float(np.median(speeds[-20:]))


@pytest.mark.slow  # a minute each, with their kernels two
def test_a_flag_in_a_gale_does_not_pass_through_itself() -> None:
    """At 20 m/s and more in gusts: 0 of 60 frames, threads of 3.2 %."""
    scene = load_scene("flag", ["cloth.representation=mesh", "forces.wind.velocity_m_per_s=[20,0,0.8]"])
    through, longest, _ = course(skin_of(scene), 60)
    assert not any(through)
    assert longest < 0.05


@pytest.mark.slow
def test_a_body_that_folds_its_arms_does_not_draw_its_shirt_through_itself() -> None:
    scene = load_scene("tshirt", ["garment.representation=mesh", "body.motion=arms-folded"])
    through, longest, _ = course(skin_of(scene), 60)
    assert not any(through)
    assert longest < 0.1


@pytest.mark.slow
def test_a_t_shirt_that_is_dropped_lies_as_a_heap_clear_of_itself() -> None:
    """Off a body that is no more there, on a floor 30 cm below its hem: at rest two seconds after it lies."""
    scene = load_scene("tshirt", ["garment.representation=mesh"])
    through, longest, speed = course((skin_of(scene)[0], dropped(scene, dress(scene))), 80)
    assert not any(through)
    assert longest < 0.06
    assert speed < 0.005
