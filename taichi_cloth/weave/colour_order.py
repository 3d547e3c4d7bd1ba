"""Colour-and-weave: the order of coloured threads in warp and weft makes stripes, checks and tartans.

An order is a text or a list of (colour, count) pairs, and repeats over the cloth:

    "navy*4 white*4"            four navy, four white; the count is 1 when not said
    "#1d3557*12, ecru*2"        any sRGB colour in hexadecimal; commas are as good as blanks
    "sett: K4 R24 K24 Y4"       a tartan thread count; the first and last stripes are pivots: the order turns
                                back there without doubling them, K4 R24 K24 Y4 K24 R24 | K4 R24 …;
                                "K/4 R24 K24 Y/4" is the same

Houndstooth is "black*4 white*4" both ways on twill-2/2; a shepherd's check the same with wider counts.
"""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.weave.draft import MAX_CROSSINGS, Draft

__all__ = ["Order", "colour", "coloured", "known_colours", "srgb_to_linear", "thread_colours", "thread_repeat"]

Order = str | Sequence[tuple[str, int]]

_MAX_REPEAT = 1_000_000  # threads in one repeat of an order

_NAMES = {
    "amber": "#d98e04", "azure": "#3a86c8", "beige": "#d9c9a3", "black": "#101010", "blue": "#1f4fa3",
    "bottle": "#12402c", "brown": "#5c3a21", "burgundy": "#6b1024", "camel": "#b88a55", "charcoal": "#36393d",
    "cerise": "#c91c5c", "chocolate": "#3f2417", "claret": "#7a1530", "coral": "#e8674f", "cream": "#f4ead0",
    "crimson": "#a8112f", "cyan": "#18a7b5", "denim": "#2f4a6d", "ecru": "#e2d6b8", "emerald": "#0c7a4a",
    "fuchsia": "#c0267e", "gold": "#c9971c", "gray": "#7d8084", "green": "#1d6b37", "grey": "#7d8084",
    "indigo": "#232c5c", "ivory": "#f6f1e1", "khaki": "#8b7f55", "lavender": "#a996c9", "lilac": "#b79bc4",
    "lime": "#8cb82b", "linen": "#e6dcc6", "magenta": "#b5156f", "maroon": "#5c1620", "mauve": "#9a738f",
    "mint": "#a5d6b8", "mustard": "#c39a1f", "natural": "#e8dec5", "navy": "#16213f", "ochre": "#b87a24",
    "olive": "#5f6128", "orange": "#d96a17", "peach": "#f0b48c", "petrol": "#12505c", "pink": "#e38fa5",
    "plum": "#5a2449", "purple": "#552a78", "red": "#b3161f", "rose": "#cf6a7c", "royal": "#2440a0",
    "rust": "#9c4421", "sage": "#8b9b78", "salmon": "#e58a72", "sand": "#cdb88c", "scarlet": "#c81a1a",
    "silver": "#b9bcc0", "sky": "#86b6dc", "slate": "#55606b", "stone": "#b5aa96", "tan": "#b08a5c",
    "taupe": "#80705f", "teal": "#156b6b", "terracotta": "#b5573a", "turquoise": "#2aa8a0",
    "violet": "#613a93",
    "white": "#f5f5f2", "wine": "#5e1430", "yellow": "#e3b81a",
}  # fmt: skip
_TARTAN = {
    "K": "black", "W": "white", "R": "red", "G": "green", "B": "blue", "Y": "yellow", "N": "grey",
    "T": "brown",
    "A": "azure", "P": "purple", "O": "orange", "C": "crimson", "DB": "navy", "DG": "bottle", "DR": "maroon",
    "DY": "mustard", "DN": "charcoal", "DT": "chocolate", "DP": "plum", "LB": "sky", "LG": "sage",
    "LR": "coral",
    "LY": "cream", "LN": "silver", "LT": "tan", "LP": "lavender", "LO": "peach", "MG": "emerald",
    "MB": "royal",
}  # fmt: skip


def known_colours() -> tuple[str, ...]:
    """Colour names, in alphabetical order. Dyed-yarn shades, not the full-strength CSS primaries."""
    return tuple(_NAMES)


def srgb_to_linear(srgb: ArrayLike) -> NDArray[np.float32]:
    """sRGB 0..1, any shape, to linear light, float32 (IEC 61966-2-1)."""
    s = np.asarray(srgb, dtype=np.float64)
    return np.where(s <= 0.04045, s / 12.92, ((s + 0.055) / 1.055) ** 2.4).astype(np.float32)


def colour(name: str) -> NDArray[np.float32]:
    """Linear RGB, float32 (3,), of a colour name or of "#rgb" or "#rrggbb".

    Raises InputError when the name is unknown.
    """
    if not isinstance(name, str):
        raise InputError(f"colour: {name!r} is not a colour name; use a name or #rrggbb")
    key = name.strip().lower()
    digits = _NAMES.get(key, key).removeprefix("#")
    if (key in _NAMES or key.startswith("#")) and re.fullmatch(r"[0-9a-f]{3}|[0-9a-f]{6}", digits):
        if len(digits) == 3:
            digits = "".join(2 * digit for digit in digits)
        return srgb_to_linear(np.array([int(digits[k : k + 2], 16) for k in (0, 2, 4)]) / 255)
    if key.startswith("#"):
        raise InputError(f"colour: {name!r} is not a colour; in hexadecimal it is # and 3 or 6 digits, such as #1d3557")
    raise InputError(f"colour: unknown colour {name!r}; use #rrggbb or a name such as navy{did_you_mean(key, _NAMES)}")


def thread_colours(order: Order, count: int) -> NDArray[np.float32]:
    """Linear RGB of each of `count` threads, float32 (count, 3), the order repeated from the first thread.

    >>> thread_colours("#fff*2 #000*1", 4)[:, 0].tolist()
    [1.0, 1.0, 0.0, 1.0]

    Raises InputError on an unknown colour, a stripe of 0 threads, an empty order, or too long a one.
    """
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or not 1 <= count <= MAX_CROSSINGS:
        raise InputError(f"colour order: for {count!r} threads; allowed: a whole number from 1 to {MAX_CROSSINGS}")
    stripes = _stripes(order)
    if not stripes:
        raise InputError('colour order: empty; give at least one colour, such as "navy*4 white*4"')
    total = sum(number for _, number in stripes)
    if total > _MAX_REPEAT:
        raise InputError(f"colour order: {total} threads in one repeat; allowed: up to {_MAX_REPEAT}")
    palette = {name: k for k, name in enumerate(dict(stripes))}
    table = np.array([colour(name) for name in palette], dtype=np.float32)
    repeat = np.repeat([palette[name] for name, _ in stripes], [number for _, number in stripes])
    return table[repeat[np.arange(count) % total]]


def thread_repeat(order: Order) -> NDArray[np.float32]:
    """One repeat of an order, (n, 3) linear. Raises InputError as `thread_colours` does."""
    return thread_colours(order, sum(number for _, number in _stripes(order)))


def coloured(draft: Draft, *, warp: Order | None = None, weft: Order | None = None) -> Draft:
    """The draft with its threads coloured in these orders; None leaves that family as it is.

    Raises InputError as `thread_colours` does.
    """
    return replace(
        draft,
        warp_colour=draft.warp_colour if warp is None else thread_colours(warp, draft.ends),
        weft_colour=draft.weft_colour if weft is None else thread_colours(weft, draft.picks),
    )


def _stripes(order: Order) -> list[tuple[str, int]]:
    """(colour, threads) for one repeat."""
    if not isinstance(order, str):
        try:
            pairs = [(name, number) for name, number in order]
        except (TypeError, ValueError):
            raise InputError("colour order: a list of (colour, count) pairs is needed") from None
        return [(name, _threads(f"{name!r}", number)) for name, number in pairs]
    text = order.strip()
    if text.lower().startswith("sett:"):
        return _sett(text[len("sett:") :])
    stripes = []
    for token in re.sub(r"\s*\*\s*", "*", text).replace(",", " ").split():
        name, star, number = token.partition("*")
        stripes.append((name, _threads(token, number) if star else 1))
    return stripes


def _sett(text: str) -> list[tuple[str, int]]:
    """One full repeat of a mirrored tartan sett, the pivots once each."""
    tokens = text.replace(",", " ").split()
    half = []
    for position, token in enumerate(tokens):
        match = re.fullmatch(r"([A-Za-z]+|#[0-9A-Fa-f]{6}(?=[/*]))([/*]?)(\d+)", token)
        if match is None:
            raise InputError(
                f'colour order: sett: {token!r} is no stripe; write colour and count, "sett: K4 R24 K24 Y4"'
            )
        name, mark, number = match.groups()
        if mark == "/" and position not in (0, len(tokens) - 1):
            raise InputError(
                f"colour order: sett: {token!r} marks a pivot; only the first and last stripes may be pivots"
            )
        half.append((_tartan_colour(name), _threads(token, number)))
    return half + half[-2:0:-1]


def _tartan_colour(name: str) -> str:
    if name.startswith("#") or name.lower() in _NAMES:
        return name
    if name.upper() not in _TARTAN:
        raise InputError(
            f"colour order: sett: unknown colour {name!r}; known: {', '.join(_TARTAN)}, or a colour name"
            f"{did_you_mean(name.lower(), _NAMES)}"
        )
    return _TARTAN[name.upper()]


def _threads(token: str, number: object) -> int:
    whole = isinstance(number, (int, np.integer)) and not isinstance(number, bool)
    digits = re.fullmatch(r"[0-9]{1,9}", number) if isinstance(number, str) else None
    value = int(number) if whole or digits else 0  # type: ignore[arg-type]
    if value < 1:
        raise InputError(f"colour order: {token}: count {number!r}; allowed: a whole number of threads from 1")
    return value
