"""How much of a picture each particle is, against the picture's own coverage."""

import numpy as np

from taichi_cloth.render.data.camera import Camera
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.splat.shares import shares_seen
from taichi_cloth.render.splat.splat import Splatter


def drawn(place: list[list[float]], radius: list[float], opacity: list[float]) -> Splatter:
    count = len(place)
    even = {"colour": np.full((count, 3), 0.5), "tangent": np.tile([1.0, 0.0, 0.0], (count, 1))}
    balls = Particles(
        np.array(place),
        np.array(radius),
        normal=np.tile([0.0, 0.0, -1.0], (count, 1)),
        opacity=np.array(opacity),
        **even,
    )
    splatter = Splatter(64, 48).load(balls)
    splatter.render(Camera(np.eye(3), np.zeros(3), 100.0, 32.0, 24.0, 64, 48, near=0.01))
    return splatter


def covered(splatter: Splatter) -> np.ndarray:
    return splatter.linear()[..., 3].astype(np.float64)


def test_what_is_in_front_takes_from_what_is_behind() -> None:
    """A small disc before a large one: the large one has what it has alone but for what the small one takes."""
    small, large = [0.0, 0.0, 1.0], [0.0, 0.0, 1.5]
    both = drawn([large, small], [0.24, 0.06], [0.8, 0.5])
    everywhere = np.ones((48, 64), bool)
    shares = shares_seen(both, everywhere)[:2]
    front = covered(drawn([small], [0.06], [0.5]))
    back = covered(drawn([large], [0.24], [0.8]))
    np.testing.assert_allclose(shares, [((1 - front) * back).sum(), front.sum()], rtol=2e-3)
    np.testing.assert_allclose(shares.sum(), covered(both).sum(), rtol=1e-3)


def test_pixels_that_are_not_asked_about_do_not_count() -> None:
    """Of a disc across four tiles the half that is asked about; what lies outside of it has nothing."""
    splatter = drawn([[0.0, 0.0, 1.0], [0.25, 0.1, 1.0]], [0.1, 0.03], [1.0, 1.0])
    left = np.zeros((48, 64), bool)
    left[:, :32] = True
    shares = shares_seen(splatter, left)[:2]
    np.testing.assert_allclose(shares, [covered(splatter)[left].sum(), 0.0], rtol=1e-3)
    assert shares[0] > 100.0
