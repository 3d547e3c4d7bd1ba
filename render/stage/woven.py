"""How a woven sheet answers light, beside Lambert's law. Over it, of a light

    G = BODY + LAID (x v)^2 + NAP / (x + 0.2 v + 0.1), at most 1 / WHITE,

of the cosines x to the light and v to the eye: of fibres, which lie every way, some face a light that grazes the sheet,
as grains of Seeliger's law do, NAP; those that lie in it send light back near the cone round them, which holds the
sheet's normal, LAID. In all directions it sends back as much as by Lambert's law, to 3 %, and in none more than it
gets; of a sky see `mixing.under_sky`. Found on flat pieces of plain, twill, satin and denim of three colours as fibres,
and beside a path tracer's pictures (`docs/appearance.md`).
"""

import taichi as ti

from taichi_cloth.ground.mixing import WHITE

__all__ = ["answered"]

BODY, LAID, NAP = 0.346, 0.345, 0.48


@ti.func
def answered(light, eye):
    """G. light, eye: x and v."""
    both = ti.max(light * eye, 0.0)
    over = BODY + LAID * both * both + NAP / (ti.max(light, 0.0) + 0.2 * ti.max(eye, 0.0) + 0.1)
    return ti.min(over, ti.static(1.0 / WHITE))
