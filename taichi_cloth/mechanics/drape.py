"""How far a cloth hangs over: bending length, and Cusick's drape coefficient by a curve.

c = (B/w)^(1/3), w the cloth's weight per area (Peirce 1930). DC = 100/(1 + (c₀/c)⁴) with c₀ = 15.5 mm: fitted on five
cloths whose bending and drape were both measured, within 12 points. Shear and friction move it by a few points more: a
disc that is simulated knows them.
"""

__all__ = ["bending_length", "drape_coefficient"]

GRAVITY = 9.81
HALF_DRAPE = 15.5  # mm: bending length of a cloth that drapes to 50 %
STEEPNESS = 4.0


def bending_length(bending: float, density: float) -> float:
    """c [mm] from B [µN·m] and mass per area [g/m²].

    >>> round(bending_length(9.81, 100.0), 1)
    21.5
    """
    return 1e3 * (1e-6 * bending / (1e-3 * density * GRAVITY)) ** (1.0 / 3.0)


def drape_coefficient(bending_mean: float, density: float) -> float:
    """DC [%] of a specimen of 30 cm on a disc of 18 cm, from the mean of B of warp and weft [µN·m] and g/m²."""
    c = bending_length(bending_mean, density)
    return 100.0 / (1.0 + (HALF_DRAPE / max(c, 1e-9)) ** STEEPNESS)
