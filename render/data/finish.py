"""How a fibre answers light, by material: Kajiya and Kay's fibre shading with a sheen, and named presets.

J. T. Kajiya, T. L. Kay, "Rendering fur with three dimensional textures", SIGGRAPH 1989, section 4: a thin
cylinder with unit tangent t, lit from direction l and seen from direction e (both pointing away from it), has

    diffuse   sin(t, l)
    specular  (sin(t, l) sin(t, e) - (t.l)(t.e)) ^ p

(the highlight is a cone round the fibre on the other side of the normal plane: t.e = -t.l).
Departures, all in `shade`: the diffuse term is mixed with Lambert's for the cloth's normal, because a
fibre in a yarn is shadowed by its neighbours; both terms fade where the cloth turns from the light; and the
power is max(0, 1 - p (1 - x) / 16) ^ 16, which is x^p at p = 16, has the same peak for every p, and needs four
multiplications instead of a pow().
"""

from dataclasses import dataclass, fields
from typing import Literal

from taichi_cloth.ground.errors import InputError, did_you_mean

__all__ = ["FINISHES", "Finish", "finish_for"]

RANGES = {
    "specular": (0, 4),
    "sheen": (0, 4),
    "exponent": (4, 500),
    "spread": (2, 40),
    "depth": (0, 0.1),
    "to_eye": (0, 4),
}
"""Of the numbers of a finish that are not shares."""


@dataclass(frozen=True, kw_only=True)
class Finish:
    """How a fibre's surface answers light. Raises InputError for a value outside its range."""

    fibre: float = 0.45
    """0..1: share of the fibre's own diffuse term; the rest is Lambert's for the cloth's normal."""
    specular: float = 0.10
    """0..4: strength of the highlight, relative to the key light."""
    exponent: float = 12.0
    """4..500: narrowness of the highlight."""
    tint: float = 0.3
    """0..1: how far the highlight takes the fibre's own colour; 0 is the light's colour."""
    sheen: float = 0.06
    """0..4: bright rim where the cloth is seen at a grazing angle."""
    roundness: float = 0.7
    """0..1: how much an elliptic splat is shaded across, as a round thread; 0 draws a flat ribbon."""
    model: Literal["kajiya", "marschner"] = "kajiya"
    """How the highlight is made: Kajiya's and Kay's cone, or the three lobes of `fibre`, which take the next four
    numbers in place of `specular` and `exponent`."""
    spread: float = 12.0
    """2..40: half width of the reflection along the fibre [degrees]; small is silky."""
    reflect: float = 0.06
    """0..1: share of light that a fibre's surface reflects (R)."""
    transmit: float = 0.12
    """0..1: share that passes through it (TT): a fringe glows against the light."""
    internal: float = 0.10
    """0..1: share that is reflected inside it and comes back coloured (TRT)."""
    depth: float = 0.0
    """0..0.1: how deep the cloth or the yarn is that fibres make together [m]: light goes from fibre to fibre in it,
    and a colour is that of a mass of them (see `light.bulk`). 0 lights every particle by itself."""
    alone: float = 0.0
    """0..1: how black all is that a particle sees instead of the sky, in such a mass; 0 is of the particle's colour."""
    to_eye: float = 0.0
    """0..4: how far normals lean to the eye (`light.lean`), of fibres that each stand for many."""

    def __post_init__(self) -> None:
        if self.model not in ("kajiya", "marschner"):
            raise InputError(f"finish.model: unknown {self.model!r}; known: kajiya, marschner")
        if self.reflect + self.transmit + self.internal > 1:
            raise InputError(
                f"finish: reflect + transmit + internal = {self.reflect + self.transmit + self.internal:g}; "
                "allowed: up to 1, a fibre makes no light"
            )
        for field in fields(self):
            if field.name == "model":
                continue
            low, high = RANGES.get(field.name, (0, 1))
            value = getattr(self, field.name)
            if not low <= value <= high:
                raise InputError(f"finish.{field.name}: {value!r}; allowed: {low} to {high}")


FINISHES: dict[str, Finish] = {
    "cotton": Finish(
        fibre=0.40,
        specular=0.05,
        exponent=8,
        tint=0.5,
        sheen=0.05,
        roundness=0.85,
        spread=10,
        reflect=0.07,
        transmit=0.10,
        internal=0.02,
    ),
    "linen": Finish(
        fibre=0.50,
        specular=0.14,
        exponent=16,
        tint=0.4,
        sheen=0.04,
        roundness=0.8,
        spread=12,
        reflect=0.1,
        transmit=0.1,
        internal=0.14,
    ),
    "wool": Finish(
        fibre=0.35,
        specular=0.04,
        exponent=6,
        tint=0.6,
        sheen=0.32,
        roundness=0.7,
        spread=20,
        reflect=0.06,
        transmit=0.16,
        internal=0.08,
    ),
    "silk": Finish(
        fibre=0.60,
        specular=0.75,
        exponent=48,
        tint=0.35,
        sheen=0.10,
        roundness=0.9,
        spread=4,
        reflect=0.08,
        transmit=0.1,
        internal=0.02,
    ),
    "viscose": Finish(
        fibre=0.55,
        specular=0.42,
        exponent=30,
        tint=0.3,
        sheen=0.06,
        roundness=0.85,
        spread=7,
        reflect=0.07,
        transmit=0.12,
        internal=0.16,
    ),
    "polyester": Finish(
        fibre=0.50,
        specular=0.30,
        exponent=24,
        tint=0.1,
        sheen=0.05,
        roundness=0.85,
        spread=5,
        reflect=0.18,
        transmit=0.2,
        internal=0.04,
    ),
    "nylon": Finish(
        fibre=0.50,
        specular=0.50,
        exponent=40,
        tint=0.1,
        sheen=0.05,
        roundness=0.9,
        spread=5,
        reflect=0.18,
        transmit=0.22,
        internal=0.06,
    ),
    "acrylic": Finish(
        fibre=0.40,
        specular=0.12,
        exponent=12,
        tint=0.3,
        sheen=0.14,
        roundness=0.8,
        spread=14,
        reflect=0.1,
        transmit=0.16,
        internal=0.1,
    ),
}
"""Presets by material, chosen by eye: cotton is matte, wool has a soft rim, silk a bright narrow highlight; but for the
lobes of cotton and silk, which are as a path tracer has them (`docs/appearance.md`)."""


def finish_for(material: str) -> Finish:
    """The preset of a material by name. Raises InputError for a name that is not in FINISHES."""
    if material not in FINISHES:
        raise InputError(
            f"finish: unknown material {material!r}; known: {', '.join(FINISHES)}{did_you_mean(material, FINISHES)}"
        )
    return FINISHES[material]
