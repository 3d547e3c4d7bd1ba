"""Where a program finds itself: no home, a home that cannot be written, a terminal of ASCII, closed streams."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

KERNEL = """
from taichi_cloth.ground import runtime
import taichi as ti
runtime.start("cpu", threads=1)

@ti.kernel
def seven() -> ti.i32:
    return 7

print(seven())
"""

ONE_VIEW = (
    "turntable", "plain", "--views", "1", "--size", "48x32", "--set", "weave.ends=4", "--set", "weave.picks=4",
    "--set", "light.shadows=false", "--set", "light.occlusion=false",
)  # fmt: skip


def run(arguments: list[str], folder: Path, **environment: str | None) -> subprocess.CompletedProcess[str]:
    changed = {**os.environ, **environment}
    return subprocess.run(
        arguments,
        cwd=folder,
        env={key: value for key, value in changed.items() if value is not None},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def kernel(folder: Path, **environment: str | None) -> subprocess.CompletedProcess[str]:
    (folder / "kernel.py").write_text(KERNEL)
    return run([sys.executable, "kernel.py"], folder, **{"XDG_CACHE_HOME": None, **environment})


def test_a_home_that_cannot_be_written_costs_the_cache_and_a_line(tmp_path: Path) -> None:
    (tmp_path / "home").touch()  # no folder can be made in a file, by root neither
    done = kernel(tmp_path, HOME=str(tmp_path / "home"))
    assert (done.returncode, done.stdout) == (0, "7\n")
    (line,) = done.stderr.splitlines()
    assert "nothing is kept in" in line
    assert "set XDG_CACHE_HOME" in line


def test_without_a_home_that_of_the_list_of_users_is_taken(tmp_path: Path) -> None:
    done = kernel(tmp_path, HOME=None)
    assert (done.returncode, done.stdout) == (0, "7\n")
    assert len(done.stderr.splitlines()) <= 1  # that home need not be writable


def test_a_terminal_of_ascii_is_told_all(tmp_path: Path) -> None:
    turn = [sys.executable, "-m", "taichi_cloth.scenes", *ONE_VIEW, "--out", "made"]
    done = run(turn, tmp_path, LC_ALL="C", PYTHONIOENCODING="ascii", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0")
    assert (done.returncode, done.stderr) == (0, "")
    assert "48 \\xd7 32 px" in done.stdout


@pytest.mark.skipif(os.name != "posix", reason="the shell's way to close a stream")
def test_closed_streams_lose_nothing(tmp_path: Path) -> None:
    turn = ["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", sys.executable, "-m", "taichi_cloth.scenes", *ONE_VIEW]
    done = run([*turn, "--out", "made"], tmp_path)
    assert done.returncode == 0
    made = {path.name for path in (tmp_path / "made").iterdir()}
    assert {"frame_0000.png", "sheet.png", "turntable.mp4"} <= made
    for path in (tmp_path / "made").glob("*.png"):
        assert path.read_bytes()[:4] == b"\x89PNG"


def test_other_pythons_are_refused_by_a_line_of_pip() -> None:
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["requires-python"] == ">=3.11,<3.14"
    assert "Python 3.11, 3.12 or 3.13" in (Path(__file__).parents[2] / "README.md").read_text("utf-8")
