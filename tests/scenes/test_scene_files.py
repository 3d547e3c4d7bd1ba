"""Scenes: the built-in ones stand, and whatever a person gets wrong earns one clear line and exit code 2."""

import importlib.metadata
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from taichi_cloth.fibre.contours import FIBRES
from taichi_cloth.ground.errors import InputError
from taichi_cloth.scenes import __main__ as command_line
from taichi_cloth.scenes.plan.plan import plan
from taichi_cloth.scenes.prepare.drawing import picture_bytes
from taichi_cloth.scenes.prepare.yarns import yarn_of
from taichi_cloth.scenes.scene.load import built_in_scenes, load_scene
from taichi_cloth.scenes.scene.schema import YarnSection

MALFORMED = Path(__file__).parents[1] / "malformed_scenes"
DRAFT = Path(__file__).parents[1] / "data" / "wif" / "schort.wif"
Run = Callable[..., str]


@pytest.fixture
def refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run the command line in an empty folder: exit code 2, one line, nothing else said or written. Gives the line."""
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)

    def run(*arguments: str) -> str:
        before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
        status = command_line._status(list(arguments))
        out, err = capsys.readouterr()
        assert (status, out) == (2, "")
        assert err.startswith("taichi-cloth: ")
        assert err.endswith("\n")
        assert len(err.splitlines()) == 1, err
        assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before
        return err

    return run


FILES = {
    "binary": "not UTF-8",
    "utf16": "not UTF-8",
    "latin1": "not UTF-8",
    "truncated-string": "not TOML: Unterminated string",
    "truncated-table": "not TOML: Expected ']'",
    "cut-after-equals": "not TOML: Invalid value",
    "ini-not-toml": "not TOML: Expected '=' after a key",
    "json-not-toml": "not TOML: Invalid statement",
    "key-twice": "not TOML: Cannot overwrite a value",
    "section-twice": "not TOML: Cannot declare",
    "value-then-section": "not TOML: Cannot overwrite a value",
    "seed-too-many-digits": "not TOML: Exceeds the limit",
    "seed-negative": "seed: -1; allowed: greater than or equal to 0",
    "yarn-is-a-number": "yarn: 3; allowed: a section, with count_tex, count_ne,",
    "weave-is-a-list": "weave: ['plain', 'twill']; allowed: a section, with draft,",
    "weave-is-a-date": "weave: datetime.date(1979, 5, 27); allowed: a section",
    "cyclic": "yarn.hairiness.hairiness: unknown key; known: ends_per_m,",
    "unknown-section": 'camara: unknown key; known: title,|(did you mean "camera"?)',
    "unknown-key": 'weave.endz: unknown key; known: draft,|(did you mean "ends"?)',
    "unknown-deep-key": 'yarn.hairiness.ends_per_meter: unknown key|(did you mean "ends_per_m"?)',
    "ends-are-words": "weave.ends: 'many'; allowed: a valid integer",
    "ends-are-half": "weave.ends: 6.5; allowed: a valid integer",
    "ends-in-a-list": "weave.ends: [6]; allowed: a valid integer",
    "no-ends": "weave.ends: 0; allowed: a whole number from 1",
    "no-picks": "weave.picks: 0; allowed: a whole number from 1",
    "negative-ends": "weave.ends: -6; allowed",
    "billion-ends": "1000000000 ends × 6 picks|allowed: up to",
    "billion-both": "1000000000 ends × 1000000000 picks|allowed: up to",
    "nan-count": "yarn.count_tex: nan; allowed: a finite number",
    "infinite-count": "yarn.count_tex: inf; allowed: a finite number",
    "zero-count": "yarn.count_tex: 0; allowed: greater than 0",
    "negative-twist": "yarn.twist_per_m: -3; allowed",
    "two-counts": "count_tex and count_ne are two names for one thing",
    "twist-q": "yarn.twist: 'Q'; allowed: 'S' or 'Z'",
    "weave-and-twist": "either [weave] or [twist], not both",
    "fabric-without-weave": "[fabric] needs [weave]; add it",
    "weave-without-yarn": "are made of [yarn]; add it",
    "twist-without-yarn": "are made of [yarn]; add it",
    "unknown-fibre": "fibre.kind: unknown fibre 'coton'|(did you mean \"cotton\"?)",
    "unknown-weave": "unknown weave 'twil-2/2'; known: plain,|(did you mean \"twill-2/2\"?)",
    "unknown-finish": "light.finish: unknown material 'sikl'|(did you mean \"silk\"?)",
    "unknown-sprite": "fibre.sprite: unknown sprite 'thred'; known: thread,|(did you mean \"thread\"?)",
    "unknown-colour": "yarn.colour: |unknown colour 'navvy'|(did you mean \"navy\"?)",
    "unknown-thread-colour": "weave.warp_colours|unknown colour 'navvy'|(did you mean \"navy\"?)",
    "unknown-pose": "fabric.pose: 'wavy'; allowed: 'flat', 'wave' or 'roll' (did you mean \"wave\"?)",
    "half-a-colour": "light.background: |'#ff' is not a colour",
    "one-background": "light.background.1: is missing",
    "sprite-file-missing": "fibre.sprite: |no-such.png: cannot be read (No such file",
    "sprite-is-text": "fibre.sprite: |not-a.png: not an image that can be read|PNG with an alpha channel",
    "sprite-null-byte": "fibre.sprite: |embedded null byte",
    "size-nothing": "size: 0x0; allowed: 1x1 to 16384x16384",
    "size-too-wide": "size: 20000x1; allowed",
    "fps-0": "output.fps: 0; allowed",
    "sphere-of-three": "fibre.spheres.0.3: is missing",
    "sphere-infinite": "fibre.spheres.0.2: inf; allowed: a finite number",
    "sphere-inside-out": "fibre.spheres: row 1 is (0.0, 0.0, 0.0, -1.0)|r > 0",
    "no-spheres": "fibre.spheres: 0 spheres",
    "spacing-of-atoms": "lattice points, the limit is 5e+07",
    "threads-jammed": "jam at 400.0 ends/cm|as which no yarn is pressed",
    "draft-missing": "weave.draft: |no-such.wif: cannot be read (No such file",
    "draft-is-this-file": "unknown weave 'draft-is-this-file.toml'",
    "draft-null-byte": "embedded null byte",
    "draft-name-endless": "xxxx.wif|too long",
}
"""Scene file: the words its line must hold, parted by |."""


def test_the_table_names_every_malformed_scene() -> None:
    assert sorted(FILES) == sorted(path.stem for path in MALFORMED.glob("*.toml"))


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("command", ["plan", "turntable"])
def test_a_malformed_scene_is_refused(command: str, name: str, refused: Run) -> None:
    line = refused(command, str(MALFORMED / f"{name}.toml"))
    for words in FILES[name].split("|"):
        assert words.lower() in line.lower()


COMMANDS = [
    (["plan", "swach"], "scene: unknown scene 'swach'; known: closeup,|(did you mean \"swatch\"?)"),
    (["plan", "x" * 5000], "scene: unknown scene"),
    (["plan", "no/such.toml"], "no/such.toml: cannot be read (No such file"),
    (["plan", "x" * 5000 + ".toml"], "cannot be read (File name too long)"),
    (["plan", "/dev/zero"], "/dev/zero: is no regular file"),
    (["plan", "/"], "/: is a folder"),
    (["plan", "\udcff\x1b[2J"], "unknown scene"),
    (["plan", "\udcff/\x1b[2J.toml"], "\\udcff/\\x1b[2J.toml: cannot be read"),
    (["plan", "plain", "--set", "weave.ends"], "--set weave.ends: expected key=value"),
    (["plan", "plain", "--set", "=3"], "--set =3: expected key=value"),
    (["plan", "plain", "--set", "weave..ends=3"], "expected key=value"),
    (["plan", "plain", "--set", "weave.draft.x=3"], "draft is a value, not a section"),
    (["plan", "plain", "--set", "a." * 5000 + "a=3"], "a key has at most 8 parts"),
    (["plan", "plain", "--set", "weave.ends=0"], "weave.ends: 0; allowed"),
    (["plan", "plain", "--set", "weave.ends=1000000000"], "1000000000 ends"),
    (["plan", "plain", "--set", "weave.ends="], "weave.ends: ''; allowed: a valid integer"),
    (["plan", "plain", "--set", "weave.ends=\ud800"], "weave.ends: '\\ud800'"),
    (["plan", "plain", "--set", "yarn.count_tex=nan"], "yarn.count_tex: nan; allowed: a finite number"),
    (["plan", "plain", "--set", "seed=" + "9" * 5000], "seed: "),
    (["plan", "plain", "--set", "fibre.spheres=" + "[" * 5000], "fibre.spheres: "),
    (["plan", "plain", "--set", "fibre.spheres=" + "[" * 200 + "]" * 200], "fibre.spheres"),
    (["plan", "plain", "--set", "fabric.ends_per_cm=1e308"], "warp_spacing_m: 0"),
    (["plan", "plain", "--set", "weave.drft=plain"], 'weave.drft: unknown key|(did you mean "draft"?)'),
    (["plan", "plain", "--set", "light.finish=wol"], '(did you mean "wool"?)'),
    (["plan", "tshirt", "--set", "weave.draft=mine.wif"], "weave.draft: mine.wif: cannot be read (No such file"),
    (["plan", "mine.wif"], "mine.wif: cannot be read (No such file"),
    (["plan", "plain", "--set", "camera.width=1080"], "camera.width: unknown key|did you mean output.size, or --size"),
    (["plan", "drape", "--set", "cloth.width=2"], 'cloth.width: unknown key|did you mean "width_m"'),
    (["plan"], "missing argument"),
    (["plan", "plain", "twill"], "unexpected extra argument"),
    (["plna", "plain"], "no such command"),
    (["turntable", "plain", "--sise", "64x48"], "no such option"),
    (["turntable", "plain", "--views", "many"], "invalid value"),
    (["turntable", "plain", "--views", "0"], "output.views: 0; allowed"),
    (["turntable", "plain", "--views", "1000000000"], "output.views: 1000000000; allowed"),
    (["turntable", "plain", "--size", "big"], "--size: 'big'; allowed: WIDTHxHEIGHT"),
    (["turntable", "plain", "--size", ""], "--size: ''; allowed"),
    (["turntable", "plain", "--size", "0x0"], "--size: '0x0'; allowed"),
    (["turntable", "plain", "--size", "20000x1"], "--size: '20000x1'; allowed"),
    (["turntable", "plain", "--size", "-64x48"], "--size: '-64x48'; allowed"),
    (["turntable", "plain", "--size", "६४x४८"], "--size: "),
    (["turntable", "plain", "--size", "9" * 5000 + "x1"], "--size: "),
    (["turntable", "plain", "--out", "x" * 5000], "--out xxx|cannot be written (File name too long)"),
    (["turntable", "plain", "--out", "/dev/null/deep"], "cannot be written (/dev/null is a file)"),
    (["turntable", "plain", "--threads", "0"], "--threads: 0; allowed: 1 to 1024"),
    (["turntable", "plain", "--arch", "gpus"], "--arch: unknown device 'gpus'|(did you mean \"gpu\"?)"),
    (["animate", "plain"], "animate: plain stands still; use turntable"),
    (["animate", "twist", "--frames", "0"], "output.frames: 0; allowed"),
    (["animate", "twist", "--set", "twist.speed_mm_per_s=-3"], "twist.speed_mm_per_s: -3"),
    (["profile", "plain", "--repeats", "0"], "--repeats: 0; allowed"),
]


@pytest.mark.parametrize(
    ("arguments", "says"), COMMANDS, ids=[" ".join(a)[:60].encode("ascii", "replace").decode() for a, _ in COMMANDS]
)
def test_a_malformed_command_is_refused(arguments: list[str], says: str, refused: Run) -> None:
    line = refused(*arguments)
    for words in says.split("|"):
        assert words.lower() in line.lower()


def test_a_scene_of_nothing_is_the_default_fibre(tmp_path: Path) -> None:
    (tmp_path / "empty.toml").write_bytes(b"")
    assert load_scene(str(tmp_path / "empty.toml")).subject == "fibre"


def test_a_huge_scene_file_is_refused_unread(tmp_path: Path, refused: Run) -> None:
    with open(tmp_path / "huge.toml", "wb") as file:
        file.truncate(50_000_000_000)  # a sparse file: reading it would take the machine's memory
    assert "50,000,000,000 bytes; allowed: up to 1,000,000" in refused("plan", str(tmp_path / "huge.toml"))


def test_a_deeply_nested_scene_file_is_refused(tmp_path: Path, refused: Run) -> None:
    (tmp_path / "deep.toml").write_text("title = " + "[" * 100_000)
    assert "nested too deeply" in refused("plan", str(tmp_path / "deep.toml"))
    (tmp_path / "deep.toml").write_text("a." * 10_000 + "b = 1\n")
    assert "a key of more than 32 parts" in refused("plan", str(tmp_path / "deep.toml"))


def test_an_output_folder_that_is_a_file_is_refused(tmp_path: Path, refused: Run) -> None:
    (tmp_path / "taken").write_text("mine")
    assert "is a file; give a folder" in refused("turntable", "plain", "--out", str(tmp_path / "taken"))
    assert "taken is a file" in refused("turntable", "plain", "--out", str(tmp_path / "taken" / "below"))
    assert (tmp_path / "taken").read_text() == "mine"


def test_foreign_frames_are_not_touched(tmp_path: Path, refused: Run) -> None:
    (tmp_path / "film").mkdir()
    (tmp_path / "film" / "frame_0002.png").write_text("mine")
    line = refused("turntable", "plain", "--views", "3", "--out", str(tmp_path / "film"))
    assert "holds frame_0002.png from elsewhere; choose another folder" in line


def test_too_large_for_the_machine_is_refused_with_estimate_and_limit(
    monkeypatch: pytest.MonkeyPatch, refused: Run
) -> None:
    monkeypatch.setenv("TAICHI_CLOTH_MEMORY_GB", "0.001")
    line = refused("turntable", "plain")
    assert "needs about 0." in line
    assert "the limit here is 0.0 GB" in line
    monkeypatch.setenv("TAICHI_CLOTH_MEMORY_GB", "plenty")
    assert "TAICHI_CLOTH_MEMORY_GB: 'plenty'; allowed" in refused("plan", "plain")


BAD_WIF = sorted(
    str(file.locate())
    for file in importlib.metadata.files("dtx-to-wif") or []
    if file.suffix == ".wif" and "bad_wif" in file.parts
)


def test_the_wheel_brings_its_malformed_drafts() -> None:
    assert len(BAD_WIF) == 16


@pytest.mark.parametrize("path", BAD_WIF, ids=lambda path: Path(path).stem)
def test_a_malformed_draft_is_refused(path: str, refused: Run) -> None:
    assert Path(path).name in refused("plan", "swatch", "--set", f"weave.draft={path}")


@pytest.mark.parametrize("name", built_in_scenes())
def test_a_built_in_scene_stands(name: str) -> None:
    assert built_in_scenes()[name].strip()
    scene = load_scene(name)
    planned = plan(scene)
    assert planned.particles > 0
    assert 0 < planned.bytes - picture_bytes(scene.output.size) < 3e9
    assert any(stage.built for stage in planned.stages)


def test_overrides_reach_the_scene() -> None:
    scene = load_scene("plain", ["weave.ends=7", "weave.draft=twill-2/2", "light.background=['white', 'black']"])
    assert scene.weave is not None
    assert (scene.weave.ends, scene.weave.draft, scene.light.background) == (7, "twill-2/2", ("white", "black"))


def test_a_draft_named_in_a_file_lies_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(os.sep)
    shutil.copy(DRAFT, tmp_path / "my.wif")
    (tmp_path / "mine.toml").write_text('[yarn]\ncount_tex = 20\n[weave]\ndraft = "my.wif"\n')
    scene = load_scene(str(tmp_path / "mine.toml"))
    assert scene.weave is not None
    assert scene.weave.draft == str(tmp_path / "my.wif")
    scene = load_scene(str(tmp_path / "mine.toml"), [f"weave.draft={DRAFT}"])
    assert scene.weave is not None
    assert scene.weave.draft == str(DRAFT)


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("yarn.epi=60", "did you mean fabric.ends_per_cm, ends an inch / 2.54?"),
        ("fabric.epc=24", "did you mean fabric.ends_per_cm?"),
        ("yarn.denier=20", "did you mean yarn.count, such as Ne 30 or 2/60 Nm?"),
        ("yarn.count=20 texx", "known: 30/2, Ne 30"),
        ("yarn.count=2/60", "write 2/60 Nm"),
        ("yarn.plis=2", 'did you mean "plies"'),
    ],
)
def test_words_of_the_trade_lead_to_the_key(refused: Run, override: str, line: str) -> None:
    assert line in refused("plan", "swatch", "--set", override)


def test_a_count_in_the_trades_words_replaces_the_scenes_own() -> None:
    yarn = yarn_of(load_scene("swatch", ["yarn.count=2/60 Nm"]).yarn or YarnSection(), FIBRES["wool"])
    assert (yarn.plies, yarn.resultant_tex) == (2, pytest.approx(1000 / 30))
    single = yarn_of(YarnSection(count="Ne 36", twist_multiplier=4.0), FIBRES["cotton"])
    assert (single.plies, single.twist_per_m) == (1, pytest.approx(24 / 0.0254))
    fine = yarn_of(YarnSection(count="dtex 167f48"), FIBRES["polyester"])
    assert fine.fineness_dtex == pytest.approx(167 / 48)
    with pytest.raises(InputError, match="plies of 2, plies is 3"):
        load_scene("swatch", ["yarn.count=30/2", "yarn.plies=3"])
    with pytest.raises(InputError, match="count and count_tex are two names for one thing"):
        load_scene("swatch", ["yarn.count=30/2", "yarn.count_tex=20"])
