"""Things that take long to make, kept on disk by the hash of what made them.

A file that is damaged, or is not what its name says, is made again; where nothing can be written, nothing is kept.
"""

import hashlib
import logging
import os
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.files import in_one_step

__all__ = ["can_keep", "digest", "folder", "kept"]

Arrays = dict[str, NDArray]

SEAL = "sha256"
_said: list[Path] = []


def folder() -> Path:
    """TAICHI_CLOTH_CACHE, or taichi_cloth in XDG_CACHE_HOME or ~/.cache."""
    own = os.environ.get("TAICHI_CLOTH_CACHE")
    return Path(own) if own else Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "taichi_cloth"


def digest(*parts: Any) -> str:
    """A hash of numbers, words, arrays, and of sequences, mappings and dataclasses of them, by value."""
    state = hashlib.sha256()
    for part in parts:
        _feed(state, part)
    return state.hexdigest()


def kept(kind: str, made_of: str, make: Callable[[], Mapping[str, NDArray]]) -> tuple[Arrays, bool]:
    """The arrays that `make` gives, from disk if they are there, and whether they were. made_of: `digest` of all that
    they follow from, the version of the code that makes them included."""
    file = folder() / f"{kind}-{made_of[:32]}.npz"
    found = _read(file)
    if found is not None:
        return found, True
    arrays = {name: np.asarray(value) for name, value in make().items()}
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with in_one_step(file) as part, part.open("wb") as handle:
            np.savez_compressed(handle, allow_pickle=False, **arrays, **{SEAL: np.array(_seal(arrays))})
    except OSError as error:  # a full or read-only disk costs the next run some time, and nothing else
        _not_kept(file.parent, error)
    return arrays, False


def can_keep(place: Path) -> bool:
    """Whether files can be kept in a folder, which is made if it is not there; a line is said where they cannot."""
    try:
        place.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=place):
            return True
    except OSError as error:
        _not_kept(place, error)
        return False


def _not_kept(place: Path, error: OSError) -> None:
    """Say, once a process, that what takes long is made anew each time."""
    if not _said:
        _said.append(place)
        logging.getLogger(__name__).warning(
            "nothing is kept in %s (%s): what takes long is made anew each time; set XDG_CACHE_HOME to a folder that "
            "can be written",
            place,
            error.strerror or error,
        )


def _read(file: Path) -> Arrays | None:
    try:
        with np.load(file, allow_pickle=False) as saved:
            arrays = {name: saved[name] for name in saved.files}
    except Exception:  # not there, cut short, or damaged: zipfile and zlib raise their own
        return None
    seal = arrays.pop(SEAL, None)
    return arrays if seal is not None and str(seal) == _seal(arrays) else None


def _seal(arrays: Mapping[str, NDArray]) -> str:
    return digest({name: arrays[name] for name in sorted(arrays)})


def _feed(state: Any, part: Any) -> None:
    if isinstance(part, np.ndarray):
        state.update(f"a{part.dtype.str}{part.shape}".encode() + np.ascontiguousarray(part).tobytes())
    elif is_dataclass(part) and not isinstance(part, type):
        state.update(f"d{type(part).__name__}(".encode())
        for field in fields(part):
            _feed(state, field.name)
            _feed(state, getattr(part, field.name))
        state.update(b")")
    elif isinstance(part, Mapping):
        state.update(b"{")
        for key, value in part.items():
            _feed(state, key)
            _feed(state, value)
        state.update(b"}")
    elif isinstance(part, list | tuple):
        state.update(b"[")
        for one in part:
            _feed(state, one)
        state.update(b"]")
    elif part is None or isinstance(part, str | int | float | bool | np.generic):
        state.update(f"{type(part).__name__}:{part!r};".encode())
    else:
        raise TypeError(f"digest: {type(part).__name__}; allowed: numbers, words, arrays, and what holds them")
