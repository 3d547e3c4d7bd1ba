"""The mill's ticket: sizes in the reed, on the loom and finished, yarn by colour, and what is drawn and simulated."""

import json
from pathlib import Path

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.mechanics.construction import Construction
from taichi_cloth.mechanics.presets import named_construction
from taichi_cloth.mechanics.properties import BANDS, woven_properties
from taichi_cloth.scenes import __main__ as command_line
from taichi_cloth.scenes.fabric.lines import ticket_lines
from taichi_cloth.scenes.fabric.piece import piece_of
from taichi_cloth.scenes.fabric.ticket import PieceAsked, ticket_of
from taichi_cloth.scenes.paper.own_scenes import PAPER_DRAPE
from taichi_cloth.scenes.prepare.construction import construction_of
from taichi_cloth.scenes.prepare.weave_layout import LEAST_THINNED
from taichi_cloth.scenes.scene.load import load_scene, make_scene

WIF = Path(__file__).parents[1] / "data" / "wif" / "schort.wif"
WHITE = np.ones((1, 3))
POPLIN = {
    "yarn": {"count": "Ne 40", "twist_multiplier": 4.0},
    "weave": {"draft": "plain", "warp_colours": "navy*3 white*1"},
    "fabric": {"ends_per_cm": 46, "picks_per_cm": 27},
}


@pytest.fixture(scope="module")
def poplin() -> Construction:
    return named_construction("cotton-shirting")


def test_a_metre_after_twenty_percent_leaves_the_loom_with_1_25(poplin: Construction) -> None:
    piece = piece_of(poplin, (WHITE, WHITE), length=1.0, width=1.0, shrinkage=(0.20, 0.20))
    assert piece.length.on_loom == pytest.approx(1.25)
    assert piece.width.on_loom == pytest.approx(1.25)
    assert piece.ends_per_cm_on_loom == pytest.approx(0.8 * piece.ends_per_cm_finished)
    # Crimp of 15 % takes all that it can of it; the threads have to give the rest.
    assert piece.length.take_up == 0.0
    assert piece.length.yarn_shrinkage == pytest.approx(1 - 0.8 * (1 + piece.length.crimp))


def test_threads_are_as_long_on_the_loom_as_in_the_finished_cloth(poplin: Construction) -> None:
    piece = piece_of(poplin, (WHITE, WHITE), length=50.0, width=1.5, shrinkage=(0.05, 0.02))
    for way, size in ((piece.length, 50.0), (piece.width, 1.5)):
        assert way.yarn == pytest.approx(size * (1 + way.crimp))
        assert way.yarn == pytest.approx(way.on_loom * (1 + way.take_up))
        assert (1 + way.take_up) == pytest.approx((1 + way.crimp) * (1 - way.shrinkage))
        assert way.yarn_shrinkage == pytest.approx(0.0)
    assert piece.width_in_reed == piece.width.yarn
    assert piece.ends_per_cm_in_reed < piece.ends_per_cm_on_loom < piece.ends_per_cm_finished
    assert piece.picks == round(50 * 100 * poplin.facts.picks_per_cm)


def test_the_yarn_weighs_what_the_cloth_weighs_before_finishing(poplin: Construction) -> None:
    piece = piece_of(poplin, (WHITE, WHITE), length=40.0, width=1.5)
    grams = sum(need.grams for need in piece.yarn)
    assert grams == pytest.approx(poplin.areal_density / 0.96 * 40.0 * 1.5, rel=1e-3)
    wasted = piece_of(poplin, (WHITE, WHITE), length=40.0, width=1.5, waste=2.0)
    assert wasted.yarn[0].metres - piece.yarn[0].metres == pytest.approx(2.0 * piece.ends)
    assert wasted.yarn[1] == piece.yarn[1]


def test_yarn_is_counted_by_colour() -> None:
    ticket = ticket_of(make_scene(POPLIN), PieceAsked(length=10.0, width=1.0))
    warp = [need for need in ticket.piece.yarn if need.family == "warp"]
    assert sum(need.threads for need in warp) == ticket.piece.ends == 4600
    assert [need.threads for need in warp] == [3450, 1150]
    assert [need.colour for need in warp] == ["#16213f", "#f5f5f2"]


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"length": -1.0}, "--length: -1 m; allowed: 0.001 to"),
        ({"width": float("inf")}, "--width: inf m"),
        ({"shrinkage": (0.0, 0.9)}, "--shrinkage-width: 90 %; allowed: 0 to 80 %"),
        ({"waste": -1.0}, "--waste: -1 m; allowed: 0 to"),
    ],
)
def test_a_piece_of_no_size_is_refused(poplin: Construction, changes: dict, line: str) -> None:
    with pytest.raises(InputError, match=line):
        piece_of(poplin, (WHITE, WHITE), **{"length": 1.0, "width": 1.0, **changes})


def test_what_is_drawn_weighs_what_the_construction_says_where_nothing_jams() -> None:
    ticket = ticket_of(make_scene(POPLIN))
    assert not ticket.construction.pressed
    assert ticket.drawn_mass == pytest.approx(ticket.properties["areal_density"].value, rel=0.01)
    assert ticket.drawn is not None
    assert ticket.drawn.thinned == pytest.approx(1.0)
    assert ticket.simulated == {}


def test_a_moving_cloth_shows_what_it_moves_by_beside_what_it_is_woven_of() -> None:
    scene = load_scene(PAPER_DRAPE, ["cloth.properties.shear_n_per_m=33", "cloth.representation=mesh"])
    ticket = ticket_of(scene)
    assert str(ticket.simulated["shear"]) == "shear G 33 N/m (properties.shear_n_per_m)"
    assert ticket.simulated["areal_density"].value == pytest.approx(115.0)
    assert ticket.simulated["areal_density"].origin == "preset"
    assert (ticket.piece.length.size, ticket.piece.width.size) == (1.0, 1.0)
    shown = "\n".join(ticket_lines(ticket))
    assert "115 g/m² (preset cotton-shirting)" in shown
    assert "note: no yarn.count is stated" in shown


def test_a_preset_alone_brings_its_construction() -> None:
    scene = make_scene({"cloth": {"material": "silk-habotai", "representation": "mesh"}})
    ticket = ticket_of(scene)
    assert ticket.construction.facts.ends_per_cm == pytest.approx(60.5)
    assert ticket.drawn is None
    assert "the construction of silk-habotai" in ticket.notes[0]


def test_a_yarn_is_told_in_the_words_of_its_trade(capsys: pytest.CaptureFixture[str]) -> None:
    """Spun yarn by its cotton and metric counts with plies, filaments in denier; stiff threads in kN/m; a title says
    what is not as the scene's file has it; what is simulated as woven is not said to be so twice."""
    folded = ["yarn.count=30/2", "fabric.ends_per_cm=24", "fabric.picks_per_cm=22"]
    assert command_line._status(["fabric", str(WIF), *(word for one in folded for word in ("--set", one))]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("schort, with yarn.count=30/2, fabric.ends_per_cm=24, fabric.picks_per_cm=22\n")
    assert "2 × 19.7 tex (Ne 30/2, Nm 2/50.8)" in shown
    assert "oz/yd²" in shown
    flag = "\n".join(ticket_lines(ticket_of(load_scene("flag"))))
    assert "2 × 2.33 tex (2 × 21 den)" in flag
    assert "plain, mean float of warp 1, of weft 1" in flag
    assert flag.count("from yarn and weave") == len(BANDS)
    assert "tension, crimp drawn out, warp     152 kN/m" in flag


def test_a_draft_file_has_a_ticket_as_json(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    measured = tmp_path / "cloth.toml"
    measured.write_text('source = "here"\n[fast]\nshear = 44.0\n')
    arguments = ["fabric", str(WIF), "--set", "yarn.count=30/2", "--measured", str(measured), "--json"]
    assert command_line._status(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["construction"]["warp"]["plies"] == 2
    assert found["construction"]["weft"]["fibre"] == "cotton"
    assert found["construction"]["ends_per_cm"] == pytest.approx(21.65, abs=0.01)  # no spacing in the file: what fits
    assert found["properties"]["shear"]["origin"] == "measured"
    assert found["properties"]["shear"]["how"] == "FAST, here"
    low, high = found["properties"]["bending_warp"]["limits"]
    assert low < found["properties"]["bending_warp"]["value"] < high
    assert sum(need["threads"] for need in found["piece"]["yarn"]) == found["piece"]["ends"] + found["piece"]["picks"]


def test_a_scene_without_a_weave_has_no_ticket(capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line._status(["fabric", "yarn"]) == 2
    assert "a scene of a yarn has no [weave]" in capsys.readouterr().err


@pytest.mark.parametrize("count", ["0.5 tex", "5000 tex", "20 den"])
@pytest.mark.parametrize("sett", [(0.1, 300.0), (60.0, 60.0)])
@pytest.mark.parametrize("weave", ["plain", "twill-7/1"])
def test_cloth_that_nobody_would_weave_still_has_finite_numbers(
    count: str, sett: tuple[float, float], weave: str
) -> None:
    """All jammed, or all holes: what follows is no cloth, but numbers that are finite and not negative."""
    scene = make_scene(
        {
            "yarn": {"count": count},
            "weave": {"draft": weave, "ends": 8, "picks": 8},
            "fabric": {"ends_per_cm": sett[0], "picks_per_cm": sett[1], "balance": 0.05},
        }
    )
    made = construction_of(scene)
    properties = woven_properties(made)
    for quantity in properties.values():
        assert np.isfinite(quantity.value), quantity
        assert quantity.value >= 0, quantity
    for family in ("warp", "weft"):
        assert properties[f"tensile_{family}"].value <= properties[f"drawn_{family}"].value
    if made.fitted.thinned > LEAST_THINNED:
        assert list(ticket_lines(ticket_of(scene, PieceAsked(1.0, 1.0, (50.0, 0.0)))))
    else:
        with pytest.raises(InputError, match="no yarn is pressed"):
            ticket_of(scene)
