"""Facts of a garment's motion: the deepest point and the longest thread over all frames, with the frame of each."""

import json
from dataclasses import asdict
from pathlib import Path

from taichi_cloth.garment.sewn.in_motion import Moment
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.files import read_json, write_bytes

from .facts import Fact
from .model import FACTS

__all__ = ["MotionFacts"]

LARGEST_FILE = 50_000_000  # bytes


class MotionFacts:
    """What each frame of an animation measured. A run that goes on keeps what the one before it left in a folder."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / FACTS
        self.moments: dict[int, Moment] = {}

    def read(self, last: int) -> None:
        """Takes up what an earlier run left, up to a frame; what is none of ours is left out."""
        try:
            rows = read_json(self.path, most=LARGEST_FILE, give="facts")["frames"]
            found = {int(row.pop("frame")): Moment(**row) for row in rows}
        except (InputError, KeyError, TypeError, ValueError, AttributeError):
            return
        self.moments = {frame: moment for frame, moment in found.items() if frame <= last}

    def facts(self) -> list[Fact]:
        """Two lines, where anything was measured; and one of layers that contact could not keep apart."""
        if not self.moments:
            return []
        deep = max(self.moments, key=lambda k: self.moments[k].depth)
        long = max(self.moments, key=lambda k: self.moments[k].taut)
        d, t = self.moments[deep], self.moments[long]
        stretch = max(moment.stretch for moment in self.moments.values())
        where = f", in {d.part}" if d.part else ""
        out = [
            Fact("deepest in the body, in motion", f"{1e3 * d.depth:.2f} mm in frame {deep}{where}"),
            Fact(
                "longest thread, in motion",
                f"{100 * t.taut:.1f} % in frame {long}, of {t.panel}; at seams {100 * stretch:.1f} %",
            ),
        ]
        let_off = [frame for frame in sorted(self.moments) if self.moments[frame].let_off]
        if let_off:
            pairs = sum(self.moments[frame].let_off for frame in let_off)
            out.append(Fact("layers that could not be kept apart", f"{pairs} pairs, first in frame {let_off[0]}"))
        return out

    def write(self, said: list[Fact]) -> None:
        """said: what was printed of the garment before it moved. Raises OSError."""
        rows = [{"frame": frame, **asdict(self.moments[frame])} for frame in sorted(self.moments)]
        document = {
            "facts": [{"name": f.name, "value": f.value, "beside": f.textbook} for f in [*said, *self.facts()]],
            "units": "depth [m]; stretch, taut: strains of threads, of all and of those that end at no seam; let_off: "
            "pairs of layers that contact could not keep apart",
            "frames": rows,
        }
        write_bytes(self.path, (json.dumps(document, indent=1, ensure_ascii=False) + "\n").encode())
