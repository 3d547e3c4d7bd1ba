"""Yarn paths against Peirce's closed form, and every built-in weave against interpenetration."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.cloth_facts import (
    areal_mass_gsm,
    cloth_cover,
    cloth_facts,
    cotton_diameter_m,
    cover_factor,
    thickness_m,
)
from taichi_cloth.weave.crimp import (
    Interlacing,
    PathKinds,
    centreline,
    crimp,
    crossing_heights,
    interlacing,
    path_kinds,
    peirce,
    weave_angle,
    yarn_length,
)
from taichi_cloth.weave.draft import Draft, known_weaves, named_weave
from taichi_cloth.weave.interpenetration import deepest_interpenetration
from taichi_cloth.weave.jamming import balance_limits, fit_balance, fit_diameters, jams, least_pitches
from taichi_cloth.yarn.count import in_tex

TABLE = [  # textiles.md section 3: p/D, theta [deg], crimp %
    (np.sqrt(0.75), 60.0, 20.92),
    (1.0, 36.87, 14.35),
    (1.2, 27.67, 9.46),
    (1.5, 20.80, 5.85),
    (2.0, 14.98, 3.21),
    (3.0, 9.73, 1.41),
]


def cloth(name="plain", pitch=0.5e-3, d=0.2e-3, **more) -> Interlacing:
    sizes = {"warp_spacing_m": pitch, "weft_spacing_m": pitch, "warp_diameter_m": d, "weft_diameter_m": d}
    return interlacing(named_weave(name), **{**sizes, **more})


def mixed(seed: int) -> Interlacing:
    """A random weave of unlike threads at unlike spacings, scaled to where it just does not jam."""
    rng = np.random.default_rng(seed)
    picks, ends = rng.integers(1, 9, 2)
    made = Interlacing(
        warp_up=rng.random((picks, ends)) < rng.uniform(0.2, 0.8),
        warp_spacing_m=rng.uniform(0.2e-3, 0.6e-3, ends),
        weft_spacing_m=rng.uniform(0.2e-3, 0.6e-3, picks),
        warp_diameter_m=rng.uniform(0.1e-3, 0.4e-3, ends),
        weft_diameter_m=rng.uniform(0.1e-3, 0.4e-3, picks),
        balance=rng.random(),
        periodic=bool(seed % 2),
    )
    return scaled(made, fit_diameters(made))


def scaled(made: Interlacing, factor: float) -> Interlacing:
    return replace(made, warp_diameter_m=made.warp_diameter_m * factor, weft_diameter_m=made.weft_diameter_m * factor)


@pytest.mark.parametrize(("p_over_d", "degrees", "percent"), TABLE)
@pytest.mark.parametrize("share", [0.5, 0.3])
def test_peirce_table(p_over_d, degrees, percent, share):
    total = 0.3e-3
    cell = peirce(p_over_d * total, share * total, (1 - share) * total)
    assert np.degrees(cell.angle_rad) == pytest.approx(degrees, rel=5e-3)
    assert 100 * cell.crimp == pytest.approx(percent, rel=5e-3)


@pytest.mark.parametrize("balance", [0.1, 0.5, 0.8])
@pytest.mark.parametrize("p_over_d", [1.0, 1.7, 4.0])
def test_peirce_equations_hold(p_over_d, balance):
    d = 2.5
    cell = peirce(p_over_d * d, 1.5, 1.0, balance=balance)
    straight = cell.length - d * cell.angle_rad
    sin, cos = np.sin(cell.angle_rad), np.cos(cell.angle_rad)
    assert straight * cos + d * sin == pytest.approx(p_over_d * d, rel=1e-12)
    assert straight * sin + d * (1 - cos) == pytest.approx(balance * d, rel=1e-12)


def test_small_crimp_follows_peirces_rule():
    for p_over_d in (1.0, 1.5, 2.0, 3.0):  # h = 4/3 p sqrt(c), within 5.7 %
        cell = peirce(p_over_d, 0.5, 0.5)
        assert 4 / 3 * p_over_d * np.sqrt(cell.crimp) == pytest.approx(cell.height, rel=0.057)


def test_peirce_jams_at_root_three_quarters():
    assert peirce(np.sqrt(0.75), 0.5, 0.5).length == pytest.approx(np.pi / 3)  # arcs only
    with pytest.raises(InputError, match=r"jam.*0\.866025"):
        peirce(0.866, 0.5, 0.5)


def test_crossing_threads_touch():
    made = mixed(4)
    z_warp, z_weft = crossing_heights(made.warp_up, made.warp_diameter_m, made.weft_diameter_m, made.balance)
    radius = 0.5 * (made.warp_diameter_m[None, :] + made.weft_diameter_m[:, None])
    np.testing.assert_allclose(np.where(made.warp_up, 1, -1) * (z_warp - z_weft), radius, rtol=1e-12)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("family", ["warp", "weft"])
def test_paths_are_smooth_and_as_long_as_stated(seed, family):
    kinds = path_kinds(mixed(seed), family)
    if kinds.z0.size == 0:
        return
    u = np.linspace(0, 1, 20_001)
    z, slope = centreline(kinds, u)
    np.testing.assert_allclose(z[..., 0], kinds.z0, atol=1e-15)
    np.testing.assert_allclose(z[..., -1], kinds.z1, atol=1e-12)
    np.testing.assert_allclose(slope[..., [0, -1]], 0, atol=1e-12)
    # The slope is that of z: the trapezium rule on it, at second order, gives z back.
    along = np.cumsum(0.5 * (slope[..., 1:] + slope[..., :-1]), axis=-1) / (u.size - 1)
    gentle = weave_angle(kinds) < 1.4
    np.testing.assert_allclose((kinds.z0[..., None] + along)[gentle], z[..., 1:][gentle], atol=1e-9)
    chords = np.hypot(np.diff(z, axis=-1), kinds.pitch[..., None] * np.diff(u)).sum(axis=-1)
    np.testing.assert_allclose(chords, yarn_length(kinds), rtol=1e-5)


def test_crimp_of_plain_is_peirces_and_floats_dilute_it():
    one = peirce(0.5e-3, 0.2e-3, 0.2e-3).crimp
    for name, changes, of in (("plain", 1, 1), ("twill-2/2", 2, 4), ("satin-5", 2, 5), ("basket-3/3", 2, 6)):
        warp, weft = crimp(cloth(name))
        np.testing.assert_allclose(warp, one * changes / of, rtol=1e-12)
        np.testing.assert_allclose(weft, one * changes / of, rtol=1e-12)


def test_balance_moves_the_crimp_from_one_family_to_the_other():
    warp, weft = crimp(cloth(balance=0.0))
    np.testing.assert_allclose(warp, 0, atol=1e-15)
    np.testing.assert_allclose(weft, peirce(0.5e-3, 0.2e-3, 0.2e-3, balance=1.0).crimp)


def test_an_open_cloth_has_a_block_less():
    made = cloth("twill-2/2", periodic=False)
    assert path_kinds(made, "warp").z0.shape == (3, 4)
    assert path_kinds(made, "weft").z0.shape == (4, 3)
    assert made.pitches("warp").shape == (3,)


SETS = [0.8660255, 1.0, 1.3, 2.0]  # p/D from jammed to open


@pytest.mark.parametrize("name", sorted(set(known_weaves())))
def test_no_built_in_weave_runs_into_itself(name):
    for p_over_d in SETS:
        for ratio in (1.0, 2.0):
            made = cloth(
                name, pitch=p_over_d * 0.4e-3, warp_diameter_m=0.4e-3 / (1 + ratio), d=0.4e-3 * ratio / (1 + ratio)
            )
            assert deepest_interpenetration(made).fraction < 1e-4
    window = interlacing(
        named_weave(name, ends=16, picks=16), warp_spacing_m=0.3e-3, weft_spacing_m=0.4e-3,
        warp_diameter_m=0.15e-3, weft_diameter_m=0.2e-3, periodic=False, balance=0.6,
    )  # fmt: skip
    assert deepest_interpenetration(window).fraction < 1e-4


@pytest.mark.parametrize("seed", range(60))
def test_no_mixture_of_threads_runs_into_itself(seed):
    assert deepest_interpenetration(mixed(seed)).fraction < 1e-4


def cosine(kinds, u):
    """A path that knows nothing of the threads' thickness."""
    u = np.asarray(u)
    z0, z1 = kinds.z0[..., None], kinds.z1[..., None]
    return z0 + (z1 - z0) * 0.5 * (1 - np.cos(np.pi * u)), 0.5 * np.pi * (z1 - z0) * np.sin(np.pi * u)


def straight(kinds, u):
    u = np.asarray(u)
    z0, z1 = kinds.z0[..., None], kinds.z1[..., None]
    return z0 + (z1 - z0) * u, (z1 - z0) + 0 * u


def test_the_check_sees_paths_that_cut_corners():
    near_jam = cloth(pitch=0.3465e-3)
    assert deepest_interpenetration(near_jam).fraction < 1e-4
    assert deepest_interpenetration(near_jam, path=cosine).fraction > 0.05
    bad = deepest_interpenetration(near_jam, path=straight)
    assert bad.fraction > 0.1
    assert bad.between == "warp-weft"


def test_the_check_measures_neighbours_exactly():
    """Two ends floating side by side, 0.15 mm apart and 0.2 mm thick: a quarter of a diameter."""
    made = cloth("basket-2/2", warp_spacing_m=np.array([0.15e-3, 0.15e-3, 0.7e-3, 0.7e-3]))
    deep = deepest_interpenetration(made)
    assert deep.fraction == pytest.approx(0.25, abs=1e-4)
    assert deep.depth_m == pytest.approx(0.05e-3, rel=1e-3)
    assert (deep.between, deep.end) == ("warp-warp", 0)


def test_jams_name_the_pair_and_the_least_pitch():
    made = cloth(warp_spacing_m=np.array([0.3e-3, 0.5e-3]), periodic=False)
    assert not jams(made)
    tight = replace(made, warp_spacing_m=np.array([0.3e-3, 0.3e-3]))
    (jam,) = jams(tight)
    assert (jam.family, jam.first) == ("warp", 0)
    assert jam.pitch_m == pytest.approx(0.3e-3)
    assert jam.least_pitch_m == pytest.approx(np.sqrt(0.75) * 0.4e-3)
    with pytest.raises(InputError, match="jam"):
        crimp(tight)


@pytest.mark.parametrize("seed", range(10))
def test_fitted_diameters_just_fit(seed):
    made = scaled(mixed(seed), 1.7)
    factor = fit_diameters(made)
    if factor < 1:
        assert not jams(scaled(made, factor))
        assert jams(scaled(made, factor * 1.001))
    least = least_pitches(scaled(made, 0.5))
    for half, whole in zip(least, least_pitches(made), strict=True):
        np.testing.assert_allclose(half, 0.5 * whole)


def test_poplin_needs_its_warp_to_take_the_crimp():
    d = float(cotton_diameter_m(in_tex(40, "Ne")))
    made = cloth(warp_spacing_m=0.0254 / 133, weft_spacing_m=0.0254 / 72, d=d)
    assert jams(made)
    low, high = balance_limits(made)
    assert 0.7 < low < 0.8
    assert high == 1
    fitted = replace(made, balance=fit_balance(made))
    assert fitted.balance == low
    assert not jams(fitted)
    assert deepest_interpenetration(fitted).fraction < 1e-4


@pytest.mark.parametrize("seed", range(6))
def test_fitted_balance_shrinks_the_yarns_least(seed):
    rng = np.random.default_rng(seed)
    made = cloth(warp_spacing_m=rng.uniform(0.1e-3, 0.3e-3), weft_spacing_m=rng.uniform(0.1e-3, 0.3e-3), d=0.3e-3)
    best = fit_diameters(replace(made, balance=fit_balance(made)))
    for other in np.linspace(0, 1, 41):
        assert fit_diameters(replace(made, balance=float(other))) <= best + 1e-9


@pytest.mark.parametrize(("call", "words"), [
    (lambda: interlacing(named_weave("plain")), "states no warp spacing"),
    (lambda: cloth(d=0.0), "above 0"),
    (lambda: cloth(d=np.nan), "above 0"),
    (lambda: cloth(warp_spacing_m=np.ones(3)), "(2,)"),
    (lambda: cloth(balance=1.5), "balance"),
    (lambda: cloth(balance=np.nan), "balance"),
    (lambda: cloth(warp_diameter_m="thick"), "not a number"),
    (lambda: peirce(0.0, 1, 1), "above 0"),
    (lambda: crimp(cloth("plain", periodic=False, d=0.3e-3)), "jam"),
    (lambda: cloth_facts(cloth(), warp_tex=0.0, weft_tex=20.0), "warp_tex"),
    (lambda: crimp(interlacing(Draft(warp_up=np.ones((1, 2), bool)), warp_spacing_m=1, weft_spacing_m=1,
                               warp_diameter_m=0.1, weft_diameter_m=0.1, periodic=False)), "single crossing"),
])  # fmt: skip
def test_bad_sizes_are_one_line(call, words):
    with pytest.raises(InputError) as error:
        call()
    assert words in str(error.value)


def test_mass_of_the_textbook_poplins():
    """textiles.md: 40×40 / 133×72 gives 128 g/m², 32×32 / 68×68 gives 105, both at 10 % warp and 3 % weft
    crimp.

    The source states no crimp; these two reproduce both masses, and are usual for poplin.
    """
    for ne, epi, ppi, grams in ((40, 133, 72, 128), (32, 68, 68, 105)):
        tex = float(in_tex(ne, "Ne"))
        assert areal_mass_gsm([epi / 2.54, ppi / 2.54], [tex, tex], [0.10, 0.03]) == pytest.approx(grams, abs=0.5)


def test_facts_of_a_cloth_agree_with_the_formulas():
    tex = float(in_tex(32, "Ne"))
    made = cloth(pitch=0.0254 / 68, d=float(cotton_diameter_m(tex)))
    facts = cloth_facts(made, warp_tex=tex, weft_tex=tex)
    assert facts.ends_per_cm == pytest.approx(68 / 2.54)
    c = peirce(0.0254 / 68, *2 * (float(cotton_diameter_m(tex)),)).crimp
    assert facts.warp_crimp == pytest.approx(c)
    assert facts.mass_gsm == pytest.approx(2 * 68 / 2.54 * tex * (1 + c) / 10)
    assert facts.mass_gsm == pytest.approx(105, rel=0.05)  # round yarns crimp more than those of a finished cloth
    assert facts.warp_cover == pytest.approx(68 / np.sqrt(32))
    assert facts.cover == pytest.approx(cloth_cover(facts.warp_cover, facts.weft_cover))
    assert facts.thickness_mm == pytest.approx(2e3 * 0.0254 / (28 * np.sqrt(32)))  # two diameters: h + d


def test_cover_of_a_closed_row_is_28():
    d_inch = 1 / (28 * np.sqrt(20))
    assert cover_factor(1 / d_inch / 2.54, float(in_tex(20, "Ne"))) == pytest.approx(28)
    assert cloth_cover(28, 5) == pytest.approx(28)


def test_thickness_of_a_straight_weft():
    """Weft straight, warp over and under it: two warp diameters and one weft."""
    made = cloth(warp_diameter_m=0.1e-3, weft_diameter_m=0.3e-3, balance=1.0)
    assert thickness_m(made) == pytest.approx(0.5e-3)


def test_mass_of_unlike_threads_is_their_sum():
    made = cloth(warp_spacing_m=np.array([0.4e-3, 0.6e-3]))
    facts = cloth_facts(made, warp_tex=np.array([10.0, 30.0]), weft_tex=20.0)
    warp, weft = crimp(made)
    by_hand = 1e-3 * ((10 * (1 + warp[0]) + 30 * (1 + warp[1])) / 1e-3 + 2 * 20 * (1 + weft[0]) / 1e-3)
    assert facts.mass_gsm == pytest.approx(by_hand)


def test_path_kinds_take_any_shape():
    kinds = PathKinds(np.array(2.0), np.array(0.3), np.array(-0.3), np.array(0.5), np.array(0.7))
    z, slope = centreline(kinds, [0.0, 0.5, 1.0])
    assert z.shape == slope.shape == (3,)
    assert yarn_length(kinds) > 2
