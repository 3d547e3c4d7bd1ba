"""WIF drafts: every file of the dtx-to-wif wheel and ours, against drawdowns worked out here from their text alone."""

import importlib.metadata
import os
import time
from pathlib import Path

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.colour_order import srgb_to_linear
from taichi_cloth.weave.wif import read_wif
from taichi_cloth.weave.wif_text import MAX_BYTES

HERE = Path(__file__).parents[1]
MALFORMED = HERE / "malformed"
GOOD = (MALFORMED / "good.wif").read_text(encoding="utf-8")


def wheel_files() -> list[Path]:
    listed = importlib.metadata.files("dtx-to-wif") or []
    return sorted(Path(str(f.locate())) for f in listed if f.name.endswith(".wif"))


VALID = [f for f in wheel_files() if f.parent.name != "bad_wif"] + sorted((HERE / "data" / "wif").glob("*.wif"))
REFUSED = [f for f in wheel_files() if f.parent.name == "bad_wif"]


def tiny_ini(text: str) -> dict[str, dict[str, str]]:
    found: dict[str, dict[str, str]] = {}
    here: dict[str, str] = {}
    for line in text.splitlines():
        line = line.strip()
        if line.startswith("[") and line.endswith("]"):
            here = found.setdefault(line.strip("[]").lower(), {})
        elif line and not line.startswith(";"):
            here[line.split("=")[0].strip().lower()] = line.partition("=")[2].strip()
    return found


def drawdown(text: str) -> np.ndarray:
    """Straight from the definition, crossing by crossing."""
    ini = tiny_ini(text)

    def numbers(section: str, key: int) -> set[int]:
        said = ini.get(section, {}).get(str(key), "")
        return {int(n) for n in said.split(",") if n} - {0}

    ends, picks = int(ini["warp"]["threads"]), int(ini["weft"]["threads"])
    threaded = [numbers("threading", j + 1) for j in range(ends)]
    up = np.zeros((picks, ends), dtype=bool)
    for i in range(picks):
        lifted = numbers("liftplan", i + 1)
        for treadle in numbers("treadling", i + 1):
            lifted = lifted | numbers("tieup", treadle)
        up[i] = [bool(lifted & shafts) for shafts in threaded]
    rising = ini["weaving"].get("rising shed", "true").lower() in ("true", "yes", "on", "1")
    return up if rising else ~up


def test_the_wheel_carries_its_46_files():
    assert (len(VALID) - 2, len(REFUSED)) == (30, 16)


@pytest.mark.parametrize("path", VALID, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_drawdown_of_valid_files(path):
    draft = read_wif(path)
    np.testing.assert_array_equal(draft.warp_up, drawdown(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("path", VALID, ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_colours_of_valid_files(path):
    draft, ini = read_wif(path), tiny_ini(path.read_text(encoding="utf-8"))
    for family, colours in (("warp", draft.warp_colour), ("weft", draft.weft_colour)):
        assert colours is not None
        for k, found in enumerate(colours):
            own = ini.get(f"{family} colors", {}).get(str(k + 1), "")
            number = own or ini[family].get("color", "")
            if number in ini["color table"]:
                rgb = [int(v) for v in ini["color table"][number].split(",")]
                np.testing.assert_allclose(found, srgb_to_linear(np.array(rgb) / 255), rtol=1e-6)


@pytest.mark.parametrize("path", REFUSED, ids=lambda p: p.stem)
def test_malformed_files_of_the_wheel(path):
    words = {
        "default warp color missing": "[WARP] has no default Color",
        "default warp color too big": "[WARP] color = '11'",
        "default warp color too small": "[WARP] color = '0'",
        "default weft color missing": "[WEFT] has no default Color",
        "default weft color too big": "[WEFT] color = '11'",
        "default weft color too small": "[WEFT] color = '0'",
        "missing liftplan": "[LIFTPLAN]",
        "missing tieup": "missing or empty: [TIEUP]",
        "missing treadling": "missing or empty: [TREADLING]",
        "missing_color_table_warp": "[COLOR TABLE]",
        "missing_color_table_weft": "[COLOR TABLE]",
        "too many treadles in treadline": "treadle 7; allowed: 0 to 6",
        "warp_color too big": "no colour 11",
        "warp_color too small": "colour 0",
        "weft_color too big": "no colour 11",
        "weft_color too small": "colour 0",
    }
    assert words[path.stem] in refusal(path)


def refusal(path) -> str:
    with pytest.raises(InputError) as error:
        read_wif(path)
    message = str(error.value)
    assert str(path) in message
    assert "\n" not in message
    assert len(message) < 250 + len(str(path))
    return message


EXPECTED = {
    "billion-ends.wif": "the number of threads 1000000000; allowed: 1 to 100000",
    "circular-interpolation.wif": "'%(2)s': shaft is not a whole number",
    "colour-beyond-table.wif": "[WARP COLORS] 4 = '7': no colour 7 in [COLOR TABLE]",
    "colour-nan.wif": "'0,0,nan': colour value is not a whole number",
    "colour-out-of-range.wif": "colour value 300; allowed: 0 to 255",
    "colour-two-numbers.wif": "a colour is three numbers",
    "colour-zero.wif": "colour 0; allowed: from 1",
    "cut-in-heading.wif": "line 45: heading '[COLOR' has no ]",
    "cut-in-tieup.wif": "promises [TREADLING], which is missing; is the file cut short?",
    "cut-in-treadling.wif": "ends at 2 of 4 threads in [TREADLING]; is the file cut short?",
    "default-colour-beyond-table.wif": "[WEFT] color = '9': default colour 9 is not in [COLOR TABLE]",
    "ebcdic.wif": "no [WIF] section",
    "empty.wif": "the file is empty",
    "end-beyond-count.wif": "[THREADING] 9 = '1': end 9; allowed: 1 to 8",
    "endless-digits.wif": "99...; allowed: 1 to 100000",
    "half-an-end.wif": "'8.5': the number of threads is not a whole number",
    "list-with-a-hole.wif": "'1,,2': shaft is not a whole number",
    "million-shafts.wif": "shafts 1000000; allowed: 0 to 4096",
    "negative-ends.wif": "the number of threads is negative",
    "no-colour-table.wif": "promises [COLOR TABLE], which is missing",
    "no-threading.wif": "promises [THREADING], which is missing",
    "no-tieup-undeclared.wif": "needs [TIEUP] and [TREADLING], or [LIFTPLAN]; missing or empty: [TIEUP], [LIFTPLAN]",
    "no-treadling.wif": "promises [TREADLING], which is missing",
    "no-wif-section.wif": "no [WIF] section; is this a WIF file?",
    "not-a-draft.wif": "no [WIF] section",
    "nothing-threaded.wif": "[THREADING] is empty",
    "only-wif-heading.wif": "[THREADING] is missing",
    "pick-beyond-count.wif": "pick 5; allowed: 1 to 4",
    "png-image.wif": "binary data",
    "random-bytes.wif": "binary data",
    "range-backwards.wif": "the first must be below the second",
    "range-one-number.wif": "two numbers are needed",
    "rising-maybe.wif": "'maybe': allowed: true or false",
    "section-refers-to-section.wif": "'[TREADLING]': shaft is not a whole number",
    "shaft-99-of-8.wif": "line 61: [THREADING] 5 = '99': shaft 99; allowed: 0 to 8",
    "shaft-negative.wif": "shaft is negative",
    "shaft-word.wif": "'one': shaft is not a whole number",
    "spacing-infinite.wif": "allowed: 0.001 mm to 1 m",
    "spacing-nan.wif": "'NaN': is not a number",
    "spacing-negative.wif": "'-0.06'",
    "spacing-of-a-mile.wif": "allowed: 0.001 mm to 1 m",
    "thickness-word.wif": "'thin': is not a number",
    "thread-key-word.wif": "[THREADING] first = '1': end is not a whole number",
    "thread-key-zero.wif": "end 0; allowed: 1 to 8",
    "tieup-beyond-shafts.wif": "shaft 5; allowed: 0 to 4",
    "too-many-crossings.wif": "100000 ends × 90000 picks; allowed: up to 200000000 crossings",
    "treadle-beyond-count.wif": "treadle 7; allowed: 0 to 4",
    "units-furlongs.wif": "allowed: decipoints, inches, centimeters",
    "utf16-odd-length.wif": "marked as utf-16 text, but it is not",
    "utf8-mark-but-latin1.wif": "marked as utf-8 text, but it is not",
    "warp-missing-though-promised.wif": "promises [WARP], which is missing",
    "zero-ends.wif": "the number of threads 0; allowed: 1 to 100000",
    "zero-picks.wif": "[WEFT] threads = '0'",
}


def test_the_corpus_is_whole():
    assert {f.name for f in MALFORMED.glob("*.wif")} == {"good.wif", *EXPECTED}
    assert len(EXPECTED) >= 30


@pytest.mark.parametrize("name", EXPECTED)
def test_malformed_drafts(name):
    assert EXPECTED[name] in refusal(MALFORMED / name)


def test_no_file_folder_and_other_things(tmp_path):
    assert "No such file" in refusal(tmp_path / "absent.wif")
    assert "is a folder" in refusal(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        read_wif("null\0byte.wif")
    with pytest.raises(InputError, match="cannot be read"):
        read_wif("x" * 5000)
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.wif")  # opening it would wait for ever
        assert "no regular file" in refusal(tmp_path / "pipe.wif")
    locked = tmp_path / "loop.wif"
    locked.symlink_to(locked)
    assert "cannot be read" in refusal(locked)


def test_a_file_too_large_is_not_read(tmp_path):
    path = tmp_path / "large.wif"
    with path.open("wb") as file:
        file.truncate(10**12)
    began = time.process_time()
    assert f"up to {MAX_BYTES:,}" in refusal(path)
    assert time.process_time() - began < 1


def test_the_good_draft(tmp_path):
    draft = read_wif(MALFORMED / "good.wif")
    by_hand = ["##..##..", ".##..##.", "..##..##", "#..##..#"]
    np.testing.assert_array_equal(draft.warp_up, [[c == "#" for c in row] for row in by_hand])
    assert draft.name == "straight draw"
    assert draft.notes == ()
    assert draft.warp_spacing_m is not None
    assert draft.weft_spacing_m is not None
    assert draft.warp_thickness_m is not None
    assert draft.weft_thickness_m is None
    np.testing.assert_allclose(draft.warp_spacing_m, 36 * 0.0254 / 720)  # a decipoint is a tenth of 1/72 inch
    np.testing.assert_allclose(draft.warp_thickness_m, 18 * 0.0254 / 720)
    np.testing.assert_allclose(draft.weft_spacing_m, [0.5e-3, 0.6e-3, 0.5e-3, 0.5e-3])
    navy = srgb_to_linear(np.array([0, 0, 128]) / 255)
    assert draft.warp_colour is not None
    np.testing.assert_allclose(draft.warp_colour[[2, 3]], [navy, navy])
    np.testing.assert_allclose(draft.warp_colour[[0, 1, 4, 5, 6, 7]], 1)


def changed(tmp_path, *changes: tuple[str, str], encoding: str = "utf-8"):
    text = GOOD
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "draft.wif"
    path.write_bytes(text.encode(encoding))
    return read_wif(path)


SAME_DRAFT = {
    "junk before": [("[WIF]", "From: a friend\n\n[Mail]\nx\n[WIF]")],
    "case": [("[WEAVING]", "[Weaving]"), ("[COLOR TABLE]", "[color table]"), ("Threads=8", "THREADS = 8")],
    "comments": [("[TIEUP]\n", "; a comment\n# another\n[TIEUP]\n")],
    "duplicates": [("[THREADING]\n", "[THREADING]\n1=4\n")],
    "no equals": [("[WARP COLORS]\n", "[WARP COLORS]\n7\n8 \n")],
    "percent": [("Title=straight draw", "Title=100% cotton %(title)s")],
    "rising on": [("Rising Shed=yes", "Rising Shed=On")],
    "signs": [("1=1\n", "1=+1\n")],
    "private": [("[TIEUP]", "[PRIVATE X]\n1=99\n[TIEUP]")],
    "dos": [("\n", "\r\n")],
    "range 999": [("Range=0,255", "Range=0,999"), ("1=255,255,255", "1=999,999,999")],
    "liftplan too": [("[TREADLING]", "[LIFTPLAN]\n1=1,2\n2=2,3\n3=3,4\n4=1,4\n[TREADLING]")],
    "no range": [("Range=0,255\n", "")],
    "no palette": [("[COLOR PALETTE]\nRange=0,255\nEntries=2\n", "")],
    "no shafts": [("Shafts=4\n", ""), ("Treadles=4\n", "")],
    "no threads": [("Threads=8\n", ""), ("Threads=4\n", "")],
    "gap in table": [("2=0,0,128", "9=0,0,128"), ("Color=2", "Color=9"), ("3=2\n4=2", "3=9\n4=9")],
}


@pytest.mark.parametrize("what", SAME_DRAFT)
def test_what_programs_are_known_to_write(tmp_path, what):
    np.testing.assert_array_equal(
        changed(tmp_path, *SAME_DRAFT[what]).warp_up, read_wif(MALFORMED / "good.wif").warp_up
    )


def test_sinking_shed_is_the_other_face(tmp_path):
    sinking = changed(tmp_path, ("Rising Shed=yes", "Rising Shed=0"))
    np.testing.assert_array_equal(sinking.warp_up, ~read_wif(MALFORMED / "good.wif").warp_up)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "utf-32"])
def test_encodings(tmp_path, encoding):
    draft = changed(tmp_path, ("straight draw", "gerade, schräg"), encoding=encoding)
    assert draft.name == "gerade, schräg"


def test_units_default_colour_and_commas(tmp_path):
    draft = changed(
        tmp_path, ("Units=Decipoints", "Units=inches"), ("Spacing=36", "Spacing=0,05"),
        ("Thickness=18", "Thickness=.02"), ("Color=2", "Color=0,255,0,0"), ("2=0.06", "2=0"),
    )  # fmt: skip
    assert draft.warp_spacing_m is not None
    assert draft.warp_thickness_m is not None
    assert draft.weft_spacing_m is not None
    assert draft.weft_colour is not None
    np.testing.assert_allclose(draft.warp_spacing_m, 0.05 * 0.0254)
    np.testing.assert_allclose(draft.warp_thickness_m, 0.02 * 0.0254)
    np.testing.assert_allclose(draft.weft_spacing_m, 0.5e-3)
    np.testing.assert_allclose(draft.weft_colour, [[1, 0, 0]] * 4)


def test_oddities_are_noted(tmp_path):
    plain = changed(
        tmp_path, ("Units=Decipoints\n", ""), ("Color=1\n", ""), ("Color=2\n", ""), ("[WARP COLORS]\n3=2\n4=2\n", ""),
        ("[COLOR TABLE]\n1=255,255,255\n2=0,0,128\n", ""), ("COLOR TABLE=yes\n", ""), ("8=4\n", ""),
    )  # fmt: skip
    assert plain.warp_colour is None
    assert plain.weft_colour is None
    assert plain.warp_spacing_m is None
    notes = " | ".join(plain.notes)
    for words in (
        "warp spacing left out",
        "promises [WARP COLORS]",
        "1 of 8 ends are on no shaft",
        "would fall off the cloth: 8",
    ):
        assert words in notes


def test_a_private_section_at_the_end_is_no_cut(tmp_path):
    path = tmp_path / "private.wif"
    path.write_text(GOOD.removesuffix("4=4\n") + "[PRIVATE X]\nkey=value")
    short, whole = read_wif(path), read_wif(MALFORMED / "good.wif")
    np.testing.assert_array_equal(short.warp_up[:3], whole.warp_up[:3])
    assert not short.warp_up[3].any()
    assert "1 of 4 picks lift nothing" in short.notes


@pytest.mark.parametrize("source", ["good", "schort"])
def test_any_cut_or_spoilt_byte_gives_a_draft_or_one_line(tmp_path, source):
    data = (MALFORMED / "good.wif" if source == "good" else HERE / "data" / "wif" / "schort.wif").read_bytes()
    rng = np.random.default_rng(7)
    path = tmp_path / "draft.wif"
    loaded = refused = 0
    for trial in range(250):
        at = int(rng.integers(len(data)))
        spoilt = data[:at] if trial % 2 else data[:at] + bytes([int(rng.integers(256))]) + data[at + 1 :]
        path.write_bytes(spoilt)
        try:
            read_wif(path)
            loaded += 1
        except InputError:
            refused += 1
    assert loaded > 10
    assert refused > 10


def test_the_largest_files_take_seconds(tmp_path):
    many = 60_000
    rows = "".join(f"{k + 1}={k % 8 + 1}\n" for k in range(many))
    text = f"[WIF]\n[WARP]\nThreads={many}\n[WEFT]\nThreads=8\n[THREADING]\n{rows}[LIFTPLAN]\n"
    path = tmp_path / "wide.wif"
    path.write_text(text + "".join(f"{k + 1}={k + 1}\n" for k in range(8)))
    began = time.process_time()
    draft = read_wif(path)
    assert time.process_time() - began < 5
    np.testing.assert_array_equal(draft.warp_up, np.tile(np.eye(8, dtype=bool), many // 8))
