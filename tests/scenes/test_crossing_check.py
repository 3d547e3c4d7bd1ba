"""`check`: what is counted of a scene, a run and a mesh, frame by frame, and the exit code that follows."""

from pathlib import Path

import numpy as np
import pytest

from taichi_cloth.garment.pattern.cut import cut
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern, Seam, Side
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.scenes.__main__ import main
from taichi_cloth.scenes.models.model import STATE
from taichi_cloth.scenes.prepare.sheet_setup import sheet_simulation
from taichi_cloth.scenes.scene.load import load_scene
from taichi_cloth.sheet.materials import named_material

SMALL = ["cloth.columns=7", "cloth.rows=7", "cloth.material=cotton-shirting"]
SETS = [word for one in SMALL for word in ("--set", one)]


def run(*arguments: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(["check", *arguments])
    return int(end.value.code or 0)


@pytest.fixture
def folding(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the second frame on, the sheet's first column lies beyond its third, a little lower at one end."""

    def step(self: Simulation) -> None:
        self.frame += 1
        if self.frame == 2:
            inside = self.state.values[:3, 2:-2, : self.sheet.shape[1]]
            inside[0, :, 0] = inside[0, :, 2] + 0.3 * (inside[0, :, 3] - inside[0, :, 2])
            inside[1, :, 0] += np.linspace(-0.01, 0.01, self.sheet.shape[0])

    monkeypatch.setattr(Simulation, "step", step)


@pytest.mark.usefixtures("folding", "keep_taichi")
def test_a_scene_and_a_run_of_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("drape", *SETS, "--frames", "2") == 0
    said, summary = capsys.readouterr().out.splitlines()
    assert said == "longest thread 0.0 %, in frame 0; in the last frame it moves by 0.0 mm/s in the mean"
    assert summary == "2 frames: none of 72 triangles passes through another"
    assert run("drape", *SETS, "--frames", "4") == 1
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines] == ["frame 2", "frame 3", lines[2], "2 of 4 frames"]
    assert lines[2].startswith("longest thread 27.0 %, in frame 2; in the last")
    # A run that was left after frame 3.
    scene = load_scene("drape", SMALL)
    simulation = sheet_simulation(scene)
    for _ in range(3):
        simulation.step()
    simulation.save(tmp_path / STATE, about=scene.model_dump_json(exclude_unset=True))
    assert run(str(tmp_path)) == 1
    assert capsys.readouterr().out.splitlines() == lines
    assert run(str(tmp_path / STATE), "--frames", "2") == 0
    simulation.state.values[0] += 1.0
    simulation.save(tmp_path / STATE, about=scene.model_dump_json(exclude_unset=True))
    capsys.readouterr()
    assert run(str(tmp_path)) == 1
    assert "another version" in capsys.readouterr().out


def test_a_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two triangles, each with corners of its own, as STL has them: points in one place are one."""
    crossing = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nv 0.2 0.2 -1\nv 0.2 0.2 1\nf 1 2 3\nf 4 5 6\n"
    path = tmp_path / "two.obj"
    path.write_text(crossing)
    assert run(str(path)) == 1
    assert "2 of 2 triangles pass through others; about (0.200, 0.200, 0.000) m" in capsys.readouterr().out
    path.write_text(crossing.replace("-1", "0.5"))
    assert run(str(path)) == 0
    assert "none of 2 triangles" in capsys.readouterr().out


def test_what_cannot_be_checked_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "state.npz").write_bytes(b"no state")
    for what, line in ((tmp_path, "no state of a scene"), (tmp_path / "no.npz", "is not there"), ("swatch", "moves")):
        assert run(str(what), *([] if what != "swatch" else ["--frames", "1"])) == 2
        assert line in capsys.readouterr().err


def test_a_sheet_is_two_triangles_a_cell_of_cloth() -> None:
    sheet = sheet_simulation(load_scene("drape", SMALL)).sheet
    faces = sheet.triangles
    assert len(faces) == 2 * 36
    assert faces[:2].tolist() == [[0, 1, 8], [0, 8, 7]]


def test_points_along_a_seam_are_one_and_no_others() -> None:
    """Two squares of 0.2 m, sewn along one side of each: every point there has a partner on the other panel within the
    distance of two ties, and no other point has any."""
    ring = np.array([[0, 0], [0.2, 0], [0.2, 0.2], [0, 0.2], [0, 0]])
    panels = [Panel(name, tuple(ring[k : k + 2] for k in range(4)), Flat(np.eye(3), np.zeros(3))) for name in "ab"]
    pattern = Pattern("two", tuple(panels), (Seam(Side("a", 1), Side("b", 3), alike=False),))
    garment = Garment(pattern, cut(pattern, (0.015, 0.015)), named_material("cotton-shirting"))
    surface = garment.surface
    same = surface.same
    first, second = (np.flatnonzero(surface.panel == k) for k in (0, 1))
    right, left = first[surface.flat[first, 0] > 0.2 - 1e-9], second[surface.flat[second, 0] < 1e-9]
    assert len(right) > 10
    assert len(left) > 10
    for one, other in ((right, left), (left, right)):
        for k in one:
            partners = other[same[other] == same[k]]
            assert len(partners)
            assert np.abs(surface.flat[partners, 1] - surface.flat[k, 1]).max() < 0.03
    count = np.bincount(same)
    rest = np.setdiff1d(np.arange(len(same)), np.concatenate([right, left]))
    assert (count[same[rest]] == 1).all()


@pytest.mark.slow
@pytest.mark.usefixtures("keep_taichi")
def test_a_dress_that_is_sewn_with_contact_passes_through_itself_nowhere(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """And stays so: of so few key points it is clear as soon as it is sewn."""
    sets = ("--set", "garment.key_points=1200", "--set", "forces.self_contact={}")
    assert run("dress", "--frames", "4", *sets) == 0
    assert "4 frames: none of" in capsys.readouterr().out
