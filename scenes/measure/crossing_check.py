"""`check`: triangles of a cloth that pass through others, frame by frame, and which panels they are of; how long its
threads are, how deep a garment lies in its body, and how fast it moves at the end."""

import json
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from taichi_cloth.body.files.mesh_reading import FORMATS, read_mesh
from taichi_cloth.crossings.crossings import Crossings, find_crossings
from taichi_cloth.garment.sewn.in_motion import Watch
from taichi_cloth.ground import runtime
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.simulation import Simulation

from ..commands.device import device_of
from ..models.model import STATE
from ..plan.plan import plan
from ..prepare.garment_setup import dress, garment_simulation, motion_of
from ..prepare.sett import on_cells
from ..prepare.sheet_setup import sheet_simulation, standing_in
from ..scene.load import load_scene
from ..scene.schema import Scene

__all__ = ["Skin", "check", "skin_of"]

MOST_PLACES = 3
"""Pairs of panels that a line names."""
LOOKS = 10
"""Frames from one look at how deep a garment lies in its body to the next."""


@dataclass(frozen=True, eq=False)
class Skin:
    """The triangles that are drawn of a cloth. points: from key points (rows, cols, 3) to its points (n, 3) [m]. faces:
    (m, 3). same: (n,) numbers of points, alike where they are sewn together, or None. panel: (m,) of each triangle.
    names: of the panels. depth: from key points and the time [s] to how deep they lie in the body [m], and in which
    part of it; None: there is none."""

    points: Callable[[NDArray], NDArray]
    faces: NDArray
    same: NDArray | None
    panel: NDArray
    names: list[str]
    depth: Callable[[NDArray, float], tuple[float, str]] | None = None

    def crossings(self, positions: NDArray) -> Crossings:
        """At key points (rows, cols, 3) [m]."""
        return find_crossings(self.points(positions), self.faces, self.same)


def skin_of(scene: Scene) -> tuple[Skin, Simulation]:
    """The cloth of a scene of a [cloth], a [garment] or several, and its simulation, at the start. Taichi is running.
    Raises InputError."""
    if scene.subject == "cloth":
        simulation = sheet_simulation(on_cells(scene), standing_in(scene))
        faces = simulation.sheet.triangles
        skin = Skin(lambda x: x.reshape(-1, 3), faces, None, np.zeros(len(faces), int), ["the sheet"])
        return skin, simulation
    dressed = dress(scene)
    surface = dressed.garment.surface
    names = [piece.panel.name for piece in dressed.garment.atlas.panels]
    watch, motion = Watch(dressed.garment, dressed.grids or dressed.primitives), motion_of(scene, dressed.body)

    def depth(positions: NDArray, time: float) -> tuple[float, str]:
        moment = watch.at(positions, dressed.body.bone_transforms(motion.pose(time)))
        return moment.depth, moment.part

    panel = surface.panel[surface.faces[:, 0]]
    skin = Skin(lambda x: surface.points(x)[0], surface.faces, surface.same, panel, names, depth)
    return skin, garment_simulation(scene, dressed)


def check(what: str, overrides: list[str], *, frames: int | None, arch: Any, threads: int | None) -> Iterator[str]:
    """Lines on a scene, the folder of a run of `animate`, or a mesh; the last is what a command's end follows from.

    frames: how many to look at, the start included; None: all of the scene, or those that the run came to. Returns
    whether anything meets. Raises InputError on what is none of these.
    """
    path = Path(what)
    if path.suffix.lower().removeprefix(".") in FORMATS:
        points, faces = read_mesh(path)
        same = np.unique(points, axis=0, return_inverse=True)[1].ravel()
        found = find_crossings(points, faces, same)
        yield _line(f"{path.name}, points in one place counted as one", found, len(faces), None)
        return found.count > 0
    kept = path / STATE if path.is_dir() else path
    left = None
    if kept.suffix == ".npz":
        scene, left = _run(kept)
        count = left[0] + 1 if frames is None else min(frames, left[0] + 1)
    else:
        scene = load_scene(what, overrides)
        count = frames or scene.output.frames
    if not scene.is_soft:
        raise InputError(f"check: {what} has no cloth that moves; allowed: a scene of a [cloth] or a [garment]")
    runtime.start(arch if arch == "cpu" else device_of(plan(scene), arch), threads=threads)
    skin, simulation = skin_of(scene)
    counts, let_off, moved = [], 0, _Moved(skin, simulation)
    for frame in range(count):
        if frame:
            simulation.step()
            let_off += simulation.solver.let_off
        moved.look()
        found = skin.crossings(simulation.positions)
        counts.append(found.count)
        if found.count:
            yield _line(f"frame {frame}", found, len(skin.faces), skin)
    if left and count == left[0] + 1 and not np.array_equal(left[1], simulation.state.values):
        yield f"{kept} was left by another version of this program, or on another device: this is the same scene, anew"
    if let_off:
        yield f"{let_off:,} pairs could not be kept apart, and were let off"
    yield moved.line()
    yield _summary(counts, len(skin.faces))
    return any(counts)


class _Moved:
    """The longest thread, the deepest place in the body, and the speed in the last frame."""

    def __init__(self, skin: Skin, simulation: Simulation) -> None:
        self._skin, self._simulation = skin, simulation
        self._longest, self._deepest, self._speed = (0.0, 0), (0.0, 0, ""), 0.0
        self._before = simulation.positions

    def look(self) -> None:
        simulation = self._simulation
        positions, frame = simulation.positions, simulation.frame
        longest = max(float(family.max()) for family in simulation.sheet.stretch(positions))
        if longest > self._longest[0]:
            self._longest = longest, frame
        if self._skin.depth is not None and frame % LOOKS == 0:
            depth, part = self._skin.depth(positions, simulation.time)
            if depth > self._deepest[0]:
                self._deepest = depth, frame, part
        way = np.linalg.norm(positions - self._before, axis=-1)[simulation.sheet.present]
        self._speed, self._before = float(way.mean()) / simulation.frame_time, positions

    def line(self) -> str:
        said = [f"longest thread {100 * self._longest[0]:.1f} %, in frame {self._longest[1]}"]
        if self._skin.depth is not None:
            depth, frame, part = self._deepest
            said.append(
                f"deepest in the body {1e3 * depth:.1f} mm" + (f", in frame {frame}, in {part}" if part else "")
            )
        said.append(f"in the last frame it moves by {1e3 * self._speed:.1f} mm/s in the mean")
        return "; ".join(said)


def _run(kept: Path) -> tuple[Scene, tuple[int, NDArray]]:
    """Scene, and number and state of the last frame, of what `animate` left."""
    if not kept.is_file():
        raise InputError(f"check: {kept} is not there; allowed: a scene, the folder of an `animate`, or a mesh file")
    try:
        with np.load(kept, allow_pickle=False) as saved:
            scene = Scene.model_validate(json.loads(str(saved["about"])))
            return scene, (int(saved["frame"]), saved["values"])
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, ValidationError):
        raise InputError(f"{kept}: no state of a scene; allowed: what `animate` of this version left") from None


def _line(name: str, found: Crossings, triangles: int, skin: Skin | None) -> str:
    """What was found in one frame: how much, which panels, and where."""
    if not found.count:
        return f"{name}: none of {triangles:,} triangles passes through another"
    said = f"{name}: {found.count:,} of {triangles:,} triangles pass through others"
    if skin is not None and len(skin.names) > 1:
        pairs = Counter(tuple(sorted(skin.names[k] for k in skin.panel[pair])) for pair in found.pairs)
        most = [f"{one} and {other} {n:,}" for (one, other), n in pairs.most_common(MOST_PLACES)]
        said += f"; pairs of {', '.join(most)}" + (", …" if len(pairs) > MOST_PLACES else "")
    x, y, z = np.median(found.places, axis=0)
    return f"{said}; about ({x:.3f}, {y:.3f}, {z:.3f}) m"


def _summary(counts: list[int], triangles: int) -> str:
    n = np.array(counts)
    if not n.any():
        return f"{len(n)} frames: none of {triangles:,} triangles passes through another"
    return (
        f"{int((n > 0).sum())} of {len(n)} frames: triangles pass through others, at most {n.max():,} of {triangles:,} "
        f"(frame {int(n.argmax())}), in the last {n[-1]:,}"
    )
