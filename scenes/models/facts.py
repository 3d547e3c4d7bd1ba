"""Printed facts of a yarn and of a fabric, each beside the textbook's value where there is one."""

from dataclasses import dataclass

import numpy as np

from taichi_cloth.fabric.layout import FabricLayout, drawn_tex
from taichi_cloth.weave.cloth_facts import cloth_cover, cloth_facts, cotton_diameter_m, cover_factor
from taichi_cloth.weave.crimp import peirce_crimp
from taichi_cloth.weave.interpenetration import deepest_interpenetration
from taichi_cloth.yarn.count import in_count
from taichi_cloth.yarn.yarn import Yarn

__all__ = ["Fact", "fabric_facts", "yarn_facts"]

LARGEST_CHECKED = 96  # ends and picks of the corner of a fabric that the interpenetration check samples


@dataclass(frozen=True)
class Fact:
    """One line: what, our value, and the textbook's with its source; both as printed."""

    name: str
    value: str
    textbook: str = ""


def yarn_facts(yarn: Yarn, name: str = "yarn") -> list[Fact]:
    """Diameter, twist angles and take-up of a yarn."""
    folded = np.degrees(yarn.ply_helix_angle)
    single = np.degrees(yarn.single_helix_angle)
    facts = [
        Fact(
            f"{name}: count",
            f"{yarn.count_tex:.1f} tex × {yarn.plies}",
            f"Ne {in_count(yarn.count_tex, 'Ne'):.1f}/{yarn.plies}",
        ),
        Fact(
            f"{name}: diameter of a single",
            f"{1e3 * yarn.single_diameter:.3f} mm",
            f"{1e3 * float(cotton_diameter_m(yarn.count_tex)):.3f} mm (cotton, 1/(28√Ne) in)",
        ),
        Fact(f"{name}: fibres in a single's section", f"{yarn.fibres_in_section}"),
        Fact(f"{name}: retraction of a single", f"{100 * yarn.retraction:.1f} %", "tan²(α/2)"),
    ]
    if yarn.plies > 1:
        facts += [
            Fact(f"{name}: ply helix angle β", f"{folded:.1f}°", "tan β = 2πRT"),
            Fact(f"{name}: take-up by folding", f"{100 * yarn.ply_take_up:.1f} %", "1 − cos β"),
        ]
    else:
        facts.append(Fact(f"{name}: helix angle α", f"{single:.1f}°", "tan α = 2πrT"))
    return facts


def fabric_facts(layout: FabricLayout) -> list[Fact]:
    """Threads/cm, mass, crimp, cover, thickness and the deepest interpenetration of a fabric."""
    cloth = layout.cloth
    tex = drawn_tex(layout)
    facts: list[Fact] = []
    if min(cloth.warp_up.shape) > 1:
        f = cloth_facts(cloth, warp_tex=tex[0], weft_tex=tex[1])
        d1, d2 = float(layout.warp.thickness.mean()), float(layout.weft.thickness.mean())
        h1, h2 = cloth.balance * (d1 + d2), (1.0 - cloth.balance) * (d1 + d2)
        up = cloth.warp_up
        textbook = [  # Peirce's h = 4/3·p·√c on the part of the pitch that is free to bend
            peirce_crimp(h, pitch, free) * float(np.mean(changes))
            for h, free, pitch, changes in (
                (h1, float((cloth.pitches("weft") - cloth.flats("weft")).mean()), layout.weft.pitch, up[1:] != up[:-1]),
                (
                    h2,
                    float((cloth.pitches("warp") - cloth.flats("warp")).mean()),
                    layout.warp.pitch,
                    up[:, 1:] != up[:, :-1],
                ),
            )
        ]
        mean_tex = [float(t.mean()) for t in tex]
        per_cm = (0.01 / layout.warp.pitch, 0.01 / layout.weft.pitch)
        mass = sum(n * t * (1 + c) / 10 for n, t, c in zip(per_cm, mean_tex, textbook, strict=True))
        k = [cover_factor(n, t) for n, t in zip(per_cm, mean_tex, strict=True)]
        rule = "9/16·(h/p)² a change of side, Peirce"
        facts += [
            Fact("ends × picks per cm", f"{f.ends_per_cm:.1f} × {f.picks_per_cm:.1f}"),
            Fact("mass", f"{f.mass_gsm:.0f} g/m²", f"{mass:.0f} g/m² (with the textbook crimps)"),
            Fact("crimp, warp", f"{100 * f.warp_crimp:.1f} %", f"{100 * textbook[0]:.1f} % ({rule})"),
            Fact("crimp, weft", f"{100 * f.weft_crimp:.1f} %", f"{100 * textbook[1]:.1f} % ({rule})"),
            Fact("cover factor Kc", f"{f.cover:.1f}", f"{cloth_cover(*k):.1f} = k1 + k2 − k1·k2/28; 28 is closed"),
            Fact(
                "thickness", f"{f.thickness_mm:.3f} mm", f"{1e3 * max(h1 + d1, h2 + d2):.3f} mm = max(h1 + d1, h2 + d2)"
            ),
        ]
    n = LARGEST_CHECKED
    corner = type(cloth)(
        warp_up=cloth.warp_up[:n, :n],
        warp_spacing_m=cloth.warp_spacing_m[:n],
        weft_spacing_m=cloth.weft_spacing_m[:n],
        warp_diameter_m=cloth.warp_diameter_m[:n],
        weft_diameter_m=cloth.weft_diameter_m[:n],
        warp_flat_m=np.asarray(cloth.warp_flat_m)[:n],
        weft_flat_m=np.asarray(cloth.weft_flat_m)[:n],
        balance=cloth.balance,
        periodic=False,
    )
    deepest = deepest_interpenetration(corner)
    where = "" if max(cloth.warp_up.shape) <= n else f" (checked on {n} × {n} threads)"
    facts.append(
        Fact("deepest interpenetration", f"{100 * max(0.0, deepest.fraction):.2f} % of a diameter{where}", "0")
    )
    return facts
