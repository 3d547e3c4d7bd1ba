"""How many fibres are drawn where a scene leaves it to the picture."""

import pytest

from taichi_cloth.scenes.prepare.cell_layout import prepare_sheet
from taichi_cloth.scenes.prepare.weave_layout import prepare_fabric
from taichi_cloth.scenes.scene.load import load_scene

SMALL = ("weave.ends=12", "weave.picks=12")


def drawn(name: str, *own: str) -> int:
    return prepare_fabric(load_scene(name, [*SMALL, *own])).layout.detail.fibres


def test_every_fibre_that_a_picture_tells_apart_is_drawn() -> None:
    real = prepare_fabric(load_scene("plain", [*SMALL])).layout.warp.yarn.fibres_in_section
    near = drawn("plain", "camera.zoom=40")
    far, farther = (drawn("plain", f"output.size=[{size}, {size}]") for size in (200, 400))
    assert near == real
    assert far < farther < real
    assert farther == pytest.approx(4 * far, rel=0.15)  # as many as make them as wide in pixels
    assert drawn("plain", "output.size=[16, 16]") == 4


def test_a_stated_number_of_fibres_holds() -> None:
    assert drawn("plain", "yarn.fibres=5") == 5
    assert drawn("plain", "yarn.fibres=5", "camera.zoom=40") == 5


def test_cloth_that_is_made_where_it_is_seen_has_all_its_fibres() -> None:
    prepared = prepare_sheet(load_scene("flag"))
    assert prepared is not None
    layout = prepared.layout
    assert layout.detail.fibres >= max(layout.warp.yarn.fibres_in_section, layout.weft.yarn.fibres_in_section)


def test_far_away_a_fibre_is_of_fewer_pieces_than_pixels() -> None:
    def steps(*own: str) -> int:
        return prepare_fabric(load_scene("plain", [*SMALL, *own])).layout.detail.steps

    assert steps() == 10
    assert steps("output.size=[96, 96]") == 6  # 8 pixels from crossing to crossing, and an even number
    assert steps("output.size=[16, 16]") == 4
    assert steps("output.size=[16, 16]", "fabric.steps=12") == 12
