"""The text of a WIF file: bytes to characters to sections, tolerant of what weaving programs are known to write.

WIF 1.1 is INI text. Real files come with text before [WIF], duplicate keys, keys without "=", any case, comments,
Latin-1 or UTF-16 letters, a DOS end-of-file mark. All of that is read; bytes that are no text are refused.
"""

import re
from os import PathLike, fspath
from typing import NamedTuple

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import read_bytes

__all__ = ["MAX_BYTES", "Entry", "Sections", "read_text", "sections", "shown"]

MAX_BYTES = 20_000_000
"""The largest file that is read; a draft of 100,000 threads is smaller."""

_BOMS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe\0\0", "utf-32"), (b"\0\0\xfe\xff", "utf-32"),
         (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))  # fmt: skip


class Entry(NamedTuple):
    """The text to the right of "=", and its line in the file, counted from 1."""

    value: str
    line: int


Sections = dict[str, dict[str, Entry]]


def shown(value: str) -> str:
    """A value for a message: quoted, and cut when long."""
    return repr(value if len(value) <= 40 else value[:37] + "...")


def read_text(path: str | PathLike[str]) -> tuple[str, tuple[str, ...]]:
    """The characters of a draft file, and notes on how they were read.

    Raises InputError when there is no such file, it is no regular file, above MAX_BYTES, unreadable, or not text.
    """
    name = fspath(path)
    data = read_bytes(path, most=MAX_BYTES, give="a WIF file")
    if not data.strip():
        raise InputError(f"{name}: the file is empty")
    return _decoded(name, data)


def _decoded(name: str, data: bytes) -> tuple[str, tuple[str, ...]]:
    for mark, encoding in _BOMS:
        if data.startswith(mark):
            return _strict(name, data, encoding), ()
    if b"\0" in data:
        for encoding, zeros in (("utf-16-le", data[1::2]), ("utf-16-be", data[0::2])):
            if len(data) % 2 == 0 and zeros.count(0) > 0.9 * len(zeros):
                return _strict(name, data, encoding), ("UTF-16 without its mark",)
        raise InputError(f"{name}: binary data, not a text file; a WIF file starts with [WIF]")
    try:
        text, notes = data.decode("utf-8"), ()
    except UnicodeDecodeError:
        text, notes = data.decode("latin-1"), ("not UTF-8: letters read as Latin-1",)
    strange = sum(data.count(code) for code in range(32) if code not in b"\t\n\v\f\r\x1a")
    if strange > 0.01 * len(data):
        raise InputError(f"{name}: binary data, not a text file; a WIF file starts with [WIF]")
    return text, notes


def _strict(name: str, data: bytes, encoding: str) -> str:
    try:
        return data.decode(encoding)
    except UnicodeDecodeError:
        raise InputError(f"{name}: marked as {encoding.removesuffix('-sig')} text, but it is not") from None


def sections(name: str, text: str) -> Sections:
    """Sections by lower-case name, each {lower-case key: entry}, from [WIF] on; the last of duplicate keys counts.

    Raises InputError when there is no [WIF], or a heading is not closed.
    """
    found: Sections = {}
    current: dict[str, Entry] | None = None
    for number, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1):
        line = line.strip(" \t\v\f\x1a\ufeff")
        if not line or line[0] in ";#":
            continue
        if line[0] == "[":
            heading, closed, _ = line[1:].partition("]")
            title = " ".join(heading.lower().split())
            if not closed and current is not None:
                raise InputError(f"{name}: line {number}: heading {shown(line)} has no ]; is the file cut short?")
            if current is None and title != "wif":
                continue
            current = found.setdefault(title, {})
        elif current is not None:
            key, equals, value = line.partition("=")
            if not equals:
                key, _, value = line.partition(":")
            current[key.strip().lower()] = Entry(value.strip(), number)
    if current is None:
        raise InputError(f"{name}: no [WIF] section; is this a WIF file?")
    return found
