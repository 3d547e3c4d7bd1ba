"""The study of solvers: its reference and the schemes beside it, how motion is judged, and where costs cross."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.mechanics.presets import WITHIN, preset_properties
from taichi_cloth.scenes.measure.curves import Panel, draw_curves
from taichi_cloth.scenes.studies.solvers import within
from taichi_cloth.scenes.studies.solvers.cases import case_of, judged, motion_error, stretch_error
from taichi_cloth.scenes.studies.solvers.crossing import NAMES, Cost, crossing
from taichi_cloth.scenes.studies.solvers.reference import Scheme, reference, scheme_course
from taichi_cloth.scenes.studies.solvers.settings import NOW, settings, verlet, yarns

FRAMES = 6


@pytest.mark.parametrize("scheme", ["Verlet", "XPBD", "one sweep"])
def test_every_scheme_falls_as_all_falls(scheme: Scheme) -> None:
    """Free and flat, in air that takes 4 of its speed a second: y = −g/c (t − (1 − e^(−ct))/c)."""
    case = case_of("hang", 6)
    sheet = replace(case.sheet, pinned=np.zeros_like(case.sheet.pinned))
    sheet = replace(sheet, material=replace(sheet.material, air_damping=4.0))
    flat = np.stack([sheet.flat()[..., 0], 0 * sheet.flat()[..., 0], sheet.flat()[..., 1]], axis=-1)
    course = scheme_course(sheet, case.forces, flat, 0.3, frames=FRAMES, substeps=100, scheme=scheme)
    t = 0.3 * (np.arange(FRAMES) + 1) / FRAMES
    exact = -9.81 / 4 * (t - (1 - np.exp(-4 * t)) / 4)
    np.testing.assert_allclose(course[..., 1].mean(axis=(1, 2)), exact, rtol=2e-3)
    assert np.ptp(course[..., 1], axis=(1, 2)).max() < 1e-12


@pytest.fixture(scope="module")
def hangs() -> dict[str, float]:
    """Errors of mean height [m] of a hung sheet with threads × 100, by scheme and substeps; `stretch …`: of strain."""
    case = case_of("hang", 6, threads=1e2)
    seconds = FRAMES / 60
    best = judged(case.sheet, reference(case.sheet, case.forces, case.start, seconds, share=0.2, frames=FRAMES)[0])
    out = {}
    for scheme in ("XPBD", "one sweep"):
        for substeps in (40, 160, 640):
            options = {"frames": FRAMES, "substeps": substeps, "scheme": scheme}
            found = judged(case.sheet, scheme_course(case.sheet, case.forces, case.start, seconds, **options))
            out[f"{scheme} {substeps}"] = motion_error(found, best)
            out[f"stretch {scheme} {substeps}"] = stretch_error(found, best)
    return out


def test_schemes_come_to_the_reference_as_steps_get_shorter(hangs: dict[str, float]) -> None:
    for scheme in ("XPBD", "one sweep"):
        errors = [hangs[f"{scheme} {substeps}"] for substeps in (40, 160, 640)]
        assert errors[0] > 2 * errors[1] > 4 * errors[2]
    assert hangs["XPBD 640"] < 1e-4


def test_what_is_broken_off_early_is_seen_where_it_errs(hangs: dict[str, float]) -> None:
    """One sweep moves wrongly long before it stretches; XPBD stretches."""
    assert hangs["one sweep 160"] > 10 * hangs["XPBD 160"]
    assert hangs["stretch XPBD 40"] > 5 * hangs["stretch XPBD 160"]


def test_heights_and_strain_are_judged_frame_by_frame() -> None:
    """A flat sheet that is drawn out by 1 % a frame along its rows, and lifted by a millimetre."""
    sheet = case_of("hang", 5).sheet
    course = np.stack([sheet.flat() * [1 + 0.01 * k, 1, 1] + [0, 1e-3 * k, 0] for k in range(4)])
    found, still = judged(sheet, course), judged(sheet, np.stack([sheet.flat()] * 4))
    np.testing.assert_allclose(found.mean - still.mean, [0, 1e-3, 2e-3, 3e-3])
    np.testing.assert_allclose(found.lowest, [0, 1e-3, 2e-3, 3e-3], atol=1e-12)
    np.testing.assert_allclose(found.strain, [0, 0.01, 0.02, 0.03], atol=1e-12)
    assert motion_error(found, still) == pytest.approx(1e-3 * (14 / 4) ** 0.5)
    assert stretch_error(found, still) == pytest.approx(1e-2 * (14 / 4) ** 0.5)


def test_costs_cross_where_lines_between_them_do() -> None:
    """Verlet's rises with the root of the ratio, whole yarns' stays at 2: they cross at 4; beyond what was measured,
    nowhere."""

    def costs(ratios: tuple[float, ...]) -> list[Cost]:
        return [
            Cost(solver=name, points=9, ratio=ratio, substeps=1, error=0.0, seconds=seconds)
            for ratio in ratios
            for name, seconds in zip(NAMES, (ratio**0.5, 2.0), strict=True)
        ]

    assert crossing(costs((1.0, 3.0, 9.0)), 9) == pytest.approx(4.0)
    assert np.isnan(crossing(costs((5.0, 9.0)), 9))


def test_curves_are_drawn() -> None:
    pytest.importorskip("matplotlib")
    time = np.linspace(0, 1, 5)
    panel = Panel("p", time, {"a": np.sin(time), "b": 30 * time}, 0.5 * time)
    assert draw_curves([panel] * 3, ["a", "b"], ("t", "x")).startswith(b"\x89PNG")


def test_a_sheet_has_of_what_is_beside_springs_what_is_asked_for() -> None:
    """From none of it to all that a disc of the same cloth drapes with."""
    woven = preset_properties("cotton-shirting")
    material = case_of("hang", 6, within=["couple", "locking"]).sheet.material
    assert material.couple_weft == pytest.approx(woven.si("couple_weft") / 2)
    assert material.locking == pytest.approx(woven.si("locking_angle"))
    assert (material.torsion, material.shear_friction) == (0.0, 0.0)
    assert case_of("hang", 6).sheet.material == material.elastic
    assert material.tensile_warp == case_of("hang", 6).sheet.material.tensile_warp


@pytest.mark.slow
def test_what_is_left_out_is_seen_and_what_a_start_hides_is_not() -> None:
    """Five runs and a level: with all of it none is off; friction of bending is told from chance."""
    found = {row.method: row for row in within.rows(True)}
    assert list(found) == [within.ALL, *(f"without {name}" for name in WITHIN), within.NONE, "reference"]
    assert found[within.ALL].error == 0
    assert found["without couple"].error > 100 * found["reference"].error
    assert found[within.NONE].default
    assert all(row.seconds > 0 for row in found.values() if row.method != "reference")


def test_a_devices_way_is_a_line_of_its_own_and_moves_as_the_kernel() -> None:
    case = case_of("hang", 6)
    several = {one.method: one for one in settings(case, quick=True)}
    assert several[NOW].tried()[0] is not None
    for of in (verlet, yarns):
        kernel, loops = of(case), of(case, loops=True)
        assert kernel.method != loops.method
        assert {kernel.method, loops.method} <= set(several)
        assert loops.substeps == kernel.substeps
        assert not loops.default
        (one, _), (two, cost) = kernel.tried(), loops.tried()
        assert one is not None
        assert two is not None
        assert cost > 0
        np.testing.assert_allclose(two, one, atol=1e-6)
