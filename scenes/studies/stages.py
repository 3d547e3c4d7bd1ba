"""Pay only for what is used: what each built-in scene builds, and what each thing it leaves out would cost it."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from taichi_cloth.ground.errors import InputError

from ..measure.machine import cores
from ..measure.page import Section, csv_text
from ..prepare.garment_setup import dress
from ..scene.load import built_in_scenes, load_scene
from ..scene.schema import Scene
from .stage_probe import Probe

__all__ = ["FORCED", "StageRow", "probed", "sections"]

SIZE = "320x240"
QUICK = ("yarn",)
MOVED, ALL = ("cloth", "garment"), ("fabric", "cloth", "garment", "yarn", "fibre", "twist")

FORCED: dict[str, tuple[tuple[str, ...], Callable[[Scene], bool], tuple[str, ...]]] = {
    "wind": (MOVED, lambda s: bool(s.forces and s.forces.wind), ("forces.wind.velocity_m_per_s=[0, 0, 0]",)),
    "ball": (
        MOVED,
        lambda s: bool(s.forces and s.forces.sphere),
        ("forces.sphere.centre_m=[0, -99, 0]", "forces.sphere.radius_m=0.1"),
    ),
    "plane": (
        MOVED,
        lambda s: bool(s.forces and s.forces.plane),
        ("forces.plane.height_m=-99", "stage.ground=false"),
    ),
    "strain limit": (
        MOVED,
        lambda s: bool(s.forces and s.forces.strain_limit),
        ("forces.strain_limit.percent=100",),
    ),
    "cloth on cloth": (
        MOVED,
        lambda s: bool(s.forces and s.forces.self_contact),
        ("forces.self_contact.thickness_mm=1e-3",),
    ),
    "fibre damping": (
        ("cloth",),
        lambda s: bool(s.cloth and s.cloth.properties.fibre_damping_ms),
        ("cloth.properties.fibre_damping_ms=1e-6",),
    ),
    "rim light": (ALL, lambda s: s.light.rim_strength > 0, ("light.rim_strength=1e-6",)),
    "floor": (("yarn", "fibre", "twist"), lambda s: s.stage.ground is not None, ("stage.ground=true",)),
}
"""What can be forced on: the subjects it is for, whether a scene has it, and the overrides that turn it on where it
changes nothing that is seen."""
SEEN = ("rim light", "floor")
"""Of these, what is a part of drawing and not of moving."""


@dataclass(frozen=True, kw_only=True)
class StageRow:
    """A scene as it is (forced: ""), or with something it has no use for. As `Probe`; stages: in one text."""

    scene: str
    forced: str
    kernels: int
    field_bytes: int
    moved_ms: float
    drawn_ms: float
    cpu_s: float
    stages: str


def probed(name: str, overrides: tuple[str, ...] = (), cache: str | None = None) -> Probe:
    """A scene in a process of its own. cache: folder of Taichi's compiled kernels instead of the usual one. Raises
    InputError with what the process said last where it fails."""
    environment = os.environ | ({"TI_OFFLINE_CACHE_FILE_PATH": cache} if cache else {})
    command = [
        sys.executable,
        "-P",
        "-m",
        "taichi_cloth.scenes.studies.stage_probe",
        str(time.time()),
        SIZE,
        name,
        *overrides,
    ]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if done.returncode:
        raise InputError(f"report: {name} {' '.join(overrides)}: {done.stderr.strip().splitlines()[-1]}")
    return Probe(**json.loads(done.stdout.splitlines()[-1]))


def _rows(names: list[str], say: Callable[[str], object]) -> Iterator[StageRow]:
    """Two processes at a time where there are two cores: the times of frames are CPU times."""
    cases: list[tuple[str, str, tuple[str, ...]]] = []
    for name in names:
        scene = load_scene(name)
        cases.append((name, "", ()))
        cases += [
            (name, what, changes)
            for what, (subjects, has, changes) in FORCED.items()
            if scene.subject in subjects and not has(scene)
        ]
    for name, _, changes in cases:
        scene = load_scene(name, list(changes))
        if scene.subject == "garment":
            say(f"stages: {name}, sewn where it is not kept")
            dress(scene)  # once for all: kernels that sew are not the scene's
    with ThreadPoolExecutor(min(2, cores())) as pool:
        for (name, what, _), found in zip(cases, pool.map(lambda c: probed(c[0], c[2]), cases), strict=True):
            yield StageRow(
                scene=name,
                forced=what,
                kernels=found.kernels,
                field_bytes=found.bytes,
                moved_ms=1e3 * found.moved_s,
                drawn_ms=1e3 * found.drawn_s,
                cpu_s=found.cpu_s,
                stages=", ".join(found.stages),
            )


def _start_up(states: Sequence[tuple[str, int]]) -> list[str]:
    """Import alone, and the first picture of the swatch in each state of the cache of kernels, with the time [s] that
    is wanted: one after the other on the same cache, empty at first."""
    code = "import time; t = time.perf_counter(); import taichi_cloth; print(time.perf_counter() - t)"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    out = [f"import taichi_cloth: {float(done.stdout):.3f} s, without Taichi (wanted: under 0.5 s)."]
    with tempfile.TemporaryDirectory() as folder:
        for state, wanted in states:
            p = probed("swatch", cache=folder)
            out.append(
                f"First picture of the swatch, {state} kernel cache: {p.picture_s:.1f} s, {p.cpu_s:.1f} s of CPU time "
                f"(wanted: under {wanted} s): Python and imports {p.import_s:.1f}, plan and start of Taichi "
                f"{p.start_s - p.import_s:.1f}, fabric {p.build_s - p.start_s:.1f}, light and picture with kernels "
                f"{p.picture_s - p.build_s:.1f}."
            )
    return out


def sections(quick: bool, say: Callable[[str], object]) -> list[Section]:
    """The table of scenes."""
    names = [n for n in built_in_scenes() if n in QUICK or not quick]
    rows: list[StageRow] = []
    for row in _rows(names, say):
        rows.append(row)
        say(f"stages: {row.scene} {row.forced}")
    plain = {row.scene: row for row in rows if not row.forced}
    table = []
    for row in rows:
        less = plain[row.scene]
        more = f"{row.kernels - less.kernels:+d} kernels, {(row.field_bytes - less.field_bytes) / 1e6:+.2f} MB, " + (
            f"drawn {row.drawn_ms - less.drawn_ms:+.1f} ms"
            if row.forced in SEEN
            else f"moved {row.moved_ms - less.moved_ms:+.2f} ms"
        )
        numbers = f"{row.kernels}", f"{row.field_bytes / 1e6:.2f}", f"{row.moved_ms:.2f}", f"{row.drawn_ms:.1f}"
        table.append(
            (row.scene, f"with {row.forced}" if row.forced else "", *numbers, more if row.forced else row.stages)
        )
    one = Section(
        name="stages",
        title="Pay only for what a scene uses",
        about=f"Each scene in a process of its own, one thread, pictures of {SIZE.replace('x', ' × ')} px; below it "
        "the same scene with something it has no use for forced on where it changes nothing that is seen: what "
        "leaving it out saves. Kernels: compiled or loaded, each variant once. Fields: of Taichi, most "
        "of them the picture's and the particles'. A frame: moved, 0 where nothing moves, and drawn, fibres laid where "
        "they go; CPU times, medians of up to twelve and up to three frames, which differ by some percent from run to "
        "run: what is forced on is compared by the one that it is a part of.",
        sentences=_start_up(() if quick else (("cold", 30), ("warm", 5))),
        head=("scene", "forced on", "kernels", "fields [MB]", "moved [ms]", "drawn [ms]", "built, or what it costs"),
        table=table,
        csv=csv_text(rows),
    )
    return [one]
