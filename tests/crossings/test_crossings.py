"""Which triangles meet: closed cases, all pairs one by one in whole numbers, sheets of every shape, and touching."""

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from taichi_cloth.crossings.boxes import overlapping
from taichi_cloth.crossings.crossings import find_crossings
from taichi_cloth.crossings.signs import area_signs, volume_signs
from taichi_cloth.ground.errors import InputError

FLAT = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)


def two(other: object) -> int:
    """How many of two triangles meet: FLAT and another one."""
    return find_crossings(np.concatenate([FLAT, np.asarray(other, float)]), [[0, 1, 2], [3, 4, 5]]).count


def grid(rows: int, cols: int) -> NDArray:
    """Triangles of a sheet, two a cell."""
    a = (np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)).ravel()
    return np.concatenate([np.stack([a, a + 1, a + cols + 1], -1), np.stack([a, a + cols + 1, a + cols], -1)])


def separated(one: list, other: list) -> bool:
    """Two triangles of exact points, told apart as convex bodies are: by a plane along a face, or along an edge of each
    (the theorem of separating axes); within one plane across an edge of either, along one line by its ends."""

    def minus(p, q):
        return [x - y for x, y in zip(p, q, strict=True)]

    def cross(u, v):
        return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]

    def dot(u, v):
        return sum(x * y for x, y in zip(u, v, strict=True))

    edges = [[minus(t[(k + 1) % 3], t[k]) for k in range(3)] for t in (one, other)]
    normals = [cross(e[0], e[1]) for e in edges]
    axes = [*normals, *(cross(u, v) for u in edges[0] for v in edges[1])]
    both, apart = [*edges[0], *edges[1]], minus(one[0], other[0])
    axes += [cross(n, u) for n in axes for u in both] + both + [apart]
    axes += [cross(cross(apart, u), u) for u in both]
    for axis in axes:
        first, second = ([dot(axis, p) for p in t] for t in (one, other))
        if max(first) < min(second) or max(second) < min(first):
            return True
    return False


@pytest.mark.parametrize(
    ("other", "meet"),
    [
        ([[0.2, 0.2, -1], [0.2, 0.2, 1], [5, 5, 0]], 2),  # an edge through the face
        ([[0.2, 0.2, 1e-300], [0.3, 0.2, 1], [0.2, 0.3, 1]], 0),  # a hair above it
        ([[0.2, 0.2, 0], [0.3, 0.2, 1], [0.2, 0.3, 1]], 2),  # touching it
        ([[0.5, 0.5, -1], [0.5, 0.5, 1], [5, 5, 0]], 2),  # through its edge
        ([[0.5 + 2e-16, 0.5, -1], [0.5 + 2e-16, 0.5, 1], [5, 5, 0]], 0),  # the next number beside it
        ([[0, 0, 0], [0, 0, 1], [-1, -1, 0]], 2),  # at a corner
        ([[2, 0, 0], [3, 0, 0], [2, 1, 0]], 0),  # beside it in its plane
        ([[0.1, 0.1, 0], [0.2, 0.1, 0], [0.1, 0.2, 0]], 2),  # inside it in its plane
        ([[-1, -1, 0], [3, -1, 0], [-1, 3, 0]], 2),  # round it in its plane
        ([[1, 0, 0], [2, 0, 0], [3, 0, 0]], 2),  # a line in its plane, touching
        ([[0.2, 0.2, -1], [0.2, 0.2, 0], [0.2, 0.2, 1]], 2),  # a line through it
        ([[2, 2, -1], [2, 2, 0], [2, 2, 1]], 0),  # a line past it
        ([[0.3, 0.3, 0]] * 3, 2),  # a point in it
        ([[0.3, 0.3, 1]] * 3, 0),  # a point above it
    ],
)
def test_two_triangles(other: list, meet: int) -> None:
    assert two(other) == meet
    assert two(np.asarray(other, float)[[1, 2, 0]]) == meet
    swap = [2, 0, 1]
    points = np.concatenate([np.asarray(other, float), FLAT])[:, swap]
    assert find_crossings(points, [[0, 1, 2], [3, 4, 5]]).count == meet


@pytest.mark.parametrize("kind", ["spread", "lattice", "flat", "needles"])
def test_as_all_pairs_one_by_one(kind: str) -> None:
    """30 triangles at random, in general and in every special position, against separating axes in whole numbers."""
    rng = np.random.default_rng(7)
    if kind == "spread":
        points = rng.normal(size=(90, 3)) * 0.4 + rng.uniform(size=(30, 1, 3)).repeat(3, 1).reshape(-1, 3)
    else:
        points = rng.integers(0, 4, (90, 3)) * 0.1
    if kind == "flat":
        points[:, 2] = 0.3 * points[:, 0]
    if kind == "needles":
        points[1::3] = points[::3]
    faces = np.arange(90).reshape(-1, 3)
    exact = [[[int(Fraction(float(x)) * 2**80) for x in points[k]] for k in face] for face in faces]
    wanted = [pair for pair in combinations(range(30), 2) if not separated(exact[pair[0]], exact[pair[1]])]
    found = find_crossings(points, faces)
    assert found.pairs.tolist() == [list(pair) for pair in wanted]
    assert 20 < len(wanted) < 400
    corners = points[faces[found.pairs]]
    assert (found.places <= corners.max(axis=2).min(axis=1) + 1e-12).all(), "each place is in both boxes"
    assert (found.places >= corners.min(axis=2).max(axis=1) - 1e-12).all()


def test_pairs_of_some_triangles_are_those_of_all() -> None:
    """A crumpled sheet: what is asked of some of its triangles is what all of it says of them, in the same order."""
    rng, faces = np.random.default_rng(11), grid(30, 40)
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    points = (np.stack([x, y, 0 * x], -1) + rng.normal(size=(30, 40, 3))).reshape(-1, 3)
    whole, among = find_crossings(points, faces), rng.uniform(size=len(faces)) < 0.1
    some, kept = find_crossings(points, faces, None, among), among[whole.pairs[:, 0]] | among[whole.pairs[:, 1]]
    assert 200 < kept.sum() < 0.4 * len(whole.pairs)
    np.testing.assert_array_equal(some.pairs, whole.pairs[kept])
    np.testing.assert_array_equal(some.places, whole.places[kept])
    np.testing.assert_array_equal(some.at, whole.at[kept[whole.of]])
    np.testing.assert_array_equal(some.edges, whole.edges[kept[whole.of]])
    assert find_crossings(points, faces, None, np.zeros(len(faces), bool)).count == 0


def test_points_in_common_are_let_off_and_nothing_else() -> None:
    """A fold: triangles that share a point do not meet there, but do where one is bent through the other."""
    points = np.array([[0, 0, 0], [1, -1, 0], [1, 1, 0], [1, 0, 1], [1, 0, 2]], float)
    assert find_crossings(points, [[0, 1, 2], [0, 3, 4]]).count == 0
    points[4, 2] = -1
    found = find_crossings(points, [[0, 1, 2], [0, 3, 4]])
    assert found.pairs.tolist() == [[0, 1]]
    assert found.places == pytest.approx(np.array([[1.0, 0.0, 0.0]]))
    assert find_crossings(points, [[0, 1, 2], [1, 2, 3]]).count == 0, "an edge in common"
    apart = np.concatenate([points, points[:1]])
    apart[4, 2] = 2
    assert find_crossings(apart, [[0, 1, 2], [5, 3, 4]]).count == 2, "two points in one place touch"
    assert find_crossings(apart, [[0, 1, 2], [5, 3, 4]], same=[0, 1, 2, 3, 4, 0]).count == 0, "sewn they are one"


def test_a_sheet_through_itself() -> None:
    """A strip of 1 m, rolled up to a ring that passes through its own beginning: both ends meet, no more."""
    rows, cols = 5, 101
    turn = np.linspace(0, 2 * np.pi * 1.005, cols)
    radius = 0.16 + 0.002 * np.linspace(-1, 1, cols) * (1 + 0.2 * np.linspace(-1, 1, rows)[:, None])
    y = np.broadcast_to(np.linspace(0, 0.04, rows)[:, None], (rows, cols))
    ring = np.stack([radius * np.cos(turn), y, radius * np.sin(turn)], -1).reshape(-1, 3)
    faces = grid(rows, cols)
    assert find_crossings(ring, faces).count == 0
    ring.reshape(rows, cols, 3)[:, -1] *= 0.97
    found = find_crossings(ring, faces)
    column = faces[found.triangles].min(axis=1) % cols
    assert 4 <= found.count <= 16
    assert set(column.tolist()) <= {0, 1, 99, 98}


def test_a_flat_sheet_and_one_upon_it() -> None:
    """Everything in one plane: all by whole numbers. A sheet meets itself nowhere, and another in its plane."""
    x = np.stack(np.meshgrid(np.arange(30) * 0.01, [0.0], np.arange(30) * 0.01, indexing="ij"), -1).reshape(-1, 3)
    faces = grid(30, 30)
    assert find_crossings(x.astype(np.float32), faces).count == 0
    both = np.concatenate([x, x + np.array([0.1503, 0, 0])])
    found = find_crossings(both, np.concatenate([faces, faces + len(x)]))
    assert 2 * 2 * 13 * 29 < found.count < 2 * 2 * 16 * 29
    both[len(x) :, 1] = 1e-9
    assert find_crossings(both, np.concatenate([faces, faces + len(x)])).count == 0


def test_boxes_that_overlap() -> None:
    rng = np.random.default_rng(3)
    low = rng.uniform(size=(300, 3))
    high = low + rng.exponential(0.08, (300, 3))
    meet = ((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)
    assert sorted(map(tuple, overlapping(low, high).tolist())) == list(zip(*np.triu(meet, 1).nonzero(), strict=True))
    aslant = np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 0]])
    among = rng.uniform(size=300) < 0.2
    meet &= (((low @ aslant)[:, None] <= high @ aslant) & ((low @ aslant) <= (high @ aslant)[:, None])).all(axis=2)
    pairs = overlapping(low @ aslant, high @ aslant, among)
    some = np.triu(meet & (among[:, None] | among), 1)
    assert sorted(map(tuple, pairs.tolist())) == list(zip(*some.nonzero(), strict=True))


def test_signs_are_exact() -> None:
    """A point moved by one unit in the last place off a plane, and off a line, at all sizes; and numbers near 0."""
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(2, 200, 3)) * 10.0 ** rng.integers(-8, 8, (200, 1))
    middle = 0.5 * a + 0.5 * a  # on the plane through a, b and the origin: twice a half is a
    for shift in (-1, 0, 1):
        d = middle.copy()
        d[:, 2] = np.nextafter(d[:, 2], shift * np.inf) if shift else d[:, 2]
        exact = [_volume(*(list(map(Fraction, p)) for p in points)) for points in zip(a, b, d, strict=True)]
        wanted = [(v > 0) - (v < 0) for v in exact]
        assert volume_signs(np.zeros(3), a, b, d).tolist() == wanted
    assert area_signs(np.zeros((1, 2)), np.array([[1e-200, 1e-200]]), np.array([[1e-200, 1.1e-200]])).tolist() == [1]
    assert volume_signs(np.zeros((1, 3)), *(1e-150 * np.eye(3))[:, None]).tolist() == [1]


def _volume(a: list, b: list, d: list) -> Fraction:
    return sum(
        (a[i] * (b[j] * d[k] - b[k] * d[j]) for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1))),
        Fraction(0),
    )


def test_what_is_no_mesh_is_refused() -> None:
    for points, faces, line in (
        (FLAT[:2], [[0, 1, 2]], "point 2"),
        (FLAT * np.nan, [[0, 1, 2]], "finite"),
        (FLAT[:, :2], [[0, 1, 2]], "allowed"),
    ):
        with pytest.raises(InputError, match=line):
            find_crossings(points, faces)
    assert find_crossings(np.zeros((0, 3)), np.zeros((0, 3), int)).count == 0
