"""Measured properties: units of the instruments, what overrides what, and what is refused."""

from pathlib import Path

import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.mechanics.measured import measured_of, measured_properties, read_measured
from taichi_cloth.mechanics.presets import named_construction
from taichi_cloth.mechanics.properties import woven_properties

FILE = """
source = "cloth 17"
[kes]
bending_warp = 0.09
bending_hysteresis_warp = 0.08
shear = 1.2
weight = 12.0
[cantilever]
bending_length_weft = 20
"""


def test_measured_numbers_take_the_place_of_woven_ones_and_say_so(tmp_path: Path) -> None:
    path = tmp_path / "cloth.toml"
    path.write_text(FILE)
    woven = woven_properties(named_construction("poplin"))
    found = measured_properties(woven, read_measured(path))
    assert found["bending_warp"].si == pytest.approx(0.09 * 98.07e-6)
    assert found["couple_warp"].si == pytest.approx(0.08 * 9.807e-3)
    assert found["shear"].si == pytest.approx(1.2 * 56.2)
    assert found["areal_density"].si == pytest.approx(0.120)
    assert str(found["bending_warp"]) == "bending, warp 8.83 µN·m (KES-F, cloth 17)"
    assert found["bending_warp"].origin == "measured"
    assert found["couple_weft"] == woven["couple_weft"]


def test_a_cantilevers_bending_length_becomes_the_rigidity_of_the_heavy_strip() -> None:
    """The exact heavy elastica that hangs at 41.5° has w·L³/B = 8.0042, and Peirce's c is half of L."""
    measured = measured_of({"cantilever": {"bending_length_warp": 25.0, "weight": 100.0}})
    found = measured_properties(woven_properties(named_construction("poplin")), measured)
    weight, length = 0.1 * 9.81, 2 * 0.025
    assert found["bending_warp"].si == pytest.approx(weight * length**3 / 8.0042, rel=1e-3)
    assert found["bending_warp"].how == "cantilever, bending length 25 mm"
    assert found["bending_length_warp"].value == pytest.approx(25.0)


@pytest.mark.parametrize(
    ("data", "line"),
    [
        ({"kess": {"shear": 1}}, 'kess: unknown method; known: source, .kes.*did you mean "kes"'),
        ({"kes": {"bendin_warp": 1}}, 'kes.bendin_warp: unknown key; known: bending_warp.*did you mean "bending_warp"'),
        ({"kes": {"shear": -1}}, "kes.shear: -1; allowed: a number above 0"),
        ({"kes": {"shear": True}}, "kes.shear: True; allowed"),
        ({"kes": {"shear": float("nan")}}, "kes.shear: nan; allowed"),
        ({"kes": {"weight": 0}}, "kes.weight: 0; allowed"),
        ({"kes": 3}, "kes: 3; allowed: a section"),
        ({"source": 3}, "source: 3; allowed: text"),
        ({}, "nothing measured"),
        ({"kes": {"shear": 1}, "fast": {"shear": 60}}, "fast.shear: shear is measured by KES-F too"),
        (
            {"kes": {"bending_warp": 0.1}, "cantilever": {"bending_length_warp": 20}},
            "cantilever.bending_length_warp: .* by KES-F too",
        ),
    ],
)
def test_what_cannot_be_measured_is_refused(data: dict, line: str) -> None:
    with pytest.raises(InputError, match=line):
        measured_of(data)


def test_a_file_that_is_no_toml_is_named(tmp_path: Path) -> None:
    path = tmp_path / "cloth.toml"
    path.write_text("[kes\n")
    with pytest.raises(InputError, match=r"cloth\.toml: not TOML"):
        read_measured(path)
    with pytest.raises(InputError, match=r"none\.toml"):
        read_measured(tmp_path / "none.toml")
