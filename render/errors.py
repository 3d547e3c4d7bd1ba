"""What a person gets for input the renderer cannot draw: one line that says what, which value, what to do."""

from collections.abc import Iterable
from difflib import get_close_matches

__all__ = ["RenderError", "did_you_mean"]


class RenderError(ValueError):
    """Bad input to the renderer. Its text is always one line."""

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.split()))


def did_you_mean(value: str, known: Iterable[str]) -> str:
    """The nearest right spelling as ' (did you mean "wool"?)', or '' when nothing is near."""
    near = get_close_matches(value, list(known), n=1, cutoff=0.6)
    return f' (did you mean "{near[0]}"?)' if near else ""
