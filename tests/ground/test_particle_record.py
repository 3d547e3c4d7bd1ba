"""The particle record has one owner: who holds particles names the same properties, in the same order."""

from dataclasses import fields

import numpy as np

from taichi_cloth.fabric.templates import COLUMN, TEMPLATE
from taichi_cloth.ground.particles import LANES, RECORD, ROWS, FibreCloud, fill_up, first_numbers
from taichi_cloth.render.data.blocks import Layout
from taichi_cloth.render.data.particles import Particles


def test_a_cloud_has_the_properties_of_fibres_in_their_order() -> None:
    names = [one.name for one in RECORD if one.given != "others"]
    assert [f.name for f in fields(FibreCloud)] == names
    assert ROWS == 15


def test_the_splatter_takes_every_property() -> None:
    assert {one.name for one in RECORD} <= {f.name for f in fields(Particles)}
    every = Layout(elliptic=True, openness=True, opacity=True, textured=True)
    assert every.names == [one.name for one in RECORD]
    assert [every.half_length_row, every.openness_row, every.opacity_row, every.sprite_row] == [13, 14, 15, 16]
    assert Layout(opacity=True).opacity_row == 13
    assert Layout(elliptic=True, openness=True).rows == ROWS


def test_a_template_names_its_columns() -> None:
    assert [getattr(COLUMN, one.name) for one in TEMPLATE] == list(first_numbers(TEMPLATE))


def test_a_cloud_is_made_of_rows() -> None:
    rows = np.arange(ROWS * 3, dtype=np.float32).reshape(ROWS, 3)
    cloud = FibreCloud.of_rows(rows)
    assert (cloud.position == rows[:3].T).all()
    assert (cloud.openness == rows[14]).all()
    assert all(getattr(cloud, f.name).flags.c_contiguous for f in fields(cloud))
    assert len(FibreCloud.joined([cloud, cloud])) == 6


def test_places_left_over_hold_nothing() -> None:
    groups = np.ones((ROWS, 2, LANES), np.float32)
    groups[:, 1, 3:] = np.nan
    fill_up(groups, LANES + 3)
    assert (groups[3, 1, 3:] == 0).all()
    assert np.isfinite(groups).all()
