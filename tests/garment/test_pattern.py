"""Patterns: curves against closed forms, GarmentCode files, seams that pair up, and what is refused."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from figures import plain_figure

from taichi_cloth.garment.pattern.curves import FLATNESS, along, arc, bezier, from_relative, length
from taichi_cloth.garment.pattern.drafts import DRAFTS, Cut, draft
from taichi_cloth.garment.pattern.garmentcode import read_garmentcode
from taichi_cloth.garment.pattern.pattern import Bent, Flat, Panel, Pattern, Seam, Side, Wrap
from taichi_cloth.ground.errors import InputError

SAMPLES = sorted((Path(__file__).parents[1] / "data" / "patterns").glob("*.json"))
FLAT = Flat(np.eye(3), np.zeros(3))


def square(name="square", size=0.2):
    corner = np.array([[0, 0], [size, 0], [size, size], [0, size], [0, 0]], float)
    return Panel(name, tuple(corner[k : k + 2] for k in range(4)), FLAT)


@pytest.mark.parametrize("control", [[(0, 0), (1, 2), (3, 0)], [(0, 0), (0, 1), (1, 1), (1, 0)]])
def test_bezier_lies_on_the_curve_and_its_chords_stay_near(control):
    c = np.array(control, float) * 0.3
    points = bezier(c)

    def curve(t):
        if len(c) == 3:
            return (1 - t) ** 2 * c[0] + 2 * t * (1 - t) * c[1] + t**2 * c[2]
        return (1 - t) ** 3 * c[0] + 3 * t * (1 - t) ** 2 * c[1] + 3 * t**2 * (1 - t) * c[2] + t**3 * c[3]

    t = np.linspace(0, 1, len(points))[:, None]
    assert np.abs(points - curve(t)).max() < 1e-12
    middle = (points[1:] + points[:-1]) / 2
    assert np.linalg.norm(middle - curve((t[1:] + t[:-1]) / 2), axis=1).max() < FLATNESS


def test_length_of_a_parabola():
    # y = x² from 0 to 1: L = √5/2 + asinh(2)/4. A polyline of n chords is short by O(1/n²).
    assert length(bezier([(0, 0), (0.5, 0), (1, 1)], 1e-6)) == pytest.approx(
        np.sqrt(5) / 2 + np.arcsinh(2) / 4, abs=2e-5
    )


@pytest.mark.parametrize(("large", "right", "angle"), [(False, True, 90), (True, True, 270), (False, False, 90)])
def test_arc_has_its_radius_its_angle_and_its_side(large, right, angle):
    points = arc((0, 0), (1, 1), 1.0, large=large, right=right, flatness=1e-6)
    centre = np.array([0, 1]) if right != large else np.array([1, 0])
    assert np.abs(np.linalg.norm(points - centre, axis=1) - 1).max() < 1e-12
    assert length(points) == pytest.approx(np.radians(angle), rel=1e-5)
    start = points[1] - points[0]  # anticlockwise about the centre when right
    out = points[0] - centre
    turn = out[0] * start[1] - out[1] * start[0]
    assert (turn > 0) == right


def test_arc_of_too_small_a_radius_is_refused():
    with pytest.raises(InputError, match=r"radius 0\.4 m with ends 1 m apart"):
        arc((0, 0), (1, 0), 0.4, large=False, right=True)


def test_relative_points_and_shares_of_length():
    assert from_relative((1, 1), (1, 3), (0.5, 0.25)) == pytest.approx([0.5, 2.0])  # left of the way up is −x
    assert along(np.array([[0, 0], [1, 0], [1, 3]], float), np.array([0, 0.5, 1])) == pytest.approx(
        np.array([[0, 0], [1, 1], [1, 3]])
    )


def test_both_notations_of_all_curves_agree(tmp_path):
    def write(name, notation, bends):
        panel = {
            "vertices": [[0, 0], [40, 0], [40, 30], [0, 30]],
            "edges": [{"endpoints": [k, (k + 1) % 4], **({"curvature": b} if b else {})} for k, b in enumerate(bends)],
            "translation": [10, 100, 20],
            "rotation": [0, 90, 0],
        }
        document = {
            "pattern": {"panels": {"one": panel}, "stitches": []},
            "properties": {"curvature_coords": notation, "units_in_meter": 100},
        }
        (tmp_path / name).write_text(json.dumps(document))
        return read_garmentcode(tmp_path / name).panel("one")

    relative = write(
        "a.json",
        "relative",
        [
            [0.5, -0.1],
            {"type": "cubic", "params": [[0.2, -0.1], [0.8, 0.1]]},
            {"type": "quadratic", "params": [[0.5, 0.2]]},
            None,
        ],
    )
    absolute = write(
        "b.json",
        "absolute",
        [[20, -4], {"type": "cubic", "params": [[43, 6], [37, 24]]}, {"type": "quadratic", "params": [[20, 22]]}, None],
    )
    for one, two in zip(relative.edges, absolute.edges, strict=True):
        assert np.abs(one - two).max() < 1e-12
    # R = Ry(90°): x goes to −z, and the translation is in the same units
    assert relative.place.points(np.array([[0.4, 0.3]]))[0] == pytest.approx([0.1, 1.3, -0.2])


def test_circle_edge(tmp_path):
    panel = {
        "vertices": [[0, 0], [2, 0], [2, 2]],
        "edges": [
            {"endpoints": [0, 1]},
            {"endpoints": [1, 2], "curvature": {"type": "circle", "params": [1.0, 0, 1]}},
            {"endpoints": [2, 0]},
        ],
    }
    (tmp_path / "c.json").write_text(
        json.dumps({"pattern": {"panels": {"p": panel}}, "properties": {"units_in_meter": 1}})
    )
    found = read_garmentcode(tmp_path / "c.json").panel("p")
    assert length(found.edges[1]) == pytest.approx(np.pi, rel=1e-3)
    assert found.area == pytest.approx(2 + np.pi / 2, rel=1e-3)  # the half disc bulges out, to the right of the way up


@pytest.mark.parametrize("file", SAMPLES, ids=lambda f: f.stem)
def test_samples_are_read_whole(file):
    pattern = read_garmentcode(file)
    document = json.loads(file.read_text())["pattern"]
    assert len(pattern.panels) == len(document["panels"])
    assert len(pattern.seams) == len(document["stitches"])
    assert 0.4 < sum(panel.area for panel in pattern.panels) < 1.5
    for seam in pattern.seams:
        one, two = (length(pattern.edge(side)) for side in (seam.first, seam.second))
        gathered = 1.45 if file.stem.startswith("dress_pencil") else 1.12  # that one's bodice is gathered at the waist
        assert max(one, two) < gathered * min(one, two) + 0.01


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("pattern"), r"file\.pattern: missing"),
        (lambda d: d["properties"].update(units_in_meter=0), r"units_in_meter: 0; allowed: above 0"),
        (lambda d: d["properties"].update(curvature_coords="polar"), r"'polar'; allowed: relative, absolute"),
        (lambda d: d["pattern"]["panels"]["front"]["vertices"].__setitem__(0, [0, "x"]), r"vertices: .* 2 numbers"),
        (lambda d: d["pattern"]["panels"]["front"]["edges"][0].update(endpoints=[0, 99]), r"endpoints: \[0, 99\]"),
        (lambda d: d["pattern"]["panels"]["front"]["edges"].pop(), r"does not end where the next one starts"),
        (lambda d: d["pattern"]["stitches"][0][0].update(panel="frond"), r"no panel 'frond'.*front"),
        (lambda d: d["pattern"]["stitches"][0][0].update(edge=77), r"edge 77 of"),
        (lambda d: d["pattern"]["stitches"].append([1]), r"stitches\[12\]: allowed: two sides"),
        (
            lambda d: d["pattern"]["panels"]["front"]["edges"][0].update(curvature={"type": "spiral", "params": []}),
            r"'spiral'; allowed: quadratic, cubic, circle",
        ),
        (
            lambda d: d["pattern"]["panels"]["front"]["edges"][0].update(curvature={"type": "circle", "params": [1]}),
            r"params: 1 of them; a circle curve has 3",
        ),
        (
            lambda d: d["pattern"]["panels"]["front"]["edges"][0].update(curvature={"params": []}),
            r"curvature\.type: missing",
        ),
        (lambda d: d["pattern"]["panels"]["front"]["vertices"].__setitem__(0, [0, 10**400]), r"vertices: .* allowed"),
        (lambda d: d["properties"].update(units_in_meter=1e-3), r"vertices: .*; allowed: numbers up to 0\.01"),
        (
            lambda d: d["pattern"]["panels"]["front"].update(translation=[2e9, 0, 0]),
            r"translation: .*allowed: numbers up to",
        ),
    ],
)
def test_malformed_files_get_one_line(tmp_path, change, message):
    document = json.loads(next(f for f in SAMPLES if f.stem == "tee").read_text())
    change(document)
    file = tmp_path / "bad.json"
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=message) as error:
        read_garmentcode(file)
    assert "\n" not in str(error.value)
    assert "bad.json" in str(error.value)


def rectangle(**more):
    edges = [{"endpoints": [k, (k + 1) % 4]} for k in range(4)]
    return {"vertices": [[0, 0], [40, 0], [40, 30], [0, 30]], "edges": edges, **more}


def written(folder, panels, stitches=()):
    file = folder / "own.json"
    properties = {"units_in_meter": 100, "curvature_coords": "relative"}
    document = {"pattern": {"panels": panels, "stitches": list(stitches), "panel_order": ["no", "such"]}}
    file.write_text(json.dumps({**document, "properties": properties}))
    return read_garmentcode(file)


def test_which_ends_meet_and_what_edges_are_called_is_as_the_file_says(tmp_path):
    one, two = rectangle(label="body"), rectangle(label="leg")
    one["edges"][2]["label"] = "lower_interface"
    sides = [{"panel": "one", "edge": 1}, {"panel": "two", "edge": 3}]
    pattern = written(tmp_path, {"one": one, "two": two}, [sides, [*sides[::-1], "right_wrong"]])
    assert [seam.alike for seam in pattern.seams] == [False, True]
    assert pattern.panel("one").marks == ((2, "lower_interface"),)
    assert pattern.panel("two").label == "leg"


@pytest.mark.parametrize(("deep", "area"), [(2.0, 0.11686), (9.0, None)])
def test_a_loop_under_two_square_centimetres_is_cut_off_and_said(tmp_path, deep, area):
    """The right side comes to its upper corner from inside, the top leaves it downwards: they cross before it."""
    crossing = rectangle(vertices=[[0, 0], [40, 0], [40, 30], [0, 30]])
    crossing["edges"][1]["curvature"] = {"type": "cubic", "params": [[0.5, 0.0], [1.0, deep / 30]]}
    crossing["edges"][2]["curvature"] = {"type": "cubic", "params": [[0.0, deep / 40], [0.5, 0.0]]}
    if area is None:
        with pytest.raises(InputError, match="crosses itself"):
            written(tmp_path, {"one": crossing})
        return
    pattern = written(tmp_path, {"one": crossing})
    (note,) = pattern.notes
    assert re.fullmatch(r"panel one: a loop of 0\.\d\d cm² where edges 1 and 2 cross, cut off", note)
    assert pattern.panel("one").area == pytest.approx(area, rel=1e-3)


@pytest.mark.parametrize("content", [b"", b"{", b"[1, 2]", b"\xff\xfe", b"null"])
def test_what_is_no_pattern_is_refused(tmp_path, content):
    (tmp_path / "x.json").write_bytes(content)
    with pytest.raises(InputError, match=r"x\.json"):
        read_garmentcode(tmp_path / "x.json")


def test_an_outline_that_crosses_itself_is_refused():
    corner = np.array([[0, 0], [1, 1], [1, 0], [0, 1.2], [0, 0]], float)
    bow = Panel("bow", tuple(corner[k : k + 2] for k in range(4)), FLAT)
    with pytest.raises(InputError, match="crosses itself"):
        Pattern("p", (bow,), ())


def test_a_panel_far_too_large_is_refused():
    with pytest.raises(InputError, match="reaches 2e\\+04 m; allowed: up to 10 m"):
        Pattern("p", (square(size=2e4),), ())


def test_a_seam_of_an_edge_to_itself_is_refused():
    with pytest.raises(InputError, match="to itself"):
        Pattern("p", (square(),), (Seam(Side("square", 1), Side("square", 1)),))


@pytest.mark.parametrize("name", DRAFTS)
def test_drafts_close(name):
    pattern = draft(name, plain_figure())
    for seam in pattern.seams:
        one, two = (length(pattern.edge(side)) for side in (seam.first, seam.second))
        assert one == pytest.approx(two, rel=0.025)
        a, b = pattern.pairs(seam, 9)
        places = [pattern.panel(s.panel).place.points(p) for s, p in ((seam.first, a), (seam.second, b))]
        straight = np.linalg.norm(places[0] - places[1], axis=1).sum()
        crossed = np.linalg.norm(places[0] - places[1][::-1], axis=1).sum()
        assert straight < crossed + 1e-9  # the ends that belong together are the ones that start together
    for hold in pattern.holds:
        assert 0 <= hold.side.edge < len(pattern.panel(hold.side.panel).edges)


def test_a_sleeve_is_as_long_round_its_cap_as_the_armhole():
    pattern = draft("tshirt", plain_figure())
    cap = length(pattern.edge(Side("left_sleeve", 2))) + length(pattern.edge(Side("left_sleeve", 3)))
    hole = length(pattern.edge(Side("front", 2))) + length(pattern.edge(Side("back", 6)))
    assert cap == pytest.approx(1.015 * hole, rel=1e-3)


def test_ease_and_length_are_what_they_say():
    figure = plain_figure()
    front = draft("tshirt", figure, Cut(ease=0.2, length=0.7)).panel("front").outline
    assert np.ptp(front[:, 0]) == pytest.approx(figure.chest * 1.2 / 2)
    assert np.ptp(front[:, 1]) == pytest.approx(0.7)
    hem = draft("skirt", figure, Cut(flare=2.0)).panel("front").edges[0]
    assert length(hem) == pytest.approx(figure.hip * 2.0 / 2, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "cut", "message"),
    [
        ("tshirtt", Cut(), "unknown pattern 'tshirtt'.*tshirt"),
        ("tshirt", Cut(length=0.1), r"garment\.length: 0\.1"),
        ("dress", Cut(flare=0.1), r"garment\.flare: 0\.1; allowed: 0\.8 to 8"),
    ],
)
def test_impossible_cuts_are_refused(name, cut, message):
    with pytest.raises(InputError, match=message):
        draft(name, plain_figure(), cut)


def test_wrapping_keeps_lengths_and_closes():
    wrap = Wrap(np.zeros(3), np.array([0.0, 1, 0]), np.array([0.0, 0, 1]), (0.1, 0.15))
    x = np.linspace(-0.3, 0.3, 601)
    placed = wrap.points(np.stack([x, 0 * x], -1))
    assert np.abs(np.linalg.norm(np.diff(placed, axis=0), axis=1) / 0.001 - 1).max() < 2e-3
    assert placed[300] == pytest.approx([0, 0, 0.1])
    assert (placed[:, 0] / 0.15) ** 2 + (placed[:, 2] / 0.1) ** 2 == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_what_is_bent_back_keeps_lengths_and_ends_square(side: float) -> None:
    bent = Bent(FLAT, side, line=-0.01, radius=0.02)
    x = side * np.linspace(-0.2, 0.1, 3001)
    placed = bent.points(np.stack([x, 0.5 + 0 * x], -1))
    assert np.abs(np.linalg.norm(np.diff(placed, axis=0), axis=1) / 1e-4 - 1).max() < 1e-5
    flat = side * x < -0.03
    assert placed[flat] == pytest.approx(FLAT.points(np.stack([x, 0.5 + 0 * x], -1))[flat])
    assert side * placed[-1] == pytest.approx([-0.01, side * 0.5, -side * (0.13 - 0.01 * np.pi + 0.02)])


def test_a_pattern_of_half_the_width_starts_half_as_far_apart() -> None:
    whole = draft("trousers", plain_figure())
    for one, other in zip(whole.panels, whole.scaled(0.5, 1.0).panels, strict=True):
        assert np.abs(other.world[:, 0]).min() == pytest.approx(0.5 * np.abs(one.world[:, 0]).min())
