"""The contours of fibres that textile people know, as sphere sets, each with its source (paper 2.1, Figure 1).

A fibre's axis is x, from 0 to its length.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.fibre.sphere_set import LARGEST_SPHERE_COUNT, UM, SphereSet
from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["FIBRES", "FibreKind", "contour", "known_contours"]


@dataclass(frozen=True)
class FibreKind:
    """What a textile person would look up of a fibre. SI, but for the customary fineness and width.

    density_kg_m3 and fineness_dtex: Morton & Hearle, Physical Properties of Textile Fibres, 4th ed., ch. 3
    and 5 (typical apparel grades, dry); width_um: the wider way across. colour: linear-light RGB of the
    undyed fibre, chosen by eye. finish: name of the surface look to draw it with. section_um2
    follows from fineness and density: 1 dtex = 1e-7 kg/m.
    """

    name: str
    density_kg_m3: float
    fineness_dtex: float
    width_um: float
    colour: tuple[float, float, float]
    finish: str
    shape: str

    @property
    def section_um2(self) -> float:
        """Area of the solid cross-section, fineness over density [um^2]."""
        return self.fineness_dtex * 1e-7 / self.density_kg_m3 * 1e12


FIBRES: dict[str, FibreKind] = {
    kind.name: kind
    for kind in (
        FibreKind("cotton", 1520, 1.7, 17.4, (0.80, 0.76, 0.66), "cotton", "twisted flat ribbon; bean section"),
        FibreKind("wool", 1310, 4.1, 20.8, (0.72, 0.66, 0.52), "wool", "overlapping scales; round section"),
        FibreKind("silk", 1340, 1.2, 11.9, (0.83, 0.79, 0.70), "silk", "smooth; rounded triangle"),
        FibreKind("viscose", 1520, 1.7, 15.0, (0.85, 0.85, 0.83), "viscose", "furrowed; lobed section"),
        FibreKind("polyester", 1380, 1.7, 12.5, (0.86, 0.86, 0.87), "polyester", "smooth; round section"),
    )
}


def known_contours() -> tuple[str, ...]:
    """Names that `contour` knows."""
    return tuple(FIBRES)


def contour(kind: str, *, length_m: float = 240 * UM, width_m: float | None = None) -> SphereSet:
    """The spheres of a known fibre, from x = 0 to length_m [m].

    width_m [m], the wider way across, defaults to the fibre's usual one; the section keeps its proportions.
    The lengthwise pattern of cotton and wool keeps its own length. Raises InputError for an unknown kind, a
    length under one width or over 20 mm, a width not in 1 um to 1 mm, or more than 100,000 spheres.
    """
    if kind not in FIBRES:
        raise InputError(
            f'fibre.contour: unknown fibre "{kind}"; known: {", ".join(FIBRES)}{did_you_mean(kind, FIBRES)}'
        )
    usual = FIBRES[kind].width_um * UM
    width = usual if width_m is None else float(width_m)
    if not UM <= width <= 1000 * UM:
        raise InputError(f"fibre.width_m: {width:g} m is not allowed; a fibre is 1e-06 to 0.001 m wide")
    if not width <= length_m <= 0.02:
        raise InputError(f"fibre.length_m: {length_m:g} m is not allowed; it must be {width:g} (its width) to 0.02 m")
    return CONTOURS[kind](float(length_m), width / usual)


def _stations(length: float, step: float) -> NDArray[np.float64]:
    return np.linspace(0.0, length, max(2, ceil(length / step) + 1))


def _refuse_too_many(count: int) -> None:
    if count > LARGEST_SPHERE_COUNT:
        raise InputError(
            f"fibre.length_m: this fibre needs {count} spheres, the limit is {LARGEST_SPHERE_COUNT};"
            " give a shorter length"
        )


def _swept(
    length: float, x: NDArray[np.float64], section: ArrayLike, r: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres (n, 3) and radii (n,) of sections y + iz, broadcast to (stations, spheres), between x = 0 and length.

    At the ends spheres are drawn back by their radius, so that the fibre ends at 0 and length.
    """
    y, z = np.real(section), np.imag(section)
    x, y, z, r = np.broadcast_arrays(x[:, None], y, z, np.asarray(r, dtype=np.float64))
    inside = np.clip(x, np.minimum(r, 0.5 * length), np.maximum(length - r, 0.5 * length))
    return np.stack([inside.ravel(), y.ravel(), z.ravel()], axis=1), r.ravel()


def _cotton(length: float, scale: float) -> SphereSet:
    """A collapsed tube: a bean section, 17 um by 8 um, bent round the line where the lumen closed.

    It is twisted by half a turn (one convolution) every 100 um, and the sense reverses. Convolutions of
    mature cotton: 200 to 300 per inch, 85 to 125 um each; bean section and convolutions: Morton & Hearle ch.
    1 and 3.10. Width and pitch vary along a real fibre, here by smooth 8 % and 25 %. A reversal comes every
    340 um (real ones are further apart) so that a short piece shows one.
    """
    um = UM * scale
    x = _stations(length, 1.2 * um)
    _refuse_too_many(len(x) * 15)
    phase = 2 * pi * (x / (680 * UM) + 0.01)
    swing = np.arcsin(0.985 * np.sin(phase)) * (340 / 100)  # a triangle wave with rounded tips: 3.4 half turns
    turn = swing + 0.35 * np.sin(2 * pi * x / (74 * UM) + 1.0)
    breadth = 1 + 0.08 * np.sin(2 * pi * x / (57 * UM)) * np.cos(2 * pi * x / (131 * UM) + 0.6)
    along = np.linspace(-1.0, 1.0, 15)  # across the ribbon
    rim = (2.75 + 0.75 * along**2) * um  # thicker edges, the two rolled rims of the collapsed tube
    bent, across = 2.3 * um * (along**2 - 0.45), 5.2 * um * along
    section = across * breadth[:, None] + 1j * bent / breadth[:, None]
    centres, radii = _swept(length, x, section * np.exp(1j * turn)[:, None], rim)
    return SphereSet(centres, radii, x, turn)


def _wool(length: float, scale: float) -> SphereSet:
    """Round, 21 um over the scale edges, with scales like roof tiles, their free edges toward +x (the tip).

    Fine merino: 19 to 21 um, edges about 0.7 um high and 9 to 14 um apart (up to 700 scales per cm), two or
    so scales around, their edges wavy: Morton & Hearle ch. 1; Wildman, The Microscopy of Animal Textile
    Fibres, 1954. A core of large spheres is covered by a shell of small ones whose height rises along each
    scale and drops at its edge.
    """
    um = UM * scale
    small, around = 1.3 * um, 64
    x, angle = _stations(length, 0.8 * um), np.arange(around) * (2 * pi / around)
    core = _stations(length, 2.0 * um)
    _refuse_too_many(len(x) * around + len(core))
    angles = angle[None, :] + 0.5 * (np.arange(len(x)) % 2)[:, None] * (2 * pi / around)
    # Edge k lies at k + wave_k(angle) pitches: two rounded tips around, notches between, turned at random per scale.
    place = x[:, None] / (12.5 * UM)
    random = np.random.Generator(np.random.Philox(1954)).random((ceil(length / (12.5 * UM)) + 4, 3))

    def edge(k: NDArray[np.intp]) -> NDArray[np.float64]:
        tip, wave, shift = random[k + 2, 0], random[k + 2, 1], random[k + 2, 2]
        return (
            k
            + 0.34 * np.abs(np.sin(angles + 2 * pi * tip))
            + 0.07 * np.sin(3 * angles + 2 * pi * wave)
            + 0.2 * (shift - 0.5)
        )

    below = np.floor(place).astype(np.intp) + np.zeros_like(angles, dtype=np.intp)
    for _ in range(2):
        below = np.where(edge(below) > place, below - 1, below)
    rise = (place - edge(below)) / (edge(below + 1) - edge(below))
    reach = (8.0 + 0.25 * np.sin(2 * pi * x / (90 * UM)))[:, None] * um + 1.1 * um * rise
    centres, radii = _swept(length, x, reach * np.exp(1j * angles), small)
    inner, inner_radii = _swept(length, core, 0.0, 8.3 * um)
    return SphereSet(np.concatenate([inner, centres]), np.concatenate([inner_radii, radii]))


def _silk(length: float, scale: float) -> SphereSet:
    """A degummed silk filament: smooth, a triangle with rounded corners and slightly bulging sides, 12 um wide.

    Section and width (10 to 13 um, 1.0 to 1.3 dtex): Morton & Hearle 3.10; Bombyx mori. The triangle turns
    slowly, a few degrees over the piece, as drawn silk does.
    """
    um = UM * scale
    x = _stations(length, 0.8 * um)
    corner, side = 2.3 * um, np.linspace(0, 1, 8)[:-1]
    points = []
    for k in range(3):
        begin, end = (np.exp(1j * (pi / 2 + 2 * pi * (k + j) / 3)) for j in (0, 1))
        edge = begin + (end - begin) * side
        points.append(edge * (1 + 0.25 * 4 * side * (1 - side)))
    rim = np.concatenate(points) * 4.0 * um
    section = np.concatenate([rim, rim[::2] * 0.5])
    _refuse_too_many(len(x) * len(section))
    turn = 0.35 * np.sin(2 * pi * x / (900 * UM))
    turned = section[None, :] * np.exp(1j * turn)[:, None]
    centres, radii = _swept(length, x, turned, corner)
    return SphereSet(centres, radii, x, turn)


VISCOSE_LOBES = 8


def _viscose(length: float, scale: float) -> SphereSet:
    """A regenerated fibre whose skin shrank on its core: eight uneven lobes, the furrows running along the fibre.

    Serrated section, 12 to 15 um at 1.7 dtex, from the wet spinning of regular viscose: Morton & Hearle 3.10.
    """
    um = UM * scale
    x = _stations(length, 0.6 * um)
    lobe = np.arange(VISCOSE_LOBES)
    angle = 2 * pi * (lobe + 0.22 * np.sin(2.1 * lobe + 0.5)) / VISCOSE_LOBES
    radius = (1.85 + 0.30 * np.cos(1.7 * lobe)) * um
    reach = (4.55 + 0.40 * np.sin(3.3 * lobe + 1.0) + 0.4 * np.cos(2 * angle)) * um
    fans = [(part * reach * np.exp(1j * angle), radius) for part in (1.0, 0.8, 0.6)]
    core = np.array([0.0, 1.3, 1.3j, -1.3, -1.3j]) * um
    section = np.concatenate([spot for spot, _ in fans] + [core])
    radii = np.concatenate([r for _, r in fans] + [np.full(len(core), 3.1 * um)])
    _refuse_too_many(len(x) * len(section))
    wander = 1 + 0.02 * np.sin(2 * pi * x / (83 * UM))
    centres, all_radii = _swept(length, x, section * wander[:, None], radii)
    return SphereSet(centres, all_radii)


def _polyester(length: float, scale: float) -> SphereSet:
    """Melt-spun through a round hole: a smooth cylinder, 12.5 um across at 1.7 dtex (Morton & Hearle 3.10)."""
    um = UM * scale
    x = _stations(length, 0.8 * um)
    _refuse_too_many(len(x))
    centres, radii = _swept(length, x, 0.0, 6.26 * um)
    return SphereSet(centres, radii)


CONTOURS: dict[str, Callable[[float, float], SphereSet]] = {
    "cotton": _cotton,
    "wool": _wool,
    "silk": _silk,
    "viscose": _viscose,
    "polyester": _polyester,
}
