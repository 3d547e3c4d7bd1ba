"""A cloth as a mill states it, and the sizes of its threads where they cross.

Inside this room lengths are in mm, forces in mN and counts in tex = g/km, so that threads/mm · tex is g/m², mN·mm² is
the rigidity of a yarn, and mN·mm²/mm = µN·m that of a width of cloth.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.mechanics.fibre_mechanics import FibreMechanics
from taichi_cloth.weave.cloth_facts import ClothFacts, cloth_facts
from taichi_cloth.weave.cloth_set import CLOSEST, Fitted, fit_set, set_sizes
from taichi_cloth.weave.crimp import Family, Interlacing, path_kinds, peirce_crimp
from taichi_cloth.weave.draft import Draft
from taichi_cloth.yarn.yarn import Yarn

__all__ = ["FINISHES", "FLATTENING", "Construction", "ThreadFamily", "usual_loss"]

FLATTENING = {"spun": 2.0, "filament": 2.9}
"""Width of a thread over its thickness where it lies in cloth. Filaments without twist: 0.35 = 1/2.9 (polyester of 300
den, Afrashteh, Merati & Jeddi 2013); cotton laid over cotton 2.4 at 54 tex, 1.6 at 146 (Panneerselvam et al. 2024);
worsted under the force of a crossing 1.9 (Kawabata, Niwa & Matsudaira 1985)."""

_LOSS = 0.04
"""Share of its nominal mass that spun cotton and its like lose until the cloth is finished: dirt, wax and short fibres
that are scoured, singed and washed out. Nominal counts and the crimps of this model together come out heavier by 1 to 5
% in three measured twills and in three weights that the trade names (poplin, sheeting, denim); this is their mean."""

FINISHES = {"plain": 1.0, "softened": 0.7, "raised": 1.0, "resin": 2.0, "sized": 2.7, "starched": 4.0}
"""How much a finish changes the cohesion of yarns in bending. "sized": raw denim (see `bending`). The others are the
middle of what is usual, quoted from memory: size, resin and starch stiffen 2 to 10 times, a softener divides. "raised":
milled or brushed, which is seen (`yarn.hairs.NAPPED`); what it does to bending is not known here."""


def usual_loss(fibre: FibreMechanics, finish: str = "plain") -> float:
    """Share of its mass that a yarn loses until the cloth is finished (`Yarn.loss`): that of spun cotton and its like,
    but where the size stays in; else none."""
    return _LOSS if fibre.cellulosic and fibre.form == "spun" and finish != "sized" else 0.0


@dataclass(frozen=True)
class ThreadFamily:
    """The warp, or the weft, of a cloth: means over its threads.

    per_mm: threads a mm. tex: of one thread, with its folding. single_fibre: of one fibre [tex]. diameter: of the
    round thread [mm]; other_diameter: of the threads it crosses. pitch: from one of those to the next [mm]. turns:
    changes of face a crossing, 1 in plain weave, 1/2 in a 2/2 twill. crimp: a share. height: of the wave from face to
    face [mm]. leg: yarn from one crossing to the next [mm].
    """

    name: Family
    fibre: FibreMechanics
    per_mm: float
    tex: float
    single_fibre: float
    diameter: float
    other_diameter: float
    pitch: float
    turns: float
    crimp: float
    height: float
    twist: float
    helix: float

    @property
    def leg(self) -> float:
        return self.pitch * (1.0 + self.crimp)

    @property
    def angle(self) -> float:
        """Of a straight leg from face to face with the cloth's plane [rad]."""
        return float(np.arctan2(self.height, self.pitch))

    @property
    def straight_leg(self) -> float:
        """Its length [mm]."""
        return float(np.hypot(self.pitch, self.height))

    @property
    def mass(self) -> float:
        """What the family weighs without its crimp [g/m²]."""
        return self.per_mm * self.tex


@dataclass(frozen=True, kw_only=True, eq=False)
class Construction:
    """Fibre, yarns, weave and sett. Raises InputError on values that no cloth has.

    draft: taken as a repeat. warp_fibre, weft_fibre: what the yarns are made of; the density and the fineness that
    count are those of the yarns. ends_per_cm, picks_per_cm: of the finished cloth; None takes the draft's own, else
    what just fits. flattening: width over thickness of the threads where they lie. balance: the warp's part of the
    crimp height, kept where it can be woven; None takes that at which both families press each other alike. finish: one
    of FINISHES.
    """

    draft: Draft
    warp: Yarn
    weft: Yarn
    warp_fibre: FibreMechanics
    weft_fibre: FibreMechanics
    ends_per_cm: float | None = None
    picks_per_cm: float | None = None
    flattening: float = 2.0
    balance: float | None = None
    finish: str = "plain"

    def __post_init__(self) -> None:
        for key in ("ends_per_cm", "picks_per_cm"):
            value = getattr(self, key)
            if value is not None and not (isfinite(value) and value > 0):
                raise InputError(f"fabric.{key}: {value!r}; allowed: a finite number above 0")
        if self.finish not in FINISHES:
            raise InputError(
                f"fabric.finish: {self.finish!r}; known: {', '.join(FINISHES)}{did_you_mean(self.finish, FINISHES)}"
            )

    @cached_property
    def _sizes(self) -> tuple[tuple[NDArray, NDArray], tuple[NDArray, NDArray]]:
        stated = (self.warp.woven_diameter, self.weft.woven_diameter)
        return set_sizes(self.draft, stated, (self.ends_per_cm, self.picks_per_cm), self.flattening)

    @cached_property
    def fitted(self) -> Fitted:
        """The weave with its sizes. Where threads jam, they are pressed, all alike: thinner than their yarn."""
        diameter, rooms = self._sizes
        balance = self.resting_balance if self.balance is None else self.balance
        found = fit_set(self.draft.warp_up, rooms, diameter, flattening=self.flattening, balance=balance)
        whole = min(found.cloth.warp_up.shape) > 1
        return replace(found, cloth=replace(found.cloth, periodic=True)) if whole else found

    @property
    def pressed(self) -> bool:
        """Whether threads as drawn would jam even when pressed to the closest packing."""
        return self.fitted.thinned < CLOSEST

    @cached_property
    def resting_balance(self) -> float:
        """The warp's part of the crimp height at which both families press each other alike: the force of a bent leg
        goes as B·h/p³."""
        _, rooms = self._sizes
        stiff = [
            fibre.flexural * yarn.folded_tex * yarn.fineness_dtex / float(across.mean()) ** 3
            for yarn, fibre, across in (
                (self.warp, self.warp_fibre, rooms[1]),
                (self.weft, self.weft_fibre, rooms[0]),
            )
        ]
        return float(np.clip(stiff[1] / (stiff[0] + stiff[1]), 0.05, 0.95))

    @cached_property
    def tex(self) -> tuple[NDArray, NDArray]:
        """Of every warp end and weft pick: of its yarn, or of its section where the draft says how thick it is."""
        diameter, _ = self._sizes
        warp, weft = (
            yarn.folded_tex * (own / yarn.woven_diameter) ** 2
            for yarn, own in zip((self.warp, self.weft), diameter, strict=True)
        )
        return warp, weft

    @cached_property
    def facts(self) -> ClothFacts:
        """Sett, mass, crimp, cover, and the thickness of the threads that lie on one another."""
        return cloth_facts(self.fitted.cloth, warp_tex=self.tex[0], weft_tex=self.tex[1])

    @cached_property
    def areal_density(self) -> float:
        """What the finished cloth weighs [g/m²]."""
        return sum(own.mass * (1.0 + own.crimp) for own in self.families)

    @cached_property
    def _heights(self) -> tuple[float, float]:
        """Heights of the waves of warp and weft [mm].

        As woven. Where threads jam, round ones would leave all of the wave to one family; real ones give way, to the
        closest packing at most, and rest where they press each other alike.
        """
        fitted, (warp, weft) = self.fitted, self._sizes[0]
        whole = 1e3 * float(warp.mean() + weft.mean()) / np.sqrt(self.flattening)
        share = self.resting_balance if self.pressed else fitted.balance
        whole *= max(fitted.thinned, CLOSEST)
        return share * whole, (1.0 - share) * whole

    @cached_property
    def families(self) -> tuple[ThreadFamily, ThreadFamily]:
        """Warp and weft. The crimp is that of the paths as drawn; of pressed threads Peirce's for their heights."""
        facts, (warp, weft), cloth = self.facts, self._sizes[0], self.fitted.cloth
        per_mm = (0.1 * facts.ends_per_cm, 0.1 * facts.picks_per_cm)
        names: tuple[Family, Family] = ("warp", "weft")
        rows = zip(
            names,
            (self.warp, self.weft),
            (self.warp_fibre, self.weft_fibre),
            (facts.warp_crimp, facts.weft_crimp),
            strict=True,
        )
        heights, found = self._heights, []
        for k, (name, yarn, fibre, crimp) in enumerate(rows):
            turns, pitch = _turns(cloth, name), 1.0 / per_mm[1 - k]
            if self.pressed:
                crimp = turns * peirce_crimp(heights[k], pitch)
            found.append(
                ThreadFamily(
                    name=name,
                    fibre=fibre,
                    per_mm=per_mm[k],
                    tex=float(self.tex[k].mean()),
                    single_fibre=0.1 * yarn.fineness_dtex,
                    diameter=1e3 * float((warp, weft)[k].mean()),
                    other_diameter=1e3 * float((weft, warp)[k].mean()),
                    pitch=pitch,
                    turns=turns,
                    crimp=crimp,
                    height=heights[k],
                    twist=yarn.twist_per_m,
                    helix=yarn.ply_helix_angle if yarn.plies > 1 else yarn.single_helix_angle,
                )
            )
        return found[0], found[1]


def _turns(cloth: Interlacing, family: Family) -> float:
    """Changes of face a crossing of one family's threads."""
    kinds = path_kinds(cloth, family)
    return float(np.mean(np.sign(kinds.z0) * np.sign(kinds.z1) < 0))
