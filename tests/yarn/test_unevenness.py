"""Thick and thin places of yarn, and where its twist goes."""

import numpy as np
import pytest
import taichi as ti

from taichi_cloth.ground.arrays import F32x1, I32x1
from taichi_cloth.ground.runtime import Runtime
from taichi_cloth.yarn.places import thick_at, wider_at
from taichi_cloth.yarn.spin import Period, spin
from taichi_cloth.yarn.unevenness import (
    FILAMENT,
    WIDENS,
    thick_places,
    uneven_row,
    usual_unevenness,
)
from taichi_cloth.yarn.yarn import Yarn

CV, PITCH = 0.15, 0.3e-3
THREADS, PLACES = 400, 300


def test_usual_yarns_are_as_uneven_as_mills_spin_them() -> None:
    assert usual_unevenness("cotton", "spun", 87) == pytest.approx(0.15, abs=0.01)
    assert usual_unevenness("cotton", "spun", 500) == pytest.approx(0.11, abs=0.01)
    assert usual_unevenness("flax", "spun", 138) == pytest.approx(0.22, abs=0.01)
    assert usual_unevenness("silk", "filament", 50) == FILAMENT


def test_widths_vary_as_much_as_is_said_about_the_mean_and_are_alike_only_near_by() -> None:
    seed = np.random.Generator(np.random.Philox(key=1)).integers(0, 1 << 30, THREADS)
    wide = thick_places(uneven_row(CV, PITCH), seed[:, None], np.arange(PLACES))
    assert wide.mean() == pytest.approx(1.0, abs=0.005)
    assert wide.std() == pytest.approx(WIDENS * CV, rel=0.05)

    def alike(places: int) -> float:
        return float(np.corrcoef(wide[:, 0], wide[:, places])[0, 1])

    assert alike(1) > 0.95  # 0.3 mm
    assert 0.3 < alike(30) < 0.8  # 9 mm
    assert abs(alike(200)) < 0.15  # 60 mm
    assert (np.abs(np.diff(wide, axis=1)) < 0.2 * CV).all()  # nothing jumps
    assert (thick_places(uneven_row(0.0, PITCH), seed, 7) == 1.0).all()


@ti.kernel
def _widths(uneven: F32x1, seed: I32x1, wide_out: F32x1, thick_out: F32x1):
    for k in range(seed.shape[0]):
        wide_out[k] = wider_at(uneven, k % 2, seed[k], k % 1000)
        thick_out[k] = thick_at(uneven, k % 2, seed[k], k % 1000)


def test_kernels_find_what_the_host_finds(taichi_runtime: Runtime) -> None:
    seed = np.random.Generator(np.random.Philox(key=2)).integers(0, 1 << 30, 4000).astype(np.int32)
    rows = uneven_row(CV, PITCH), uneven_row(0.05, 2 * PITCH)
    wide, thick = np.zeros((2, len(seed)), np.float32)
    _widths(np.concatenate(rows), seed, wide, thick)
    for family, row in enumerate(rows):
        mine = np.arange(len(seed)) % 2 == family
        expected = thick_places(row, seed[mine], np.arange(len(seed))[mine] % 1000)
        np.testing.assert_allclose(wide[mine], expected, atol=2e-5)
        assert thick[mine].std() == pytest.approx(np.sqrt(0.65) * WIDENS * (CV, 0.05)[family], rel=0.1)


@pytest.mark.parametrize("unevenness", [0.0, 0.15])
def test_twist_varies_along_a_yarn_as_its_mass_does_and_closes(unevenness: float) -> None:
    turns = []
    for seed in range(12):
        yarn = Yarn(count_tex=20, plies=1, twist_per_m=900, migration=0.0, unevenness=unevenness)
        period = Period.of(yarn, PITCH)
        made = spin(yarn, period, fibres=8, steps=6, start=0.0, stop=2 * period.length, seed=seed)
        angle = np.unwrap(np.arctan2(made.position[-1, :, 2], made.position[-1, :, 1]))
        turns.append(np.diff(angle) / np.diff(angle).mean())
        half = len(angle) // 2
        np.testing.assert_allclose(made.position[:, half:, 1:], made.position[:, :half, 1:], atol=1e-9)
    assert np.std(turns) == pytest.approx(unevenness, rel=0.35, abs=1e-6)
