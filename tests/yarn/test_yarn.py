"""Spinner's formulas against textbook numbers, and the laid-out fibres against the spinner's formulas."""

from math import cos, degrees, pi, sqrt, tan

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.yarn.count import in_tex
from taichi_cloth.yarn.hairs import hairs, usual_hairiness
from taichi_cloth.yarn.spin import Period, pack_section, rotate_section, spin
from taichi_cloth.yarn.thick_fibres import twist_of
from taichi_cloth.yarn.yarn import Hairiness, Yarn, resultant_count, turns_per_m

BLOCK = 0.4e-3


def laid_out(yarn: Yarn, *, fibres: int = 200, steps: int = 8, seed: int = 1):
    period = Period.of(yarn, BLOCK)
    return period, spin(yarn, period, fibres=fibres, steps=steps, start=0.0, stop=period.length, seed=seed)


def test_counts():
    assert in_tex(40, "Ne") == pytest.approx(14.7625)
    assert resultant_count(40, 40) == pytest.approx(20)
    assert turns_per_m(4.0, 36) == pytest.approx(24 / 0.0254)


@pytest.mark.parametrize("ne", [10, 20, 40, 80])
def test_cotton_diameter_is_the_textbook_one(ne: float):
    yarn = Yarn(count_tex=in_tex(ne, "Ne"), plies=1)
    assert yarn.single_diameter == pytest.approx(0.0254 / (28 * sqrt(ne)), rel=0.01)


def test_ne40_at_900_turns():
    """textiles: Ne 40 at 900 turns/m has a helix angle of 22.1° and a retraction of 3.8 %."""
    yarn = Yarn(count_tex=in_tex(40, "Ne"), plies=1, twist_per_m=900)
    assert degrees(yarn.single_helix_angle) == pytest.approx(22.1, rel=0.01)
    assert 100 * yarn.retraction == pytest.approx(3.8, rel=0.01)
    assert yarn.retraction == pytest.approx(1 - 1 / yarn.contraction, rel=1e-9)


@pytest.mark.parametrize("plies", [1, 2, 3, 4])
def test_diameter_of_the_laid_out_yarn(plies: int):
    yarn = Yarn(count_tex=20, plies=plies, twist_per_m=600, singles_twist_per_m=350, migration=0.0)
    _, strands = laid_out(yarn, fibres=400)
    reach = (np.hypot(strands.position[..., 1], strands.position[..., 2]) + strands.radius).max()
    assert 2 * reach == pytest.approx(yarn.diameter, rel=0.01)


def test_how_fast_fibres_go_round_is_found_from_their_courses():
    yarn = Yarn(count_tex=in_tex(40, "Ne"), plies=1, twist_per_m=900, migration=0.0)
    for fibres in (4, 60):
        period, strands = laid_out(yarn, fibres=fibres)
        turned = twist_of(strands.position[..., 1:], strands.tangent, strands.ply)
        assert turned == pytest.approx(2 * pi * period.single_turns / period.length, rel=2e-3)


@pytest.mark.parametrize("fibres", [3, 12, 60])
def test_few_fibres_are_as_bright_as_many(fibres: int):
    """The mean of their tone, by their area, is the yarn's colour."""
    _, strands = laid_out(Yarn(count_tex=20, plies=2, twist_per_m=600), fibres=fibres)
    assert np.average(strands.tone, weights=strands.radius.mean(axis=1)) == pytest.approx(1.0, abs=1e-9)
    assert strands.tone.std() > 0.02


def test_helix_angle_and_contraction_of_the_laid_out_single():
    yarn = Yarn(count_tex=in_tex(40, "Ne"), plies=1, twist_per_m=900, migration=0.0)
    period, strands = laid_out(yarn, fibres=2000)
    r = np.hypot(strands.position[..., 1], strands.position[..., 2])
    angle = np.arccos(np.abs(strands.tangent[..., 0]))
    turns = abs(period.single_turns) / period.length
    assert turns == pytest.approx(900, rel=0.01)
    np.testing.assert_allclose(np.tan(angle), 2 * pi * r * turns, rtol=2e-3)
    outermost = (r + strands.radius).max()  # the surface, not the axis of the outermost fibre
    surface = np.interp(outermost, *_sorted(r.ravel(), np.tan(angle).ravel()))
    assert surface * outermost / r.max() == pytest.approx(tan(yarn.single_helix_angle), rel=0.01)
    length_ratio = np.mean(1 / np.cos(angle))
    assert length_ratio == pytest.approx(yarn.contraction, rel=0.01)


def test_ply_helix_and_take_up():
    yarn = Yarn(count_tex=20, plies=2, twist_per_m=700, migration=0.0)
    period, _ = laid_out(yarn)
    assert abs(period.ply_turns) / period.length == pytest.approx(700, rel=0.01)
    assert tan(yarn.ply_helix_angle) == pytest.approx(2 * pi * (yarn.diameter / 4) * 700, rel=1e-9)
    x = np.linspace(0, period.length, 4001)
    turn = 2 * pi * period.ply_turns * x / period.length
    axis = np.stack([x, yarn.ply_offset * np.cos(turn), yarn.ply_offset * np.sin(turn)], 1)
    path = np.linalg.norm(np.diff(axis, axis=0), axis=1).sum()
    assert 1 - period.length / path == pytest.approx(yarn.ply_take_up, rel=0.02)
    assert yarn.ply_take_up == pytest.approx(1 - cos(yarn.ply_helix_angle))


@pytest.mark.parametrize(("direction", "sign"), [("Z", 1), ("S", -1)])
def test_s_and_z(direction, sign: int):
    """Z: seen from outside the fibres climb to the right, which is a right-handed helix: x · (p × t) > 0."""
    yarn = Yarn(count_tex=20, plies=2, twist_per_m=700, twist=direction, migration=0.0)
    _, strands = laid_out(yarn, fibres=8)
    swirl = np.cross(strands.position, strands.tangent)[..., 0]
    assert np.sign(swirl.mean()) == sign


def test_period_closes_without_a_seam():
    yarn = Yarn(count_tex=20, plies=3, twist_per_m=650, singles_twist_per_m=300)
    period = Period.of(yarn, BLOCK)
    first = spin(yarn, period, fibres=10, steps=5, start=0.0, stop=BLOCK, seed=3)
    after = spin(yarn, period, fibres=10, steps=5, start=period.length, stop=period.length + BLOCK, seed=3)
    np.testing.assert_allclose(first.position[..., 1:], after.position[..., 1:], atol=1e-12)
    np.testing.assert_allclose(first.tangent, after.tangent, atol=1e-6)


def test_pieces_are_the_whole():
    yarn = Yarn(count_tex=20)
    period = Period.of(yarn, BLOCK)
    whole = spin(yarn, period, fibres=5, steps=4, start=0.0, stop=2 * BLOCK, seed=3)
    second = spin(yarn, period, fibres=5, steps=4, start=BLOCK, stop=2 * BLOCK, seed=3)
    np.testing.assert_allclose(whole.position[:, 4:], second.position, atol=1e-15)


def test_period_keeps_stated_twists_within_one_percent():
    for twist in (250, 480, 700, 1200):
        for own in (0, 180, 900):
            yarn = Yarn(count_tex=20, plies=2, twist_per_m=twist, singles_twist_per_m=own)
            period = Period.of(yarn, 0.37e-3, most=200)
            assert abs(period.ply_turns) / period.length == pytest.approx(twist, rel=0.01)
            if own:
                assert abs(period.single_turns) / period.length == pytest.approx(own, rel=0.01)


def test_packing_is_even():
    """Any inner disc holds its share of the fibres."""
    area, _ = pack_section(1000)
    for share in (0.1, 0.25, 0.5, 0.9):
        assert np.mean(area < share) == pytest.approx(share, abs=0.002)


def test_drawn_fibres_cover_the_area_of_the_real_ones():
    yarn = Yarn(count_tex=20)
    for drawn in (1, 7, 60, yarn.fibres_in_section):
        _, strands = laid_out(yarn, fibres=drawn, steps=2)
        cover = pi * np.sum(strands.radius[:, 0] ** 2) / yarn.plies
        real = yarn.count_tex * 1e-6 / yarn.fibre_density
        assert cover == pytest.approx(real, rel=0.01)


def test_migration_stays_inside_the_ply_and_wanders():
    yarn = Yarn(count_tex=20, plies=1, twist_per_m=0, migration=0.5, migration_period_mm=2.0)
    _, strands = laid_out(yarn, fibres=30)
    r = np.hypot(strands.position[..., 1], strands.position[..., 2])
    assert r.max() <= yarn.single_diameter / 2
    assert np.ptp(r, axis=1).min() > 0.05 * yarn.single_diameter


def test_hairs_leave_the_yarn_and_loops_come_back():
    yarn = Yarn(count_tex=20, hairiness=Hairiness(ends_per_m=0, loops_per_m=5000, height_mm=0.3))
    loops = hairs(yarn, length=0.01, step=2e-5, seed=2)
    r = np.hypot(loops.position[..., 1], loops.position[..., 2])
    assert len(loops.ply) == pytest.approx(50, abs=1)
    surface = yarn.diameter / 2
    assert r[:, 0].max() < surface + 0.1e-3
    assert r[:, -1].max() < surface + 0.1e-3
    assert r.max() > surface + 0.3e-3
    ends = hairs(
        Yarn(count_tex=20, hairiness=Hairiness(ends_per_m=5000, height_mm=0.3)),
        length=0.01,
        step=2e-5,
        seed=2,
    )
    r = np.hypot(ends.position[..., 1], ends.position[..., 2])
    assert np.all(np.diff(r, axis=1) > 0)


def test_hairs_are_fibres_that_come_out_of_the_yarn_and_end_in_points():
    yarn = Yarn(count_tex=20, hairiness=Hairiness(ends_per_m=5000, loops_per_m=3000, height_mm=0.3))
    grown = hairs(yarn, length=0.01, step=2e-5, seed=2)
    r = np.hypot(grown.position[..., 1], grown.position[..., 2])
    ends = np.arange(80) < 50
    assert r[:, 0].max() < 0.75 * yarn.diameter / 2
    assert r[~ends, -1].max() < 0.75 * yarn.diameter / 2
    thick = grown.radius / (yarn.fibre_diameter / 2)
    assert thick[:, 0] == pytest.approx(np.ones(80), abs=0.2)
    assert np.ptp(thick[:, 0]) > 0.2  # no two alike
    assert (thick[ends, -1] < 0.4 * thick[ends, 0]).all()
    np.testing.assert_array_equal(thick[~ends, -1], thick[~ends, 0])
    assert (np.diff(thick[ends], axis=1) <= 0).all()


def test_spun_yarns_are_hairy_and_filaments_are_not():
    assert usual_hairiness("silk", "filament", 20) == Hairiness()
    wool, cotton = usual_hairiness("wool", "spun", 20), usual_hairiness("cotton", "spun", 20)
    fine = usual_hairiness("cotton", "spun", 5)
    assert wool.height_mm > cotton.height_mm
    assert wool.ends_per_m > cotton.ends_per_m == pytest.approx(2 * fine.ends_per_m)
    assert usual_hairiness("polyester", "spun", 20) == cotton


def test_a_nap_lies_flat_and_a_few_wide_hairs_cover_as_much():
    nap = usual_hairiness("wool", "spun", 20, raised=True)
    assert nap.of_nap
    assert not usual_hairiness("wool", "spun", 20).of_nap
    yarn = Yarn(count_tex=20, hairiness=nap)
    area = []
    for each in (1, 4):
        grown = hairs(yarn, length=0.05, step=1e-4, seed=3, each=each)
        area.append(np.sum(grown.radius * grown.half_length))
        rise = np.hypot(grown.position[..., 1], grown.position[..., 2]).max(axis=1) - yarn.diameter / 2
        assert np.median(np.ptp(grown.position[..., 0], axis=1) / rise) > 3.0
    assert area[1] == pytest.approx(area[0], rel=0.1)


def test_plies_that_nothing_holds_together_lie_as_one_bundle():
    thrown = Yarn(count_tex=2.33, plies=3, twist_per_m=108, fineness_dtex=1.2, fibre_density=1340)
    one = thrown.as_one
    assert (one.plies, one.fibres_in_section) == (1, round(3 * 2.33 / 0.12))
    assert one.woven_diameter == pytest.approx(thrown.woven_diameter)
    folded = Yarn(count_tex=20, plies=2, twist_per_m=700)
    assert folded.as_one is folded


def test_hair_number_is_right_in_the_mean():
    yarn = Yarn(count_tex=20, hairiness=Hairiness(ends_per_m=1000))
    counts = [len(hairs(yarn, length=0.4e-3, step=2e-5, seed=s).ply) for s in range(400)]
    assert np.mean(counts) == pytest.approx(0.4, abs=0.08)


def test_rotation_keeps_lengths_and_adds_up():
    rng = np.random.default_rng(0)
    p, a, b = rng.normal(size=(50, 3)), rng.normal(size=50), rng.normal(size=50)
    np.testing.assert_allclose(rotate_section(rotate_section(p, a), b), rotate_section(p, a + b), atol=1e-12)


def test_same_seed_same_yarn_other_seed_other_yarn():
    yarn = Yarn(count_tex=20)
    a, b, c = (laid_out(yarn, fibres=4, seed=s)[1].position for s in (5, 5, 6))
    assert np.array_equal(a, b)
    assert not np.allclose(a, c)


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        ({"count_tex": -1}, "yarn.count_tex: -1"),
        ({"count_tex": float("nan")}, "yarn.count_tex: nan"),
        ({"count_tex": 20, "plies": 0}, "yarn.plies: 0"),
        ({"count_tex": 20, "packing": 1.5}, "yarn.packing: 1.5"),
        ({"count_tex": 20, "twist_per_m": 1e9}, "yarn.twist_per_m"),
        ({"count_tex": 0.1, "fineness_dtex": 5.0}, "heavier than the whole single"),
    ],
)
def test_impossible_yarns_are_refused(bad: dict, says: str):
    with pytest.raises(InputError, match=says):
        Yarn(**bad)


def _sorted(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(x)
    return x[order], y[order]


def test_hairs_that_stand_for_several_take_turns() -> None:
    """Every third of the same hairs, three times as wide: the three parts together are all of them."""
    yarn = Yarn(count_tex=20, hairiness=Hairiness(4000.0, 2000.0, 0.3))
    every = hairs(yarn, length=0.01, step=1e-4, seed=5)
    parts = [hairs(yarn, length=0.01, step=1e-4, seed=5, each=3, part=k) for k in range(3)]
    assert sum(len(part.ply) for part in parts) == len(every.ply)
    for k, part in enumerate(parts):
        assert (part.position == every.position[k::3]).all()
        assert part.radius == pytest.approx(3 * every.radius[k::3])
