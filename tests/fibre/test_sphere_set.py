"""Sphere sets: what a person may give, and what is refused."""

import numpy as np
import pytest

from taichi_cloth.fibre.sphere_set import SphereSet, sphere_set_from_rows
from taichi_cloth.ground.errors import InputError


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ([], "0 spheres"),
        ([[0, 0, 0, 1], [0, 0, 1]], "row 2 is"),
        ([[0, 0, 0, -1]], "row 1 is"),
        ([[0, 0, 0, float("nan")]], "row 1 is"),
        ([[0, 0, "wide", 1]], "row 1 is"),
        (["1234"], "row 1 is"),
        ([7], "row 1 is"),
        ("spheres", "not a list of rows"),
        ([[0, 0, 0, 1]] * 100_001, "100001 rows"),
    ],
)
def test_a_users_bad_rows_are_named(rows: list, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        sphere_set_from_rows(rows)
    assert "\n" not in str(caught.value)


def test_centres_and_radii_must_match() -> None:
    with pytest.raises(InputError, match=r"must be \(n, 3\)"):
        SphereSet(np.zeros((2, 2)), np.ones(2))
