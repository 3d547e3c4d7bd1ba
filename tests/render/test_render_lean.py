"""Normals that lean to the eye: by how much, of which particles, and back again."""

import numpy as np
import pytest

from taichi_cloth.ground.particles import NORMAL
from taichi_cloth.render.data.camera import Camera, look_at
from taichi_cloth.render.data.finish import Finish
from taichi_cloth.render.data.light import Lighting
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.yarn.thick_fibres import SEEN, leaning
from taichi_cloth.yarn.yarn import Yarn

LEANT = Finish(to_eye=0.75)


def fibres(openness: float = 0.5) -> Particles:
    """Twenty of them in a row along x, with normals straight up."""
    x = np.linspace(-1e-3, 1e-3, 20)
    place = np.stack([x, 0 * x, 0 * x], 1)
    return Particles(place, 1e-4, (0.5, 0.5, 0.5), (1, 0, 0), (0, 1, 0), half_length=2e-4, openness=openness)


def eye_at(*place: float) -> Camera:
    return look_at(place, (0, 0, 0), width=32, height=32, fov=4)


def normals(splatter: Splatter) -> np.ndarray:
    return splatter.lists().blocks[NORMAL : NORMAL + 3].reshape(3, -1)[:, :20]


def test_normals_lean_as_far_as_is_said_and_stay_square_to_the_fibre() -> None:
    splatter = Splatter(32, 32).load(fibres())
    splatter.render(eye_at(0.0, 0.0, 10.0), finish=LEANT)
    expected = np.array([0.0, 1.0, 0.75]) / 1.25
    assert normals(splatter) == pytest.approx(np.tile(expected[:, None], 20), abs=1e-3)


def test_a_normal_leans_from_where_it_was_at_every_view_and_back() -> None:
    splatter = Splatter(32, 32).load(fibres())
    straight = splatter.render(eye_at(0.0, 5.0, 5.0))
    for k in range(4):
        splatter.render(eye_at(0.0, 5.0, 5.0 + k), finish=LEANT)
    assert np.array_equal(splatter.render(eye_at(0.0, 5.0, 5.0)), straight)
    assert normals(splatter)[1] == pytest.approx(1.0)


def test_hairs_stay_as_they_are() -> None:
    splatter = Splatter(32, 32).load(fibres(openness=1.0))
    splatter.render(eye_at(0.0, 0.0, 10.0), finish=LEANT)
    assert normals(splatter)[1] == pytest.approx(1.0)


def test_light_is_found_anew_for_normals_that_lean() -> None:
    """As that of particles that were loaded with such normals."""
    lighting, camera = Lighting(shadows=True, occlusion=True), eye_at(0.0, 0.0, 10.0)
    splatter = Splatter(32, 32).load(fibres())
    splatter.render(camera, lighting=lighting, finish=Finish(depth=1e-3))
    leant = splatter.render(camera, lighting=lighting, finish=Finish(depth=1e-3, to_eye=0.75))
    particles = fibres()
    particles.normal[:] = np.array([0.0, 1.0, 0.75]) / 1.25
    there = Splatter(32, 32).load(particles).render(camera, lighting=lighting, finish=Finish(depth=1e-3))
    assert np.abs(leant.astype(int) - there).max() <= 1


def test_all_fibres_of_a_yarn_do_not_lean_and_fewer_lean_farther() -> None:
    yarn = Yarn(count_tex=14.8)
    few = [leaning(yarn, n) for n in (yarn.fibres_in_section, 36, 12, 4)]
    assert few[0] == 0.0
    assert few == sorted(few)
    # Fibres of a quarter of the number are twice as thick: half of SEEN of that, over 2/3 of the yarn's radius.
    quarter = leaning(yarn, round(yarn.fibres_in_section / 4))
    assert quarter == pytest.approx(SEEN * 0.5 * yarn.fibre_diameter / (yarn.single_diameter / 3), rel=0.02)
