"""Cloth that meets cloth: what passes through itself with contact and without, and what a frame of either costs."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import mean, median

from taichi_cloth.layers.layer_contact import LayerContact
from taichi_cloth.motion.kernel_solver import stamped
from taichi_cloth.motion.stage_clock import StageClock

from ..measure.crossing_check import skin_of
from ..measure.diagram import draw_bars
from ..measure.frame_parts import KERNEL_PARTS, clock_or_none, kernel_parts
from ..measure.page import Section, csv_text
from ..scene.load import load_scene

__all__ = ["CASES", "Case", "LayersRow", "row_of", "run", "section", "sections"]


@dataclass(frozen=True)
class Case:
    """A scene, as a mesh, and so many frames of it."""

    scene: str
    frames: int
    overrides: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        moves = [change.split("=")[1] for change in self.overrides if change.startswith("body.motion")]
        return ", ".join([self.scene, *moves])


CASES = (
    Case("drape", 60),
    Case("flag", 60),
    Case("hanging", 60),
    Case("drape-body", 40),
    Case("sheet-walk", 40),
    Case("tshirt", 40, ("body.motion=walk",)),
    Case("skirt", 40, ("body.motion=walk",)),
    Case("dress", 40, ("body.motion=walk",)),
)
QUICK = (Case("drape", 8, ("cloth.rows=40", "cloth.columns=40")),)
OFF = "forces.self_contact=false"


class Course:
    """A case from its start on, frame by frame: CPU times [ms] and triangles through others of each, the longest thread
    [%], ms of each of KERNEL_PARTS where kernels can ask for the time, pairs that a proof pushed and those let off."""

    def __init__(self, case: Case, clock: StageClock | None, *overrides: str) -> None:
        subject = load_scene(case.scene).subject
        scene = load_scene(case.scene, [f"{subject}.representation=mesh", *case.overrides, *overrides])
        with stamped(clock):
            self.skin, self.simulation = skin_of(scene)
        self.times: list[float] = []
        self.through = [self.skin.crossings(self.simulation.positions).count]
        self.parts: dict[str, list[float]] = {}
        self.longest, self.pushed, self.let_off, self._clock = 0.0, 0, 0, clock

    def step(self) -> None:
        if self._clock is not None:
            self._clock.forget()
        begin = time.process_time()
        self.simulation.step()
        self.times.append(1e3 * (time.process_time() - begin))
        if self._clock is not None:
            for part, seconds in kernel_parts(self._clock.read()).items():
                self.parts.setdefault(part, []).append(1e3 * seconds)
        positions, solver = self.simulation.positions, self.simulation.solver
        self.through.append(self.skin.crossings(positions).count)
        self.longest = max(self.longest, *(100 * float(p.max()) for p in self.simulation.sheet.stretch(positions)))
        self.let_off += solver.let_off
        layers = [one for one in self.simulation.solver.constraints if isinstance(one, LayerContact)]
        self.pushed += sum(one.fields.certificate.pushed[None] for one in layers)


@dataclass(frozen=True, kw_only=True)
class LayersRow:
    """A case, with contact and without, of the same frames but for the first, which compiles. Times: CPU [ms] of a
    frame. frames_through: of those looked at, all, how many had triangles through others; through: most of them.
    parts: mean times [ms] of the parts of a frame with contact, in one text."""

    case: str
    key_points: int
    triangles: int
    frames: int
    frames_through: int
    through: int
    through_without: int
    median_ms: float
    mean_ms: float
    median_ms_without: float
    mean_ms_without: float
    longest_percent: float
    longest_percent_without: float
    pushed: int
    let_off: int
    parts: str


def run(case: Case, clock: StageClock | None) -> tuple[Course, Course]:
    """With contact and without, a frame of the one after a frame of the other: what the machine does besides falls on
    both alike. Taichi is running."""
    courses = Course(case, clock), Course(case, clock, OFF)
    for _ in range(case.frames):
        for course in courses:
            course.step()
    return courses


def row_of(case: Case, met: Course, not_met: Course) -> LayersRow:
    """Of what `run` gives."""
    return LayersRow(
        case=case.name,
        key_points=int(met.simulation.sheet.present.sum()),
        triangles=len(met.skin.faces),
        frames=case.frames,
        frames_through=sum(count > 0 for count in met.through),
        through=max(met.through),
        through_without=max(not_met.through),
        median_ms=median(met.times[1:]),
        mean_ms=mean(met.times[1:]),
        median_ms_without=median(not_met.times[1:]),
        mean_ms_without=mean(not_met.times[1:]),
        longest_percent=met.longest,
        longest_percent_without=not_met.longest,
        pushed=met.pushed,
        let_off=met.let_off,
        parts=", ".join(f"{part} {ms:.1f}" for part, ms in parts_of(met).items()),
    )


def parts_of(course: Course) -> dict[str, float]:
    """Mean time of each part [ms], in the order of KERNEL_PARTS; of no clock none."""
    means = {part: mean(times[1:]) for part, times in course.parts.items()}
    return {part: means[part] for part in KERNEL_PARTS if part in means}


def sections(quick: bool, say: Callable[[str], object]) -> list[Section]:
    """The table of cases, and where their frames go."""
    rows: list[LayersRow] = []
    bars: list[tuple[str, dict[str, float]]] = []
    clock = clock_or_none()
    for case in QUICK if quick else CASES:
        say(f"layers: {case.name}")
        met, not_met = run(case, clock)
        rows.append(row_of(case, met, not_met))
        bars += [(case.name, parts_of(met)), ("without contact", parts_of(not_met))]
    return [section(rows, bars)]


def section(rows: Sequence[LayersRow], bars: Sequence[tuple[str, dict[str, float]]]) -> Section:
    """The page's. bars: the parts [ms] of each case with contact, and of the same without, in turn; empty ones where
    kernels cannot ask for the time."""
    said = [
        f"{row.case}: {row.frames_through} of {row.frames + 1} frames have triangles that pass through others "
        f"(without contact up to {row.through_without:,}); a frame takes {row.median_ms / row.median_ms_without:.2f} "
        f"times that without contact in the median, {row.mean_ms / row.mean_ms_without:.2f} in the mean."
        for row in rows
    ]
    table = [
        (
            row.case,
            f"{row.key_points:,}",
            f"{row.frames_through} of {row.frames + 1}",
            f"{row.through:,} ({row.through_without:,})",
            f"{row.median_ms:.1f}, {row.mean_ms:.1f}",
            f"{row.median_ms_without:.1f}, {row.mean_ms_without:.1f}",
            f"{row.longest_percent:.1f} ({row.longest_percent_without:.1f})",
            f"{row.pushed:,}; {row.let_off:,}",
        )
        for row in rows
    ]
    timed = any(parts for _, parts in bars)
    return Section(
        name="layers",
        title="Cloth that meets cloth",
        about="Each scene as a mesh with contact and without, a frame of the one after a frame of the other, on one "
        "thread; CPU times, without the first frame. Triangles that pass through others are counted in every frame by "
        "an exact test that knows nothing of the contact. The diagram: where the mean frame goes, by "
        "time stamps within, which are of the clock and not of the CPU alone.",
        sentences=said,
        head=(
            *("scene", "key points", "frames with crossings", "most triangles through others (without)"),
            *("ms, median and mean", "the same without", "longest thread (without) [%]", "pairs pushed; let off"),
        ),
        table=table,
        csv=csv_text(rows),
        image=draw_bars(bars, KERNEL_PARTS, "mean time of a frame, by stamps inside it [ms]") if timed else None,
    )
