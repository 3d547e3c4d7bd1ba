"""Measured cloths beside their predictions: the hits that are claimed, the page that shows all, and other tables."""

import runpy
from pathlib import Path

import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.mechanics.comparison import compared, error, read_table

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
    assert rows["M1"].how == "inferred"
    assert rows["M1"].values["mass"] == (None, 123.8)
    assert rows["G1"].how == "none"
    assert rows["P1"].values["bending"][1] == pytest.approx((1.95 + 0.61) / 2)


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
