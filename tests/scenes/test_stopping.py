"""A run ends when it is asked to: by an exception where Python runs, killed where C code does not let it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from taichi_cloth.scenes.commands.stopping import GRACE, Terminated, stoppable

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")

HOLDS = "hold = lambda: sum(range(10**11))"  # one step of Python's that takes minutes, as a compiler does
WAITS = "import time; hold = lambda: time.sleep(60)"
FORGETS = """
import contextlib, time, taichi_cloth.scenes.commands.stopping as stopping
stopping.AGAIN = 0.3
def hold():
    with contextlib.suppress(BaseException):
        time.sleep(60)
    time.sleep(60)
"""
RUN = """
import signal; signal.signal(signal.SIGINT, signal.default_int_handler)
from taichi_cloth.scenes.commands.stopping import Terminated, stoppable
with stoppable("stopped by hand"):
    try:
        print("ready", flush=True)
        hold()
    except (KeyboardInterrupt, Terminated) as stop:
        print("cleaned up after", type(stop).__name__, flush=True)
"""


def ended(holding: str, number: signal.Signals, folder: Path) -> tuple[int, str, str, float]:
    """Exit code, output, errors of a run that got a signal, and the seconds that it took to end."""
    arguments = [sys.executable, "-P", "-c", holding + RUN]
    with subprocess.Popen(arguments, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        try:
            assert run.stdout is not None
            assert run.stdout.readline() == "ready\n"
            time.sleep(0.5)  # until it holds: two steps of Python's later
            began = time.monotonic()
            run.send_signal(number)
            out, err = run.communicate(timeout=50)
            return run.returncode, out, err, time.monotonic() - began
        finally:
            run.kill()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_run_that_holds_the_interpreter_is_killed_with_its_line(number: signal.Signals, tmp_path: Path) -> None:
    code, out, err, seconds = ended(HOLDS, number, tmp_path)
    assert (code, out, err) == (-signal.SIGKILL, "", "taichi-cloth: stopped by hand\n")
    assert seconds > 0.9 * GRACE


@pytest.mark.parametrize(("number", "name"), [(signal.SIGTERM, "Terminated"), (signal.SIGINT, "KeyboardInterrupt")])
def test_a_run_that_can_cleans_up_by_itself(number: signal.Signals, name: str, tmp_path: Path) -> None:
    code, out, err, _ = ended(WAITS, number, tmp_path)
    assert (code, out, err) == (0, f"cleaned up after {name}\n", "")


def test_a_run_that_forgets_is_asked_again(tmp_path: Path) -> None:
    code, out, err, _ = ended(FORGETS, signal.SIGTERM, tmp_path)
    assert (code, out, err) == (0, "cleaned up after Terminated\n", "")


def test_afterwards_signals_are_as_they_were() -> None:
    before = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    with pytest.raises(Terminated), stoppable("never said"):
        signal.raise_signal(signal.SIGTERM)
    assert (signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)) == before
    assert signal.set_wakeup_fd(-1) == -1
    with pytest.raises(ChildProcessError):  # no process is left
        os.waitpid(-1, os.WNOHANG)
