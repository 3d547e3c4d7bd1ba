"""What a person gets for bad input: one line that says what, which value, what is allowed, what to do."""

from collections.abc import Iterable
from difflib import get_close_matches

__all__ = ["DoesNotFit", "InputError", "Unstable", "did_you_mean"]

LONGEST = 1500
"""Letters of a line; what a person wrote may be longer, and its middle is left out."""


class InputError(ValueError):
    """Bad input from a person. Its text is one line, LONGEST at most; the command line prints it and exits with 2."""

    def __init__(self, message: str) -> None:
        line = " ".join(message.split())
        super().__init__(line if len(line) <= LONGEST else f"{line[: LONGEST // 2]} … {line[-LONGEST // 3 :]}")


def did_you_mean(value: str, known: Iterable[str]) -> str:
    """The nearest right spelling as ' (did you mean "twill"?)', or '' when nothing is near."""
    near = get_close_matches(value, list(known), n=1, cutoff=0.6)
    return f' (did you mean "{near[0]}"?)' if near else ""


class Unstable(RuntimeError):
    """A state that is no cloth any more. frame: the one that failed; `Simulation.state` is that before it."""

    def __init__(self, message: str, frame: int) -> None:
        super().__init__(message)
        self.frame = frame


class DoesNotFit(RuntimeError):
    """A garment that was sewn and drawn but does not fit its body: why, in one line. The command line exits with 3."""
