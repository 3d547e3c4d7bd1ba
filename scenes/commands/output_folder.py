"""The folder that a command writes into: one run at a time, and nothing replaced that this program did not make.

`made.json` in it names the files that this program made there, beside the numbered frames, which `sequence.json` tells.
"""

import errno
import json
import os
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType

from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import write_bytes

try:
    import fcntl
except ImportError:  # Windows: runs are not kept apart
    fcntl = None

__all__ = ["MADE", "OutputFolder"]

MADE = "made.json"
LARGEST_LIST = 1_000_000  # bytes


class OutputFolder:
    """A folder while a command runs. Leaving it as a context lets other runs in; so does the end of the process,
    however it comes, for what holds it is the system's lock on the folder itself.

    Raises InputError when the folder cannot be written, or another run is at work in it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._held: int | None = None
        self._refuse_unwritable()
        if path.exists():
            self._hold()

    def __enter__(self) -> "OutputFolder":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        if self._held is not None:
            os.close(self._held)
            self._held = None

    def make(self) -> None:
        """Make the folder if it is not there, and keep other runs out of it. Raises InputError."""
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self.unwritable(error.strerror) from None
        self._hold()

    def made(self) -> set[str]:
        """Names of the files in it that this program made."""
        try:
            with (self.path / MADE).open(encoding="utf-8") as file:
                found = json.loads(file.read(LARGEST_LIST))["files"]
            return {name for name in found if isinstance(name, str)}
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return set()

    def refuse_foreign(self, names: Iterable[str]) -> None:
        """Raises InputError when one of these files is there and this program did not make it."""
        made = self.made()
        for name in names:
            if name not in made and os.path.lexists(self.path / name):
                raise InputError(
                    f"--out {self.path}: holds a {name} that this program did not make; move it away, or choose "
                    "another folder"
                )

    def claim(self, names: Iterable[str]) -> None:
        """Say that these files are this program's, before they are written. Raises InputError as `refuse_foreign`."""
        wanted = list(names)
        self.refuse_foreign(wanted)
        made = self.made()
        if not made.issuperset(wanted):
            text = json.dumps({"files": sorted(made.union(wanted))}, indent=1) + "\n"
            try:
                write_bytes(self.path / MADE, text.encode())
            except OSError as error:
                raise self.unwritable(error.strerror) from None

    def clean(self, names: Iterable[str]) -> None:
        """Remove what runs that were killed left half written of these files."""
        wanted = {*names, MADE}
        for part in self.path.glob(".*.part*"):
            kept, ending = part.name[1:].split(".part", 1)
            stem = kept.rpartition(".")[0]  # without what made the name of the part its own
            if f"{stem}{ending}" in wanted:
                part.unlink(missing_ok=True)

    def unwritable(self, reason: str | None) -> InputError:
        shown = str(self.path) if len(str(self.path)) < 200 else f"{str(self.path)[:80]}…"
        return InputError(f"--out {shown}: cannot be written ({reason}); choose another folder")

    def _hold(self) -> None:
        if fcntl is None or self._held is not None:
            return
        try:
            self._held = os.open(self.path, os.O_RDONLY)
        except OSError as error:
            raise self.unwritable(error.strerror) from None
        try:
            fcntl.flock(self._held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                self.close()
                raise InputError(
                    f"--out {self.path}: another run is writing into it; wait for its end, or choose another folder"
                ) from None
            # a file system without locks: runs are not kept apart there

    def _refuse_unwritable(self) -> None:
        folder = self.path
        try:
            if folder.exists() and not folder.is_dir():
                raise InputError(f"--out {folder}: is a file; give a folder")
            nearest = next(p for p in (folder, *folder.absolute().parents) if p.exists())
        except ValueError as error:  # a null byte
            raise self.unwritable(str(error)) from None
        except OSError as error:
            raise self.unwritable(error.strerror) from None
        if not nearest.is_dir():
            raise self.unwritable(f"{nearest} is a file")
        if not os.access(nearest, os.W_OK | os.X_OK):
            raise self.unwritable(os.strerror(errno.EACCES))
