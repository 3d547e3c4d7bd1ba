"""Yarn counts in the trade's words, as a spinner or a weaver writes them.

Direct systems state mass for a length: tex (g/km), dtex, den (g per 9 km). Indirect ones state length for a mass: Ne,
of cotton (hanks of 840 yd a pound, tex = 590.5/Ne), Nm (km a kg, 1000/Nm), Nw, of worsted (560 yd a pound, 885.8/Nw),
NeL, of linen (leas of 300 yd a pound, 1653.5/NeL).
"""

import re
from dataclasses import dataclass
from typing import Literal

from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["COUNT_WORDS", "Count", "System", "in_count", "in_tex", "parse_count"]

System = Literal["Ne", "Nm", "Nw", "NeL", "dtex", "den"]

_TEX_OF_ONE = {"Ne": 590.5, "Nm": 1000.0, "Nw": 885.8, "NeL": 1653.5}
_TEX_OF_UNIT = {"tex": 1.0, "dtex": 0.1, "den": 1.0 / 9.0}
_WORDS = {
    "ne": "Ne",
    "nec": "Ne",
    "cc": "Ne",
    "s": "Ne",
    "'s": "Ne",
    "nm": "Nm",
    "nw": "Nw",
    "new": "Nw",
    "nel": "NeL",
    "lea": "NeL",
    "tex": "tex",
    "dtex": "dtex",
    "den": "den",
    "denier": "den",
    "d": "den",
}
COUNT_WORDS = (
    "30/2",
    "Ne 30",
    "30/2 Ne",
    "2/60 Nm",
    "Nw 2/48",
    "NeL 25",
    "tex 20x2",
    "20 tex",
    "dtex 167f48",
    "20 den",
)
"""One of each form."""

_NUMBER = r"\d+(?:\.\d+)?"
_FORM = re.compile(
    rf"(?P<before>[a-z]+)?\s*(?P<a>{_NUMBER})(?:\s*/\s*(?P<b>{_NUMBER}))?\s*(?P<after>[a-z']+?)?"
    rf"(?:\s*/?\s*(?:f\s*(?P<filaments>\d+)|(?P<filaments2>\d+)\s*f))?(?:\s*[x×]\s*(?P<plies>\d+))?"
)
_LARGEST_PLIES = 12


def in_count(tex: float, system: System) -> float:
    """A count in tex [g/km] in another system.

    >>> in_count(19.7, "den"), round(in_count(19.7, "Ne"), 1)
    (177.3, 30.0)
    """
    return _TEX_OF_ONE[system] / tex if system in _TEX_OF_ONE else tex / _TEX_OF_UNIT[system]


def in_tex(count: float, system: System) -> float:
    """A count in another system in tex [g/km].

    >>> round(in_tex(30, "Ne"), 2)
    19.68
    """
    return _TEX_OF_ONE[system] / count if system in _TEX_OF_ONE else count * _TEX_OF_UNIT[system]


@dataclass(frozen=True)
class Count:
    """tex: of one single [g/km]. plies: singles folded together. form: "filament" where the words say so. filaments: in
    one single, 0 where not said. fibre: "flax" in its own system."""

    tex: float
    plies: int = 1
    form: Literal["filament"] | None = None
    filaments: int = 0
    fibre: Literal["flax"] | None = None

    @property
    def fineness_dtex(self) -> float | None:
        """Of one filament [dtex]; None where the words do not say."""
        return 10.0 * self.tex / self.filaments if self.filaments else None


def parse_count(text: str) -> Count:
    """A count in the trade's words.

    Cotton counts state the single, then the plies (30/2); metric and worsted ones the plies, then the single (2/60 Nm),
    and are also read the other way round where that is what makes sense. Two numbers of den are the limits of a raw
    silk, 20/22 den.

    >>> parse_count("2/60 Nm").plies, round(parse_count("2/60 Nm").tex, 2)
    (2, 16.67)

    Raises InputError, with the forms that are known.
    """
    said = " ".join(str(text).split())
    words = said.lower()
    found = _FORM.fullmatch(words)
    if found is None:
        raise _unknown(said, words)
    named = [word for word in (found["before"], found["after"]) if word]
    if len(named) > 1 or (named and named[0] not in _WORDS):
        raise _unknown(said, words)
    system = _WORDS[named[0]] if named else None
    first, second = float(found["a"]), float(found["b"]) if found["b"] else None
    plies = int(found["plies"] or 1)
    filaments = int(found["filaments"] or found["filaments2"] or 0)
    if system is None:
        if second is None or filaments:
            raise InputError(
                f"yarn.count: {said!r} names no system; write Ne {first:g}, Nm {first:g}, {first:g} tex or "
                f"{first:g} den"
            )
        if first <= _LARGEST_PLIES and second > _LARGEST_PLIES:
            raise InputError(
                f"yarn.count: {said!r} may be metric or worsted; write {said} Nm or {said} Nw, or {second:g}/{first:g} "
                "for a cotton count"
            )
        system = "Ne"
    if system in _TEX_OF_UNIT:
        size = first
        if second is not None and system == "den":
            size = (first + second) / 2.0
        elif second is not None:
            plies *= _plies(said, second)
        tex = size * _TEX_OF_UNIT[system]
        form = "filament" if system == "den" or filaments else None
        return _checked(said, Count(tex, plies, form, filaments))
    if second is not None:
        plied_first = system != "Ne" and first <= _LARGEST_PLIES and first.is_integer()
        first, plies = (second, plies * _plies(said, first)) if plied_first else (first, plies * _plies(said, second))
    if first <= 0:
        raise InputError(f"yarn.count: {said!r}; allowed: a count above 0")
    return _checked(said, Count(_TEX_OF_ONE[system] / first, plies, fibre="flax" if system == "NeL" else None))


def _plies(said: str, number: float) -> int:
    if not number.is_integer() or not 1 <= number <= _LARGEST_PLIES:
        raise InputError(f"yarn.count: {said!r}: {number:g} plies; allowed: 1 to {_LARGEST_PLIES}")
    return int(number)


def _checked(said: str, count: Count) -> Count:
    if not 0.1 <= count.tex <= 10_000:
        raise InputError(f"yarn.count: {said!r} is {count.tex:g} tex; allowed: 0.1 to 10000 tex")
    _plies(said, float(count.plies))
    return count


def _unknown(said: str, words: str) -> InputError:
    letters = re.findall(r"[a-z]{2,}", words)
    near = next((hint for word in letters if word not in _WORDS for hint in [did_you_mean(word, _WORDS)] if hint), "")
    systems = "Ne, Nm, Nw, NeL, tex, dtex, den"
    return InputError(
        f"yarn.count: {said[:60]!r} is no count; known: {', '.join(COUNT_WORDS)}; systems: {systems}{near}"
    )
