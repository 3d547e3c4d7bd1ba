"""What frames take in units of another program's: the table of `solvers.md`, made again.

    python docs/frame_ratios.py "THREADS=1 python proto_verlet.py drape 79 126"

The command is run in each round, and prints `ms_median=` and a number: best of CPU time, as what else a machine does
falls on short programs and long ones unlike. In the same round, one after the other, on one thread and in CPU time,
move: a sheet of 79 × 79 key points that falls on a ball with friction, threads of 10⁵ N/m, for 120 frames of 1/60 s;
then FRAMES frames of each of the paper's garments, which walk. Printed: medians of all rounds, with quartiles, in
milliseconds and in units of the command's own of the same round.
"""

import argparse
import re
import subprocess
from statistics import median
from time import process_time

import numpy as np

from taichi_cloth.ground import runtime
from taichi_cloth.motion.forces import Forces, Sphere
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.scenes.measure.machine import cores, cpu_name
from taichi_cloth.scenes.paper.garment_timing import BEFORE
from taichi_cloth.scenes.paper.tables import scene_of
from taichi_cloth.scenes.prepare.garment_setup import dress, garment_simulation
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import Springs
from taichi_cloth.solvers.yarns import Yarns

SIDE, FALL = 79, 120
GARMENTS = ("T-shirt", "short skirt", "dress")
FRAMES = 20


def drape() -> Simulation:
    """1 m × 1 m, 0.15 kg/m², shear springs of 100 N/m, drag of 1/s, 1 cm above a ball."""
    length = 1 / (SIDE - 1)
    springs = Springs(
        structural_x=1e5, structural_y=1e5, diagonal=100.0, second_x=1.0, second_y=1.0, hinge_x=0.0, hinge_y=0.0,
        spacing_x=length, spacing_y=length, law="spring",
    )  # fmt: skip
    material = Material(
        tensile_warp=1e5, tensile_weft=1e5, shear=100.0, bending_warp=0.0, bending_weft=0.0, density=0.15
    )
    sheet = Sheet.rectangle(SIDE, SIDE, material=material, springs=springs)
    forces = Forces(sphere=Sphere(centre=(0.0, -0.26, 0.0), radius=0.25, gap=0.005))
    flat = sheet.flat()
    positions = np.stack([flat[..., 0], np.zeros(sheet.shape), flat[..., 1]], axis=-1)
    positions -= positions.mean(axis=(0, 1))
    return Simulation(sheet, Yarns(sheet, forces, threads=1), forces=forces, positions=positions)


def timed(simulation: Simulation, frames: int) -> float:
    """Median of so many frames [ms]."""
    times = []
    for _ in range(frames):
        begin = process_time()
        simulation.step()
        times.append(1e3 * (process_time() - begin))
    return median(times[2:])


def other(command: str) -> float:
    """[ms]"""
    said = subprocess.run(command, shell=True, check=True, capture_output=True, text=True).stdout
    return float(re.findall(r"ms_median=([\d.]+)", said)[-1])


def main() -> None:
    words = argparse.ArgumentParser(description="What frames take in units of another program's.")
    words.add_argument("command", help="what is run for its ms_median")
    words.add_argument("--rounds", type=int, default=10)
    asked = words.parse_args()
    runtime.start("cpu", threads=1)
    print(f"{cpu_name()}, {cores()} cores; medians of {asked.rounds} rounds (quartiles)", flush=True)
    walking = {}
    for name in GARMENTS:
        scene = scene_of(name)
        walking[name] = garment_simulation(scene, dress(scene))
        for _ in range(BEFORE):
            walking[name].step()
    rows: dict[str, list[float]] = {}
    for _ in range(asked.rounds):
        rows.setdefault("the command", []).append(other(asked.command))
        sheet = drape()
        rows.setdefault(f"drape, {sheet.solver.substeps} substeps", []).append(timed(sheet, FALL))
        for name, simulation in walking.items():
            rows.setdefault(name, []).append(timed(simulation, FRAMES))
        print(" ".join(f"{row[-1]:.2f}" for row in rows.values()), flush=True)
    unit = np.array(rows["the command"])
    for name, row in rows.items():
        one, two, three = np.percentile(row, [25, 50, 75])
        first, middle, last = np.percentile(np.array(row) / unit, [25, 50, 75])
        print(f"{name}: {two:.1f} ms ({one:.1f} to {three:.1f}); {middle:.2f} ({first:.2f} to {last:.2f})")


if __name__ == "__main__":
    main()
