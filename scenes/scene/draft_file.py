"""A draft of a .wif file, read once however many parts of a scene ask for it."""

from functools import lru_cache
from pathlib import Path

from taichi_cloth.weave.draft import Draft
from taichi_cloth.weave.wif import read_wif

__all__ = ["draft_file"]


def draft_file(path: str) -> Draft:
    """As the file is now: one that has changed is read again. Raises InputError on what is no such file."""
    try:
        found = Path(path).stat()
    except (OSError, ValueError):  # ValueError: a null byte in its name
        return read_wif(path)  # which says what is wrong with it
    return _read(path, found.st_mtime_ns, found.st_size)


@lru_cache(maxsize=16)
def _read(path: str, changed: int, size: int) -> Draft:
    """changed, size: of the file [ns, bytes]."""
    return read_wif(path)
