"""Measured cloths beside their predictions: the hits that are claimed, the page that shows all, and other tables."""

import runpy
from pathlib import Path

import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.mechanics.comparison import compared, error, measured_material, read_table, row_construction
from taichi_cloth.sheet.materials import Material

REPOSITORY = Path(__file__).parents[2]
TABLE = REPOSITORY / "tests" / "data" / "fabrics" / "fabrics.csv"


def test_mass_and_thickness_of_cloths_whose_construction_is_stated() -> None:
    rows = [row for row in map(compared, read_table(TABLE)) if row.how == "stated"]
    for key, near in (("mass", 1.08), ("thickness", 1.15)):
        pairs = [row.values[key] for row in rows if key in row.values]
        hits = [error(predicted or 1.0, measured) <= near for predicted, measured in pairs]
        assert len(hits) >= 3
        assert sum(hits) >= 0.8 * len(hits)
    drape = [row.values["drape"] for row in rows]
    assert sum(abs((predicted or 0.0) - measured) <= 12 for predicted, measured in drape) >= 0.8 * len(drape)


def test_an_inferred_construction_predicts_nothing_that_it_was_inferred_from() -> None:
    rows = {row.number: row for row in map(compared, read_table(TABLE))}
    assert rows["M1"].how == "named"
    assert rows["M1"].values["mass"] == (None, 123.8)
    assert rows["P1"].how == "inferred"
    assert rows["P1"].values["mass"][0] is rows["P1"].values["thickness"][0] is None
    assert rows["G1"].how == "none"
    assert rows["P1"].values["bending"][1] == pytest.approx((1.95 + 0.61) / 2)


def test_a_cloth_of_a_name_of_the_trade_is_as_dense_as_it_is_heavy_and_bends_within_its_band() -> None:
    """A broad cloth of 124 g/m² is a poplin of Ne 40, some 130 × 70 an inch, and no square cloth of Ne 16."""
    rows = {row["id"]: row for row in read_table(TABLE)}
    for number, per_inch, near in (("M1", (129.0, 70.0), 1.8), ("M2", (55.0, 55.0), 1.15)):
        made, _ = row_construction(rows[number])
        assert made is not None
        assert made.areal_density == pytest.approx(float(rows[number]["mass_gsm"]), rel=1e-3)
        assert (made.ends_per_cm, made.picks_per_cm) == pytest.approx([n / 2.54 for n in per_inch], rel=0.02)
        predicted, measured = compared(rows[number]).values["bending"]
        assert error(predicted or 1.0, measured) < near


def test_a_sheet_of_what_was_measured_has_that_and_else_what_is_woven() -> None:
    rows = {row["id"]: row for row in read_table(TABLE)}
    woven = Material(
        tensile_warp=1e3, tensile_weft=1e3, shear=50.0, bending_warp=4e-6, bending_weft=2e-6, density=0.1,
        couple_warp=2e-4, couple_weft=1e-4, torsion=3e-6, shear_friction=1.0, locking=1.0,
    )  # fmt: skip
    found = measured_material(rows["P1"], woven)  # B of both families and G
    assert found is not None
    assert (found.bending_warp, found.bending_weft) == pytest.approx((1.95e-6, 0.61e-6))
    assert (found.couple_warp, found.couple_weft) == pytest.approx((2e-4 * 1.95 / 4, 1e-4 * 0.61 / 2))
    assert (found.shear, found.density, found.shear_friction) == (41.0, pytest.approx(0.13517), 1.0)
    found = measured_material(rows["M1"], woven)  # their mean, and 2HB
    assert found is not None
    assert (found.couple_warp, found.couple_weft, found.shear) == (0.608e-3, 0.608e-3, 50.0)
    assert measured_material(rows["V8"], woven) is None


def test_the_page_is_what_the_script_writes() -> None:
    page = runpy.run_path(str(REPOSITORY / "docs" / "fabrics.py"))["page"]
    assert (REPOSITORY / "docs" / "fabrics.md").read_text("utf-8") == page(TABLE)


def test_a_table_that_is_none_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    path.write_text("id,name,fibre\nA,b,cotton 100\n")
    with pytest.raises(InputError, match="no column weave"):
        read_table(path)
    path.write_text("id,name,fibre,weave,mass_gsm,thickness_mm\nA,b,cotton 100,plain,heavy,0.3\n")
    with pytest.raises(InputError, match="A: mass_gsm: 'heavy'; allowed"):
        compared(read_table(path)[0])
