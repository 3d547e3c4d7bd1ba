"""A numbered PNG sequence on disk: every file whole or not there, and a run that was cut off can go on.

The folder holds `frame_0000.png` …, `sequence.json` (what made them), and at the end a video and a contact sheet.
"""

import errno
import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import taichi_cloth
from taichi_cloth.ground.errors import InputError

from ...render.image.image import write_bytes, write_png
from ..scene.scene_files import file_hashes
from ..scene.schema import Scene

__all__ = ["Sequence", "fingerprint"]

MANIFEST = "sequence.json"
PRODUCTS = (*(f"{c}.{e}" for c in ("turntable", "animate", "zoom") for e in ("mp4", "webp")), "sheet.png", "state.npz")
LARGEST_COUNT = 100_000
Image = NDArray[np.uint8]


def fingerprint(scene: Scene, command: str) -> str:
    """A hash of everything that decides the frames of a sequence, with the contents of the files it names."""
    contents = [taichi_cloth.__version__, command, scene.model_dump(mode="json"), file_hashes(scene)]
    text = json.dumps(contents, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class Sequence:
    """The frames of one command in one folder. Make it with `Sequence.open`, then `begin`, then `write`."""

    folder: Path
    count: int
    mark: str
    outdated: tuple[str, ...]

    @staticmethod
    def name(number: int) -> str:
        return f"frame_{number:04d}.png"

    @staticmethod
    def open(folder: Path, mark: str, count: int, *, resume: bool) -> "Sequence":
        """Look at a folder for a sequence of `count` frames marked `mark` (see `fingerprint`). Touches nothing.

        Raises InputError when the folder cannot be written, holds frames that no run of ours left, or, with
        `resume`, was left by a different command.
        """
        _refuse_unwritable(folder)
        ours = _read_manifest(folder)
        outdated: list[str] = []
        if ours is None:
            taken = [n for n in map(Sequence.name, range(count)) if (folder / n).exists()]
            if taken:
                raise InputError(f"--out {folder}: holds {taken[0]} from elsewhere; choose another folder")
        elif not resume:
            outdated = [*map(Sequence.name, range(ours["frames"])), *PRODUCTS]
        elif ours["fingerprint"] != mark:
            raise InputError(
                f"--resume: {folder} was left by another scene, size or number of frames; "
                "leave --resume out to begin anew, or choose another --out"
            )
        return Sequence(folder, count, mark, tuple(outdated))

    def begin(self) -> None:
        """Make the folder ours: what an older command of ours left goes, then the manifest is written.

        In this order, so that a later `resume` can never take an old frame for a new one. Raises InputError.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for name in self.outdated:
                (self.folder / name).unlink(missing_ok=True)
            text = json.dumps({"fingerprint": self.mark, "frames": self.count}, indent=1) + "\n"
            write_bytes(self.folder / MANIFEST, text.encode())
        except OSError as error:
            raise _unwritable(self.folder, error.strerror) from None

    @property
    def paths(self) -> list[Path]:
        return [self.folder / self.name(k) for k in range(self.count)]

    def missing(self) -> list[int]:
        """Numbers of the frames that are not there yet; a frame that is there is whole."""
        return [k for k, path in enumerate(self.paths) if not path.exists()]

    def write(self, frames: Iterable[tuple[int, Image]]) -> Iterator[int]:
        """Write (number, image) as they come, and give each number back once its file is whole."""
        for number, image in frames:
            write_png(self.folder / self.name(number), image)
            yield number


def _refuse_unwritable(folder: Path) -> None:
    try:
        if folder.exists() and not folder.is_dir():
            raise InputError(f"--out {folder}: is a file; give a folder")
        nearest = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    except OSError as error:
        raise _unwritable(folder, error.strerror) from None
    if not nearest.is_dir():
        raise _unwritable(folder, f"{nearest} is a file")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise _unwritable(folder, os.strerror(errno.EACCES))


def _unwritable(folder: Path, reason: str | None) -> InputError:
    shown = str(folder) if len(str(folder)) < 200 else f"{str(folder)[:80]}…"
    return InputError(f"--out {shown}: cannot be written ({reason}); choose another folder")


def _read_manifest(folder: Path) -> dict | None:
    """What an earlier run of ours left, or None."""
    try:
        found = json.loads((folder / MANIFEST).read_text("utf-8"))
        ours = {"fingerprint": str(found["fingerprint"]), "frames": int(found["frames"])}
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return None
    return ours if 0 < ours["frames"] <= LARGEST_COUNT else None
