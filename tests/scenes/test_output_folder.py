"""Folders that commands write into: others' files stay, one run at a time, and what a killed run left goes."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.render.image.image import png_is_whole, write_png
from taichi_cloth.scenes.commands.output_folder import OutputFolder
from taichi_cloth.scenes.commands.run import run
from taichi_cloth.scenes.commands.sequence import Sequence, fingerprint
from taichi_cloth.scenes.commands.still import still
from taichi_cloth.scenes.measure.page import check_folder
from taichi_cloth.scenes.paper.figures import make_figures
from taichi_cloth.scenes.scene.load import load_scene

THEIRS = b"somebody's picture"
QUIET = {"size": None, "arch": "cpu", "threads": None}


def started(command: str, scene: str, out: Path) -> None:
    if command == "still":
        still(scene, [], passes="colour", form="png", supersample=1, out=out, **QUIET)
    elif command == "figures":
        make_figures(out=out, only="9", quick=True)
    else:
        run(command, scene, ["output.webp=true"], out=out, resume=False, **QUIET)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("command", "scene", "file"),
    [
        ("turntable", "plain", "sheet.png"),
        ("turntable", "plain", "turntable.mp4"),
        ("turntable", "plain", "turntable.webp"),
        ("zoom", "plain", "zoom.mp4"),
        ("animate", "flag", "animate.mp4"),
        ("animate", "flag", "state.npz"),
        ("still", "plain", "colour.png"),
        ("still", "plain", "still.json"),
        ("figures", "", "figure-09.png"),
        ("figures", "", "index.html"),
    ],
)
def test_no_command_replaces_what_this_program_did_not_make(
    command: str, scene: str, file: str, tmp_path: Path
) -> None:
    (tmp_path / file).write_bytes(THEIRS)
    with pytest.raises(InputError, match=f"holds a {file} that this program did not make; move it away"):
        started(command, scene, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [file]
    assert (tmp_path / file).read_bytes() == THEIRS


def test_a_report_with_somebodys_file_beside_it_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "report.md").write_text("Rows: [solver.csv](solver.csv)\n")
    for name in ("index.html", "solver.csv"):
        (tmp_path / name).write_text("")
    check_folder(tmp_path)
    (tmp_path / "notes.txt").write_bytes(THEIRS)
    with pytest.raises(InputError, match=r"holds notes\.txt beside a report"):
        check_folder(tmp_path)


def test_only_what_is_claimed_counts_as_made(tmp_path: Path) -> None:
    with OutputFolder(tmp_path / "new") as held:
        held.make()
        held.claim(["sheet.png"])
        write_png(held.path / "sheet.png", np.zeros((2, 2, 3), np.uint8))
        held.claim(["sheet.png", "turntable.mp4"])
        assert held.made() == {"sheet.png", "turntable.mp4"}
        (held.path / "zoom.mp4").write_bytes(THEIRS)
        with pytest.raises(InputError, match=r"holds a zoom\.mp4"):
            held.claim(["zoom.mp4"])


@pytest.mark.parametrize("ledger", [b"", b"[]", b'{"files": 3}', b"[" * 100_000, b"\xff"])
def test_a_broken_list_of_what_was_made_makes_everything_foreign(ledger: bytes, tmp_path: Path) -> None:
    (tmp_path / "made.json").write_bytes(ledger)
    (tmp_path / "sheet.png").write_bytes(THEIRS)
    with OutputFolder(tmp_path) as held, pytest.raises(InputError, match=r"holds a sheet\.png"):
        held.claim(["sheet.png"])


@pytest.mark.skipif(sys.platform == "win32", reason="locks of POSIX")
def test_two_runs_cannot_write_into_one_folder_and_a_killed_one_does_not_block(tmp_path: Path) -> None:
    code = (
        "import sys, time; from pathlib import Path\n"
        "from taichi_cloth.scenes.commands.output_folder import OutputFolder\n"
        "held = OutputFolder(Path(sys.argv[1])); held.make(); print('held', flush=True); time.sleep(600)"
    )
    folder = tmp_path / "out"
    with subprocess.Popen([sys.executable, "-P", "-c", code, str(folder)], stdout=subprocess.PIPE, text=True) as other:
        try:
            assert other.stdout is not None
            assert other.stdout.readline() == "held\n"
            with pytest.raises(InputError, match="another run is writing into it; wait for its end, or choose another"):
                OutputFolder(folder)
            other.send_signal(signal.SIGKILL)
            other.wait(60)
        finally:
            other.kill()
    with OutputFolder(folder) as held:
        held.make()
    assert list(folder.iterdir()) == []


def test_a_file_system_without_locks_is_written_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fcntl = pytest.importorskip("fcntl")

    def none(*_: object) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", none)
    with OutputFolder(tmp_path) as held:
        held.make()


def test_parts_that_a_killed_run_left_go_and_others_stay(tmp_path: Path) -> None:
    ours = (".frame_0001.png.abc_1.part", ".turntable.x2y.part.mp4", ".state.npz.4711.part", ".sequence.json.q.part")
    theirs = (".notes.part", ".holiday.png.abc.part", ".film.x2y.part.mp4", "frame.part")
    for name in (*ours, *theirs):
        (tmp_path / name).write_bytes(b"half")
    with OutputFolder(tmp_path) as held:
        Sequence.open(held, "a", 3, ["turntable.mp4"], resume=True).begin()
    assert {path.name for path in tmp_path.iterdir()} == {*theirs, "made.json", "sequence.json"}


def test_a_damaged_frame_is_named_and_what_to_do(tmp_path: Path) -> None:
    image = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    with OutputFolder(tmp_path) as held:
        sequence = Sequence.open(held, "a", 2, resume=False)
        sequence.begin()
        list(sequence.write([(0, image), (1, image)]))
    path = tmp_path / "frame_0001.png"
    whole = path.read_bytes()
    assert png_is_whole(path)
    for damaged in (b"", whole[:-1], whole[:40], whole[:50] + bytes([whole[50] ^ 1]) + whole[51:], b"GIF" + whole[3:]):
        path.write_bytes(damaged)
        with (
            OutputFolder(tmp_path) as held,
            pytest.raises(InputError, match=r"frame_0001\.png is damaged; delete it, and it is made again"),
        ):
            Sequence.open(held, "a", 2, resume=True)


@pytest.mark.usefixtures("keep_taichi")
def test_a_damaged_state_says_what_to_delete(tmp_path: Path) -> None:
    mesh = ["cloth.representation=mesh", "cloth.rows=8", "cloth.columns=8", "output.frames=2", "output.size=[64, 48]"]
    scene = load_scene("flag", mesh)
    with OutputFolder(tmp_path) as held:
        products = ["animate.mp4", "sheet.png", "state.npz"]
        Sequence.open(held, fingerprint(scene, "animate"), 2, products, resume=False).begin()
    state = tmp_path / "state.npz"
    state.write_bytes(b"PK\x03\x04" + os.urandom(100))
    with pytest.raises(InputError, match=r"^--resume: .*state\.npz.*; delete .*state\.npz and the motion is computed"):
        run("animate", "flag", mesh, out=tmp_path, resume=True, **QUIET)
