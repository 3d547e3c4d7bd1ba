"""Directions of fibres that stand for many: through their tables they spread as those that are wanted."""

import numpy as np

from taichi_cloth.detail.directions import DIRECTIONS, EACH, NODES, STEPS, VALUES, Seen, mended, tables


def seen(rise: np.ndarray, share: np.ndarray | None = None) -> Seen:
    level = np.zeros(len(rise))
    return Seen(rise, level, level, level + 0.5, np.ones(len(rise)) if share is None else share)


def through(table: np.ndarray, rise: np.ndarray, chance: np.ndarray) -> np.ndarray:
    """What `turned` makes of what directions rise."""
    at = STEPS * (1.0 + np.sign(rise) * np.sqrt(np.abs(rise))) + chance
    rank = np.interp(at, np.arange(NODES), table[:NODES])
    return table[NODES:EACH][np.clip((rank * VALUES).astype(int), 0, VALUES - 1)]


def test_flat_directions_rise_where_those_that_are_wanted_do_and_keep_their_order() -> None:
    """An eighth is wanted steep where all are nearly flat: an eighth becomes steep, and the highest do."""
    rng = np.random.default_rng(0)
    have = seen(rng.uniform(-0.05, 0.05, 4000))
    want = seen(np.repeat([0.0, 0.45], [1750, 250]))
    table = tables(have, want, rng)
    assert table.shape == (DIRECTIONS,)
    out = through(table, have.rise, rng.random(4000))
    assert abs((out > 0.4).mean() - 0.125) < 0.01
    assert np.isin(out.round(6), [0.0, 0.45]).mean() > 0.98
    assert have.rise[out > 0.4].mean() > have.rise[out < 0.1].mean() + 0.03


def test_a_share_that_is_seen_too_little_of_is_mended() -> None:
    """Steep pieces are seen half as well as flat ones: after some turns as much is seen of them as is wanted."""
    rng = np.random.default_rng(1)
    have, want = rng.uniform(-0.05, 0.05, 8000), seen(np.repeat([0.0, 0.45], [1750, 250]))
    table, chance = tables(seen(have), want, rng), rng.random(8000)
    shares = []
    for _ in range(4):
        out = through(table, have, chance)
        weight = np.where(out > 0.2, 0.5, 1.0)
        shares.append(weight[out > 0.2].sum() / weight.sum())
        table = mended(table, seen(out, weight), want)
    assert shares[0] < 0.08
    assert abs(shares[-1] - 0.125) < 0.01


def test_normals_of_a_class_come_to_those_wanted() -> None:
    have, want = seen(np.linspace(-0.5, 0.5, 1600)), seen(np.linspace(-0.5, 0.5, 1600))
    want = Seen(want.rise, want.lean, want.ahead + 0.1, want.up, want.share)
    table = mended(tables(have, want, np.random.default_rng(2)), have, want)
    assert np.allclose(table[2 * EACH :].reshape(-1, 2), [0.1, 0.0], atol=1e-6)
