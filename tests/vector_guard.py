"""Whether the stencil still turns into vector instructions: that is lost silently, at two to four times the cost.

Two ways to look, both in processes of their own, as each needs another start of Taichi: what LLVM made of the kernel
(`roots`, exact, the same on every run) and what it gains (`vector_gain`, a measurement).
"""

import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Roots", "VectorGain", "roots", "vector_gain"]

_SHEET = """
import sys, time
import numpy as np
import taichi_cloth.sheet.sheet
if sys.argv[1] == "one":
    taichi_cloth.sheet.sheet.LANES = 1
from taichi_cloth.ground import runtime
from taichi_cloth.motion.forces import Forces, FrameForces
from taichi_cloth.sheet.materials import named_material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.sheet.springs import calibrate

runtime.start("cpu", threads=1, cache=sys.argv[1] != "roots")
n, frames = int(sys.argv[2]), int(sys.argv[3])
springs = calibrate(named_material("cotton-shirting"), spacing_x=1 / (n - 1), spacing_y=1 / (n - 1))
sheet = Sheet.rectangle(n, n, material=named_material("cotton-shirting"), springs=springs, pinned=np.eye(n)[:1].T)
solver = Verlet(sheet, Forces(), frame_rate=200.0)
state = sheet.state(sheet.flat())
times = []
for _ in range(frames):
    start = time.process_time()
    solver.advance(state, FrameForces())
    times.append(time.process_time() - start)
print(min(times) / solver.substeps / sheet.present.sum())
"""


@dataclass(frozen=True)
class Roots:
    """Square roots in the kernels of a frame after LLVM's last pass: how many numbers vectors hold, and single ones.

    Each lane of the stencil has one for each spring. The look at how stiff the sheet has become has one for springs,
    through which it loops, and five for a 32nd root. Nothing else has one: they tell whether that is vector code.
    """

    packed: int
    single: int


@dataclass(frozen=True)
class VectorGain:
    """CPU time of a substep for each key point [ns]: with whole lanes, and of the same kernel with lanes of one."""

    lanes: float
    single: float

    @property
    def ratio(self) -> float:
        return self.single / self.lanes


def _run(how: str, size: int, frames: int, folder: str | None = None, **environment: str) -> str:
    command = [sys.executable, "-c", _SHEET, how, str(size), str(frames)]
    done = subprocess.run(
        command, cwd=folder, env=os.environ | environment, capture_output=True, text=True, check=True, timeout=600
    )
    return done.stdout


def roots() -> Roots:
    """Counts them in the optimised code that Taichi writes to a folder when asked."""
    with tempfile.TemporaryDirectory() as folder:
        _run("roots", 5, 1, folder, TI_PRINT_KERNEL_LLVM_IR_OPTIMIZED="1")
        text = "\n".join(path.read_text() for path in Path(folder).glob("*.ll"))
    widths = [int(width or 1) for width in re.findall(r"call (?:<(\d+) x )?float>? @llvm\.sqrt", text)]
    return Roots(packed=sum(w for w in widths if w > 1), single=widths.count(1))


def vector_gain(size: int = 79, frames: int = 20) -> VectorGain:
    """Fastest of `frames` frames of a sheet of size² key points, in alternation: lanes, one, lanes, one."""
    found: dict[str, list[float]] = {"lanes": [], "one": []}
    for how in ("lanes", "one") * 2:
        found[how].append(1e9 * float(_run(how, size, frames).split()[-1]))
    return VectorGain(lanes=min(found["lanes"]), single=min(found["one"]))
