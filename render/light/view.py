"""The numbers of one view, camera, lights and finish, as kernels read them: rows of three, by name."""

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.ground.mixing import SURFACE_SHARE

from ..data.camera import Camera
from ..data.finish import Finish
from ..data.light import Lighting
from ..tiles.sort import DEEPEST_KEY
from .bulk import BODY, cone

__all__ = ["MOST_OTHERS", "VIEW_ROWS", "new_view", "set_bulk", "set_finish", "set_view", "surface_share"]

ROTATION = 0  # world to camera, three rows
TRANSLATION = 3  # world to camera [m]
EYE = 4  # of the camera, world [m]
LENS = 5  # focal [px], cx, cy [px]
KEY_DIRECTION = 6  # towards the key light, world, unit
KEY = 7  # radiance of a white surface that faces it
SKY, GROUND = 8, 9  # radiance from above (at the horizon), from below
FIBRE = 10  # share of the fibre's diffuse term, specular strength, exponent / 16
SURFACE = 11  # tint of the highlight, sheen, gain of the slope across the fibre
IMAGE = 12  # width, height [px], near [m]
DEPTH = 13  # nearest depth [m], keys per metre, opacity of all
EDGE = 14  # edge of the splat, 0 for crisp; share of the key light that openness takes; sharpness of lobe R
LOBES = 15  # weights of R, TT, TRT
OTHERS = 16  # further lights: direction and radiance, two rows a light
MOST_OTHERS = 8
DOME = OTHERS + 2 * MOST_OTHERS  # how much the zenith differs from the horizon
BULK = DOME + 1  # what highlights leave of a bulk's light; share of what maps do not show; the sky's highlights
COAT = BULK + 1  # how far these have the fibre's colour; gain of lights that maps do not tell apart; limb darkening
DYE = COAT + 1  # of what is left to the dye of a bulk's colour: gain, what is taken off after it; `Finish.alone`
CONE = DYE + 1  # k and h of `bulk.cone`; gain of a light on all of a cloth that maps tell of alone
ABOVE = CONE + 1  # `FROM_ABOVE`, as far as maps tell of the cloth alone
VIEW_ROWS = ABOVE + 1

FROM_ABOVE = 0.3, 0.1
"""There, how much less a cloth sends back of a sky before it for each unit that the cosine between the view and what is
open is more than `ASLANT`: of what goes from fibre to fibre, as a share, and of what surfaces mirror, which has no
colour. Found on flat pieces of two plain weaves, a twill and a satin, of three colours, seen at cosines of 0.2 to 1,
beside the path tracer's pictures, as `mixing.LESS_ABOVE` of meshes."""

LIMB_DARKENING = 0.5
"""How much darker the sides of a round thread are than its middle, at roundness 1."""

SLOPE_GAIN, KEY_SHADE = 0.6, 0.6
"""Shading across a round thread at roundness 1 (with `LIMB_DARKENING` its worst case stays above 0), and the share of
the key light that a particle loses when it sees no sky at all; half that where it casts shadows too."""
BULK_SHADE = 0.32
"""That share in a cloth within which light goes from fibre to fibre: its fibres that are seen from above and from the
side lose 0.14 of a light in front of them, at a mean openness of 0.55 (plain weave and satin of all fibres)."""

OPEN = 0.55
"""Mean share of the sky that fibres of a cloth see, so far as highlights of the sky are taken off its dye."""

LEAVING = 0.4
"""Of what surfaces of fibres mirror of the sky, the share that leaves a cloth without its colour; the rest is sent on
into it. By the path tracer a mass of fibres whose surfaces mirror 0.08 sends back `SURFACE_SHARE`."""
UNRESOLVED = 0.22
"""More of a light, where maps are too coarse for the direction that is open between yarns, and their normals, which
lean farther, stand for it: a plain weave has 0.80 of its light without."""
OF_CLOTH, SEEN, DIFFUSE = 0.05, 0.85, 0.80
"""The same, the share of what openness takes of the sky that is taken, and a gain of what a light sends on all of the
cloth, where maps are so coarse that they tell of the cloth alone (`map_place.blind`), and with it of the direction that
is open to it: found on flat pieces of plain, twill and satin, of three colours, from two sides, under a sky and ten
lights, beside the path tracer's pictures (`docs/appearance.md`)."""


def new_view() -> NDArray[np.float32]:
    """Rows of zeros, shape (VIEW_ROWS, 3)."""
    return np.zeros((VIEW_ROWS, 3), np.float32)


def set_view(view: NDArray[np.float32], camera: Camera, lighting: Lighting) -> None:
    """Fill the rows of the camera and of the lights."""
    view[ROTATION : ROTATION + 3] = camera.rotation
    view[TRANSLATION] = camera.translation
    view[EYE] = camera.eye
    view[LENS] = camera.focal, camera.cx, camera.cy
    view[IMAGE] = camera.width, camera.height, camera.near
    view[KEY_DIRECTION] = lighting.towards_key(camera)
    view[KEY], view[SKY], view[GROUND] = lighting.radiances()
    view[DOME] = lighting.rise
    view[OTHERS:DOME] = 0.0
    for k, other in enumerate(lighting.others[:MOST_OTHERS]):
        view[OTHERS + 2 * k] = other.towards(camera)
        view[OTHERS + 2 * k + 1] = np.multiply(other.intensity * 2.0**lighting.exposure, other.colour)


def set_finish(
    view: NDArray[np.float32],
    camera: Camera,
    lighting: Lighting,
    finish: Finish,
    box: NDArray[np.float64],
    *,
    opacity: float,
    edge: float,
) -> None:
    """Fill the rows of the fibres and of the particles in a box (2, 3) [m]. edge: of a splat, 0 for crisp."""
    key, sky, ground = lighting.radiances()
    corners = np.array([[box[i >> k & 1, k] for k in range(3)] for i in range(8)])
    depths = corners @ camera.rotation[2] + camera.translation[2]
    nearest = max(camera.near, float(depths.min()))
    around = float(key.sum() + view[OTHERS + 1 : DOME : 2].sum() + (sky.sum() + ground.sum()) / 2)
    view[FIBRE] = finish.fibre, finish.specular, finish.exponent / 16
    view[SURFACE] = finish.tint, finish.sheen, SLOPE_GAIN * finish.roundness / max(around, 1e-12)
    view[DEPTH] = nearest, DEEPEST_KEY / max(float(depths.max()) - nearest, 1e-9), opacity
    sharpness = 1.0 / (8.0 * np.sin(np.radians(finish.spread)) ** 2)
    view[EDGE] = edge, KEY_SHADE / (2 if lighting.shadows else 1), sharpness
    view[LOBES] = finish.reflect, finish.transmit, finish.internal
    view[COAT, 2] = LIMB_DARKENING * finish.roundness
    set_bulk(view, finish, 1.0, 0.0)


def set_bulk(view: NDArray[np.float32], finish: Finish, coarse: float, blind: float) -> None:
    """Fill the rows of light that goes from fibre to fibre; nothing without a depth of it. coarse: share of what
    particles hide from each other within the cloth that maps of light do not show. blind: how far they tell of the
    cloth alone, see `map_place.blind`; with no maps it is not known either."""
    if finish.depth <= 0:
        return
    body, uncoloured = _left(finish)
    view[EDGE, 1] = BULK_SHADE * coarse
    view[BULK] = body, coarse * (1.0 + blind * (SEEN - 1.0)), 1.0 - body
    more = UNRESOLVED + blind * (OF_CLOTH - UNRESOLVED)
    view[COAT, :2] = 1.0 - uncoloured, 1.0 + more * coarse
    surface = surface_share(finish)
    view[DYE] = 1.0 / (1.0 - surface), surface / (1.0 - surface), finish.alone
    view[CONE] = *cone(finish.spread), 1.0 + blind * (DIFFUSE - 1.0)
    view[ABOVE, :2] = np.multiply(coarse * blind, FROM_ABOVE)


def surface_share(finish: Finish) -> float:
    """What a thick mass of such fibres sends back of the sky before light gets to their dye, of any colour."""
    body, uncoloured = _left(finish)
    shine = OPEN * (1.0 - body)
    return (SURFACE_SHARE * body + uncoloured * shine) / (body + shine)


def _left(finish: Finish) -> tuple[float, float]:
    """What highlights leave of a bulk's light, and the share of the sky's highlights that has no colour."""
    lobes = finish.reflect + finish.transmit + finish.internal if finish.model == "marschner" else 0.0
    return min((1.0 - lobes) / BODY, 1.0), LEAVING * finish.reflect / max(lobes, 1e-6)
