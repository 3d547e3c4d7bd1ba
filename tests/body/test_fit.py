"""Primitives fitted to a skin: solids are found again, a person is wrapped within the bounds, the report is true."""

import json

import numpy as np
import pytest
import trimesh
from figure_mesh import figure, meshed, standing

from taichi_cloth.body.primitives.distance import signed_distance
from taichi_cloth.body.primitives.fit import fit
from taichi_cloth.body.primitives.fit_report import exposed_samples, report_fit
from taichi_cloth.body.primitives.primitive_file import load_primitives, primitives_json
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.body.primitives.samples import mesh_distance, skin_samples, skin_space
from taichi_cloth.body.primitives.simpler import simpler
from taichi_cloth.body.primitives.skin_field import SkinField
from taichi_cloth.body.primitives.slopes import distance_slopes, farthest_slopes
from taichi_cloth.body.primitives.solids import Solid
from taichi_cloth.body.primitives.turning import Piece, Task
from taichi_cloth.ground.errors import InputError
from taichi_cloth.scenes.__main__ import main
from taichi_cloth.scenes.body import body_fit


def solid(kind, start, end, radii, across=None, rounding=0.0):
    return Primitive(
        kind=kind, start=np.array(start, float), end=np.array(end, float), radii=radii,
        across=None if across is None else np.array(across, float), rounding=rounding,
    )  # fmt: skip


def ball(radius=0.1):
    mesh = trimesh.creation.icosphere(4, radius)
    return np.array(mesh.vertices), np.array(mesh.faces)


KNOWN = [
    solid("sphere", (0.1, 0.2, 0), (0.1, 0.2, 0), (0.12, 0.12)),
    solid("cylinder", (0, 0, 0), (0.1, 0.35, 0.05), (0.07, 0.045)),
    solid("elliptic", (0, 0, 0), (0, 0.3, 0), (0.16, 0.09), (0.8, 0, 0.6), 0.03),
]


@pytest.mark.parametrize("known", KNOWN, ids=lambda p: p.kind)
def test_a_solid_is_found_again(known):
    vertices, faces = meshed([known], 0.01, 1e-9)
    (found,) = fit(vertices, faces, np.zeros(len(faces), int), ["limb"], count=1)
    assert found.kind == known.kind
    points, _ = skin_samples(vertices, faces, 3000, seed=11)
    # the mesh itself is a chord's height inside the solid, 0.3 mm, and cuts the elliptic one's edges by 2 mm
    away = np.abs(signed_distance(found, points)[0])
    assert away.mean() < 0.6e-3
    assert away.max() < 4e-3
    np.testing.assert_allclose(sorted(found.radii), sorted(known.radii), atol=1.5e-3)
    assert found.part == "limb"
    if known.kind == "sphere":
        # one is within the bound, and the same input gives the same output
        again = fit(vertices, faces, np.zeros(len(faces), int), ["limb"], count=3, error_mm=1)
        assert primitives_json(again) == primitives_json([found])


@pytest.fixture(scope="module")
def wrapped():
    _, vertices, faces, found = standing()
    primitives = fit(vertices, faces, found.labels, found.names, count=19, bones={"left hand": 9, "right hand": 13})
    return vertices, faces, found, primitives


def test_a_person_is_wrapped_within_the_bounds(wrapped):
    vertices, faces, found, primitives = wrapped
    report = report_fit(vertices, faces, found.labels, found.names, primitives)
    assert len(primitives) <= 19
    assert report.whole.mean_mm < 8
    assert report.whole.p95_mm < 20
    assert report.exposed_mean_mm < 8
    assert report.exposed_p95_mm < 20
    assert {r.part for r in report.parts} == set(found.names)
    assert sum(r.primitives for r in report.parts) == len(primitives)
    assert sum(r.area_m2 for r in report.parts) == pytest.approx(report.whole.area_m2)
    size = [r.area_m2 * r.mean_mm for r in report.parts]
    assert sum(size) / report.whole.area_m2 == pytest.approx(report.whole.mean_mm)
    assert len(report.lines()) == len(report.parts) + 4


def test_a_symmetric_body_gets_symmetric_primitives(wrapped):
    *_, primitives = wrapped
    bones = {p.part: p.bone for p in primitives}
    assert (bones["left hand"], bones["right hand"], bones["head"]) == (9, 13, 0)
    flip = np.array([-1.0, 1, 1])
    for p in primitives:
        twin = min(primitives, key=lambda q: np.linalg.norm((q.start + q.end) / 2 - flip * (p.start + p.end) / 2))
        assert twin.kind == p.kind
        # the plane is found from the parts' middles, to a millimetre
        np.testing.assert_allclose((twin.start + twin.end) / 2, flip * (p.start + p.end) / 2, atol=3e-3)
        assert sorted(twin.radii) == sorted(p.radii)


@pytest.mark.slow
def test_fewer_primitives_than_parts(wrapped):
    vertices, faces, found, many = wrapped
    few = fit(vertices, faces, found.labels, found.names, count=9)
    assert len(few) <= 9
    one = report_fit(vertices, faces, found.labels, found.names, few).whole.mean_mm
    assert one > report_fit(vertices, faces, found.labels, found.names, many).whole.mean_mm


@pytest.mark.slow
def test_an_error_bound_ends_the_splitting():
    bow = [
        solid("cylinder", (0, 0, 0), (0, 0.3, 0), (0.05, 0.05)),
        solid("cylinder", (0, 0.3, 0), (0.25, 0.4, 0), (0.05, 0.05)),
    ]
    vertices, faces = meshed(bow, 0.025, 1e-9)
    labels = np.zeros(len(faces), int)
    one = fit(vertices, faces, labels, ["limb"], count=3, error_mm=100)
    two = fit(vertices, faces, labels, ["limb"], count=2)
    assert (len(one), len(two)) == (1, 2)
    error = [report_fit(vertices, faces, labels, ["limb"], p).whole.mean_mm for p in (one, two)]
    assert error[1] < 2 < error[0]


def test_wrong_arguments(wrapped):
    vertices, faces, found, _ = wrapped
    with pytest.raises(InputError, match="count: 0"):
        fit(vertices, faces, found.labels, found.names, count=0)
    with pytest.raises(InputError, match="error_mm"):
        fit(vertices, faces, found.labels, found.names, error_mm=0)
    with pytest.raises(InputError, match="labels"):
        fit(vertices, faces, found.labels[:-1], found.names)


def test_report_of_a_ball_in_a_ball():
    vertices, faces = ball()
    labels = np.zeros(len(faces), int)
    inner = report_fit(vertices, faces, labels, ["ball"], [solid("sphere", (0, 0, 0), (0, 0, 0), (0.09, 0.09))])
    assert inner.whole.mean_mm == pytest.approx(10, abs=0.15)  # chords of the mesh are 0.13 mm high
    assert inner.whole.over_share == 0
    assert inner.exposed_mean_mm == pytest.approx(10, abs=0.15)
    outer = report_fit(vertices, faces, labels, ["ball"], [solid("sphere", (0, 0, 0), (0, 0, 0), (0.13, 0.13))])
    assert outer.whole.over_mm == pytest.approx(30, abs=0.15)
    assert outer.whole.over_share == 1


def test_depth_in_a_union_is_to_its_own_surface():
    vertices, faces = ball(0.02)
    two = [solid("sphere", (x, 0, 0), (x, 0, 0), (0.1, 0.1)) for x in (-0.06, 0.06)]
    report = report_fit(vertices, faces, np.zeros(len(faces), int), ["ball"], two)
    # the nearest of the union's surface to the middle is the circle where the balls meet, √(0.1² − 0.06²) = 80 mm away
    points, _ = skin_samples(vertices, faces, 20_000, seed=1)
    off = np.hypot(points[:, 1], points[:, 2])
    assert report.whole.over_mm == pytest.approx(1000 * np.hypot(0.08 - off, points[:, 0]).mean(), abs=1.5)


def test_exposed_area_of_two_balls():
    two = [solid("sphere", (x, 0, 0), (x, 0, 0), (0.1, 0.1)) for x in (-0.06, 0.06)]
    points, area = exposed_samples(two, each=20_000)
    # a cap of height 0.04 of each is inside the other
    assert area.sum() == pytest.approx(2 * (4 * np.pi * 0.01 - 2 * np.pi * 0.1 * 0.04), rel=0.02)
    assert np.abs(np.linalg.norm(np.abs(points) - [0.06, 0, 0], axis=1) - 0.1).max() < 1e-9


def test_distance_to_a_box():
    box = trimesh.creation.box((0.2, 0.4, 0.6))
    points = np.random.default_rng(2).uniform(-0.5, 0.5, (500, 3))
    q = np.abs(points) - [0.1, 0.2, 0.3]
    truth = np.where((q < 0).all(axis=1), -q.max(axis=1), np.linalg.norm(np.maximum(q, 0), axis=1))
    np.testing.assert_allclose(mesh_distance(points, box.vertices, box.faces), truth, atol=1e-12)


def test_field_of_a_ball():
    field = SkinField(*ball(0.3))
    points = np.random.default_rng(4).uniform(-0.33, 0.33, (2000, 3))
    truth = np.linalg.norm(points, axis=1) - 0.3
    far = np.abs(truth - field(points))
    assert far[np.linalg.norm(points, axis=1) > 0.05].max() < 4e-3  # "a few millimetres"


def test_farthest_points_are_on_the_surface_and_nothing_is_beyond():
    chance = np.random.default_rng(5)
    up = chance.normal(size=(50, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    cone = Solid("cylinder", np.array([0, 0, 0, 0.1, 0.3, 0, np.log(0.08), np.log(0.05)]))
    slab = Solid("elliptic", np.array([0, 0, 0, 0, 0.3, 0, np.log(0.2), np.log(0.1), 0.4, 0.0]), np.array([1.0, 0, 0]))
    for one in (cone, slab):
        primitive = one.primitive
        assert primitive is not None
        far = one.farthest(up)
        assert np.abs(signed_distance(primitive, far)[0]).max() < 1e-9
        points = chance.uniform(-0.5, 0.5, (20_000, 3))
        inside = points[signed_distance(primitive, points)[0] < 0]
        assert (inside @ up.T).max(axis=0).max() <= (far * up).sum(axis=1).max() + 1e-9
        assert ((inside @ up.T).max(axis=0) <= (far * up).sum(axis=1) + 1e-9).all()


MOVING = [
    Solid("sphere", np.array([0.1, 0.2, 0.3, np.log(0.1)])),
    Solid("cylinder", np.array([0, 0, 0, 0.1, 0.3, 0.05, np.log(0.08), np.log(0.05)])),
    Solid("cylinder", np.array([0, 0, 0, 0.01, 0.03, 0.05, np.log(0.05), np.log(0.15)])),  # a ball holds the other
    Solid("elliptic", np.array([0, 0.1, 0, 0.06, 0.3, 0.1, np.log(0.2), np.log(0.1), 0.4, 0.3]), np.eye(3)[0]),
    Solid("elliptic", np.array([0, 0.1, 0, 0.15, 0.2, 0.03, np.log(0.1), np.log(0.2), -2, -1.3]), np.eye(3)[0]),
    Solid("elliptic", np.array([0, 0.1, 0, 0, 0.05, 0.03, np.log(0.1), np.log(0.2), 0, 0.5]), np.eye(3)[0]).on_plane(
        np.eye(3)[0], 0.0
    ),
]


@pytest.mark.parametrize("solid", MOVING)
def test_slopes_are_those_of_finite_differences(solid):
    chance = np.random.default_rng(6)
    points = chance.uniform(-0.4, 0.5, (600, 3))
    up = chance.normal(size=(200, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    distance, normal = signed_distance(solid.primitive, points)
    near = distance_slopes(solid, points, distance, normal)
    far = solid.farthest(up)
    x, y, z = far.T
    rise = np.stack([3 * np.cos(3 * x), 2 * z, 2 * y - 2 * np.sin(2 * z)], axis=1)
    reach = farthest_slopes(solid, far, up, rise)
    for k, step in enumerate(1e-6 * np.eye(len(solid.numbers))):
        one, two = solid.moved(step), solid.moved(-step)
        change = (signed_distance(one.primitive, points)[0] - signed_distance(two.primitive, points)[0]) / 2e-6
        np.testing.assert_allclose(near[:, k], change, atol=1e-6)
        said = [np.sin(3 * x) + 2 * y * z + np.cos(2 * z) for x, y, z in (one.farthest(up).T, two.farthest(up).T)]
        np.testing.assert_allclose(reach[:, k], (said[0] - said[1]) / 2e-6, atol=1e-4)


@pytest.mark.parametrize("known", KNOWN, ids=lambda p: p.kind)
def test_the_simplest_kind_that_fits_as_well_is_taken(known):
    """Begun with an elliptic cylinder each: of a ball a sphere is left, of a tapered cylinder a cylinder."""
    vertices, faces = meshed([known], 0.012, 1e-9)
    task = Task(skin_space(vertices, faces, 500, 150, 80), SkinField(vertices, faces), None)
    middle, span = vertices.mean(axis=0), np.ptp(vertices, axis=0)
    numbers = np.array([*middle, 0, span[1], 0, *np.log(span[[0, 2]] / 2), 0, 1.0])
    (found,) = simpler([Piece(Solid("elliptic", numbers, np.eye(3)[0]), "limb")], task)
    assert found.solid.kind == known.kind
    assert found.solid.primitive is not None
    np.testing.assert_allclose(sorted(found.solid.primitive.radii), sorted(known.radii), atol=2e-3)


def test_file_and_back(tmp_path):
    path = tmp_path / "body.json"
    path.write_bytes(primitives_json(KNOWN, {"source": "x"}))
    for one, two in zip(KNOWN, load_primitives(path), strict=True):
        assert (one.kind, one.radii, one.rounding, one.part, one.bone) == (
            two.kind, two.radii, two.rounding, two.part, two.bone,
        )  # fmt: skip
        np.testing.assert_array_equal(one.start, two.start)
        np.testing.assert_array_equal(one.end, two.end)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda d: d.update(version=2), "version 2"),
        (lambda d: d.update(format="x"), "format"),
        (lambda d: d.update(primitives=[]), "none"),
        (lambda d: d["primitives"][1].pop("radii"), "primitive 1: not readable"),
        (lambda d: d["primitives"][0].update(radii=[-1, 1]), "primitive 0: primitive.radii"),
        (lambda d: d["primitives"].insert(0, 3), "primitive 0"),
    ],
)
def test_a_bad_file_is_one_line(tmp_path, change, says):
    data = json.loads(primitives_json(KNOWN))
    change(data)
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match=says) as caught:
        load_primitives(path)
    assert "\n" not in str(caught.value)
    path.write_bytes(primitives_json(KNOWN)[:-40])
    with pytest.raises(InputError, match="cut short"):
        load_primitives(path)
    with pytest.raises(InputError, match="No such file"):
        load_primitives(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nothing.obj"], "nothing.obj: no such file"),
        (["built-in:child"], "known: built-in:female, built-in:male"),
        (["nothing.obj", "--out", "no/such/folder.json"], "no such folder"),
    ],
)
def test_the_command_refuses_in_one_line(arguments, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main(["body", "fit", *arguments])
    assert end.value.code == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_a_comparison_that_cannot_be_made_is_refused_first(monkeypatch, capsys):
    def missing(*_):
        raise ModuleNotFoundError("No module named 'rtree'", name="rtree")

    monkeypatch.setattr(trimesh.proximity, "signed_distance", missing)
    monkeypatch.setattr(body_fit, "read_body", lambda source: pytest.fail("the body was read"))
    with pytest.raises(SystemExit) as end:
        main(["body", "fit", "built-in:female", "--compare"])
    assert end.value.code == 2
    error = capsys.readouterr().err
    assert "package rtree is not there; install it with: pip install taichi-cloth[report]" in error
    assert error.count("\n") == 1


@pytest.mark.slow
def test_the_command_fits_a_file_in_any_unit(tmp_path, capsys):
    vertices, faces = meshed(figure(), 0.025)
    trimesh.Trimesh(vertices[:, [0, 2, 1]] * [100, -100, 100], faces, process=False).export(tmp_path / "me.ply")
    with pytest.raises(SystemExit) as end:
        main(["body", "fit", str(tmp_path / "me.ply"), "--out", str(tmp_path / "me.json"), "--count", "17"])
    assert end.value.code == 0
    assert "17 primitives" in capsys.readouterr().out
    found = load_primitives(tmp_path / "me.json")
    head = next(p for p in found if p.part == "head")
    assert head.start[1] == pytest.approx(1.59, abs=0.08)
    assert next(p for p in found if p.part == "left hand").start[0] > 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["me.json", "me.ply", "me.png"]
