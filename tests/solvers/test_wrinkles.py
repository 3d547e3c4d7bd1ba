"""A sheet held at two ends and pulled wrinkles along the pull (paper, Figure 14), as Cerda and Mahadevan say.

E. Cerda, L. Mahadevan, "Geometry and physics of wrinkling", Phys. Rev. Lett. 90, 2003: bending wants long waves, the
tension wants flat ones, and between clamps a distance L apart the wavelength is

    λ = 2√π (B/T)^{1/4} √L

With lengths counted along the material, as the sheet's own bending is, T per width of the resting sheet and the pull
stretching it by ε, B becomes B (1 + ε).
"""

import numpy as np
import pytest
from numpy.typing import NDArray

from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.energy import elastic_forces
from taichi_cloth.sheet.materials import Material
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet

LENGTH, WIDTH, SPACING, BENDING = 0.25, 0.10, 1.6e-3, 8e-7
PULL, SETTLE, RATE = 0.20, 0.15, 500.0
NOTHING = Forces(gravity=(0.0, 0.0, 0.0))


def pulled(strain: float) -> tuple[NDArray, float]:
    """Key points (rows, columns, 3) [m] at rest after the pull, and the tension T [N/m]. Wrinkles grow from seeded
    bumps of 0.02 mm; the diagonals make the sheet narrower as it is pulled, by about 0.55 ε."""
    material = Material(
        tensile_warp=1000.0,
        tensile_weft=1000.0,
        shear=800.0,
        bending_warp=BENDING,
        bending_weft=BENDING,
        density=0.115,
        air_damping=40.0,
    )
    rows, columns = round(WIDTH / SPACING) + 1, round(LENGTH / SPACING) + 1
    held = np.zeros((rows, columns), bool)
    held[:, [0, -1]] = True
    springs = calibrate(material, spacing_x=SPACING, spacing_y=SPACING)
    sheet = Sheet.rectangle(rows, columns, material=material, springs=springs, pinned=held)
    x = sheet.flat()
    bumps = 2e-5 * np.random.Generator(np.random.Philox(key=0)).standard_normal((rows, columns))
    x[..., 2] = np.where(held, 0.0, bumps)
    start = x[held]
    away = strain * LENGTH * np.where(start[:, 0] > LENGTH / 2, 0.5, -0.5)

    def path(time: float) -> NDArray:
        share = min(time / PULL, 1.0)
        out = start.copy()
        out[:, 0] += away * share * share * (3 - 2 * share)
        return out

    solver = Verlet(sheet, NOTHING, frame_rate=RATE)
    simulation = Simulation(sheet, solver, forces=NOTHING, positions=x, pins=(Pins(held, path),))
    for _ in range(round((PULL + SETTLE) * RATE)):
        simulation.step()
    after = simulation.positions.astype(np.float64)
    pull = elastic_forces(sheet, after)[:, [0, -1], 0].sum(axis=0)
    return after, float(np.abs(pull).mean()) / WIDTH


def wavelength(x: NDArray) -> float:
    """Of the largest wave of the line half-way between the clamps [m], along the material."""
    rows = len(x)
    height = x[:, x.shape[1] // 2, 2]
    place = np.arange(rows)
    wave = (height - np.polyval(np.polyfit(place, height, 1), place)) * np.hanning(rows)
    strength = np.abs(np.fft.rfft(wave, 16 * rows))
    return 16 * rows * SPACING / (1 + int(np.argmax(strength[1:])))


@pytest.mark.slow
def test_wrinkles_of_a_stretched_sheet_are_as_far_apart_as_cerda_and_mahadevan_say() -> None:
    """Three tensions, 25 %; at least 8 key points a wave; the waves run along the pull."""
    for strain in (0.02, 0.04, 0.08):
        x, tension = pulled(strain)
        found = wavelength(x)
        law = 2 * np.sqrt(np.pi) * (BENDING * (1 + strain) / tension) ** 0.25 * np.sqrt(LENGTH)
        middle = x[:, x.shape[1] // 2, 2]
        print(f"T {tension:5.1f} N/m: {1e3 * found:.1f} mm, law {1e3 * law:.1f} mm, {1e3 * np.ptp(middle):.2f} mm high")
        assert found > 8 * SPACING
        assert found == pytest.approx(law, rel=0.25)
        along = x[x.shape[0] // 2, :, 2]
        assert np.abs(np.diff(middle)).max() > 5 * np.abs(np.diff(along)).max()
