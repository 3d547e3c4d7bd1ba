"""Whether the stencil still turns into vector instructions: that is lost silently, at two to four times the cost.

What LLVM made of the kernel tells, exactly and the same on every run; in a process of its own, as that needs another
start of Taichi.
"""

import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Roots", "roots"]

_FRAME = """
import numpy as np
from taichi_cloth.ground import runtime
from taichi_cloth.motion.forces import Forces, FrameForces
from taichi_cloth.sheet.materials import named_material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.sheet.springs import calibrate

runtime.start("cpu", threads=1, cache=False)
cotton = named_material("cotton-shirting").linear
springs = calibrate(cotton, spacing_x=0.25, spacing_y=0.25)
sheet = Sheet.rectangle(5, 5, material=cotton, springs=springs, pinned=np.eye(5)[:1].T)
Verlet(sheet, Forces(), frame_rate=200.0).advance(sheet.state(sheet.flat()), FrameForces())
"""


@dataclass(frozen=True)
class Roots:
    """Square roots in the kernels of a frame after LLVM's last pass: how many numbers vectors hold, and single ones.

    Each lane of the stencil has one for each spring. The look at how stiff the sheet has become has one for springs,
    through which it loops, and five for a 32nd root. Nothing else has one: they tell whether that is vector code.
    """

    packed: int
    single: int


def roots() -> Roots:
    """Counts them in the optimised code that Taichi writes to a folder when asked."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"TI_PRINT_KERNEL_LLVM_IR_OPTIMIZED": "1"}
        command = [sys.executable, "-P", "-c", _FRAME]
        subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=True, timeout=600)
        text = "\n".join(path.read_text() for path in Path(folder).glob("*.ll"))
    widths = [int(width or 1) for width in re.findall(r"call (?:<(\d+) x )?float>? @llvm\.sqrt", text)]
    return Roots(packed=sum(w for w in widths if w > 1), single=widths.count(1))
