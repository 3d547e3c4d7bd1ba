"""What came of a cell of the matrix, and the rule: stable, or refused with one line; nothing else."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, nan

from taichi_cloth.ground.errors import InputError, Unstable

__all__ = ["NEITHER", "REFUSED", "STABLE", "Outcome", "refused", "tried"]

STABLE, REFUSED, NEITHER = "stable", "refused", "NEITHER"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """part: of the program. what: the case. verdict: STABLE, REFUSED or NEITHER. drift: the most that the total energy
    rose above an earlier value, as a share of the largest kinetic or elastic energy; nan where something does work.
    stretch: largest strain of a thread at the end. speed: mean at the end [m/s]. recovered: "yes", "tangled" (at rest,
    but threads hold each other long), "pulled" (at rest, held long), "moving", or "". line: what was said.
    seconds: CPU time."""

    part: str
    what: str
    verdict: str
    drift: float = nan
    stretch: float = nan
    speed: float = nan
    recovered: str = ""
    line: str = ""
    seconds: float = nan

    def cells(self) -> tuple[str, ...]:
        numbers = (
            "" if not isfinite(self.drift) else f"{100 * self.drift:.2g} %",
            "" if not isfinite(self.stretch) else f"{100 * self.stretch:.3g} %",
        )
        return (self.part, self.what, self.verdict, *numbers, self.recovered, self.line)


HEAD = ("part", "case", "verdict", "energy made", "stretch", "recovered", "what it says")


def refused(part: str, what: str, error: Exception, seconds: float = nan) -> Outcome:
    """A case that one of our own errors has ended."""
    return Outcome(part=part, what=what, verdict=REFUSED, line=" ".join(str(error).split()), seconds=seconds)


def tried(part: str, what: str, work: Callable[[], str | None]) -> Outcome:
    """A case that either works, and may say how, or is refused with one line. work raises AssertionError, or anything
    that is no error of ours, where it is neither."""
    try:
        return Outcome(part=part, what=what, verdict=STABLE, line=work() or "")
    except (InputError, Unstable) as error:
        return refused(part, what, error)
    except Exception as error:  # whatever it is, it is no line for a person: the table says so
        return Outcome(part=part, what=what, verdict=NEITHER, line=f"{type(error).__name__}: {error}")
