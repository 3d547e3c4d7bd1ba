"""A numbered PNG sequence on disk: every file whole or not there, and a run that was cut off can go on.

The folder holds `frame_0000.png` …, `sequence.json` (what made them), and at the end a video and a contact sheet.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import taichi_cloth
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import write_bytes

from ...render.image.image import png_is_whole, write_png
from ..scene.scene_files import file_hashes
from ..scene.schema import Scene
from .output_folder import OutputFolder

__all__ = ["Sequence", "fingerprint"]

MANIFEST = "sequence.json"
PRODUCTS = (
    *(f"{c}.{e}" for c in ("turntable", "animate", "zoom") for e in ("mp4", "webp")),
    "sheet.png",
    "state.npz",
    "facts.json",
)
LARGEST_COUNT = 100_000
Image = NDArray[np.uint8]


def fingerprint(scene: Scene, command: str) -> str:
    """A hash of everything that decides the frames of a sequence, with the contents of the files it names."""
    contents = [taichi_cloth.__version__, command, scene.model_dump(mode="json"), file_hashes(scene)]
    text = json.dumps(contents, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class Sequence:
    """The frames of one command in one folder. Make it with `Sequence.open`, then `begin`, then `write`.

    products: what is made of the frames besides. outdated: what an older command of ours left.
    """

    within: OutputFolder
    count: int
    mark: str
    products: tuple[str, ...]
    outdated: tuple[str, ...]

    @staticmethod
    def name(number: int) -> str:
        return f"frame_{number:04d}.png"

    @staticmethod
    def open(within: OutputFolder, mark: str, count: int, products: Iterable[str] = (), *, resume: bool) -> "Sequence":
        """Look at a folder for a sequence of `count` frames marked `mark` (see `fingerprint`). Touches nothing.

        Raises InputError when the folder holds frames or products that no run of ours left, or, with `resume`, was left
        by a different command or holds a damaged frame.
        """
        folder, wanted = within.path, tuple(products)
        ours = _read_manifest(folder)
        left = 0 if ours is None else ours["frames"]
        for name in map(Sequence.name, range(left, count)):
            if (folder / name).exists():
                raise InputError(f"--out {folder}: holds {name} from elsewhere; choose another folder")
        if ours is not None and resume and ours["fingerprint"] != mark:
            raise InputError(
                f"--resume: {folder} was left by another scene, size or number of frames, or a file that the scene "
                "names was edited; leave --resume out to begin anew, or choose another --out"
            )
        within.refuse_foreign(wanted)
        outdated: list[str] = []
        if ours is not None and not resume:
            outdated = [*map(Sequence.name, range(left)), *within.made().intersection(PRODUCTS)]
        sequence = Sequence(within, count, mark, wanted, tuple(outdated))
        if resume:
            sequence._refuse_damaged()
        return sequence

    def begin(self) -> None:
        """Make the folder ours: what an older command of ours left goes, then the manifest is written.

        In this order, so that a later `resume` can never take an old frame for a new one. Raises InputError.
        """
        self.within.make()
        try:
            self.within.clean((*(path.name for path in self.paths), *self.outdated, *PRODUCTS, MANIFEST))
            for name in self.outdated:
                (self.folder / name).unlink(missing_ok=True)
            text = json.dumps({"fingerprint": self.mark, "frames": self.count}, indent=1) + "\n"
            write_bytes(self.folder / MANIFEST, text.encode())
        except OSError as error:
            raise self.within.unwritable(error.strerror) from None
        self.within.claim(self.products)

    def _refuse_damaged(self) -> None:
        for path in self.paths:
            if path.exists() and not png_is_whole(path):
                raise InputError(f"--resume: {path} is damaged; delete it, and it is made again")

    @property
    def folder(self) -> Path:
        return self.within.path

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


def _read_manifest(folder: Path) -> dict | None:
    """What an earlier run of ours left, or None."""
    try:
        found = json.loads((folder / MANIFEST).read_text("utf-8"))
        ours = {"fingerprint": str(found["fingerprint"]), "frames": int(found["frames"])}
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return None
    return ours if 0 < ours["frames"] <= LARGEST_COUNT else None
