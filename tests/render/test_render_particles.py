"""Particles check their shapes, and packing puts every number where the kernels look for it."""

from typing import Any

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.particles import COLOUR, NORMAL, POSITION, RADIUS, TANGENT
from taichi_cloth.render.data.blocks import pack
from taichi_cloth.render.data.particles import Particles, concatenate


def some(count: int, **options: Any) -> Particles:
    random = np.random.default_rng(count)
    three = [random.random((count, 3)) for _ in range(4)]
    return Particles(three[0], random.random(count) + 0.1, three[1], three[2], three[3], **options)


def test_scalars_are_repeated_and_types_are_float32() -> None:
    particles = Particles([[0, 0, 1], [1, 0, 1]], 0.5, (1, 0, 0), (1, 0, 0), (0, 0, 1), sprite=[0, 1])
    assert particles.radius.tolist() == [0.5, 0.5]
    assert particles.colour.shape == (2, 3)
    assert {a.dtype for a in (particles.position, particles.radius, particles.colour)} == {np.dtype(np.float32)}
    assert particles.sprite is not None
    assert particles.sprite.dtype == np.int32
    assert len(particles) == 2


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(InputError, match=r"position: shape \(3,\)"):
        Particles([0, 0, 1], 1, (1, 0, 0), (1, 0, 0), (0, 0, 1))
    with pytest.raises(InputError, match=r"radius: shape \(3,\); allowed: \(2,\)"):
        Particles([[0, 0, 1]] * 2, [1, 2, 3], (1, 0, 0), (1, 0, 0), (0, 0, 1))
    with pytest.raises(InputError, match="openness"):
        some(4, openness=np.ones(5))
    with pytest.raises(InputError, match="not an array of numbers"):
        some(4, half_length="long")
    with pytest.raises(InputError, match=r"opacity: 1.5"):
        some(4, opacity=1.5)


def test_concatenate_fills_what_only_some_have() -> None:
    both = concatenate([some(3, half_length=np.full(3, 2.0), opacity=0.5), some(2, openness=np.zeros(2), opacity=0.25)])
    assert len(both) == 5
    assert both.half_length == pytest.approx([2, 2, 2, *some(2).radius])
    assert both.openness == pytest.approx([1, 1, 1, 0, 0])
    assert both.opacity == pytest.approx([0.5, 0.5, 0.5, 0.25, 0.25])
    assert both.sprite is None
    assert concatenate([some(3), some(2)]).opacity == 0.85
    with pytest.raises(InputError, match="at least one"):
        concatenate([])


@pytest.mark.parametrize("count", [0, 1, 16, 37])
def test_blocks_hold_every_number(count: int) -> None:
    particles = some(count, half_length=np.ones(count), openness=np.full(count, 0.3), opacity=np.full(count, 0.7))
    layout, blocks, box = pack(particles, textured=True)
    assert blocks.shape == (17, -(-count // 16), 16)
    rows = blocks.reshape(17, -1).T
    places = ((POSITION, particles.position), (COLOUR, particles.colour))
    places += ((TANGENT, particles.tangent), (NORMAL, particles.normal))
    for first, columns in places:
        assert (rows[:count, first : first + 3] == columns).all()
    assert (rows[:count, RADIUS] == particles.radius).all()
    assert (rows[:count, layout.half_length_row] == 1).all()
    assert rows[:count, layout.openness_row] == pytest.approx(0.3)
    assert rows[:count, layout.opacity_row] == pytest.approx(0.7)
    assert (rows[:count, layout.sprite_row] == 0).all()
    assert (rows[count:] == 0).all()  # a radius of 0 is not drawn
    if count:
        assert (box == [particles.position.min(axis=0), particles.position.max(axis=0)]).all()


def test_what_is_not_drawn_does_not_reach_the_box() -> None:
    particles = Particles([[0, 0, 1], [9, 9, 9], [np.inf, 0, 0]], [1, -1, 1], (1, 1, 1), (1, 0, 0), (0, 0, 1))
    _, blocks, box = pack(particles, textured=False)
    assert box.tolist() == [[0, 0, 1], [0, 0, 1]]
    assert blocks[RADIUS, 0, :4].tolist() == [1, 0, 0, 0]
    assert np.isfinite(blocks).all()
