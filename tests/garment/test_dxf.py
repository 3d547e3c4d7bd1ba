"""Patterns in DXF: pieces as drawn, halves unfolded, notches that meet notches, and what a TOML beside it says."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from figures import plain_landmarks

pytest.importorskip("ezdxf")

from dxf_sample import add_piece, laid, new_document
from typer.testing import CliRunner

from taichi_cloth.garment.fit.fitted import fitted
from taichi_cloth.garment.fit.lay_out import drawn_for
from taichi_cloth.garment.pattern.curves import along, length
from taichi_cloth.garment.pattern.dxf_pattern import read_dxf
from taichi_cloth.garment.pattern.dxf_pieces import read_pieces
from taichi_cloth.garment.pattern.outline import Outline, closed, unfolded
from taichi_cloth.garment.pattern.pattern import Course, Wrap
from taichi_cloth.garment.pattern.seam_sides import Span, matched, ordered
from taichi_cloth.ground.errors import InputError
from taichi_cloth.scenes.__main__ import app
from taichi_cloth.scenes.commands.pattern_pieces import suggested

SAMPLE = Path(__file__).parents[1] / "data" / "patterns" / "own_tee.dxf"


def box(wide: float, tall: float) -> list[np.ndarray]:
    """Edges: bottom, right, top, left [m]."""
    corner = np.array([[0, 0], [wide, 0], [wide, tall], [0, tall], [0, 0.0]])
    return [corner[k : k + 2] for k in range(4)]


def written(folder: Path, document, words: str, name: str = "own") -> Path:
    file = folder / f"{name}.dxf"
    document.saveas(file)
    file.with_suffix(".toml").write_text(words)
    return file


def band(folder: Path, wide: float = 0.8, extra: str = "") -> Path:
    """A skirt of two rectangles under a waistband of one piece, drawn upright."""
    document = new_document()
    add_piece(document, "BAND", box(wide, 0.04))
    add_piece(document, "SKIRT", box(wide / 2, 0.5))
    words = f"""
up = "+x"
seams = [["band.2", "band.4"], ["front.2", "back.4"], ["front.4", "back.2"], ["band.1", ["back.3", "front.3"]]]
[panels.band]
piece = "BAND"
part = "trunk"
[panels.front]
piece = "SKIRT"
part = "skirt"
[panels.back]
piece = "SKIRT"
part = "skirt"
side = "back"
{extra}"""
    return written(folder, document, words)


def test_a_piece_is_read_in_metres_with_its_corners_notches_and_grain():
    front, back, sleeve = read_pieces(SAMPLE)
    assert [p.name for p in (front, back, sleeve)] == ["FRONT", "BACK", "SLEEVE"]
    assert front.size == "M"
    assert np.degrees(front.grain or 0) == pytest.approx(90)  # along x
    assert len(back.outline.edges()) == 8
    assert len(sleeve.outline.edges()) == 4
    assert [round(s, 3) for s in back.outline.marks(2)] == [0.08, 0.09]
    assert len(sleeve.outline.marks(2)) == 4


def test_a_half_is_unfolded_at_its_mirror_line():
    """The front was drawn as a half: it is as wide as the back, symmetric, and its hem and neckline are one edge."""
    front, back, _ = read_pieces(SAMPLE)
    edges, others = front.outline.edges(), back.outline.edges()
    assert len(edges) == 8
    assert sorted(map(length, edges))[-1] == pytest.approx(length(others[0]), rel=1e-6)  # the hem
    flipped = front.outline.loop * [1, -1]
    gap = np.linalg.norm(front.outline.loop[:, None] - flipped[None], axis=2).min(axis=1)
    assert gap.max() < 1e-6
    with pytest.raises(InputError, match="mirror line"):
        unfolded(front.outline, np.array([[1.0, 0.0], [1.0, 1.0]]))


def test_an_outline_may_come_in_lines_and_without_turn_points():
    corner = np.array([[0, 0], [0.3, 0], [0.3, 0.2], [0, 0.2], [0, 0.0]])
    loop = closed([corner[3:5], corner[1:3][::-1], corner[0:2], corner[2:4]])
    assert loop is not None
    outline = Outline.of(loop, [], [])
    assert sorted(round(length(e), 6) for e in outline.edges()) == [0.2, 0.2, 0.3, 0.3]
    assert closed([corner[:3]]) is None


def test_the_sew_line_is_sewn_where_it_is_drawn(tmp_path):
    document = new_document()
    inner = np.array([[0.01, 0.01], [0.29, 0.01], [0.29, 0.19], [0.01, 0.19]])
    add_piece(document, "ONE", box(0.3, 0.2), notches=[np.array([0.15, 0.0])], sew=inner)
    piece = read_pieces(written(tmp_path, document, ""))[0]
    assert piece.sewn
    assert sorted(round(length(e), 6) for e in piece.outline.edges()) == [0.18, 0.18, 0.28, 0.28]
    assert len(piece.outline.notches) == 1  # stood at the cut, and is taken to the sew line


@pytest.mark.parametrize(("unit", "metres"), [("ENGLISH", 0.0254), ("METRIC", 1e-3)])
def test_units_are_those_of_the_file(tmp_path, unit, metres):
    document = new_document(unit)
    add_piece(document, "ONE", box(0.3, 0.2))
    piece = read_pieces(written(tmp_path, document, ""))[0]
    assert piece.outline.size == pytest.approx(1000 * metres, rel=1e-6)
    assert read_pieces(tmp_path / "own.dxf", "cm")[0].outline.size == pytest.approx(10, rel=1e-6)


def test_notches_meet_notches():
    """The sides of a seam are cut at them, so that cloth between is eased as it is marked and not evenly."""
    loop = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    outlines = {
        "a": Outline(loop, (0.0, 1.0, 2.0, 3.0), (0.3,)),
        "b": Outline(loop, (0.0, 1.0, 2.0, 3.0), (0.6,)),
        "c": Outline(loop, (0.0, 1.0, 2.0, 3.0), (0.25, 0.5)),
        "d": Outline(loop, (0.0, 1.0, 2.0, 3.0)),
    }
    pairs, note = matched([Span("a", 0, 1)], [Span("b", 0, 1)], outlines)
    assert note is None
    assert [(one.long, two.long) for one, two in pairs] == [pytest.approx((0.3, 0.4)), pytest.approx((0.7, 0.6))]
    assert pairs[0][1].end == pytest.approx(1.0)  # the other side runs against its outline
    pairs, note = matched([Span("a", 0, 1)], [Span("c", 0, 1)], outlines)
    assert len(pairs) == 1
    assert note is not None
    assert "1 and 2 notches" in note
    # A joint counts as a notch: one edge onto two.
    pairs, note = matched([Span("a", 0, 1)], [Span("d", 0, 1), Span("d", 2, 3)], outlines)
    assert [(one.long, two.long) for one, two in pairs] == [pytest.approx((0.5, 1.0)), pytest.approx((0.5, 1.0))]
    assert ordered([Span("d", 1, 2), Span("d", 0, 1)], outlines, along=True)[0].start == 0
    with pytest.raises(InputError, match="do not follow"):
        ordered([Span("d", 0, 1), Span("d", 2, 3)], outlines, along=True)


def test_the_sample_is_the_built_in_tshirt_again():
    """Its seams join edges that are as long as those of the draft that it was written from, eased by 1.5 % at the
    cap; sleeves of one piece go round their arms; nothing is graded where it is drawn for the wearer."""
    pattern = read_dxf(SAMPLE)
    assert len(pattern.seams) == 16  # eight, cut at notches
    for seam in pattern.seams:
        one, two = (length(pattern.edge(side)) for side in (seam.first, seam.second))
        assert one == pytest.approx(two, rel=0.02, abs=1e-4)
    worn = plain_landmarks()
    dressed = fitted(pattern, worn)
    assert dressed.holds == ()
    sleeve = dressed.panel("left_sleeve")
    assert isinstance(sleeve.place, Wrap)
    assert sleeve.world[:, 0].mean() > 0.15 > -0.15 > dressed.panel("right_sleeve").world[:, 0].mean()
    drawn = {panel.name: length(panel.edges[0]) for panel in pattern.panels}
    assert length(sleeve.edges[0]) == pytest.approx(drawn["left_sleeve"], rel=1e-6)
    assert sleeve.grain == pytest.approx(0, abs=1e-9)
    front, back = dressed.panel("front").world, dressed.panel("back").world
    assert front[:, 2].min() > 0.1 > -0.1 > back[:, 2].max()
    assert front[:, 1].max() == pytest.approx(worn.height["neck"] + 0.04, abs=0.01)


def test_sleeves_are_mirrored_and_their_seams_meet_on_the_right_side():
    """The front half of each cap goes to the front: ends that are sewn together start nearer to each other than to the
    other end."""
    pattern = fitted(read_dxf(SAMPLE), plain_landmarks())
    for seam in pattern.seams:
        names = {seam.first.panel, seam.second.panel}
        if len(names) == 1 or not any("sleeve" in name for name in names):
            continue
        one, two = pattern.pairs(seam, 2)
        a = pattern.panel(seam.first.panel).place.points(one)
        b = pattern.panel(seam.second.panel).place.points(two)
        assert np.sign(a[:, 0].mean()) == np.sign(b[:, 0].mean())
        assert np.linalg.norm(a - b, axis=1).max() < 0.25


def test_a_band_of_one_piece_carries_a_skirt(tmp_path):
    worn = plain_landmarks()
    pattern = fitted(read_dxf(band(tmp_path)), worn)
    hold = pattern.holds[0]
    assert hold.side.panel == "band"
    assert isinstance(hold.place, Course)
    ring = hold.place.points(pattern.edge(hold.side))
    assert np.ptp(np.unwrap(np.arctan2(ring[:, 0], ring[:, 2]))) > np.radians(350)
    assert worn.height["hip"] < ring[:, 1].mean() < worn.height["waist"] + 0.02
    skirt = pattern.panel("front").world
    assert skirt[:, 1].max() == pytest.approx(ring[:, 1].mean() - 0.04, abs=0.02)


def test_a_pattern_drawn_for_another_body_is_graded(tmp_path):
    worn = plain_landmarks()
    as_drawn = fitted(read_dxf(band(tmp_path, 1.1)), worn).panel("front")
    graded = fitted(read_dxf(band(tmp_path, 1.1, extra="[body]\nhip_cm = 48.5\nwaist_cm = 36")), worn).panel("front")
    assert length(graded.edges[0]) == pytest.approx(2 * length(as_drawn.edges[0]), rel=0.02)
    assert drawn_for(worn, {"stature": 0.85}).height["waist"] == pytest.approx(0.5 * worn.height["waist"])


def test_seams_are_suggested():
    pieces = read_pieces(SAMPLE)
    assert set(suggested(pieces)) == {  # not the cap, which goes onto two edges
        ("front.1", "back.8"), ("front.7", "back.2"), ("front.3", "back.6"), ("front.5", "back.4"),
        ("sleeve.2", "sleeve.4"),
    }  # fmt: skip


def test_the_command_draws_and_writes_what_can_be_worn(tmp_path):
    shutil.copy(SAMPLE, tmp_path / "tee.dxf")
    done = CliRunner().invoke(app, ["pattern", str(tmp_path / "tee.dxf"), "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert "SLEEVE, size M" in done.output
    assert (tmp_path / "out" / "pieces.png").exists()
    shutil.copy(tmp_path / "out" / "tee.toml", tmp_path / "tee.toml")
    pattern = read_dxf(tmp_path / "tee.dxf")  # the right way up or not, it is a TOML that can be read
    assert len(pattern.seams) == 5


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('up = "+x"', 'up = "left"', "up: 'left'; known: +x"),
        ('part = "trunk"', 'part = "tail"', "panels.band.part: 'tail'; known: trunk"),
        ('part = "trunk"', "", "panels.band.part: missing"),
        ('"band.2"', '"band.9"', "band has edges 1 to 4"),
        ('"band.2"', '"strap.2"', "'strap.2'; allowed: PANEL.EDGE"),
        ('["front.4", "back.2"]', '["front.2", "back.2"]', "an edge of front that number 2 joins"),
        ('piece = "BAND"', 'piece = "BANT"', "no 'BANT' in the DXF"),
        ('up = "+x"', 'sides = "+x"', "unknown key 'sides'"),
        ("up =", "up", "not TOML"),
        ('up = "+x"', 'up = "+x"\nunit = "ell"', "unit: 'ell'; known: mm"),
        ('up = "+x"', 'up = "+x"\nsize = "XL"', "size: 'XL'; known: M"),
        ('side = "back"', 'side = "back"\nhems = [7]', "hems: [7]; allowed: numbers of edges"),
        ('side = "back"', 'side = "back"\n[body]\nhip_cm = 3', "body.hip_cm: 3; allowed: 40 to 250"),
    ],
)
def test_a_bad_word_is_one_line(tmp_path, old, new, said):
    file = band(tmp_path)
    words = file.with_suffix(".toml")
    words.write_text(words.read_text().replace(old, new, 1))
    with pytest.raises(InputError) as refused:
        read_dxf(file)
    assert said in str(refused.value)
    assert words.name in str(refused.value)
    assert "\n" not in str(refused.value)


def test_bad_files_are_one_line(tmp_path):
    for name, data in {
        "empty": b"",
        "text": b"no drawing at all\n",
        "binary": bytes(range(256)) * 40,
        "cut": SAMPLE.read_bytes()[:9000],
        "nothing": b"0\nSECTION\n2\nENTITIES\n0\nENDSEC\n0\nEOF\n",
    }.items():
        file = tmp_path / f"{name}.dxf"
        file.write_bytes(data)
        with pytest.raises(InputError) as refused:
            read_pieces(file)
        assert "\n" not in str(refused.value)
        assert file.name in str(refused.value)
    shutil.copy(SAMPLE, tmp_path / "alone.dxf")
    with pytest.raises(InputError, match=r"no alone\.toml beside it"):
        read_dxf(tmp_path / "alone.dxf")
    with pytest.raises(InputError, match="cannot be read"):
        read_dxf(tmp_path / "missing.dxf")


def test_sizes_are_chosen(tmp_path):
    document = new_document()
    add_piece(document, "ONE", box(0.3, 0.2), size="38")
    add_piece(document, "ONE", box(0.4, 0.2), size="40")
    words = '[panels.one]\npiece = "ONE"\npart = "trunk"\n'
    with pytest.raises(InputError, match="size: missing, and ONE is there in several; known: 38, 40"):
        read_dxf(written(tmp_path, document, words))
    pattern = read_dxf(written(tmp_path, document, 'size = "40"\n' + words))
    assert max(map(length, pattern.panel("one").edges)) == pytest.approx(0.4, rel=1e-6)


def test_laid_turns_up_to_x():
    assert laid(np.array([[0.0, 1.0]])).tolist() == [[1000.0, -0.0]]
    assert along(laid(np.array([[0.0, 0.0], [0.0, 1.0]])), np.array([0.5])).tolist() == [[500.0, 0.0]]
