"""Parts of a body: against a figure whose parts are known, and against itself turned, scaled, remeshed and bent."""

import numpy as np
import pytest
import trimesh
from figure_mesh import figure, meshed, standing, true_parts
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from taichi_cloth.body.figure.build import built_in_body
from taichi_cloth.body.files.repair import repaired
from taichi_cloth.body.parts.clusters import grow, k_means
from taichi_cloth.body.parts.curvature import curvedness, principal_curvatures
from taichi_cloth.body.parts.parts import PARTS
from taichi_cloth.body.parts.segment import rand_index, segment
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.skin.laplacian import Surface
from taichi_cloth.ground.errors import InputError


@pytest.fixture(name="standing")
def the_standing_figure():
    return standing()


def areas(vertices, faces):
    return Surface(vertices, faces).areas


def agreement(labels, other, area):
    return float(area[labels == other].sum() / area.sum())


def test_parts_are_those_of_the_figure(standing):
    solids, vertices, faces, found = standing
    truth = true_parts(solids, vertices, faces)
    area = areas(vertices, faces)
    # where one part ends and the next begins is a matter of a few centimetres
    assert agreement(np.array(found.names)[found.labels], truth, area) > 0.85
    assert set(found.labels) == set(range(len(PARTS)))
    assert found.labels.dtype == np.int32
    x = vertices[faces].mean(axis=1)[:, 0]
    for k, name in enumerate(PARTS):
        if "arm" in name or "hand" in name or "foot" in name or "lower" in name:
            assert (x[found.labels == k] > 0).all() == name.startswith("left")


def test_left_and_right_are_as_large(standing):
    _, vertices, faces, found = standing
    size = np.bincount(found.labels, areas(vertices, faces), len(PARTS))
    for k, name in enumerate(PARTS):
        if name.startswith("left"):
            assert size[k] == pytest.approx(size[PARTS.index(name.replace("left", "right"))], rel=0.05)


def test_turned_scaled_and_shuffled(standing):
    _, vertices, faces, found = standing
    chance = np.random.default_rng(0)
    order = chance.permutation(len(vertices))
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    shuffle = chance.permutation(len(faces))
    turned = 2.5 * Rotation.from_rotvec([1.1, -2.0, 0.7]).apply(vertices[order]) + [3, -1, 2]
    again = segment(turned, np.roll(number[faces], 1, axis=1)[shuffle])
    # the first vertex is another one, so the walk over the skin starts elsewhere
    assert agreement(again.labels, found.labels[shuffle], areas(vertices, faces)[shuffle]) > 0.99


def test_meshed_anew(standing):
    solids, vertices, faces, found = standing
    other, other_faces = meshed(solids, 0.0245)
    anew = segment(other, other_faces)
    near = KDTree(vertices[faces].mean(axis=1)).query(other[other_faces].mean(axis=1))[1]
    # faces are 2 cm wide, and only those at a cut may differ
    assert agreement(anew.labels, found.labels[near], areas(other, other_faces)) > 0.95


def test_bent_limbs_are_still_found():
    solids = figure(bent=True)
    vertices, faces = meshed(solids)
    found = segment(vertices, faces)
    named = np.array(found.names)[found.labels]
    assert agreement(named, true_parts(solids, vertices, faces), areas(vertices, faces)) > 0.8
    x = vertices[faces].mean(axis=1)[:, 0]
    assert (x[named == "left hand"] > 0).all()
    assert (x[named == "right foot"] < 0).all()


@pytest.mark.parametrize("method", ["spectral", "curvedness"])
def test_clusters(standing, method):
    solids, vertices, faces, _ = standing
    found = segment(vertices, faces, method=method)
    again = segment(vertices, faces, method=method)
    np.testing.assert_array_equal(found.labels, again.labels)
    assert len(found.names) == found.labels.max() + 1 <= 12
    assert len(set(found.names)) == len(found.names)
    truth = true_parts(solids, vertices, faces)
    whole = np.zeros(len(faces), int)
    agree = rand_index(found.labels, truth, areas(vertices, faces))
    assert agree > 0.85
    assert agree > rand_index(whole, truth, areas(vertices, faces))


def test_rand_index_by_counting_pairs():
    chance = np.random.default_rng(3)
    a, b, w = chance.integers(0, 4, 40), chance.integers(0, 5, 40), chance.random(40)
    for weight in (None, w):
        use = np.ones(40) if weight is None else weight
        same = total = 0.0
        for i in range(40):
            for j in range(i):
                total += use[i] * use[j]
                same += use[i] * use[j] * ((a[i] == a[j]) == (b[i] == b[j]))
        assert rand_index(a, b, weight) == pytest.approx(same / total, rel=1e-12)
    assert rand_index(a, a * 7 + 1) == 1
    with pytest.raises(InputError, match="faces"):
        rand_index(a, b[:-1])


def test_distance_along_a_ball():
    ball = trimesh.creation.icosphere(4, 0.3)
    surface = Surface(ball.vertices, ball.faces)
    far = surface.distance_from(0)
    truth = 0.3 * np.arccos(np.clip(ball.vertices @ ball.vertices[0] / 0.09, -1, 1))
    # heat spreads over 4 % of the root of the area, 4 cm: the error is a share of that
    assert np.abs(far - truth).max() < 0.012


def test_curvatures_of_a_torus():
    torus = trimesh.creation.torus(0.3, 0.1, major_sections=96, minor_sections=48)
    k1, k2 = principal_curvatures(Surface(torus.vertices, torus.faces), smoothing=0)
    out = np.hypot(*torus.vertices[:, :2].T) - 0.3
    np.testing.assert_allclose(k1, 10, rtol=0.01)
    np.testing.assert_allclose(k2, out / 0.1 / (0.3 + out), atol=0.04)  # cos θ / (R + r cos θ)


def test_curvedness_of_a_ball():
    ball = trimesh.creation.icosphere(3, 0.2)
    surface = Surface(ball.vertices, ball.faces)
    # normals are exact, and the chords along which they turn are 0.4 % shorter than the arcs
    np.testing.assert_allclose(curvedness(surface, smoothing=0), 5, rtol=0.005)


def test_regions_part_a_can_from_its_round_ends():
    solid = Primitive(
        kind="cylinder", start=np.array([0, -0.15, 0.0]), end=np.array([0, 0.15, 0.0]), radii=(0.06, 0.06)
    )
    vertices, faces = meshed([solid], 0.012, 1e-9)
    surface = Surface(vertices, faces)
    # on the flank C is 1 / (√2 r), at the ends 1 / r; within the smoothing's width of the rim it is in between
    region = grow(surface, curvedness(surface))
    y = np.abs(vertices[:, 1])
    area = surface.vertex_areas
    main = np.bincount(region[y < 0.12], area[y < 0.12]).argmax()
    assert area[(region == main) & (y < 0.12)].sum() > 0.98 * area[y < 0.12].sum()
    assert area[(region == main) & (y > 0.17)].sum() < 0.02 * area[y > 0.17].sum()
    size = np.bincount(region, area)
    assert len(size) <= 5  # the flank, two ends, and a strip at each rim
    assert size.min() > 0.005 * size.sum()


def clustered(vertices, faces, side):
    """A mesh with all vertices of a cube of that side [m] made one, and mended as a found mesh is."""
    cube = np.unique(np.floor(vertices / side).astype(int), axis=0, return_inverse=True)[1].ravel()
    size = np.bincount(cube)
    middle = np.stack([np.bincount(cube, x) / size for x in vertices.T], axis=-1)
    mesh = repaired(middle, cube[faces])
    return mesh.vertices, mesh.faces


@pytest.mark.slow
@pytest.mark.parametrize("other", ["finer", "coarser"])
def test_a_body_meshed_anew_has_the_same_parts(other):
    """Every face in four, or vertices in cubes of 15 mm made one: 98 % of the area keeps its part. Cuts run
    along edges, so that half a face beside each of the 16 may change: 16 × 0.3 m × 7 mm of 1.7 m² is 2 %."""
    body = built_in_body(gender="female")
    vertices, faces = body.vertices, body.faces.astype(np.int64)
    if other == "finer":
        anew, anew_faces, *_ = trimesh.remesh.subdivide(vertices, faces)
    else:
        anew, anew_faces = clustered(vertices, faces, 0.015)
        assert len(anew) < 0.6 * len(vertices)
    before, after = segment(vertices, faces), segment(anew, anew_faces)
    near = KDTree(vertices[faces].mean(axis=1)).query(anew[anew_faces].mean(axis=1))[1]
    area = areas(anew, anew_faces)
    share = agreement(after.labels, before.labels[near], area)
    assert share > 0.98
    one = np.bincount(before.labels, areas(vertices, faces), len(PARTS))
    two = np.bincount(after.labels, area, len(PARTS))
    np.testing.assert_allclose(two, one, rtol=0.07)  # a cut of a neck or a lower arm that is one coarse edge off


def test_k_means_finds_heaps():
    chance = np.random.default_rng(1)
    heap = np.repeat(np.arange(5), 60)
    points = np.eye(5)[heap] * 4 + chance.normal(0, 0.2, (300, 5))
    found = k_means(points, chance.random(300) + 0.1, 5)
    assert rand_index(found, heap) == 1
    with pytest.raises(InputError, match="clusters"):
        k_means(points, np.ones(300), 301)


def test_what_is_no_person_is_refused(standing):
    _, vertices, faces, _ = standing
    ball = trimesh.creation.icosphere(3)
    with pytest.raises(InputError, match="not a person"):
        segment(ball.vertices, ball.faces)
    with pytest.raises(InputError, match="2 pieces"):
        segment(np.concatenate([vertices, vertices + 5]), np.concatenate([faces, faces + len(vertices)]))
    with pytest.raises(InputError, match='did you mean "spectral"'):
        segment(vertices, faces, method="spectrul")  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="parts"):
        segment(vertices, faces, method="spectral", parts=1)
