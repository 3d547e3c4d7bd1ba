"""Templates cut into octets: every particle once, and as few frames as their ratios allow."""

from types import SimpleNamespace

import numpy as np
import pytest

from taichi_cloth.fabric.octets import octets_of
from taichi_cloth.ground.particles import OCTET


def cut(*templates: list[float]):
    """The octets of templates with these ratios, and the ratios, one after another."""
    u = np.concatenate([np.asarray(one, np.float32) for one in templates])
    start = np.concatenate([[0], np.cumsum([len(one) for one in templates])])
    return octets_of(SimpleNamespace(u=u, start=start)), u  # pyright: ignore[reportArgumentType]


def along(steps: int, fibres: int) -> list[float]:
    return [(k + 0.5) / steps for k in range(steps)] * fibres


@pytest.mark.parametrize(
    ("steps", "fibres", "hairs", "octets", "runs"),
    [
        (8, 4, 4, 5, 2),  # the T-shirt of the tables: a fibre an octet, and one of hairs
        (7, 5, 0, 5, 1),  # the dress: a place of each octet stays empty
        (2, 6, 0, 2, 1),  # four fibres side by side, and half of that
        (6, 4, 0, 4, 1),  # eight places are given away to spare two frames
        (7, 4, 4, 5, 2),  # the skirt of the tables: likewise
        (16, 3, 0, 6, 2),
        (1, 1, 0, 1, 1),
    ],
)
def test_fibres_cut_alike_share_their_frames(steps: int, fibres: int, hairs: int, octets: int, runs: int) -> None:
    found, _ = cut(along(steps, fibres) + [0.71 + 0.01 * k for k in range(hairs)])
    assert found.source.shape == (octets, OCTET)
    assert len(found.ratio) == runs


def test_every_particle_stands_once_at_its_own_ratio() -> None:
    """Also where a template has none, and where places are left over: there stands one that is in the run anyway."""
    rng = np.random.default_rng(5)
    found, u = cut(along(7, 5) + rng.random(4).tolist(), [], along(3, 7), rng.random(21).tolist())
    for t, (begin, end) in enumerate([(0, 39), (39, 39), (39, 60), (60, 81)]):
        first, last = found.octet[t], found.octet[t + 1]
        places = found.place[begin:end]
        assert len(set(places.tolist())) == end - begin
        assert (found.source[first:last].ravel()[places] == np.arange(begin, end)).all()
    octet_of_run = np.repeat(np.arange(len(found.ratio)), np.diff(found.start))
    assert (u[found.source] == found.ratio[octet_of_run]).all()
    assert (found.start[found.run] == found.octet).all()
