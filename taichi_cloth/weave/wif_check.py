"""The numbers of a WIF file, each checked against its bounds before anything of that size is made.

What programs are known to get wrong harmlessly is taken and noted; what would weave another cloth than the file's
author meant is refused.
"""

import re

from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.draft import MAX_CROSSINGS
from taichi_cloth.weave.wif_text import Entry, Sections, shown

__all__ = ["MAX_SHAFTS", "MAX_THREADS", "CheckedWif"]

MAX_THREADS = 100_000
"""The most ends, or picks, a WIF file may have."""
MAX_SHAFTS = 4096
"""The most shafts, treadles or colours."""

_METRES = {
    "decipoints": 0.0254 / 720, "decipoint": 0.0254 / 720, "inches": 0.0254, "inch": 0.0254, "in": 0.0254,
    "centimeters": 0.01, "centimetres": 0.01, "centimeter": 0.01, "cm": 0.01, "millimeters": 0.001, "mm": 0.001,
}  # fmt: skip
_TRUE, _FALSE = ("true", "on", "yes", "1"), ("false", "off", "no", "0")
_NEEDED = ("weaving", "warp", "weft", "threading", "tieup", "treadling", "liftplan", "color table")


class CheckedWif:
    """The numbers of a file, each checked against its bounds. Every failure is an InputError with file and line."""

    def __init__(self, name: str, found: Sections, text: str) -> None:
        self.name, self.found, self.notes = name, found, []
        self.title = found.get("text", {}).get("title", Entry("", 0)).value or name
        self._contents()
        self.rising = self._rising()
        self.shafts = self._count("weaving", "shafts", MAX_SHAFTS)
        self.treadles = self._count("weaving", "treadles", MAX_SHAFTS)
        self._way_of_lifting()
        rows = "liftplan" if self.liftplan else "treadling"
        self.threads = {"warp": self._threads("warp", "threading"), "weft": self._threads("weft", rows)}
        ends, picks = self.threads["warp"], self.threads["weft"]
        if ends * picks > MAX_CROSSINGS:
            raise InputError(f"{name}: {ends} ends × {picks} picks; allowed: up to {MAX_CROSSINGS} crossings")
        self.lists = {"threading": self._lists("threading", ends, "shaft", self.shafts)}
        if self.liftplan:
            self.lists["liftplan"] = self._lists("liftplan", picks, "shaft", self.shafts)
        else:
            self.lists["tieup"] = self._lists("tieup", self.treadles, "shaft", self.shafts)
            limit = self.treadles or max(self.lists["tieup"], default=0)
            self.lists["treadling"] = self._lists("treadling", picks, "treadle", limit)
            used = set().union(*self.lists["treadling"].values())
            if idle := sorted(used - self.lists["tieup"].keys()):
                self.notes.append(f"treadles without a tie-up lift nothing: {', '.join(map(str, idle[:8]))}")
        for what, values in self.lists.items():
            if not values:
                raise InputError(f"{name}: [{what.upper()}] is empty: nothing would be woven")
        self._cut_short(rows, text)
        self.range, self.table = self._colour_table()
        self.colour = {family: self._colour(family) for family in ("warp", "weft")}
        self.units = {family: self._units(family) for family in ("warp", "weft")}
        self.length = {
            (family, quantity): self._length(family, quantity)
            for family in ("warp", "weft")
            for quantity in ("spacing", "thickness")
        }

    def fail(self, section: str, key: str, entry: Entry, reason: str) -> InputError:
        """The one line about one entry."""
        at = f"line {entry.line}: [{section.upper()}] {shown(key)[1:-1]} = {shown(entry.value)}"
        return InputError(f"{self.name}: {at}: {reason}")

    def _contents(self) -> None:
        for section, entry in self.found.get("contents", {}).items():
            if entry.value.lower() in _TRUE and section not in self.found:
                if section in _NEEDED:
                    missing = f"[CONTENTS] promises [{section.upper()}], which is missing"
                    raise InputError(f"{self.name}: {missing}; is the file cut short?")
                if section.endswith(("colors", "spacing", "thickness")):
                    self.notes.append(f"[CONTENTS] promises [{section.upper()}], which is missing")
        if "weaving" not in self.found:
            self.notes.append("no [WEAVING]; a rising shed is taken")

    def _rising(self) -> bool:
        entry = self.found.get("weaving", {}).get("rising shed")
        if entry is None or entry.value.lower() in _TRUE:
            return True
        if entry.value.lower() not in _FALSE:
            raise self.fail("weaving", "rising shed", entry, "allowed: true or false")
        return False

    def _whole(self, section: str, key: str, entry: Entry, text: str, low: int, high: int, what: str) -> int:
        """One whole number of an entry; `text` is the part of it that is meant."""
        if not re.fullmatch(r"[+-]?[0-9]+", text):
            raise self.fail(section, key, entry, f"{what} is not a whole number")
        if text[0] == "-" and text.strip("-0"):
            raise self.fail(section, key, entry, f"{what} is negative; allowed: {low} to {high}")
        digits = text.strip("+-").lstrip("0") or "0"
        if len(digits) > 12 or not low <= int(digits) <= high:
            raise self.fail(section, key, entry, f"{what} {shown(digits)[1:-1]}; allowed: {low} to {high}")
        return int(digits)

    def _count(self, section: str, key: str, high: int) -> int:
        """A count that may be left out or empty; 0 then."""
        entry = self.found.get(section, {}).get(key)
        if entry is None or not entry.value:
            return 0
        return self._whole(section, key, entry, entry.value, 0, high, key)

    def _way_of_lifting(self) -> None:
        have = {what: _filled(self.found.get(what, {})) for what in ("threading", "tieup", "treadling", "liftplan")}
        if not have["threading"]:
            state = "is empty" if "threading" in self.found else "is missing"
            raise InputError(f"{self.name}: [THREADING] {state}; a draft needs it")
        by_treadle = have["tieup"] and have["treadling"]
        if not (by_treadle or have["liftplan"]):
            absent = ", ".join(f"[{what.upper()}]" for what in ("tieup", "treadling", "liftplan") if not have[what])
            raise InputError(f"{self.name}: needs [TIEUP] and [TREADLING], or [LIFTPLAN]; missing or empty: {absent}")
        declared = self.found.get("contents", {}).get("liftplan", Entry("true", 0)).value.lower() not in _FALSE
        self.liftplan = have["liftplan"] and (declared or not by_treadle)
        if by_treadle and have["liftplan"]:
            used = "the liftplan" if self.liftplan else "the treadling"
            self.notes.append(f"both a treadling and a liftplan; {used} is used")

    def _threads(self, family: str, rows: str) -> int:
        entry = self.found.get(family, {}).get("threads")
        if entry is not None and entry.value:
            return self._whole(family, "threads", entry, entry.value, 1, MAX_THREADS, "the number of threads")
        most = max(
            self._whole(rows, key, row, key, 0, MAX_THREADS, "the thread number")
            for key, row in self.found[rows].items()
            if row.value
        )
        self.notes.append(f"[{family.upper()}] gives no Threads; {most} by [{rows.upper()}]")
        return most

    def _numbered(self, section: str, high: int, what: str) -> dict[int, tuple[str, Entry]]:
        """Entries that hold something, by number, in order: {number: (key as written, entry)}."""
        found = {}
        for key, entry in self.found.get(section, {}).items():
            if entry.value in ("", "0"):
                if entry.value == "0" and section.endswith("colors"):
                    raise self.fail(section, key, entry, "colour 0; allowed: from 1")
                continue
            found[self._whole(section, key, entry, key, 1, high, what)] = (key, entry)
        return dict(sorted(found.items()))

    def _lists(self, section: str, rows: int, what: str, high: int) -> dict[int, set[int]]:
        """{row: set of numbers from 1}; a 0 stands for nothing, a row of nothing is left out."""
        row_name = {"threading": "end", "tieup": "treadle"}.get(section, "pick")
        lists: dict[int, set[int]] = {}
        known: dict[str, int] = {}  # drafts repeat few numbers many times
        for row, (key, entry) in self._numbered(section, rows or MAX_SHAFTS, row_name).items():
            numbers = set()
            for part in set(entry.value.split(",")):
                if part not in known:
                    known[part] = self._whole(section, key, entry, part.strip(), 0, high or MAX_SHAFTS, what)
                numbers.add(known[part])
            if numbers - {0}:
                lists[row] = numbers - {0}
        return lists

    def _cut_short(self, rows: str, text: str) -> None:
        """A file that ends within a line of its last section, before the last thread, has lost its tail."""
        for section, family in (("threading", "warp"), (rows, "weft")):
            last, count = max(self.lists[section]), self.threads[family]
            idle = count - len(self.lists[section])
            if list(self.found)[-1] == section and not text.endswith(("\n", "\r", "\x1a")) and last < count:
                raise InputError(
                    f"{self.name}: ends at {last} of {count} threads in [{section.upper()}]; is the file cut short?"
                )
            if idle:
                does = "are on no shaft" if family == "warp" else "lift nothing"
                self.notes.append(f"{idle} of {count} {'ends' if family == 'warp' else 'picks'} {does}")

    def _colour_table(self) -> tuple[tuple[int, int], dict[int, tuple[int, int, int]]]:
        limits = self.found.get("color palette", {}).get("range")
        low, high = 0, 255
        if limits is not None and limits.value:
            parts = [part.strip() for part in limits.value.split(",")]
            if len(parts) != 2:
                raise self.fail("color palette", "range", limits, "two numbers are needed, such as 0,255")
            low, high = (self._whole("color palette", "range", limits, part, 0, 10**6, "limit") for part in parts)
            if low >= high:
                raise self.fail("color palette", "range", limits, "the first must be below the second")
        elif self.found.get("color table"):
            self.notes.append("no colour range given; 0 to 255 taken")
        table = {
            number: self._rgb("color table", key, entry, entry.value.split(","), low, high)
            for number, (key, entry) in self._numbered("color table", MAX_SHAFTS, "colour").items()
        }
        stated = self._count("color palette", "entries", 10**9)
        if stated and stated != len(table):
            self.notes.append(f"[COLOR PALETTE] says {stated} entries; [COLOR TABLE] has {len(table)}")
        return (low, high), table

    def _rgb(self, section: str, key: str, entry: Entry, parts: list[str], low: int, high: int) -> tuple[int, int, int]:
        if len(parts) != 3:
            raise self.fail(section, key, entry, "a colour is three numbers: red, green, blue")
        r, g, b = (self._whole(section, key, entry, part.strip(), low, high, "colour value") for part in parts)
        return r, g, b

    def _colour(self, family: str) -> tuple[int, dict[int, int]] | None:
        """Default colour and colour by thread, both as numbers in the table; None when the file gives none."""
        count, section = self.threads[family], f"{family} colors"
        given = self._numbered(section, count, "thread")
        own = {
            thread: self._whole(section, key, entry, entry.value, 1, MAX_SHAFTS, "colour")
            for thread, (key, entry) in given.items()
        }
        default = self.found.get(family, {}).get("color")
        if own and not self.table:
            raise InputError(f"{self.name}: [{section.upper()}] is given, but no [COLOR TABLE]")
        for thread, number in own.items():
            if number not in self.table:
                raise self.fail(section, *given[thread], f"no colour {number} in [COLOR TABLE]")
        if default is None or not default.value:
            if not own:
                return None
            if self._all_coloured(family, own):
                return next(iter(own.values())), own
            raise InputError(
                f"{self.name}: {family} threads without a colour, and [{family.upper()}] has no default Color"
            )
        parts = [part.strip() for part in default.value.split(",")]
        number = self._whole(family, "color", default, parts[0], 0, 10**6, "colour")
        if number in self.table:
            return number, own
        if len(parts) == 4:
            low, high = self.range
            self.table[max(self.table, default=0) + 1] = self._rgb(family, "color", default, parts[1:], low, high)
            return max(self.table), own
        if self._all_coloured(family, own):
            return next(iter(own.values())), own
        raise self.fail(family, "color", default, f"default colour {number} is not in [COLOR TABLE]")

    def _all_coloured(self, family: str, own: dict[int, int]) -> bool:
        """Has every thread at work its own colour, so that an unusable default does not matter? Noted if so."""
        rows = "threading" if family == "warp" else "liftplan" if self.liftplan else "treadling"
        if not self.lists[rows].keys() <= own.keys():
            return False
        if bare := self.threads[family] - len(own):
            self.notes.append(f"{bare} idle {family} threads have no colour; they take that of thread {min(own)}")
        return True

    def _units(self, family: str) -> float | None:
        """Metres in the family's unit; None when none is stated."""
        entry = self.found.get(family, {}).get("units")
        if entry is None or not entry.value:
            return None
        if entry.value.lower() not in _METRES:
            raise self.fail(family, "units", entry, "allowed: decipoints, inches, centimeters")
        return _METRES[entry.value.lower()]

    def _length(self, family: str, quantity: str) -> tuple[float, dict[int, float]] | None:
        """Default and length by thread, in the file's unit; None when the file does not give them all."""
        count, section = self.threads[family], f"{family} {quantity}"
        default = self.found.get(family, {}).get(quantity)
        own = {
            thread: self._number(section, key, entry, family)
            for thread, (key, entry) in self._numbered(section, count, "thread").items()
        }
        own = {thread: value for thread, value in own.items() if value}
        whole = 0.0 if default is None or not default.value else self._number(family, quantity, default, family)
        if not own and not whole:
            return None
        if self.units[family] is None:
            self.notes.append(f"{family} {quantity} left out: [{family.upper()}] states no Units")
            return None
        if not whole and len(own) < count:
            self.notes.append(f"{family} {quantity} left out: given for {len(own)} of {count} threads, no default")
            return None
        return whole or next(iter(own.values())), own

    def _number(self, section: str, key: str, entry: Entry, family: str) -> float:
        """A length in the file's unit; a decimal comma is taken; 0 stands for not given."""
        text = entry.value.replace(",", ".", 1)
        if not re.fullmatch(r"[+-]?([0-9]{1,30}\.?[0-9]{0,30}|\.[0-9]{1,30})([eE][+-]?[0-9]{1,3})?", text):
            raise self.fail(section, key, entry, "is not a number")
        value = float(text)
        metres = value * (self.units[family] or 0.01)
        if value and not 1e-6 <= metres <= 1:
            raise self.fail(section, key, entry, f"is {metres:.3g} m; allowed: 0.001 mm to 1 m")
        return value

    def clean(self) -> str:
        """These numbers alone, as a WIF text that the library reads as meant."""
        low, high = self.range
        table = self.table or {1: (low, low, low)}
        full = {n: table.get(n, (low, low, low)) for n in range(1, max(table) + 1)}
        lines = ["[WIF]", "Version=1.1", "[COLOR PALETTE]", f"Range={low},{high}", "[COLOR TABLE]"]
        lines += [f"{n}={r},{g},{b}" for n, (r, g, b) in full.items()]
        lines += ["[WEAVING]", f"Rising Shed={'true' if self.rising else 'false'}"]
        lines += [f"Shafts={self.shafts}", f"Treadles={self.treadles}"]
        for family in ("warp", "weft"):
            default, own = self.colour[family] or (1, {})
            lines += [f"[{family.upper()}]", f"Threads={self.threads[family]}", f"Color={default}"]
            spans = {q: self.length[family, q] for q in ("spacing", "thickness")}
            lines += [f"{q}={span[0]!r}" for q, span in spans.items() if span]
            lines += [f"[{family.upper()} COLORS]", *(f"{n}={value}" for n, value in own.items())]
            for q, span in spans.items():
                if span:
                    lines += [f"[{family.upper()} {q.upper()}]", *(f"{n}={v!r}" for n, v in span[1].items())]
        for section, rows in self.lists.items():
            lines += [f"[{section.upper()}]", *(f"{n}={','.join(map(str, sorted(v)))}" for n, v in rows.items())]
        return "\n".join(lines) + "\n"


def _filled(section: dict[str, Entry]) -> bool:
    return any(entry.value for entry in section.values())
