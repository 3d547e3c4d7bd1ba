"""The paper's tables beside ours: the counts, and how numbers are set out. No time is tested."""

import csv
import io

import numpy as np
import pytest
from strips import simulate, strip

from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.scenes.measure.frame_parts import clock_or_none
from taichi_cloth.scenes.paper.garment_timing import free_sheet, measure
from taichi_cloth.scenes.paper.own_scenes import scene_file
from taichi_cloth.scenes.paper.table_text import PAPER, Measured, tables_of, write_tables
from taichi_cloth.scenes.paper.tables import _count, scene_of
from taichi_cloth.scenes.prepare.weave_layout import prepare_fabric
from taichi_cloth.scenes.scene.load import load_scene


def given(key_points: int = 6250, particles: int = 377_000) -> Measured:
    """Frames of known medians: 10 ms as a mesh, 11 as fibres, of which 4.5 and 4 are contact."""
    times = {
        "mesh": [10.0, 10.0, 10.0, 30.0],
        "fibre": [10.0, 11.0, 11.0, 900.0],
        "normals": [0.2],
        "crossings": [0.1] * 4,
        "follow": [0.754] * 4,
        "substep": [0.2, 0.3, 0.25],
        "substep, sheet": [0.1, 0.1, 0.2],
        "mesh: contact": [4.5, 4.0, 9.0],
        "parts: contact": [4.0, 4.0, 4.0, 90.0],
        "parts: yarns": [5.0, 6.0, 5.5, 90.0],
        "draw, mesh": [20.0],
        "draw, fibre": [40.0],
    }
    return Measured(key_points, particles, 64, times, through=(0, 3, 2))


def test_tables_hold_medians_and_ratios() -> None:
    through = "2 of 3, up to 3 triangles"
    counts, contact, frames, stages, ratios = tables_of({"T-shirt": given()})
    assert counts.rows == (("T-shirt", "6,245", "6,250", "+0.08 %", "377,508", "377,000", "-0.13 %", through),)
    assert contact.rows[0] == ("T-shirt", "43.5", "4.50", "9.7", "46.1", "4.00", "11.5", "1.06", "0.89", through)
    assert frames.rows[0] == ("T-shirt", "63", "10.00", "6.3", "81.3", "11.00", "7.4", "1.29", "1.10", through)
    rows = {row[0]: row[1] for row in stages.rows}
    assert rows["contact"] == "4.00"
    assert rows["as a mesh"] == "10.00"
    assert rows["a particle [ns]"] == "2.0"
    assert ratios.rows == (("T-shirt", "1.100", "250", "100", "2.00", through),)
    assert rows["frames with crossings"] == through
    assert Measured(1, 1, 1, through=(0, 0)).crossings() == "0 of 2"


def test_parts_add_up_to_the_frames_they_are_means_of() -> None:
    """The half in the middle by what frames took in all: the two of 11 ms."""
    parts = given().parts()
    known = {"contact": 4.0, "yarns": 5.75, "crossings": 0.1, "follow": 0.754, "rest": 0.396, "whole": 11.0}
    assert parts == pytest.approx(known)
    rows = {row[0]: row[1] for row in tables_of({"T-shirt": given()})[3].rows}
    assert [rows[name] for name in ("yarns", "contact", "rest", "together: a frame as fibres")] == [
        "5.75", "4.00", "0.40", "11.00"
    ]  # fmt: skip


def test_what_could_not_be_timed_is_left_out_and_said() -> None:
    times = {stage: row for stage, row in given().times.items() if stage.split(":")[0] not in ("parts", "mesh")}
    bare = Measured(6250, 377_000, 64, times | {"mesh": [10.0] * 4})
    _, contact, _, stages, _ = tables_of({"T-shirt": bare})
    assert contact.rows == ()
    assert "Not timed" in contact.notes[0]
    assert not {"contact", "rest"} & {row[0] for row in stages.rows}
    for stage in ("substep, sheet", "draw, mesh", "draw, fibre"):
        del times[stage]
    *_, stages, ratios = tables_of({"T-shirt": Measured(6250, 377_000, 64, times | {"mesh": [10.0] * 4})})
    assert ratios.rows[0][-3:] == ("", "", "not counted")
    assert not any("drawing" in row[0] for row in stages.rows)


def test_differences_are_taken_frame_by_frame() -> None:
    ours = Measured(1, 1, 1, {"a": [1.0, 5.0, 9.0], "b": [0.5, 5.0, 1.0]})
    assert ours.median("a", "b") == 0.5
    assert ours.ratio("a", "b") == 2.0


@pytest.mark.slow
def test_a_garment_is_timed_in_every_way_from_the_same_state() -> None:
    """A coarse skirt: every stage has as many frames as were asked for, and parts add up."""
    changes = ("garment.key_points=800", "garment.hem_mm=0", "body.motion=walk", "output.fps=60", "yarn.fibres=2")
    told: list[str] = []
    scene = load_scene(scene_file("skirt"), list(changes))
    timing = measure("skirt", scene, 3, clock=clock_or_none(), each=lambda stage, done, most: told.append(stage))
    while True:
        try:
            next(timing)
        except StopIteration as ended:
            ours = ended.value
            break
    assert {"skirt: walking", "skirt: timed"} <= set(told)
    stages = {"mesh", "fibre", "substep", "substep, sheet", "mesh: contact", "parts: seams", "parts: yarns"}
    assert {len(ours.times[stage]) for stage in stages} == {3}
    assert len(ours.through) >= 80
    assert not any(ours.through)
    parts = ours.parts()
    whole = parts.pop("whole")
    assert sum(parts.values()) == pytest.approx(whole)
    assert min(parts.values()) >= 0


def test_a_free_sheet_has_the_garments_key_points_and_cloth() -> None:
    sheet = strip(pinned=(0,))
    garment = simulate(sheet, frame_rate=60.0)
    free = free_sheet(garment)
    assert abs(free.sheet.present.sum() - sheet.present.sum()) <= np.sqrt(sheet.present.sum())
    assert free.sheet.material == sheet.material
    assert not free.sheet.pinned.any()
    assert free.frame_time == pytest.approx(garment.frame_time)
    free.step()
    assert np.ptp(free.positions[..., 2]) > 1e-3  # it waves


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
    assert scene.forces is not None
    assert scene.forces.self_contact is not None
    assert abs(dressed_parts(scene).garment.atlas.key_points / PAPER[name].key_points - 1) < 0.01
    assert abs(_count(scene) / PAPER[name].particles - 1) < 0.01
    assert scene.garment is not None
    assert scene.garment.threads_per_key_point == 1
