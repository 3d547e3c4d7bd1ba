"""What the host decides between the intervals of a frame, foreseen where frame after frame goes alike.

Whether an interval is proven, and whether a search is due, the host decides by numbers that a device finds, and would
wait for them several times a frame. Where the last frames went alike it takes what it was told in the last for what it
will be told, launches the whole frame, and asks at its end for all that it should have been told. If by that it had
decided otherwise anywhere the frame is taken again, and each answer waited for: the bytes are the same.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

__all__ = ["MOST_ANSWERS", "Foresight"]

MOST_ANSWERS = 256
"""In a frame that is foreseen."""

FEWEST, MOST = 8, 64
"""Frames in a row that go alike before the next is foreseen; twice as many after each that should not have been, at
most: a frame that is taken again costs as much as many waits."""

Answer = tuple[float, ...]


class _OtherwiseError(Exception):
    """Another decision than the one that was foreseen."""


class Foresight:
    """Of one sheet. ahead: whether the frame at hand is gone through by what the last was told. wrong: whether the last
    one was, and should not have been. again: whether a frame is gone through once more to find out, without kernels."""

    def __init__(self) -> None:
        self.ahead = self.wrong = self.again = False
        self._settings: tuple[float, ...] = ()
        self._made, self._before = list[tuple[Any, ...]](), list[tuple[Any, ...]]()
        self._answers, self._known = list[Answer](), list[Answer]()
        self._alike, self._needed = 0, FEWEST

    def start(self, *settings: float) -> None:
        """A frame begins, with all that decisions hang on beside answers."""
        same = settings == self._settings
        self.ahead = same and self._alike >= self._needed and not self.wrong
        self._before, self._known = self._made if same else [], self._answers
        self._made, self._answers, self._settings, self.wrong = [], [], settings, False

    def decided(self, *what: Any) -> bool:
        """A kernel and its numbers. Returns whether it is to be launched."""
        if self.again and (len(self._made) == len(self._before) or self._before[len(self._made)] != what):
            raise _OtherwiseError
        self._made.append(what)
        return not self.again

    def answer(self, read: Callable[[int], Answer]) -> Answer:
        """To the next question. read: waits for the answer in a row."""
        row = len(self._answers)
        self._answers.append(self._known[row] if self.ahead else read(row))
        return self._answers[-1]

    @property
    def row(self) -> int:
        """Of the next answer."""
        return min(len(self._answers), MOST_ANSWERS - 1)

    def end(self, proven: bool) -> None:
        """Of a frame whose answers were waited for."""
        alike = proven and self._made == self._before and len(self._answers) < MOST_ANSWERS
        self._alike = self._alike + 1 if alike else 0

    @contextmanager
    def repeated(self, answers: list[Answer]) -> Iterator[None]:
        """Within, the frame is decided on once more, by what it was really told."""
        self._before, self._made, self._known, self._answers = self._made, [], answers, []
        self.again = True
        try:
            yield
            self.wrong = len(self._made) < len(self._before)
        except _OtherwiseError:
            self.wrong = True
        finally:
            self.again, self._alike = False, 0 if self.wrong else self._alike + 1
            if self.wrong:
                self._needed = min(2 * self._needed, MOST)
            elif self._alike > 2 * self._needed:
                self._needed = FEWEST
