"""What follows from yarn and weave: closed forms, the order of cloths, and the cloths that were measured."""

from dataclasses import replace
from math import pi, radians

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.mechanics.bending import (
    KEPT,
    bias_bending,
    crossing_force,
    family_bending,
    family_couple,
    pressed,
    yarn_bending,
)
from taichi_cloth.mechanics.construction import Construction, usual_loss
from taichi_cloth.mechanics.drape import bending_length, drape_coefficient
from taichi_cloth.mechanics.fibre_mechanics import FibreMechanics, blend, fibre_mechanics
from taichi_cloth.mechanics.properties import woven_properties
from taichi_cloth.mechanics.shear import locking_angle, shear_stiffness
from taichi_cloth.mechanics.tension import drawn_stiffness, interchange_strain, leg_stiffness, poisson
from taichi_cloth.weave.cloth_facts import cloth_facts
from taichi_cloth.weave.cloth_set import CLOSEST
from taichi_cloth.weave.draft import named_weave
from taichi_cloth.yarn.yarn import Yarn

COTTON = fibre_mechanics("cotton")


def cloth(
    weave: str = "plain",
    sett: tuple[float, float] = (24.0, 22.0),
    tex: float = 20.0,
    fibre: FibreMechanics = COTTON,
    plies: int = 1,
    **changes: object,
) -> Construction:
    yarn = Yarn(
        count_tex=tex / plies,
        plies=plies,
        twist_per_m=600,
        fibre_density=1e3 * fibre.density,
        fineness_dtex=10 * fibre.fineness,
    )
    made = Construction(
        draft=named_weave(weave),
        warp=yarn,
        weft=yarn,
        warp_fibre=fibre,
        weft_fibre=fibre,
        ends_per_cm=sett[0],
        picks_per_cm=sett[1],
    )
    return replace(made, **changes)


def test_mass_and_crimp_of_an_open_cloth_are_those_of_the_threads_as_drawn() -> None:
    made = cloth()
    facts = cloth_facts(made.fitted.cloth, warp_tex=20.0, weft_tex=20.0)
    assert not made.pressed
    assert made.areal_density == pytest.approx(facts.mass_gsm, rel=1e-9)
    washed = replace(made, warp=replace(made.warp, loss=0.04), weft=replace(made.weft, loss=0.04))
    assert washed.areal_density == pytest.approx(0.96 * facts.mass_gsm, rel=1e-9)
    assert [usual_loss(COTTON), usual_loss(COTTON, "sized"), usual_loss(fibre_mechanics("wool"))] == [0.04, 0.0, 0.0]
    assert woven_properties(made)["crimp_warp"].si == pytest.approx(facts.warp_crimp, rel=1e-9)


def test_free_fibres_bend_by_mass_and_fineness_alone() -> None:
    """R·t·w/(1 + c): half the count at twice the sett is the same."""
    coarse, fine = (
        cloth(sett=(12.0, 11.0), tex=40.0, fibre=fibre_mechanics("wool")),
        cloth(fibre=fibre_mechanics("wool")),
    )
    for made in (coarse, fine):
        for own, bending in zip(made.families, family_bending(made), strict=True):
            wrapped = own.angle * (own.diameter + own.other_diameter)  # Peirce's D·θ
            held = own.turns * wrapped / own.leg * 0.24 / 0.26  # wool slips more easily than cotton
            free = own.fibre.flexural * own.mass * own.single_fibre / (1 + own.crimp)
            assert bending * (1 - held) == pytest.approx(free, rel=1e-9)
    assert [f.mass for f in coarse.families] == pytest.approx([f.mass for f in fine.families])


def test_a_weft_that_lies_straight_is_hardly_held() -> None:
    """Peirce's free length: a thread is held where it is wrapped around others. The fewer picks the straighter they
    lie; the warp has its own way around them."""
    shares = [[pressed(own) for own in cloth(sett=(37.0, picks)).families] for picks in (8.0, 16.0, 24.0, 32.0)]
    warp, weft = zip(*shares, strict=True)
    assert sorted(warp) == list(warp)
    assert sorted(weft) == list(weft)
    assert weft[0] < 0.06 < 0.25 < weft[-1]


def test_a_yarn_lies_between_sliding_and_bonded_fibres() -> None:
    """Bonded over free is T/(t·φ²), the number of fibres over the packing squared."""
    for tex in (5.0, 20.0, 400.0):
        yarn = Yarn(count_tex=tex, plies=1)
        found = yarn_bending(yarn, COTTON)
        assert found.free < found.expected < found.bonded
        assert found.bonded / found.free == pytest.approx(tex / 0.17 / 0.36)


def test_plain_bends_stiffer_than_twill_than_satin_and_finer_fibres_softer() -> None:
    stiff = [sum(family_bending(cloth(weave))) for weave in ("plain", "twill-2/1", "twill-2/2", "satin-5", "satin-8")]
    assert stiff == sorted(stiff, reverse=True)
    assert len(set(stiff)) == 5
    fine = cloth()
    fine = replace(fine, warp=replace(fine.warp, fineness_dtex=0.9), weft=replace(fine.weft, fineness_dtex=0.9))
    assert family_bending(fine)[0] == pytest.approx(0.9 / 1.7 * family_bending(cloth())[0])


def test_more_picks_make_a_cloth_stiffer_in_bending_shear_and_drape() -> None:
    rows = [woven_properties(cloth(sett=(24.0, picks))) for picks in (14.0, 18.0, 22.0, 26.0)]
    for key in ("bending_warp", "bending_weft", "couple_warp", "shear", "shear_hysteresis", "drape_coefficient"):
        values = [row[key].value for row in rows]
        assert values == sorted(values), key
        assert len(set(values)) == 4


def test_a_cloth_alike_both_ways_is_alike_on_the_bias_when_torsion_says_so() -> None:
    for angle in np.linspace(0, pi / 2, 7):
        assert bias_bending(3.0, 3.0, 6.0, angle) == pytest.approx(3.0)
    assert bias_bending(3.0, 1.0, 0.0, 0.0) == 3.0
    assert bias_bending(3.0, 1.0, 0.0, pi / 2) == pytest.approx(1.0)
    assert bias_bending(3.0, 1.0, 2.0, radians(45)) == pytest.approx(1.5)


def test_pulling_one_way_and_the_other_agree_as_energy_asks() -> None:
    """ν₁₂/E₁ = ν₂₁/E₂ of any elastic sheet; the legs' formulas keep it, whatever the sett."""
    for sett in ((24.0, 22.0), (30.0, 15.0), (18.0, 26.0)):
        made = cloth(sett=sett)
        one, other = (poisson(made, k) / leg_stiffness(made, k) for k in (0, 1))
        assert one == pytest.approx(other, rel=1e-9)


def test_legs_of_a_square_cloth_stretch_as_cantilevers_do() -> None:
    """A leg clamped where it crosses is two cantilevers of half its length. Pulled by a force F at the angle θ, its end
    moves by F·sinθ·l³/(12·B) across itself; alike both ways the other family holds as much again, so that half the
    force does: strain = F/2·sin²θ·l³/(12·B·p), and F is the tension of one thread's room."""
    made = cloth(sett=(20.0, 20.0), balance=0.5)
    own = made.families[0]
    free = own.fibre.flexural * own.tex * own.single_fibre
    sine = own.height / own.straight_leg
    strain = 0.5 * sine**2 * own.straight_leg**3 / (12 * free * own.pitch)
    assert leg_stiffness(made, 0) == pytest.approx(own.per_mm / strain, rel=1e-9)
    assert poisson(made, 0) == pytest.approx(1.0)


def test_crimp_that_is_drawn_out_goes_to_the_other_family() -> None:
    made = cloth(sett=(12.0, 12.0), tex=10.0)  # so open that nothing jams
    own, other = made.families
    straight = own.straight_leg / own.pitch - 1
    assert interchange_strain(made, 0) == pytest.approx(straight)
    assert straight == pytest.approx(own.crimp, rel=0.35)  # legs are straighter than Peirce's paths
    close = cloth(sett=(40.0, 30.0), tex=20.0)
    assert 0 < interchange_strain(close, 1) < close.families[1].straight_leg / close.families[1].pitch - 1 + 1e-12
    assert other.height > 0
    assert CLOSEST < 1


def test_straight_threads_pull_with_half_or_nine_tenths_of_their_fibres() -> None:
    own = cloth().families[0]
    assert drawn_stiffness(own) == pytest.approx(0.5 * 5200 * 2.4 * 20.0 / (1 + own.crimp))
    silk = cloth(fibre=fibre_mechanics("silk")).families[0]
    assert drawn_stiffness(silk) == pytest.approx(0.9 * 7500 * np.cos(silk.helix) ** 2 * 2.4 * 20.0 / (1 + silk.crimp))


def test_threads_lock_in_shear_when_they_touch() -> None:
    made = cloth(sett=(20.0, 10.0))
    own = made.families[0]
    assert np.cos(radians(locking_angle(made))) == pytest.approx(CLOSEST * own.diameter * own.per_mm)
    assert locking_angle(cloth(sett=(24.0, 10.0))) < locking_angle(made)
    assert locking_angle(cloth(sett=(80.0, 10.0))) == 0.0


def test_shear_of_a_square_cloth_is_that_of_pinned_legs() -> None:
    """A leg pinned at both ends is two cantilevers of half its length; both families share the angle."""
    made = cloth(sett=(20.0, 20.0), balance=0.5)
    own = made.families[0]
    rigid = 3.0 * own.fibre.flexural * own.tex * own.single_fibre
    assert shear_stiffness(made) == pytest.approx(0.21 * 6.0 * rigid / own.leg**3 / own.per_mm * own.per_mm)


def test_friction_of_bending_grows_with_the_force_of_crossings() -> None:
    made = cloth()
    own = made.families[0]
    expected = KEPT * 8 * 3.0 * 0.19 * 20.0 * 0.17 * own.angle / own.pitch**2
    assert crossing_force(own) == pytest.approx(expected)
    slick = replace(made, warp_fibre=replace(COTTON, rubbing=0.13))
    assert family_couple(slick)[0] == pytest.approx(0.5 * family_couple(made)[0])
    assert family_couple(slick)[1] == family_couple(made)[1]


@pytest.mark.parametrize(
    ("made", "per_cm"),
    [
        (cloth(sett=(52.4, 27.0), tex=14.76), 1.05),  # cotton broad
        (cloth(sett=(23.0, 20.0), tex=33.3, plies=2, fibre=fibre_mechanics("wool")), 0.49),  # wool tropical
    ],
)
def test_2hb_over_b_as_kes_finds_it(made: Construction, per_cm: float) -> None:
    """Matsudaira et al. 2015, of cloths whose construction is not known: those of the trade of their weight."""
    ratio = 20 * sum(family_couple(made)) / sum(family_bending(made))
    assert per_cm / 1.5 < ratio < per_cm * 1.5


def test_drape_of_the_five_cloths_that_have_both_measured() -> None:
    """B [µN·m], g/m², DC [%]. The three polyesters' bending with the factor that their source is low by, 1.9."""
    rows = [(11.572, 123.8, 82.9), (6.57, 162.9, 49.8)]
    rows += [(1.9 * b, m, dc) for b, m, dc in ((1.28, 135.17, 22.3), (2.685, 286.13, 28.6), (3.55, 242.0, 44.3))]
    errors = [drape_coefficient(b, m) - dc for b, m, dc in rows]
    assert max(abs(e) for e in errors) < 6
    assert bending_length(9.81e-3 * 100 * 8.0, 100.0) == pytest.approx(20.0)


def test_a_blend_weighs_by_mass() -> None:
    polyester = fibre_mechanics("polyester")
    half = blend([(1, COTTON), (1, polyester)])
    assert 1 / half.density == pytest.approx((1 / COTTON.density + 1 / polyester.density) / 2)
    assert half.cellulosic
    assert not blend([(1, COTTON), (2, polyester)]).cellulosic
    assert blend([(65, COTTON)]) == replace(COTTON, name="cotton 100")


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        (lambda: cloth(sett=(0.0, 10.0)), "fabric.ends_per_cm: 0.0; allowed"),
        (lambda: cloth(finish="size"), 'did you mean "sized"'),
        (lambda: fibre_mechanics("coton"), 'did you mean "cotton"'),
        (lambda: replace(COTTON, modulus=-1.0), "fibre.modulus: -1.0; allowed"),
        (lambda: blend([(0, COTTON)]), "a blend needs shares"),
    ],
)
def test_what_is_no_cloth_is_refused(wrong, line: str) -> None:
    with pytest.raises(InputError, match=line.replace("(", r"\(")):
        wrong()
