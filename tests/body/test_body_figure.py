"""The built-in body: closed, symmetric, as big as asked for, and reproducible."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from taichi_cloth.body.figure import build
from taichi_cloth.body.figure.anthropometry import FEMALE, MALE, Gender, measures_of, tape
from taichi_cloth.body.figure.build import _meshed, built_in_body, fitted, girth_sections, girths_of
from taichi_cloth.body.figure.implicit import Ellipsoid, Part, RoundCone, Tube, field, gradient
from taichi_cloth.body.figure.surface_nets import surface_nets
from taichi_cloth.ground.errors import InputError


@pytest.fixture(autouse=True, scope="module")
def meshed_here(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Bodies of these tests are meshed by this code, and not read from where they are kept."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("bodies")
        patch.setenv("TAICHI_CLOTH_CACHE", str(folder))
        build._built.cache_clear()
        yield folder


def closed(faces: np.ndarray) -> bool:
    """Every edge is run along once each way."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    unique = np.unique(edges, axis=0)
    return len(unique) == len(edges) and np.array_equal(unique, np.unique(edges[:, ::-1], axis=0))


@pytest.mark.parametrize("gender", ["female", "male"])
def test_body_is_one_closed_surface_with_the_girths_asked_for(gender: Gender) -> None:
    body = built_in_body(gender=gender)
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    assert closed(body.faces)
    assert mesh.euler_number == 2
    assert mesh.body_count == 1
    assert mesh.volume > 0
    assert 10_000 <= len(body.vertices) <= 16_000
    assert not body.notes
    measures = measures_of(gender)
    assert body.vertices[:, 1].min() == pytest.approx(0, abs=1e-9)
    assert body.stature == pytest.approx(measures.stature, rel=1e-6)
    read = girths_of(body.vertices, body.faces, girth_sections(gender, measures))
    for name, girth in read.items():
        assert girth == pytest.approx(getattr(measures, name), rel=0.02), name
    mirrored, _ = KDTree(body.vertices).query(body.vertices * [-1, 1, 1])
    assert (
        mirrored.max() < 0.004
    )  # the two ways to cut a quad differ from side to side; a vertex is 12 mm from the next


def test_other_measures_are_met() -> None:
    asked = measures_of("female", {"stature": 1.62, "bust": 0.98, "waist": 0.82, "hip": 1.06, "crotch_height": 0.70})
    body = built_in_body(asked, gender="female", spacing=0.012)
    read = girths_of(body.vertices, body.faces, girth_sections("female", asked))
    for name in ("bust", "waist", "hip", "thigh", "calf"):
        assert read[name] == pytest.approx(getattr(asked, name), rel=0.02), name
    assert not body.notes
    hip = body.skeleton.joints[body.skeleton.index("thigh_l"), 1]
    assert hip < 0.512 * 1.62 - 0.01  # shorter legs bring the hips down


def test_same_measures_same_bytes() -> None:
    figure = fitted("male", MALE, rounds=1)
    one, two = (_meshed(figure, 0.025)[0] for _ in range(2))
    assert one.tobytes() == two.tobytes()
    again = fitted("male", MALE, rounds=1)
    assert again.sections["wrist"].point.tobytes() == figure.sections["wrist"].point.tobytes()
    assert field(again.parts, one).tobytes() == field(figure.parts, one).tobytes()


def test_a_body_is_meshed_once(meshed_here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = built_in_body(gender="male", spacing=0.025)
    assert list(meshed_here.glob("figure-*.npz"))
    build._built.cache_clear()
    monkeypatch.setattr(build, "_meshed", None)
    again = built_in_body(gender="male", spacing=0.025)
    assert again.vertices.tobytes() == first.vertices.tobytes()
    assert again.faces.tobytes() == first.faces.tobytes()


def test_measures_not_given_follow_those_given() -> None:
    tall = measures_of("male", {"stature": 1.1 * MALE.stature})
    assert tall.crotch_height == pytest.approx(1.1 * MALE.crotch_height)
    assert tall.hip == pytest.approx(1.1 * MALE.hip)
    wide = measures_of("female", {"hip": 1.21 * FEMALE.hip})
    assert wide.thigh == pytest.approx(1.1 * FEMALE.thigh)
    assert wide.stature == FEMALE.stature


@pytest.mark.parametrize(
    ("gender", "given", "match"),
    [
        ("femal", {}, r'"female"|did you mean "female"'),
        ("male", {"waistt": 0.8}, 'did you mean "waist"'),
        ("male", {"hip": 9.0}, "900 cm; allowed: 42 to 170 cm"),
        ("male", {"hip": float("nan")}, "allowed"),
    ],
)
def test_impossible_measures_are_refused(gender: str, given: dict, match: str) -> None:
    with pytest.raises(InputError, match=match):
        measures_of(gender, given)  # type: ignore[arg-type]


def test_tape_round_a_cylinder_and_across_a_hollow() -> None:
    tube = trimesh.creation.cylinder(0.05, 0.4, sections=256)
    vertices, faces = np.asarray(tube.vertices), np.asarray(tube.faces)
    assert tape(vertices, faces, (0, 0, 0.03), (0, 0, 1)) == pytest.approx(2 * np.pi * 0.05, rel=2e-4)
    tilted = tape(vertices, faces, (0, 0, 0), (0, np.sin(0.6), np.cos(0.6)))
    semi = 0.05 / np.cos(0.6)
    ramanujan = np.pi * (3 * (semi + 0.05) - np.sqrt((3 * semi + 0.05) * (semi + 3 * 0.05)))
    assert tilted == pytest.approx(ramanujan, rel=1e-3)
    pair = trimesh.util.concatenate([tube, tube.copy().apply_translation([0.3, 0, 0])])
    assert isinstance(pair, trimesh.Trimesh)
    both = np.asarray(pair.vertices), np.asarray(pair.faces)
    assert tape(*both, (0.3, 0, 0), (0, 0, 1)) == pytest.approx(2 * np.pi * 0.05, rel=2e-4)
    assert np.isnan(tape(*both, (0, 0, 1.0), (0, 0, 1)))


def test_solids_are_zero_on_their_surface_and_rise_outwards() -> None:
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    rows = np.array([(0, 0.01, 0.2, 0.15, -0.1, 2.0), (1, 0.01, 0.2, 0.15, -0.1, 2.0)])
    tube = Tube(np.zeros(3), np.array([0.0, 1, 0]), np.array([1.0, 0, 0]), rows, 0.4)
    depth = np.where(np.sin(turn) > 0, 0.15, 0.1)
    v = np.cross([0.0, 1, 0], [1.0, 0, 0])
    ring = np.array([0.01, 0.5, 0]) + np.outer(0.2 * np.cos(turn), [1, 0, 0]) + np.outer(depth * np.sin(turn), v)
    np.testing.assert_allclose(tube.value(ring), 0, atol=1e-12)
    ball = Ellipsoid(np.array([0, 0.4, 0]), np.array([0.2, 0.1, 0.3]))
    np.testing.assert_allclose(ball.value(np.array([[0.2, 0.4, 0], [0, 0.5, 0], [0, 0.4, -0.3]])), 0, atol=1e-12)
    cone = RoundCone(np.array([0, 0.3, 0]), np.array([0, 0.6, 0]), 0.05, 0.02)
    np.testing.assert_allclose(cone.value(np.array([[0.05, 0.3, 0], [0, 0.62, 0]])), 0, atol=1e-12)
    parts = [Part(ball, 0.02)]
    assert gradient(parts, np.array([[0, 0.51, 0]])) == pytest.approx(np.array([[0, 1, 0]]), abs=2e-2)
    assert field(parts, np.array([[0, -0.01, 0]]))[0] >= 0.01  # the floor


def test_surface_nets_of_a_ball_and_of_noise() -> None:
    axis = np.linspace(-1, 1, 41)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    vertices, faces = surface_nets(np.sqrt(x**2 + y**2 + z**2) - 0.7, np.full(3, -1.0), 0.05)
    ball = trimesh.Trimesh(vertices, faces, process=False)
    assert closed(faces)
    assert ball.volume == pytest.approx(4 / 3 * np.pi * 0.7**3, rel=0.01)
    assert np.abs(np.linalg.norm(vertices, axis=1) - 0.7).max() < 0.05 / 8  # a chord's sag at this spacing is 0.9 mm
    noise = np.ones((14, 14, 14))
    noise[1:-1, 1:-1, 1:-1] = np.random.default_rng(5).normal(size=(12, 12, 12))
    _, faces = surface_nets(noise, np.zeros(3), 1.0)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), 1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] % 2 == 0).all()  # no hole even where all sheets meet
