"""Spring constants make the sheet's moduli, whatever the spacing; forces are the derivative of the energy."""

from dataclasses import replace

import numpy as np
import pytest
from strips import PLAIN, strip

from taichi_cloth.ground.errors import InputError
from taichi_cloth.sheet.energy import elastic_energy, elastic_forces, sheared
from taichi_cloth.sheet.materials import MATERIALS, Material, named_material
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import BendingLaw, calibrate

RNG = np.random.Generator(np.random.Philox(key=3))


def sheet_of(material: Material, a: float, b: float, *, bending: BendingLaw = "hinge", rows=6, cols=9) -> Sheet:
    springs = calibrate(material, spacing_x=a, spacing_y=b, bending=bending)
    return Sheet.rectangle(rows, cols, material=material, springs=springs)


@pytest.mark.parametrize(("a", "b"), [(0.01, 0.01), (0.005, 0.005), (0.01, 0.007)])
@pytest.mark.parametrize("name", MATERIALS)
def test_a_stretched_or_sheared_sheet_stores_the_energy_of_its_moduli(name: str, a: float, b: float) -> None:
    """Energy per area at 1e-4 strain against ½ E e² with the free lateral contraction, and ½ G g². Tolerance 0.1 %."""
    material = MATERIALS[name]
    sheet = sheet_of(material, a, b)
    x = sheet.flat()
    area = x[..., 0].max() * x[..., 1].max()
    e, g = 1e-4, material.shear
    c_y = (
        material.tensile_warp
        + (material.tensile_warp**2 + 4 * g**2 * material.tensile_warp / material.tensile_weft) ** 0.5
    ) / 2
    c_x = c_y * material.tensile_weft / material.tensile_warp
    for along, modulus, contraction in ((0, material.tensile_weft, g / c_y), (1, material.tensile_warp, g / c_x)):
        stretched = x.copy()
        stretched[..., along] *= 1 + e
        stretched[..., 1 - along] *= 1 - contraction * e
        assert elastic_energy(sheet, stretched) / area == pytest.approx(modulus * e**2 / 2, rel=1e-3)
    sheared = x.copy()
    sheared[..., 0] += e * x[..., 1]
    assert elastic_energy(sheet, sheared) / area == pytest.approx(material.shear * e**2 / 2, rel=1e-3)


@pytest.mark.parametrize("cut", [8, 16])
def test_a_sheet_on_a_cylinder_stores_b_kappa_squared(cut: int) -> None:
    """Of the strip between the first and the last hinge's patch; 0.3 % at 1/8 rad a key point, by (angle)²/12."""
    b, radius = 1.0 / cut * 0.1, 0.1
    sheet = sheet_of(PLAIN, b, b, rows=cut + 1, cols=4)
    angle = np.arange(cut + 1) / cut
    chord = b / (2 * np.sin(0.5 / cut))  # key points stay `b` apart
    x = sheet.flat()
    x[..., 1], x[..., 2] = chord * np.sin(angle)[:, None], chord * (1 - np.cos(angle))[:, None]
    patches = (cut - 1) * b * 3 * b  # hinges × length × width
    assert elastic_energy(sheet, x) == pytest.approx(0.5 * PLAIN.bending_warp / radius**2 * patches, rel=0.004)


def test_diagonals_of_a_twisted_cell_lock_by_g_a4_kappa4_over_32() -> None:
    """Threads keep their length, nothing is sheared, and both diagonals get shorter: what the docs say of drape on
    coarse grids (docs/fabrics.md). Within 1 %, the next order in (a κ)²."""
    a, kappa = 7.5e-3, 20.0
    material = replace(named_material("silk-habotai"), torsion=0.0)
    sheet = sheet_of(material, a, a, rows=2, cols=2)
    lift = a * a * kappa / 4  # corners by turns up and down: |x₀₀ − x₁₀ − x₀₁ + x₁₁| = a² κ
    half = np.sqrt(a * a - 4 * lift * lift) / 2
    x = np.array([[[-half, -half, lift], [half, -half, -lift]], [[-half, half, -lift], [half, half, lift]]])
    assert np.linalg.norm(x[0, 1] - x[0, 0]) == pytest.approx(a)
    assert elastic_energy(sheet, x) / a**2 == pytest.approx(material.shear * a**4 * kappa**4 / 32, rel=0.01)
    rubbing = sheet_of(replace(material, shear_friction=0.1), a, a, rows=2, cols=2)
    assert (rubbing.springs.diagonal, rubbing.springs.shear) == (0.0, pytest.approx(sheet.springs.diagonal / 2))
    assert elastic_energy(rubbing, x) < 1e-6 * elastic_energy(sheet, x)


@pytest.mark.parametrize("degrees", [30, 45])
def test_cells_of_a_cylinder_are_not_sheared_at_any_angle(degrees: int) -> None:
    """Threads that lie as helices are not sheared, but the diagonals of their chords differ, by κ_xy a² (κ_xx + κ_yy)/6
    of an angle, 1/23 at 100 a metre and 7.5 mm: of arcs a tenth of that is left, which falls with a⁴. And what is
    sheared by 0.1 before it is rolled up is so after, where chords tell half of it."""
    angle, kappa = np.radians(degrees), 100.0
    left = []
    for a, side, close in ((7.5e-3, 9, 0.04), (3.75e-3, 17, 0.004)):
        sheet = sheet_of(replace(PLAIN, shear_friction=1.0), a, a, rows=side, cols=side)
        flat = sheet.flat()[..., :2] - a * (side - 1) / 2

        def rolled(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            u = x * np.cos(angle) + y * np.sin(angle)
            v = y * np.cos(angle) - x * np.sin(angle)
            return np.stack([np.sin(kappa * u), kappa * v, 1 - np.cos(kappa * u)], axis=-1) / kappa

        length = sheet.springs.diagonal_length
        for sine in (0.0, 0.1):
            half = np.arcsin(sine) / 2
            x, y = (np.cos(half) * flat[..., k] + np.sin(half) * flat[..., 1 - k] for k in (0, 1))
            cells = sheared(sheet, rolled(x, y))
            assert cells is not None
            inner = cells.arc > 0
            assert inner[1:-1, 1:-1].all()
            assert not inner[0].any()
            one, two = (np.linalg.norm(d, axis=-1) for d in cells.diagonals)
            chords, arcs = (one - two)[inner] / length, cells.apart[inner] / length
            if sine == 0.0:
                twist = kappa * np.sin(2 * angle) / 2
                np.testing.assert_allclose(chords, -twist * a * a * kappa / 6, rtol=0.07)
                assert np.abs(arcs).max() < 0.12 * np.abs(chords).min()
                left.append(np.abs(arcs).max())
            else:
                flatly = 2 * np.sin(half)  # √2 (cos(π/4 − γ/2) − cos(π/4 + γ/2))
                np.testing.assert_allclose(arcs, flatly, rtol=close)
                assert chords.max() < 0.9 * flatly
    assert left[1] < left[0] / 14


@pytest.mark.parametrize(("a", "b"), [(0.01, 0.01), (0.01, 0.007)])
def test_cells_in_place_of_diagonals_shear_as_much_and_couple_nothing(a: float, b: float) -> None:
    """Of a fabric with friction within: ½ G g² and ½ E e² an area, the latter without contraction. 0.1 % at 1e-4."""
    material = replace(PLAIN, couple_warp=1e-4)
    sheet, e = sheet_of(material, a, b), 1e-4
    x = sheet.flat()
    area = x[..., 0].max() * x[..., 1].max()
    for along, towards, modulus in (
        (0, 1, material.shear),
        (0, 0, material.tensile_weft),
        (1, 1, material.tensile_warp),
    ):
        moved = x.copy()
        moved[..., along] += e * x[..., towards]
        assert elastic_energy(sheet, moved) / area == pytest.approx(modulus * e**2 / 2, rel=1e-3)
    assert sheet.springs.held.shear == 0


@pytest.mark.parametrize(("bending", "friction"), [("hinge", 0.0), ("spring", 0.0), ("hinge", 1.0)])
def test_forces_are_minus_the_derivative_of_the_energy(bending, friction) -> None:
    """Central differences of the energy, float64: relative error under 1e-6."""
    material = replace(PLAIN, bending_warp=3e-5, shear_friction=friction)
    sheet = sheet_of(material, 0.02, 0.015, bending=bending, rows=4, cols=5)
    x = sheet.flat() + 0.002 * RNG.standard_normal((4, 5, 3))
    forces = elastic_forces(sheet, x)
    h = 1e-7
    for index in [(0, 0, 0), (1, 2, 1), (2, 3, 2), (3, 4, 0)]:
        moved = [x.copy(), x.copy()]
        moved[0][index] -= h
        moved[1][index] += h
        slope = (elastic_energy(sheet, moved[1]) - elastic_energy(sheet, moved[0])) / (2 * h)
        assert forces[index] == pytest.approx(-slope, rel=1e-6, abs=1e-6 * np.abs(forces).max())


def test_masses_are_areas_and_edges_get_half() -> None:
    sheet = sheet_of(PLAIN, 0.01, 0.02)
    cell = PLAIN.density * 0.01 * 0.02
    assert sheet.mass.sum() == pytest.approx(cell * 5 * 8)
    assert sheet.mass[0, 0] == pytest.approx(cell / 4)
    assert sheet.mass[0, 3] == pytest.approx(cell / 2)
    assert sheet.mass[2, 3] == pytest.approx(cell)
    half = strip(rows=21)
    assert half.mass[21:].sum() == 0
    assert half.mass.sum() == pytest.approx(PLAIN.density * 0.4 * 0.04)


def test_no_key_point_of_a_cut_sheet_is_lighter_than_the_corner_of_a_cell() -> None:
    """Cells of which an outline leaves 2 % and 30 %: where 0.02 or 0.3 quarters would meet there is one, elsewhere what
    meets there."""
    cells = np.ones((4, 4))
    cells[0, 0], cells[3, 3] = 0.02, 0.3
    sheet = Sheet.of_cells(cells, material=PLAIN, springs=sheet_of(PLAIN, 0.01, 0.01).springs)
    quarter = PLAIN.density * 0.01**2 / 4
    assert sheet.mass[0, 0] == pytest.approx(quarter)
    assert sheet.mass[4, 4] == pytest.approx(quarter)
    assert sheet.mass[0, 1] == pytest.approx(1.02 * quarter)
    assert sheet.mass[1, 1] == pytest.approx(3.02 * quarter)


def test_threads_whose_crimp_is_drawn_out_are_those_of_a_stiffer_fabric() -> None:
    """In tension along the threads only, and those of a linear fabric are what they were."""
    springs = calibrate(replace(PLAIN, shear=0.0), spacing_x=0.01, spacing_y=0.012)
    stiff = replace(PLAIN, shear=0.0, tensile_warp=7e4, tensile_weft=5e4)
    drawn = springs.drawn(replace(PLAIN, shear=0.0, drawn_warp=7e4, drawn_weft=5e4, crimp_warp=0.02))
    assert drawn == calibrate(stiff, spacing_x=0.01, spacing_y=0.012)
    assert springs.drawn(PLAIN) == springs
    assert (springs.without_threads.structural_x, springs.without_threads.structural_y) == (0.0, 0.0)


@pytest.mark.parametrize("name", MATERIALS)
def test_presets_grow_at_490_newtons_a_metre_as_cloth_does_on_a_tensile_tester(name: str) -> None:
    """Between one and five percent: the crimp, and a little more."""
    m = MATERIALS[name]
    for soft, stiff, crimp in (
        (m.tensile_warp, m.drawn_warp, m.crimp_warp),
        (m.tensile_weft, m.drawn_weft, m.crimp_weft),
    ):
        strain = crimp + (490.0 - soft * crimp) / stiff
        assert 0.01 < crimp < strain < 0.05
    assert not m.linear.curved


def test_refusals_are_one_line() -> None:
    cases = [
        (lambda: named_material("denin"), 'did you mean "denim"'),
        (lambda: replace(PLAIN, density=0.0), "material.density: 0.0; allowed: a finite number, above 0"),
        (lambda: replace(PLAIN, shear=-1.0), "0 or more"),
        (lambda: calibrate(PLAIN, spacing_x=0.0, spacing_y=0.1), "springs.spacing_x"),
        (lambda: calibrate(PLAIN, spacing_x=1, spacing_y=1, bending="hinges"), 'did you mean "hinge"'),  # pyright: ignore
        (lambda: calibrate(PLAIN, spacing_x=0.001, spacing_y=0.001, bending="spring"), 'use bending "hinge"'),
        (lambda: calibrate(replace(PLAIN, shear=200.0), spacing_x=0.02, spacing_y=0.01), "squarer spacing"),
        (lambda: Sheet.of_cells(np.zeros((3, 3)), material=PLAIN, springs=strip().springs), "sheet: cells"),
        (lambda: strip().state(np.zeros((2, 2, 3))), "sheet: positions of shape"),
    ]
    for make, words in cases:
        with pytest.raises(InputError) as caught:
            make()
        assert words in str(caught.value)
        assert "\n" not in str(caught.value)
