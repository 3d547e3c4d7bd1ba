"""Files: a person's is looked at before it is read, then read whole or refused in one line; ours appear whole.

What a file is and how large is known before any of it is in memory: folders, devices and pipes, which may have no end,
are refused, and so is more than a reader can want. What is in it is each reader's own business.
"""

import contextlib
import json
import os
import secrets
import stat
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

from taichi_cloth.ground.errors import InputError

__all__ = ["in_one_step", "read_bytes", "read_json", "read_text", "shown_path", "write_bytes"]

LONGEST_INTEGER = 18
"""Digits of a whole number in JSON; longer ones are read as floats, which may be infinite."""


def read_bytes(path: str | PathLike[str], *, most: int, give: str) -> bytes:
    """The bytes of a regular file of at most `most` bytes. give: what it should be, such as "a PNG".

    Raises InputError with the path, what is wrong with it, and what to give.
    """
    name = shown_path(path)
    try:
        status = os.stat(path)
        if stat.S_ISDIR(status.st_mode):
            raise InputError(f"{name}: is a folder; give {give}")
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{name}: is no regular file; give {give}")
        if status.st_size <= most:
            with Path(path).open("rb") as file:
                data = file.read(most + 1)  # a file may grow, and one of /proc has no size
            if len(data) <= most:
                return data
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name}: cannot be read ({error}); give {give}") from None  # a name that no file can have
    except OSError as error:
        raise InputError(f"{name}: cannot be read ({error.strerror or error}); give {give}") from None
    raise InputError(f"{name}: {max(status.st_size, most + 1):,} bytes; allowed: up to {most:,}; give {give}")


def read_text(path: str | PathLike[str], *, most: int, give: str) -> str:
    """The characters of a UTF-8 file, without a mark at its beginning. Raises InputError as `read_bytes` does."""
    data = read_bytes(path, most=most, give=give)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{shown_path(path)}: is not UTF-8 text; give {give}") from None


def read_json(path: str | PathLike[str], *, most: int, give: str) -> Any:
    """What a JSON file holds. Raises InputError as `read_bytes` does."""
    text = read_text(path, most=most, give=give)
    try:
        return json.loads(text, parse_int=_whole)
    except RecursionError:
        raise InputError(f"{shown_path(path)}: nested too deeply; give {give}") from None
    except ValueError as error:
        raise InputError(f"{shown_path(path)}: not JSON, or cut short ({error}); give {give}") from None


def shown_path(path: str | PathLike[str]) -> str:
    """A path for a message, its middle cut out where it is long."""
    name = str(path)
    return name if len(name) < 200 else f"{name[:80]}…{name[-80:]}"


def write_bytes(path: str | PathLike[str], data: bytes) -> None:
    """Write a file in one step, as `in_one_step` does. Raises OSError."""
    with in_one_step(path) as part:
        part.write_bytes(data)


@contextlib.contextmanager
def in_one_step(path: str | PathLike[str], suffix: str = "") -> Iterator[Path]:
    """Where to write a file that appears whole or not at all: a part beside it, renamed at the end. Raises OSError.

    suffix: how the part's name must end for the library that writes it; then it stands in for the ending of `path`.
    Nothing is left of a write that fails or is interrupted: the part has its name before there is a file of it.
    """
    path = Path(path)
    part = path.with_name(f".{path.stem if suffix else path.name}.{secrets.token_hex(4)}.part{suffix}")
    try:
        part.touch(exist_ok=False)
        yield part
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _whole(digits: str) -> int | float:
    return int(digits) if len(digits) <= LONGEST_INTEGER else float(digits)
