"""Frames on disk: whole or not there, the same bytes every time, and a run that was cut off goes on."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.render.image.image import read_png
from taichi_cloth.scenes.__main__ import _status
from taichi_cloth.scenes.commands.output_folder import OutputFolder
from taichi_cloth.scenes.commands.sequence import Sequence, fingerprint
from taichi_cloth.scenes.scene.load import load_scene

WIF = Path(__file__).parents[1] / "data" / "wif" / "schort.wif"
COUNT = 4
TINY = ["plain", "--set", "weave.ends=6", "--set", "weave.picks=6", "--size", "64x48", "--views", "3"]
IN_PLAIN_LIGHT = [
    word for key in ("light.shadows", "light.occlusion", "stage.ground") for word in ("--set", f"{key}=false")
]
TURNTABLE_FILES = {
    "frame_0000.png",
    "frame_0001.png",
    "frame_0002.png",
    "made.json",
    "sequence.json",
    "sheet.png",
    "turntable.mp4",
}


def frames(numbers: list[int], shade: int = 0) -> Iterator[tuple[int, np.ndarray]]:
    for k in numbers:
        yield k, np.full((8, 8, 3), 10 * k + shade, np.uint8)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def made(folder: Path, mark: str, count: int = COUNT, *, resume: bool = False, shade: int = 0) -> list[int]:
    """A whole run. Gives the numbers of the frames that were drawn."""
    with OutputFolder(folder) as held:
        sequence = Sequence.open(held, mark, count, resume=resume)
        sequence.begin()
        return list(sequence.write(frames(sequence.missing(), shade)))


def looked_at(folder: Path, mark: str, count: int = COUNT, *products: str, resume: bool = False) -> Sequence:
    with OutputFolder(folder) as held:
        return Sequence.open(held, mark, count, products, resume=resume)


def cut_off(folder: Path, mark: str, count: int, after: int) -> None:
    """A run that fails while it draws frame number `after`."""

    def failing() -> Iterator[tuple[int, np.ndarray]]:
        yield from frames(list(range(after)))
        raise KeyboardInterrupt

    with OutputFolder(folder) as held:
        sequence = Sequence.open(held, mark, count, resume=False)
        sequence.begin()
        with pytest.raises(KeyboardInterrupt):
            list(sequence.write(failing()))


def test_a_run_that_was_cut_off_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    assert made(tmp_path / "whole", "a") == [0, 1, 2, 3]
    cut_off(tmp_path / "cut", "a", COUNT, after=2)
    assert set(contents(tmp_path / "cut")) == {"frame_0000.png", "frame_0001.png", "sequence.json"}
    assert made(tmp_path / "cut", "a", resume=True) == [2, 3]
    assert contents(tmp_path / "cut") == contents(tmp_path / "whole")


def test_without_resume_every_frame_is_drawn_again(tmp_path: Path) -> None:
    made(tmp_path, "a")
    assert made(tmp_path, "a") == [0, 1, 2, 3]
    assert made(tmp_path, "a", resume=True) == []


def test_another_command_cannot_resume_a_folder(tmp_path: Path) -> None:
    made(tmp_path, "a")
    before = contents(tmp_path)
    with pytest.raises(InputError, match="left by another scene, size or number of frames"):
        looked_at(tmp_path, "b", COUNT, resume=True)
    assert contents(tmp_path) == before


def test_an_old_frame_is_never_resumed_as_a_new_one(tmp_path: Path) -> None:
    made(tmp_path, "a", shade=100)
    cut_off(tmp_path, "b", COUNT, after=1)
    assert made(tmp_path, "b", resume=True) == [1, 2, 3]


def test_frames_of_a_longer_run_disappear_even_when_the_new_one_was_cut_off(tmp_path: Path) -> None:
    made(tmp_path, "a", count=9)
    with OutputFolder(tmp_path) as held:
        held.claim(["turntable.mp4"])
    (tmp_path / "turntable.mp4").write_bytes(b"of nine frames")
    cut_off(tmp_path, "b", 3, after=1)
    made(tmp_path, "b", count=3, resume=True)
    assert set(contents(tmp_path)) == {
        "frame_0000.png",
        "frame_0001.png",
        "frame_0002.png",
        "made.json",
        "sequence.json",
    }


def test_looking_at_a_folder_touches_nothing(tmp_path: Path) -> None:
    made(tmp_path, "a")
    before = contents(tmp_path)
    looked_at(tmp_path, "b", 2, resume=False)
    looked_at(tmp_path / "not" / "there", "b", 2, resume=False)
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    "manifest",
    [b"", b"{", b"[]", b'{"fingerprint": "a"}', b'{"fingerprint": "a", "frames": 1e999}', b"\xff", b"[" * 100_000]
    + [json.dumps({"fingerprint": "a", "frames": n}).encode() for n in (-1, 0, 10**12)],
)
def test_frames_beside_a_broken_manifest_count_as_foreign(manifest: bytes, tmp_path: Path) -> None:
    made(tmp_path, "a")
    (tmp_path / "sequence.json").write_bytes(manifest)
    before = contents(tmp_path)
    for resume in (False, True):
        with pytest.raises(InputError, match=r"holds frame_0000\.png from elsewhere"):
            looked_at(tmp_path, "a", COUNT, resume=resume)
    assert contents(tmp_path) == before


def test_the_manifest_is_replaced_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made(tmp_path, "a")
    old = (tmp_path / "sequence.json").read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    sequence = looked_at(tmp_path, "b", COUNT, resume=False)
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        with pytest.raises(InputError, match="No space left on device"):
            sequence.begin()
    assert contents(tmp_path) == {"sequence.json": old}


def test_the_fingerprint_tells_commands_scenes_and_drafts_apart(tmp_path: Path) -> None:
    draft, text = tmp_path / "my.wif", WIF.read_text()
    draft.write_text(text)
    scenes = [load_scene("plain", o) for o in ([], ["output.views=3"], ["output.size=[64, 48]"], ["seed=1"])]
    marks = [fingerprint(scene, "turntable") for scene in scenes] + [fingerprint(scenes[0], "animate")]
    mine = load_scene("plain", [f"weave.draft={draft}"])
    marks.append(fingerprint(mine, "turntable"))
    draft.write_text(f"{text}; another\n")
    marks.append(fingerprint(mine, "turntable"))
    assert len(set(marks)) == len(marks)
    assert fingerprint(load_scene("plain"), "turntable") == marks[0]


# ---- the whole command


def command(out: Path, *more: str, **options: Any) -> subprocess.CompletedProcess[str]:
    code = "from taichi_cloth.scenes.__main__ import main; main()"
    arguments = [sys.executable, "-P", "-c", code, "turntable", *TINY, "--out", str(out), *more]
    return subprocess.run(arguments, cwd=out.parent, capture_output=True, text=True, timeout=300, **options)


@pytest.mark.slow
def test_the_same_command_gives_the_same_bytes_on_any_number_of_threads(tmp_path: Path) -> None:
    runs = {1: tmp_path / "one", 3: tmp_path / "three"}
    for threads, folder in runs.items():
        done = command(folder, "--threads", str(threads))
        assert (done.returncode, done.stderr) == (0, "")
        assert "3 frames, turntable.mp4" in done.stdout.splitlines()[-1]
    first = contents(runs[1])
    assert set(first) == TURNTABLE_FILES
    assert len({first[f"frame_000{k}.png"] for k in range(3)}) == 3  # it turns
    assert contents(runs[3]) == first  # the video too


@pytest.mark.usefixtures("keep_taichi")
def test_resume_of_the_whole_command_gives_the_same_bytes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "out"

    def status(*more: str) -> int:
        return _status(["turntable", *TINY, "--out", str(folder), *more])

    assert status() == 0
    first = contents(folder)
    for name in ("frame_0001.png", "sheet.png", "turntable.mp4"):
        (folder / name).unlink()
    kept = (folder / "frame_0002.png").stat().st_mtime_ns
    assert status("--resume") == 0
    assert contents(folder) == first
    assert (folder / "frame_0002.png").stat().st_mtime_ns == kept
    assert status("--resume", "--set", "seed=1") == 2
    assert "left by another scene" in capsys.readouterr().err
    assert contents(folder) == first


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_leaves_whole_frames_and_resume_goes_on(number: signal.Signals, status: int, tmp_path: Path) -> None:
    # A shell that runs pytest in the background has SIGINT ignored, and children inherit that.
    listening = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    code = f"{listening}; from taichi_cloth.scenes.__main__ import main; main()"
    folder = tmp_path / "out"
    scene = [*TINY, *IN_PLAIN_LIGHT, "--views", "600"]
    arguments = [sys.executable, "-P", "-c", code, "turntable", *scene, "--out", str(folder)]
    with subprocess.Popen(arguments, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        try:
            while run.poll() is None and not (folder / "frame_0003.png").exists():
                time.sleep(0.01)
            assert run.poll() is None
            run.send_signal(number)
            _, err = run.communicate(timeout=60)
        finally:
            run.kill()
    assert run.returncode == status
    assert err == "taichi-cloth: stopped; frames already written are whole: go on with --resume\n"
    left = set(contents(folder))
    assert left == {"made.json", "sequence.json"} | {Sequence.name(k) for k in range(len(left) - 2)}
    for name in left - {"made.json", "sequence.json"}:
        assert read_png(folder / name).shape == (48, 64, 3)
