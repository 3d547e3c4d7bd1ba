"""A numbered PNG sequence on disk: every file whole or not there, and a run that was cut off can go on.

The folder holds `frame_0000.png` …, `sequence.json` (what made them), and at the end a video and a contact sheet.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import taichi_cloth
from taichi_cloth.errors import InputError

from ..render.image import write_png
from .schema import Scene

__all__ = ["Sequence", "fingerprint"]

MANIFEST = "sequence.json"
Image = NDArray[np.uint8]


def fingerprint(scene: Scene, command: str, size: tuple[int, int], count: int) -> str:
    """A hash of everything that decides the frames of a sequence."""
    stated = scene.model_dump(mode="json")
    draft = scene.weave.draft if scene.weave else ""
    content = hashlib.sha256(Path(draft).read_bytes()).hexdigest() if Path(draft).is_file() else draft
    text = json.dumps([taichi_cloth.__version__, command, stated, content, size, count], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class Sequence:
    """The frames of one command in one folder. Make it with `Sequence.open`."""

    folder: Path
    count: int
    stale: tuple[str, ...]
    resumed: bool

    @staticmethod
    def name(number: int) -> str:
        return f"frame_{number:04d}.png"

    @staticmethod
    def open(folder: Path, mark: str, count: int, *, resume: bool) -> "Sequence":
        """Take a folder for a sequence of `count` frames marked `mark` (see `fingerprint`).

        Raises InputError when the folder cannot be written, holds frames that no run of ours left, or, with
        `resume`, was left by a different command; nothing is touched then.
        """
        ours = _read_manifest(folder)
        names = [Sequence.name(k) for k in range(count)]
        if folder.exists() and not folder.is_dir():
            raise InputError(f"--out {folder}: is a file; give a folder")
        if ours is None:
            taken = [n for n in names if (folder / n).exists()]
            if taken:
                raise InputError(f"--out {folder}: holds {taken[0]} from elsewhere; choose another folder")
        elif resume and ours["fingerprint"] != mark:
            raise InputError(
                f"--resume: {folder} was left by another scene, size or number of frames; "
                "leave --resume out to begin anew, or choose another --out"
            )
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _write_text(folder / MANIFEST, json.dumps({"fingerprint": mark, "frames": count}, indent=1) + "\n")
        except OSError as error:
            raise InputError(f"--out {folder}: cannot be written ({error.strerror}); choose another folder") from None
        old = int(ours["frames"]) if ours else 0
        if not resume and ours is not None:
            for k in range(min(old, count)):  # so that a later --resume cannot take an old frame for a new one
                (folder / Sequence.name(k)).unlink(missing_ok=True)
        return Sequence(folder, count, tuple(Sequence.name(k) for k in range(count, old)), resume)

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
        for name in self.stale:
            (self.folder / name).unlink(missing_ok=True)


def _read_manifest(folder: Path) -> dict | None:
    try:
        found = json.loads((folder / MANIFEST).read_text("utf-8"))
        return {"fingerprint": str(found["fingerprint"]), "frames": int(found["frames"])}
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write_text(path: Path, text: str) -> None:
    part = path.with_name(path.name + ".part")
    part.write_text(text, "utf-8")
    os.replace(part, path)
