"""Weaves: at each crossing of a warp end and a weft pick, who lies on top (paper 2.3).

A `Draft` is one repeat, or a whole cloth, seen from its face: end 0 at the left, pick 0 (the first one
woven) at the bottom, so row i of `warp_up` is pick i. A twill is "Z" when its line climbs to the right in
this view.
"""

import re
from dataclasses import dataclass, replace
from math import gcd

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = [
    "MAX_CROSSINGS",
    "Draft",
    "check_size",
    "interlacing_notes",
    "known_weaves",
    "longest_float",
    "named_weave",
    "tile",
]

MAX_CROSSINGS = 200_000_000
"""The most crossings (ends × picks) one draft may have: 200 MB of bools."""

_ALIASES = {
    "tabby": "plain",
    "taffeta": "plain",
    "twill": "twill-2/2-z",
    "satin": "satin-5",
    "sateen": "sateen-5",
    "basket": "basket-2/2",
    "hopsack": "basket-2/2",
    "panama": "basket-2/2",
    "oxford": "basket-2/1",
    "herringbone": "herringbone-2/2",
}
_TWILLS = ("2/1", "1/2", "2/2", "3/1", "1/3")
_MAX_REPEAT = 64  # ends in the repeat of a weave named by numbers, e.g. twill-a/b or satin-n


@dataclass(frozen=True, kw_only=True, eq=False)
class Draft:
    """What is woven. Arrays are checked, copied and made read-only.

    warp_up: bool, shape (picks, ends); True where the warp end lies on top of the weft pick.
    warp_colour, weft_colour: linear light 0..1, float32, shape (ends, 3) and (picks, 3), None if not stated.
    warp_spacing_m, weft_spacing_m: room a thread takes across the cloth [m], float64, (ends,), (picks,), or
        None; the centres of neighbours k and k+1 are (spacing[k] + spacing[k+1]) / 2 apart.
    warp_thickness_m, weft_thickness_m: yarn diameter [m], float64, (ends,) and (picks,), or None.
    notes: what a person should know, e.g. an oddity of the file that was repaired.

    Raises InputError on wrong shapes, sizes, or values that are not finite and in range.
    """

    warp_up: NDArray[np.bool_]
    warp_colour: NDArray[np.float32] | None = None
    weft_colour: NDArray[np.float32] | None = None
    warp_spacing_m: NDArray[np.float64] | None = None
    weft_spacing_m: NDArray[np.float64] | None = None
    warp_thickness_m: NDArray[np.float64] | None = None
    weft_thickness_m: NDArray[np.float64] | None = None
    name: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        up = np.array(self.warp_up, dtype=bool, order="C")
        if up.ndim != 2:
            raise InputError(f"draft.warp_up: shape {up.shape}; needed: (picks, ends)")
        check_size(ends=up.shape[1], picks=up.shape[0])
        self._keep("warp_up", up)
        for family, count in (("warp", self.ends), ("weft", self.picks)):
            self._check_colour(f"{family}_colour", count)
            for quantity in ("spacing", "thickness"):
                self._check_length(f"{family}_{quantity}_m", count)

    @property
    def picks(self) -> int:
        """Weft picks, the rows of `warp_up`."""
        return self.warp_up.shape[0]

    @property
    def ends(self) -> int:
        """Warp ends, the columns of `warp_up`."""
        return self.warp_up.shape[1]

    def _keep(self, field: str, array: NDArray) -> None:
        array.flags.writeable = False
        object.__setattr__(self, field, array)

    def _check_colour(self, field: str, count: int) -> None:
        if getattr(self, field) is None:
            return
        colour = _numbers(f"draft.{field}", getattr(self, field), np.float32)
        if colour.shape != (count, 3):
            raise InputError(f"draft.{field}: shape {colour.shape}; needed: ({count}, 3), a linear RGB per thread")
        if not np.all((colour >= 0) & (colour <= 1)):  # also false for NaN
            raise InputError(f"draft.{field}: a value outside 0 to 1; give linear light between 0 and 1")
        self._keep(field, colour)

    def _check_length(self, field: str, count: int) -> None:
        if getattr(self, field) is None:
            return
        length = _numbers(f"draft.{field}", getattr(self, field), np.float64)
        if length.shape != (count,):
            raise InputError(f"draft.{field}: shape {length.shape}; needed: ({count},), metres per thread")
        bad = np.flatnonzero(~((length > 0) & np.isfinite(length)))
        if bad.size:
            raise InputError(f"draft.{field}: {length[bad[0]]:g} m at thread {bad[0] + 1}; allowed: a length above 0")
        self._keep(field, length)


def _numbers(what: str, values: ArrayLike, dtype: type) -> NDArray:
    try:
        return np.array(values, dtype=dtype, order="C")
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what}: not an array of numbers") from None


def check_size(*, ends: int, picks: int) -> None:
    """Refuse a size before anything of that size is allocated.

    Raises InputError when a count is below 1, or ends × picks is above MAX_CROSSINGS.
    """
    for what, count in (("ends", ends), ("picks", picks)):
        if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
            raise InputError(f"weave.{what}: {count!r}; allowed: a whole number from 1")
    if int(ends) * int(picks) > MAX_CROSSINGS:
        raise InputError(
            f"weave: {ends} ends × {picks} picks = {int(ends) * int(picks)} crossings; "
            f"allowed: up to {MAX_CROSSINGS}; weave a smaller piece"
        )


def known_weaves() -> tuple[str, ...]:
    """Names that `named_weave` takes. Twills, satins and baskets of other numbers work in the same form."""
    twills = tuple(f"twill-{ratio}{turn}" for ratio in _TWILLS for turn in ("", "-s", "-z"))
    shown = ("plain", *twills, "satin-5", "satin-8", "sateen-5", "sateen-8", "basket-2/2", "basket-3/3")
    return (*shown, "herringbone-2/2", *_ALIASES)


def named_weave(name: str, *, ends: int | None = None, picks: int | None = None) -> Draft:
    """The weave of that name, tiled to `ends` × `picks`; None takes one repeat in that direction.

    Forms: plain; twill-A/B[/C/D…][-s|-z] (over A picks, under B, …; Z when not said); satin-N[/STEP]
    (warp-faced) and sateen-N[/STEP] (weft-faced); basket-A/B (A ends and B picks as one); herringbone-A/A
    (twill that turns back).

    >>> print(named_weave("twill-2/1").warp_up.astype(int))
    [[1 1 0]
     [0 1 1]
     [1 0 1]]

    Raises InputError when the name is unknown or its numbers make no weave, or the size is out of bounds.
    """
    if not isinstance(name, str):
        raise InputError(f"weave: {name!r} is not a name; known: {', '.join(known_weaves())}")
    key = name.strip().lower()
    repeat = _repeat(_ALIASES.get(key, key), name)
    up = Draft(warp_up=repeat, name=key)
    return tile(up, ends=up.ends if ends is None else ends, picks=up.picks if picks is None else picks)


def _repeat(key: str, said: str) -> NDArray[np.bool_]:
    """One repeat of the weave, bool (picks, ends)."""
    if key == "plain":
        return _twill((1, 1), "z")
    kind, _, rest = key.partition("-")
    turn = "z"
    if kind == "twill" and rest[-2:] in ("-s", "-z"):
        rest, turn = rest[:-2], rest[-1]
    numbers = tuple(int(part) for part in rest.split("/")) if re.fullmatch(r"\d{1,4}(/\d{1,4})*", rest) else ()
    if kind == "twill" and len(numbers) >= 2:
        return _twill(_counts(said, numbers, "over and under", even=True), turn)
    if kind in ("satin", "sateen") and 1 <= len(numbers) <= 2:
        weft_faced = _satin(said, *numbers)
        return weft_faced if kind == "sateen" else ~weft_faced
    if kind == "basket" and len(numbers) == 2:
        a, b = _counts(said, numbers, "ends and picks of a block", even=True)
        i, j = np.indices((2 * b, 2 * a))
        return (i // b + j // a) % 2 == 0
    if kind == "herringbone" and len(numbers) == 2:
        a, b = _counts(said, numbers, "over and under", even=True)
        if a != b:
            raise InputError(
                f"weave: {said!r}: a herringbone needs equal floats on both faces, such as herringbone-2/2"
            )
        left = np.tile(_twill((a, b), "z"), (1, 2))
        return np.concatenate([left, ~left[:, ::-1]], axis=1)  # turned back with a clean cut: up meets down
    near = did_you_mean(key, known_weaves())
    raise InputError(f"weave: unknown weave {said!r}; known: {', '.join(known_weaves())}{near}")


def _counts(said: str, numbers: tuple[int, ...], meaning: str, *, even: bool) -> tuple[int, ...]:
    if min(numbers) < 1 or sum(numbers) > _MAX_REPEAT or (even and len(numbers) % 2):
        raise InputError(
            f"weave: {said!r}: {meaning} come in pairs of whole numbers from 1, together at most {_MAX_REPEAT}"
        )
    return numbers


def _twill(floats: tuple[int, ...], turn: str) -> NDArray[np.bool_]:
    """Each pick repeats the floats (up, down, up, …), moved by one end from pick to pick: right for Z,
    left for S.
    """
    row = np.repeat(np.arange(len(floats)) % 2 == 0, floats)
    i, j = np.indices((row.size, row.size))
    return row[(j - i if turn == "z" else j + i) % row.size]


def _satin(said: str, n: int, step: int | None = None) -> NDArray[np.bool_]:
    """Weft-faced satin: pick i is bound by end (step · i) mod n alone. The step shares no factor with n."""
    steps = [s for s in range(2, n - 1) if gcd(s, n) == 1] if n <= _MAX_REPEAT else []
    if not steps:
        raise InputError(f"weave: {said!r}: a satin needs 5 or from 7 to {_MAX_REPEAT} ends in its repeat")
    if step is None:
        step = steps[1] if n == 8 and len(steps) > 2 else steps[0]
    if step not in steps:
        raise InputError(f"weave: {said!r}: step {step}; allowed for {n} ends: {', '.join(map(str, steps))}")
    up = np.zeros((n, n), dtype=bool)
    picks = np.arange(n)
    up[picks, (step * picks) % n] = True
    return up


def tile(draft: Draft, *, ends: int, picks: int) -> Draft:
    """Repeat a draft, with its colours, spacings and thicknesses, to any size; a part repeat is cut off.

    Raises InputError when the size is out of bounds.
    """
    check_size(ends=ends, picks=picks)
    if (picks, ends) == draft.warp_up.shape:
        return draft
    i, j = np.arange(picks) % draft.picks, np.arange(ends) % draft.ends

    def taken(values: NDArray | None, index: NDArray) -> NDArray | None:
        return None if values is None else values[index]

    return replace(
        draft,
        warp_up=draft.warp_up[np.ix_(i, j)],
        warp_colour=taken(draft.warp_colour, j),
        weft_colour=taken(draft.weft_colour, i),
        warp_spacing_m=taken(draft.warp_spacing_m, j),
        weft_spacing_m=taken(draft.weft_spacing_m, i),
        warp_thickness_m=taken(draft.warp_thickness_m, j),
        weft_thickness_m=taken(draft.weft_thickness_m, i),
    )


def longest_float(warp_up: ArrayLike) -> tuple[int, int]:
    """The longest run of crossings that a warp end, and a weft pick, stays on one face of the cloth.

    warp_up: bool (picks, ends), taken as a repeat. A thread that never changes face counts as its whole
    repeat.

    >>> longest_float(named_weave("satin-5").warp_up)
    (4, 4)
    """
    up = np.asarray(warp_up, dtype=bool)
    return _longest_run(up.T), _longest_run(up)


def _longest_run(rows: NDArray[np.bool_]) -> int:
    """Longest run of equal values in any row, rows closed to rings."""
    count = rows.shape[1]
    if not _changes(rows).any(axis=1).all():
        return count
    best = 1
    for begin in range(0, rows.shape[0], 1024):  # strips bound the memory for the widest drafts
        changes = _changes(rows[begin : begin + 1024])
        row, column = np.nonzero(changes)
        last_of_row = np.append(row[1:] != row[:-1], True)
        first_column = column[np.append(True, row[1:] != row[:-1])]
        gap = np.empty_like(column)
        gap[:-1] = column[1:] - column[:-1]
        gap[last_of_row] = first_column + count - column[last_of_row]
        best = max(best, int(gap.max()))
    return best


def _changes(rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return rows != np.roll(rows, -1, axis=1)


def interlacing_notes(warp_up: ArrayLike) -> tuple[str, ...]:
    """A line for ends, and one for picks, that stay on one face everywhere: they fall off the cloth.

    warp_up: bool (picks, ends), taken as a repeat.
    """
    up = np.asarray(warp_up, dtype=bool)
    notes = []
    for family, along in (("ends", 0), ("picks", 1)):
        loose = np.flatnonzero(up.all(axis=along) | ~up.any(axis=along)) + 1
        if loose.size:
            listed = ", ".join(map(str, loose[:8])) + (", …" if loose.size > 8 else "")
            count = up.shape[1 - along]
            notes.append(f"{loose.size} of {count} {family} never interlace and would fall off the cloth: {listed}")
    return tuple(notes)
