"""The paper's tables beside ours: the counts, and how numbers are set out. No time is tested."""

import csv
import io

import numpy as np
import pytest
from strips import run, simulate, strip

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.body.primitives.primitives import Primitive
from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.constraints.contact import Contact
from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.motion.forces import Forces
from taichi_cloth.scenes.paper.table_text import PAPER, Measured, tables_of, write_tables
from taichi_cloth.scenes.paper.tables import _count, contact_twice, scene_of
from taichi_cloth.scenes.prepare.weave_layout import prepare_fabric
from taichi_cloth.scenes.scene.load import load_scene


def given(key_points: int = 6250, particles: int = 377_000) -> Measured:
    """Frames of known medians: 10 ms as a mesh, 11 as fibres, of which 4.5 and 4 are contact."""
    times = {
        "mesh": [9.0, 10.0, 30.0],
        "fibre": [10.0, 11.0, 12.0],
        "step, mesh": [9.0, 9.0, 9.0],
        "step, fibre": [9.5, 9.5, 9.5],
        "kernel, fibre": [9.25, 9.25, 9.25],
        "step, contact twice": [13.0, 13.5, 14.0],
        "normals": [0.2],
        "crossings": [0.1],
        "follow": [0.754],
        "draw, mesh": [20.0],
        "draw, fibre": [40.0],
    }
    return Measured(key_points, particles, 64, times)


def test_tables_hold_medians_and_ratios() -> None:
    counts, contact, frames, stages = tables_of({"T-shirt": given()})
    assert counts.rows == (("T-shirt", "6,245", "6,250", "+0.08 %", "377,508", "377,000", "-0.13 %"),)
    assert contact.rows[0] == ("T-shirt", "43.5", "4.50", "9.7", "46.1", "4.00", "11.5", "1.06", "0.89")
    assert frames.rows[0] == ("T-shirt", "63", "10.00", "6.3", "81.3", "11.00", "7.4", "1.29", "1.10")
    rows = {row[0]: row[1] for row in stages.rows}
    assert rows["springs, yarns, seams, cloth on cloth"] == "5.25"
    assert rows["what the host does for it"] == "0.25"
    assert rows["together: a frame as fibres"] == "11.00"
    assert rows["a particle [ns]"] == "2.0"


def test_contact_is_the_median_of_differences_not_the_difference_of_medians() -> None:
    ours = Measured(1, 1, 1, {"a": [1.0, 5.0, 9.0], "b": [0.0, 4.9, 1.0]})
    assert ours.median("a", "b") == 1.0
    assert abs(ours.median("a") - ours.median("b") - 4.0) < 1e-12


@pytest.mark.slow
def test_contact_that_is_done_twice_moves_cloth_as_once_does() -> None:
    """A strip that falls on a ball: both passes find it there, and in a quarter of a second the second moves no key
    point by more than 0.1 mm."""
    ball = Primitive(kind="sphere", start=np.zeros(3), end=np.zeros(3), radii=(0.1, 0.1))
    sheet = strip(air_damping=4.0)
    x = np.roll(sheet.flat(), 1, axis=-1) + np.array([0.0, 0.102, -0.2])  # level, its middle just above the ball
    forces = Forces(body=Colliders(primitives=(ball,)))
    once, twice = (
        simulate(sheet, forces=forces, positions=x, choose=choose) for choose in (constraints_for, contact_twice)
    )
    apart = np.abs(run(once, 15)[-1] - run(twice, 15)[-1])
    assert apart.max() < 1e-4
    found = [one.fields.used.to_numpy().any() for one in twice.solver.constraints if isinstance(one, Contact)]
    assert found == [True, True]


def test_text_csv_and_markdown_say_the_same(tmp_path) -> None:
    tables = tables_of({name: given() for name in PAPER})
    paths = write_tables(tables, ["a machine"], tmp_path)
    assert [p.name for p in paths] == ["tables.txt", "tables.md", *(f"{t.name}.csv" for t in tables)]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(p.name for p in paths)  # nothing half written is left
    text, marked = ((tmp_path / f"tables.{end}").read_text() for end in ("txt", "md"))
    for table in tables:
        read = list(csv.reader(io.StringIO((tmp_path / f"{table.name}.csv").read_text())))
        assert len(read) == len(table.rows) + 1
        assert all(len(row) == len(table.head) for row in read)
        for row in table.rows:
            assert "| " + " | ".join(row) + " |" in marked
            assert all(cell in text for cell in row)


def test_particles_are_counted_as_they_are_made() -> None:
    fabric = build_fabric(prepare_fabric(load_scene("plain", ["weave.ends=7", "weave.picks=6"])).layout)
    shape = fabric.layout.cloth.warp_up.shape
    present = np.ones(shape, bool)
    present[0, :3] = False
    spans = np.tile(np.array([0.0, 1.0], np.float32), (len(fabric.layout.blocks.kind), 1))
    spans[::3, 1] = 0.4
    spans[::7] = 1.0, 0.0
    for chosen in ({}, {"present": present}, {"spans": spans}, {"present": present, "spans": spans}):
        made = FibreFollower(fabric, **chosen)  # pyright: ignore[reportArgumentType]
        assert FibreFollower.count(fabric, **chosen) == made.particles


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("short skirt"),
        pytest.param("T-shirt", marks=pytest.mark.slow),
        pytest.param("dress", marks=pytest.mark.slow),
    ],
)
def test_garments_have_the_papers_counts(name: str) -> None:
    from taichi_cloth.scenes.prepare.garment_setup import dressed_parts

    scene = scene_of(name)
    assert abs(dressed_parts(scene).garment.atlas.key_points / PAPER[name].key_points - 1) < 0.01
    assert abs(_count(scene) / PAPER[name].particles - 1) < 0.01
    assert scene.garment is not None
    assert scene.garment.threads_per_key_point == 1
