"""What a key point takes in a substep, with each solver: the constants of `taichi_cloth/solvers/choice.py`, made again.

    python docs/solver_costs.py                 # sheets
    python docs/solver_costs.py --seams         # and a T-shirt at rest, which is sewn first with each solver
    python docs/solver_costs.py --within        # with friction within the sheet over without it, and nothing else

Both solvers move the same scene on one core, frame by frame in turn; CPU time, medians. What decides is their ratio; on
a machine that is busy with other things that is good to some tenths. The last lines say what to write into choice.py.
"""

import argparse
from collections.abc import Callable, Iterable
from statistics import median
from time import process_time

from taichi_cloth.ground import runtime
from taichi_cloth.motion.kernel_solver import KernelSolver
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.scenes.models.cloth_model import ClothModel
from taichi_cloth.scenes.prepare.garment_setup import dress, garment_simulation
from taichi_cloth.scenes.scene.load import load_scene
from taichi_cloth.solvers.choice import NANOSECONDS

SHEETS = ("flag", "drape", "hanging", "stretch", "sheet-walk", "drape-body")
ALONE = ("cloth.representation=mesh", "forces.self_contact=false")
BEFORE, FRAMES = 10, 30
"""Frames of each before the first one that is timed, and of those."""


def sheet(name: str, solver: str) -> Simulation:
    """Of a scene of cloth, without its fibres and without what keeps its layers apart."""
    return ClothModel(load_scene(name, [f"solver.name={solver}", *ALONE])).simulation


def shirt(name: str, solver: str) -> Simulation:
    """Worn and at rest."""
    scene = load_scene(name, [f"solver.name={solver}"])
    return garment_simulation(scene, dress(scene))


def costs(
    name: str, make: Callable[[str, str], Simulation], frames: int, options: Iterable[str] = tuple(NANOSECONDS)
) -> dict[str, float]:
    """Nanoseconds of a key point in a substep, by solver or what else `make` is asked for."""
    moved = {option: make(name, option) for option in options}
    times: dict[str, list[float]] = {solver: [] for solver in moved}
    for number in range(BEFORE + frames):
        for solver, simulation in moved.items():
            begin = process_time()
            simulation.step()
            took = process_time() - begin
            if number >= BEFORE:
                assert isinstance(simulation.solver, KernelSolver)
                points = int(simulation.sheet.present.sum())
                times[solver].append(1e9 * took / simulation.solver.substeps / points)
    return {solver: median(row) for solver, row in times.items()}


def rubbing(name: str, frames: int) -> dict[str, float]:
    """What friction within makes of a key point's time, by solver."""

    def both(name: str, option: str) -> Simulation:
        solver, within = option.split()
        options = [f"solver.name={solver}", *ALONE, f'cloth.properties.within="{within}"']
        return ClothModel(load_scene(name, options)).simulation

    found = {}
    for solver in NANOSECONDS:
        times = costs(name, both, frames, (f"{solver} none", f"{solver} all"))
        found[solver] = times[f"{solver} all"] / times[f"{solver} none"]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seams", action="store_true", help="a T-shirt too")
    parser.add_argument("--within", action="store_true", help="what friction within the sheet takes, alone")
    parser.add_argument("--frames", type=int, default=FRAMES, help=f"timed, of each; default: {FRAMES}")
    given = parser.parse_args()
    runtime.start("cpu", threads=1)
    if given.within:
        for name in ("drape", "drape-body"):
            print(f"{name:<12}", *(f"{solver} {ratio:.2f}" for solver, ratio in rubbing(name, given.frames).items()))
        return
    table = {name: costs(name, sheet, given.frames) for name in SHEETS}
    if given.seams:
        table["tshirt"] = costs("tshirt", shirt, given.frames)
    print(f"{'scene':<12} {'verlet':>8} {'yarns':>8} {'ratio':>6}   [ns a key point and substep]")
    for name, row in table.items():
        print(f"{name:<12} {row['verlet']:8.1f} {row['yarns']:8.1f} {row['yarns'] / row['verlet']:6.2f}")
    for solver, (alone, seams) in NANOSECONDS.items():
        found = median(table[name][solver] for name in SHEETS)
        sewn = f"{table['tshirt'][solver]:.1f} with seams" if given.seams else "seams not measured"
        print(f"{solver}: {found:.1f} without seams, {sewn} (choice.py: {alone}, {seams})")


if __name__ == "__main__":
    main()
