"""Error against run time of the solvers: by motion and by stretch, over time, where they cross, and of a garment."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import nan

import numpy as np

from ..measure.curves import Panel, draw_curves
from ..measure.diagram import draw
from ..measure.page import Section, csv_text, section_of
from ..measure.study import Axis, Row, Study
from .solvers import within, worn
from .solvers.cases import CASES, FRAME_RATE, Case, Judged, case_of, judged, motion_error, stretch_error
from .solvers.crossing import CASE, NAMES, NEAR, Cost, costs, crossing
from .solvers.reference import reference
from .solvers.settings import settings

__all__ = ["Tried", "sections", "tried"]

Say = Callable[[str], object]
THREADS = (1.0, 1e2, 1e4)
"""Factors of the threads' stiffness."""

POINTS, FEW = 24, 12
"""Key points along each side, in full and quickly."""

SHARE = 0.2
"""The reference's step in longest stable ones."""

NEARLY, FLOAT32 = (1, 2), 1.5e-8
"""Seeds of references with twice the step that start up to so far off [m], which float32 cannot tell: no solver in
float32 is nearer to the reference than they are."""

FALL = (0.1, 0.2, 0.3, 0.4)
"""Times [s] at which the table says how high the cloth is."""

ABOUT = (
    "Cotton shirting of 0.5 m × 0.5 m, bent to an arc, held at two corners and let go (hang) or laid on a ball "
    "(drape), for 0.4 s; the stiffness of its threads × 1, 100 and 10,000. Reference: Verlet in float64 at a fifth of "
    "its longest step; dashed, that reference against itself with twice the step and a start that float32 cannot tell "
    "from it (15 nm off), below which nothing can be told apart. Whole yarns push threads along the program's blend, "
    "or along n(y). The number beside a point is that of substeps of a frame of 1/60 s. XPBD and the one stable sweep "
    "are not in the program: plain loops in float64, whose times are good to a factor of two. "
)


@dataclass(frozen=True, eq=False)
class Tried:
    """A method in a case. run: None where it was refused, or lost. cost: CPU time [s] a simulated second."""

    case: Case
    method: str
    substeps: int
    run: Judged | None
    cost: float
    default: bool = False
    shown: bool = False

    def row(self, error: Callable[[Judged, Judged], float], best: Judged) -> Row:
        off = nan if self.run is None else error(self.run, best)
        step, knob = 1 / FRAME_RATE / self.substeps, f"{self.substeps}"
        return Row(panel=self.case.panel, method=self.method, knob=knob, value=step, error=off, seconds=self.cost,
                   default=self.default)  # fmt: skip


def tried(quick: bool) -> Iterator[Tried]:
    """Case by case, first the reference, then those that tell how sure it is, then everything else."""
    points = FEW if quick else POINTS
    for name, frames in CASES.items():
        for threads in THREADS:
            case = case_of(name, points, threads=threads)
            for seed in (0, *NEARLY):
                off = FLOAT32 * np.random.Generator(np.random.Philox(key=seed)).uniform(-1, 1, case.start.shape)
                start, share = (case.start + off, 2 * SHARE) if seed else (case.start, SHARE)
                course, count = reference(case.sheet, case.forces, start, case.seconds, share=share, frames=frames)
                yield Tried(case, "reference", count // frames, judged(case.sheet, course), nan)
            for one in settings(case, quick=quick):
                course, cost = one.tried()
                run = None if course is None else judged(case.sheet, course)
                yield Tried(case, one.method, one.substeps, run, cost, one.default, one.shown)


def sections(quick: bool, say: Say) -> list[Section]:
    """All of the page that is about solvers."""
    found: dict[str, list[Tried]] = {}
    for one in tried(quick):
        found.setdefault(one.case.panel, []).append(one)
        say(f"solver: {one.case.panel}, {one.method}, {one.substeps}"[:70])
    out = [_against_time(study, found, error) for study, error in ((MOTION, motion_error), (STRETCH, stretch_error))]
    out.append(_over_time(found))
    several: list[Cost] = []
    for cost in costs(quick):
        several.append(cost)
        say(f"solver: crossing, {cost.points} × {cost.points}, {cost.ratio:g}, {cost.solver}"[:70])
    rows = list(_crossing_rows(several))
    out.append(section_of(CROSSING, rows, draw(CROSSING, rows)))
    rows = list(within.rows(quick))
    say("solver: what cloth has beside springs")
    out.append(section_of(BESIDE, rows, draw(BESIDE, rows)))
    if not quick:
        rows = list(worn.rows())
        out.append(section_of(WORN, rows, draw(WORN, rows)))
    return out


def _against_time(study: Study, found: dict[str, list[Tried]], error: Callable[[Judged, Judged], float]) -> Section:
    rows = []
    for panel, runs in found.items():
        best = runs[0].run
        assert best is not None
        off = [error(one.run, best) for one in runs[1:] if one.run is not None and one.method == study.floor]
        rows.append(
            Row(panel=panel, method=study.floor, knob="the reference's own uncertainty", error=max(off), seconds=nan)
        )
        rows += [one.row(error, best) for one in runs if one.method != study.floor]
    return section_of(study, rows, draw(study, rows))


@dataclass(frozen=True, kw_only=True)
class Moment:
    """A frame of a run: heights [m], and strain of a thread that all but 1 % stay below."""

    panel: str
    method: str
    substeps: int
    time: float
    mean_height: float
    lowest: float
    strain: float


def _over_time(found: dict[str, list[Tried]]) -> Section:
    panels, table, moments = [], [], []
    methods = list(dict.fromkeys(one.method for runs in found.values() for one in runs))
    for panel, runs in found.items():
        best, *nearly = (one.run for one in runs if one.method == MOTION.floor and one.run is not None)
        time = (np.arange(len(best.mean)) + 1) / FRAME_RATE
        shown = {one.method: one.run for one in runs if one.shown and one.run is not None}
        for what, part in (("mean height", "mean"), ("lowest point", "lowest")):
            here = getattr(best, part)
            lines = {name: 1e3 * (getattr(run, part) - here) for name, run in shown.items()}
            # what two references are apart at some time they were able to be at any time before, too
            off = np.max([np.abs(getattr(one, part) - here) for one in nearly], axis=0)
            panels.append(Panel(f"{panel}: {what}", time, lines, np.maximum.accumulate(1e3 * off)))
        for one in runs:
            if one.run is None:
                continue
            at = [int(np.argmin(np.abs(time - moment))) for moment in FALL]
            means, lows = ([f"{1e3 * part[k]:.1f}" for k in at] for part in (one.run.mean, one.run.lowest))
            strain = f"{100 * one.run.strain.max():.2g} %"
            table.append((panel, one.method, str(one.substeps), ", ".join(means), ", ".join(lows), strain))
            moments += [
                Moment(panel=panel, method=one.method, substeps=one.substeps, time=float(t), mean_height=float(m),
                       lowest=float(low), strain=float(s))
                for t, m, low, s in zip(time, one.run.mean, one.run.lowest, one.run.strain, strict=True)
            ]  # fmt: skip
    return Section(
        name="solver_fall",
        title="Solvers: how the cloth falls",
        about="The same runs over time: how much higher than in the reference the cloth is in the mean, and its "
        "lowest point. Grey: how far references that float32 cannot tell apart have parted until then. What is above "
        "falls too slowly.",
        sentences=[],
        head=("panel", "method", "substeps", *(
            f"{what} at {', '.join(f'{t:g}' for t in FALL)} s [mm]" for what in ("mean height", "lowest point")
        ), "greatest strain of 99 %"),
        table=table,
        csv=csv_text(moments),
        image=draw_curves(panels, methods[1:], ("time [s]", "higher than the reference by [mm]")),
    )  # fmt: skip


def _crossing_rows(found: list[Cost]) -> Iterator[Row]:
    """Cost takes the place of the error, and the ratio that of time."""
    for points in dict.fromkeys(one.points for one in found):
        panel = f"{CASE}, {points} × {points}"
        for name in NAMES:
            for one in (one for one in found if (one.points, one.solver) == (points, name)):
                yield Row(panel=panel, method=name, knob=f"{one.substeps}", error=one.seconds,
                          seconds=one.ratio)  # fmt: skip
        at = crossing(found, points)
        if at == at:
            near = {name: [one for one in found if (one.points, one.solver) == (points, name)] for name in NAMES}
            cost = [
                np.exp(np.interp(np.log(at), np.log([o.ratio for o in near[n]]), np.log([o.seconds for o in near[n]])))
                for n in NAMES
            ]
            yield Row(panel=panel, method="they cross", knob=f"{at:.0f} ×", error=float(cost[0]), seconds=at)


MOTION = Study(
    name="solver",
    title="Solvers: motion",
    about=ABOUT + "Error: how far the mean height is from the reference's, root mean square over all "
    "frames. Single key points are not compared: where cotton folds they part like weather.",
    error=Axis("error of mean height, rms", "mm", 1e3),
    time=Axis("CPU time for a simulated second", "ms", 1e3),
    rows=lambda quick: iter(()),
    why={
        "Verlet": "its step is the longest that is stable",
        "yarns, blend, 2 sweeps": "shorter steps gain less than they cost, and a fresh fold asks for two sweeps",
    },
)

STRETCH = Study(
    name="solver_stretch",
    title="Solvers: stretch",
    about="The same runs. Error: how far the strain that 99 % of the threads stay below is from the reference's, root "
    "mean square over all frames.",
    error=Axis("error of strain, rms", "%", 100.0),
    time=MOTION.time,
    rows=MOTION.rows,
    why=MOTION.why,
)

CROSSING = Study(
    name="solver_crossing",
    title="Solvers: where they cross",
    about="The hanging sheet with threads 3 to 300 times as stiff as its shear, which stays cotton's: CPU time of a "
    f"frame of 1/60 s, of the cheapest setting whose motion is within {1e3 * NEAR:g} mm of the reference's (above; "
    "Verlet: its longest stable step; numbers: substeps). Verlet pays the root of the ratio, whole yarns pay nothing.",
    error=Axis("CPU time a frame", "ms", 1e3),
    time=Axis("stiffness of threads, in that of shear", "", 1.0),
    rows=MOTION.rows,
)

BESIDE = Study(
    name="solver_within",
    title="Solvers: what cloth has beside springs",
    about="The hanging sheet with all that cotton shirting has beside springs (friction of bending, the couple, and of "
    "shear, torsion, locking), without each, and by springs alone, as scenes move that do not ask for more; whole "
    "yarns, and in full Verlet; moved a few frames each in turn. Error: how far the mean height is from that with all "
    "of it, root mean square over all frames of 0.4 s; dashed, where a start takes it that is 15 nm off. Numbers: "
    "substeps.",
    error=MOTION.error,
    time=Axis("CPU time a frame", "ms", 1e3),
    rows=within.rows,
    why={within.NONE: "in motion as quick as this inertia outweighs friction; what hangs or lies for long asks for it"},
)

WORN = Study(
    name="solver_worn",
    title="Solvers: a garment",
    about="The built-in skirt, from its rest, as the body sets off walking. Reference: whole yarns at an eighth of the "
    "scene's step. Error: root mean square distance of key points.",
    error=Axis("error, rms", "mm", 1e3),
    time=MOTION.time,
    rows=lambda quick: worn.rows(),
    why={
        "whole yarns": "its error is a small part of what the spacing of key points costs, which no step mends",
    },
)
