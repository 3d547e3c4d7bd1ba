"""The report: rows to a page, whole or not at all; what studies say of orders and defaults."""

import csv
import subprocess
import sys
from dataclasses import replace
from math import log2, nan
from pathlib import Path

import cv2
import numpy as np
import pytest

from taichi_cloth.ground.errors import InputError
from taichi_cloth.scenes.measure.diagram import PARTS, draw, draw_bars
from taichi_cloth.scenes.measure.page import Section, write_report
from taichi_cloth.scenes.measure.study import Axis, Row, Study, lines_of, microseconds, orders, standing_of
from taichi_cloth.scenes.studies import interpolation
from taichi_cloth.scenes.studies.make import STUDIES, chosen, make_report
from taichi_cloth.scenes.studies.stages import probed


def line(errors: list[float], seconds: list[float], default: int) -> list[Row]:
    """A method at steps 1, ½, ¼, …"""
    return [
        Row(panel="p", method="m", knob=f"h/{2**k}", value=0.5**k, error=error, seconds=time, default=k == default)
        for k, (error, time) in enumerate(zip(errors, seconds, strict=True))
    ]


STUDY = Study(
    name="x",
    title="X",
    about="",
    error=Axis("error", "mm", 1e3),
    time=Axis("time", "s", 1.0),
    rows=lambda quick: iter(()),
)


def test_the_order_of_errors_that_fall_with_the_square_is_two() -> None:
    rows = line([1.6, 0.4, 0.1], [1.0, 2.0, 4.0], 0)
    ((_, found),) = lines_of(rows[::-1]).items()
    assert [row.knob for row in found] == ["h/1", "h/2", "h/4"]
    assert orders(found) == pytest.approx([2.0, 2.0])
    nameless = [Row(panel="p", method="m", knob="a", error=1.0, seconds=1.0, value=nan)] * 2
    assert orders(nameless) == []


def test_a_step_is_written_without_powers() -> None:
    assert [microseconds(s) for s in (1 / 600, 303.03e-6, 9.1e-6)] == ["1670 µs", "303 µs", "9.1 µs"]


def test_a_default_is_told_from_its_neighbours_and_the_knee_is_the_least_error_times_time() -> None:
    """Errors 1, 0.1, 0.09 m at 1, 2, 4 s: the second has the least product."""
    (sentence,) = standing_of(STUDY, line([1.0, 0.1, 0.09], [1.0, 2.0, 4.0], 2))
    assert "h/4, is off by 90 mm in 4 s" in sentence
    assert "coarser, h/2: error × 1.1 for time × 0.5" in sentence
    assert sentence.endswith("the knee is h/2.")
    (sentence,) = standing_of(STUDY, line([1.0, 0.1, 0.09], [1.0, 2.0, 4.0], 1))
    assert sentence.endswith("it is the knee.")
    rows = line([1.0, 0.1, 0.09], [1.0, 2.0, 4.0], 2)
    (sentence,) = standing_of(replace(STUDY, why={"p: m": "it is pretty"}), rows)
    assert sentence.endswith("the knee is h/2, but it is pretty.")
    (sentence,) = standing_of(STUDY, line([1.0, 0.1, 0.0], [1.0, 2.0, 4.0], 2))
    assert sentence == "p, m: the default, h/4, is as good as the reference, in 4 s."


def section(name: str, image: bytes | None = None) -> Section:
    return Section(
        name=name, title=name, about="", sentences=["<&>"], head=["a"], table=[["|"]], csv="a\n1\n", image=image
    )


def test_a_report_is_written_whole_and_replaces_only_a_report(tmp_path: Path) -> None:
    out = tmp_path / "report"
    write_report([section("one", b"png")], out, title="T", facts=["f"])
    assert sorted(path.name for path in out.iterdir()) == ["index.html", "one.csv", "one.png", "report.md"]
    write_report([section("two")], out, title="T", facts=[])
    assert sorted(path.name for path in out.iterdir()) == ["index.html", "report.md", "two.csv"]
    assert "&lt;&amp;&gt;" in (out / "index.html").read_text()
    assert "| \\| |" in (out / "report.md").read_text()
    assert [path.name for path in tmp_path.iterdir()] == ["report"]
    (out / "report.md").unlink()
    with pytest.raises(InputError, match="something else than a report"):
        write_report([section("two")], out, title="T", facts=[])
    with pytest.raises(AttributeError):
        write_report([section("one"), None], tmp_path / "half", title="T", facts=[])  # pyright: ignore
    assert [path.name for path in tmp_path.iterdir()] == ["report"]


def test_studies_are_chosen_by_name() -> None:
    assert chosen(None) == list(STUDIES)
    assert chosen("twist, solver") == ["solver", "twist"]
    with pytest.raises(InputError, match='did you mean "twist"'):
        chosen("twits")


@pytest.mark.usefixtures("keep_taichi")
def test_a_quick_report_of_one_study(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    make_report(only="twist", quick=True, out=tmp_path / "r")
    names = {path.name for path in (tmp_path / "r").iterdir()}
    assert names == {"index.html", "report.md", "twist.csv", "twist.png"}
    assert (tmp_path / "r" / "twist.png").read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "r" / "twist.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["method"] for row in rows} == {"two zones", "all along the yarn"}
    assert sum(row["default"] == "True" for row in rows) == 2
    assert all(float(row["error"]) > 0 and float(row["seconds"]) > 0 for row in rows)


def test_a_method_that_is_refused_everywhere_does_not_cost_the_diagram() -> None:
    pytest.importorskip("matplotlib")
    refused = [replace(row, method="refused") for row in line([nan] * 4, [nan] * 4, 0)]
    others = [replace(row, method=f"{k}") for k in range(5) for row in line([1.0, 0.1, 0.09], [1.0, 2.0, 4.0], 2)]
    assert draw(STUDY, refused + others).startswith(b"\x89PNG")


def test_bars_are_as_long_as_their_parts_together() -> None:
    """Of 1 + 2 and of 1: the second part's colour, which no other has, as wide as twice the first's."""
    pytest.importorskip("matplotlib")
    drawn = draw_bars([("both", {"one": 1.0, "two": 2.0}), ("one alone", {"one": 1.0})], ["one", "two"], "time [s]")
    picture = cv2.imdecode(np.frombuffer(drawn, np.uint8), cv2.IMREAD_COLOR)
    widths = []
    for colour in PARTS[:2]:
        bgr = [int(colour[k : k + 2], 16) for k in (5, 3, 1)]
        widths.append((picture == bgr).all(axis=-1).sum(axis=1).max())
    assert widths[1] == pytest.approx(2 * widths[0], rel=0.03)


@pytest.mark.slow  # kernels with stamps are compiled anew each time: a minute or two
@pytest.mark.usefixtures("keep_taichi")
def test_the_report_of_contact_tells_what_passes_through_and_where_time_goes(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    make_report(only="layers", quick=True, out=tmp_path / "r")
    with (tmp_path / "r" / "layers.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert row["frames_through"] == row["through"] == row["let_off"] == "0"
    assert int(row["through_without"]) > 0
    assert float(row["mean_ms"]) > float(row["mean_ms_without"]) > 0
    assert "layers: search" in row["parts"]
    assert (tmp_path / "r" / "layers.png").read_bytes().startswith(b"\x89PNG")


def test_without_matplotlib_one_line_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(InputError, match=r'pip install "taichi-cloth\[report\]"'):
        make_report(only="twist", quick=True, out=tmp_path / "r")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow  # three kernels of the follower
def test_interpolation_is_of_its_orders_away_from_edges_and_the_paper_s_rule_of_none() -> None:
    """From 4 to 2 threads a key point (of 4.7 mm waves of 0.2 m): 2 for lines and 3 or better for splines in the
    cloth's frame; the paper's offsets, which stay in the world's axes, stop at their own error. Measured: 2.0, 3.4 and
    0.3 to 1."""
    seen: dict[str, dict[float, float]] = {}
    for row in interpolation.errors(49, (3, 6), interpolation.wave(49)[1:]):
        seen.setdefault(row.method.split(",")[0], {})[row.value] = row.error
    order = {method: log2(error[6.0] / error[3.0]) for method, error in seen.items()}
    assert order["linear"] == pytest.approx(2.0, abs=0.2)
    assert order["smooth"] > 2.8
    assert order["paper: linear"] < 1.5


def test_bilinear_crossings_are_exact_on_a_plane() -> None:
    rng = np.random.Generator(np.random.Philox(key=4))
    i, j = np.meshgrid(np.arange(4.0), np.arange(3.0), indexing="ij")
    plane = i[..., None] * rng.standard_normal(3) + j[..., None] * rng.standard_normal(3)
    fine_i, fine_j = np.meshgrid(np.arange(10) / 3, np.arange(7) / 3, indexing="ij")
    rebuilt = fine_i[..., None] * (plane[1, 0] - plane[0, 0]) + fine_j[..., None] * (plane[0, 1] - plane[0, 0])
    np.testing.assert_allclose(interpolation.bilinear(plane, 3), plane[0, 0] + rebuilt, atol=1e-12)


def test_the_cloth_of_the_interpolation_study_is_bent_without_stretch() -> None:
    x = interpolation.bent(25)
    for axis in (0, 1):
        length = np.linalg.norm(np.diff(x, axis=axis), axis=-1)
        assert length.min() > interpolation.PITCH * (1 - 5e-4)
        assert length.max() < interpolation.PITCH * (1 + 1e-6)


def test_the_draped_cloth_of_the_interpolation_study_lies_on_its_ball_at_every_spacing() -> None:
    """49 threads, 0.15 m: the corners hang, nothing is in the ball, and key points twice as far apart lie within 15 mm,
    a quarter of how far the corners have fallen."""
    resolved, coarse = (interpolation.draped(49, k) for k in (4, 8))
    middle = 24 * interpolation.PITCH
    for x in (resolved, coarse):
        from_ball = np.linalg.norm(x - [middle, middle, -interpolation.BALL - 1e-3], axis=-1)
        assert from_ball.min() > interpolation.BALL - 1e-4
        assert x[[0, 0, -1, -1], [0, -1, 0, -1], 2].max() < -0.04
    assert np.linalg.norm(resolved[::2, ::2] - coarse, axis=-1).max() < 15e-3


COUNTED = """
import taichi as ti
from taichi_cloth.ground import runtime
from taichi_cloth.scenes.studies.stage_probe import field_bytes, kernel_count
runtime.start("cpu", threads=1)
held = field_bytes()
fields = ti.field(ti.f32, (25, 10)), ti.Vector.field(3, ti.i32, 7), ti.ndarray(ti.f32, (4, 4))
fields[0][0, 0] = 1.0
kernels = kernel_count()
fields[0].fill(1.0)
print(field_bytes() - held, kernel_count() - kernels)
"""


def test_fields_and_kernels_are_counted() -> None:
    """In a process that started Taichi once: fields of another start are gone, and asking them is fatal."""
    done = subprocess.run([sys.executable, "-P", "-c", COUNTED], capture_output=True, text=True, check=True)
    held, kernels = (int(number) for number in done.stdout.split()[-2:])
    assert held == 4 * (250 + 21 + 16)
    assert kernels >= 1


@pytest.mark.slow
def test_what_a_scene_leaves_out_compiles_no_kernel_and_takes_no_field() -> None:
    """A yarn without shadows and occlusion compiles fewer kernels than one with them."""
    plain = probed("yarn", ("light.shadows=false", "light.occlusion=false"))
    usual = probed("yarn")
    assert plain.kernels < usual.kernels
    assert plain.bytes <= usual.bytes
    assert "light pass" not in plain.stages
    assert "light pass" in usual.stages
