"""What a fibre is to a yarn that is bent, twisted and pulled.

A fibre of t tex has the flexural rigidity R·t² with R = η·E/(4πρ) (E in N/tex, ρ in g/cm³, η a shape factor, R in
mN·mm²/tex²), and the torsional rigidity S·t².

Sources. Morton & Hearle, Physical Properties of Textile Fibres: density table 5.1, moduli table 13.2, specific flexural
rigidity as measured for viscose 0.19, wool 0.20, silk 0.19, nylon 0.14, η for viscose 0.74, wool 0.80, silk 0.59, nylon
0.91. Cotton, polyester and flax by the formula, from E of 5.2 (Handbook of Properties of Textile and Technical Fibres,
table 1.1), 8.8 (staple) and 17.7 N/tex and η of 0.7, 0.91 (round and solid, as nylon) and 0.65. Specific torsional
rigidities are those usual of Morton & Hearle's table for torsion, quoted from memory, flax by that of cotton. Kinetic
friction of fibre on fibre: cotton 0.26, viscose 0.26, nylon 0.40, polyester 0.12 of one table (lecture notes on
frictional properties), wool the mean of both ways along its scales, silk by that of viscose, flax by that of cotton.
Yarns on one another are taken to rub as their fibres do, but for cotton: ring yarn 0.36 (J. Natural Fibers 2021, doi
10.1080/15440478.2021.1875349).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Literal

from taichi_cloth.fibre.contours import FIBRES
from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["FIBRE_MECHANICS", "FibreMechanics", "Form", "blend", "fibre_mechanics"]

Form = Literal["spun", "filament"]


@dataclass(frozen=True, kw_only=True)
class FibreMechanics:
    """One kind of fibre. Raises InputError on values that no fibre has.

    density: [g/cm³]. fineness: of one fibre [tex]. modulus: E [N/tex]. flexural, torsional: R and S [mN·mm²/tex²].
    friction: of its yarns on one another. rubbing: of its fibres on one another, 0 where that is the same. cellulosic:
    how its spun yarns cohere. form: how it is usually made up.
    """

    name: str
    density: float
    fineness: float
    modulus: float
    flexural: float
    torsional: float
    friction: float
    rubbing: float = 0.0
    cellulosic: bool = False
    form: Form = "spun"

    def __post_init__(self) -> None:
        for field in ("density", "fineness", "modulus", "flexural", "torsional", "friction"):
            value = getattr(self, field)
            if not (isfinite(value) and value > 0):
                raise InputError(f"fibre.{field}: {value!r}; allowed: a finite number above 0")

    @property
    def slipping(self) -> float:
        """Friction of fibre on fibre."""
        return self.rubbing or self.friction


def _known(name: str, flexural: float, torsional: float, modulus: float, friction: float, **rest: object):
    """A fibre that is drawn as well: its density and fineness are those of `fibre.contours`."""
    kind = FIBRES[name]
    return FibreMechanics(
        name=name,
        density=1e-3 * kind.density_kg_m3,
        fineness=0.1 * kind.fineness_dtex,
        modulus=modulus,
        flexural=flexural,
        torsional=torsional,
        friction=friction,
        **rest,  # pyright: ignore[reportArgumentType]
    )


FIBRE_MECHANICS: dict[str, FibreMechanics] = {
    fibre.name: fibre
    for fibre in (
        _known("cotton", 0.19, 0.16, 5.2, 0.36, rubbing=0.26, cellulosic=True),
        _known("wool", 0.20, 0.12, 2.3, 0.24),
        _known("silk", 0.19, 0.16, 7.5, 0.26, form="filament"),
        _known("viscose", 0.19, 0.07, 5.0, 0.26, cellulosic=True),
        _known("polyester", 0.46, 0.067, 8.8, 0.12),
        FibreMechanics(
            name="nylon",
            density=1.14,
            fineness=0.20,
            modulus=3.0,
            flexural=0.14,
            torsional=0.05,
            friction=0.40,
            form="filament",
        ),
        FibreMechanics(
            name="flax",
            density=1.53,
            fineness=0.25,
            modulus=17.7,
            flexural=0.60,
            torsional=0.16,
            friction=0.36,
            rubbing=0.26,
            cellulosic=True,
        ),
    )
}
"""By name; the sources stand at the head of this module."""


def fibre_mechanics(name: str) -> FibreMechanics:
    """A fibre by its name. Raises InputError on one that is not known."""
    if name not in FIBRE_MECHANICS:
        raise InputError(
            f"fibre: unknown fibre {name!r}; known: {', '.join(FIBRE_MECHANICS)}{did_you_mean(name, FIBRE_MECHANICS)}"
        )
    return FIBRE_MECHANICS[name]


def blend(parts: Sequence[tuple[float, FibreMechanics]]) -> FibreMechanics:
    """A blend of fibres, each with its share of the mass: rigidities, moduli and friction are means by mass, so is the
    volume. It coheres as cellulosics do from a half of them on. Raises InputError where no share is above 0.

    >>> round(blend([(50, fibre_mechanics("cotton")), (50, fibre_mechanics("polyester"))]).flexural, 3)
    0.325
    """
    total = sum(share for share, _ in parts)
    if not parts or not total > 0 or min(share for share, _ in parts) < 0:
        raise InputError("fibre: a blend needs shares of its fibres, 0 or more and not all 0")

    def mean(field: str) -> float:
        return sum(share * getattr(fibre, field) for share, fibre in parts) / total

    cellulosic = sum(share for share, fibre in parts if fibre.cellulosic)
    return FibreMechanics(
        name=" ".join(f"{fibre.name} {100 * share / total:.0f}" for share, fibre in parts if share > 0),
        density=total / sum(share / fibre.density for share, fibre in parts),
        fineness=mean("fineness"),
        modulus=mean("modulus"),
        flexural=mean("flexural"),
        torsional=mean("torsional"),
        friction=mean("friction"),
        rubbing=mean("slipping"),
        cellulosic=2 * cellulosic >= total,
        form="filament" if all(fibre.form == "filament" for share, fibre in parts if share > 0) else "spun",
    )
