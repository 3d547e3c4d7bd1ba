"""A run that ends when it is asked to, even while a compiler holds the interpreter.

Ctrl-C and SIGTERM become exceptions, so that what is being written is cleaned up. Python raises them between two steps
of its own, though, and while Taichi compiles a kernel there may be none for half a minute. So a second process of a few
lines hears of each signal at once, through the file that Python's C code writes a signal's number to
(`signal.set_wakeup_fd`), and ends a run that has not answered within GRACE. Nothing is being written at such a time.
"""

import contextlib
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Iterator
from typing import NoReturn

__all__ = ["Terminated", "stoppable"]

GRACE = 1.0
"""Seconds that a run has to answer a signal."""

AGAIN = 5.0
"""Seconds after which a run that answered and goes on is asked once more: an exception that is raised while a library's
callback or finaliser runs is written out and forgotten."""

_ANSWERED = 0
"""What a run writes when it answers: no signal has that number."""


class Terminated(BaseException):
    """SIGTERM arrived. Raised so that what is being written is cleaned up, as after Ctrl-C."""


@contextlib.contextmanager
def stoppable(line: str) -> Iterator[None]:
    """Raise `Terminated` on SIGTERM and KeyboardInterrupt on Ctrl-C within; kill a run that cannot within GRACE.

    line: what is said on standard error before a run is killed; its exit code is then that of SIGKILL (137 to a shell).
    Only in the main thread, where signals are; without `os.fork` a run that is compiling answers when it is done.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with contextlib.ExitStack() as stack:
        tell = stack.enter_context(_watcher(line)) if hasattr(os, "fork") else None

        def answered() -> None:
            if tell is not None:
                with contextlib.suppress(OSError):  # the watcher is gone, or has enough to read
                    os.write(tell, bytes([_ANSWERED]))

        def terminate(number: int, frame: object) -> NoReturn:
            answered()
            raise Terminated

        def interrupt(number: int, frame: object) -> NoReturn:
            answered()
            raise KeyboardInterrupt

        stack.callback(signal.signal, signal.SIGTERM, signal.signal(signal.SIGTERM, terminate))
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # a shell's background job ignores it
            stack.callback(signal.signal, signal.SIGINT, signal.signal(signal.SIGINT, interrupt))
        yield


@contextlib.contextmanager
def _watcher(line: str) -> Iterator[int]:
    """A process that watches this one. Yields where to write to it; it is over when that is closed."""
    heard, tell = os.pipe()
    os.set_blocking(tell, False)
    run = os.getpid()
    sys.stderr.flush()
    watcher = os.fork()
    if watcher == 0:
        with contextlib.suppress(BaseException):
            os.close(tell)
            _watch(run, heard, line)
        os._exit(0)
    os.close(heard)
    before = signal.set_wakeup_fd(tell, warn_on_full_buffer=False)
    try:
        yield tell
    finally:
        signal.set_wakeup_fd(before)
        os.close(tell)
        with contextlib.suppress(OSError):  # it ends by itself, unless a child of ours still has `tell`
            os.kill(watcher, signal.SIGKILL)
            os.waitpid(watcher, 0)


def _watch(run: int, heard: int, line: str) -> None:
    """Read numbers of signals from `heard`; end the process `run` if it does not answer one of them."""
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # a terminal sends Ctrl-C to all of a group
        signal.signal(number, signal.SIG_IGN)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1):  # who waits for the end of the run's output must not wait for us
        os.dup2(nowhere, standard)
    asked = None
    while True:
        if not select.select([heard], [], [], None if asked is None else AGAIN)[0]:
            if asked is not None and os.getppid() == run:
                os.kill(run, asked)
            continue
        number = _next(heard)
        if number is None:
            return
        if number != _ANSWERED:
            asked = number
            if not _answers(heard) and os.getppid() == run:
                os.write(2, f"taichi-cloth: {line}\n".encode(errors="replace"))
                os.kill(run, signal.SIGKILL)


def _answers(heard: int) -> bool:
    """Whether the run answers, or is over, within GRACE."""
    until = time.monotonic() + GRACE
    while (left := until - time.monotonic()) > 0 and select.select([heard], [], [], left)[0]:
        if _next(heard) in (None, _ANSWERED):
            return True
    return False


def _next(heard: int) -> int | None:
    """The next number written to a pipe, waited for; None at its end."""
    data = os.read(heard, 1)
    return data[0] if data else None
