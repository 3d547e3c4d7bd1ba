"""The same fibres by Mitsuba's path tracer (extra "reference"): W. Jakob and others, "Mitsuba 3 renderer", 2022.

Fibres are B-spline curves with its `hair` BSDF (Chiang, Bitterli, Tappan, Burley, "A practical and controllable hair
and fur model for production path tracing", CGF 35(2), 2016), at the absorption at which a thick mass of them has the
case's colour (their equation 9, less what the surfaces of fibres send back); a distant light and an even sky, or an
even half of one.
"""

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_cloth.ground.cache import digest, kept

from ....render.data.light import Colour
from ....render.light.bulk import dyed
from .cases import FOV, Case, Subject

__all__ = ["absorption", "in_no_light", "path_traced"]

VERSION = 2
"""Of the code in this file, so that pictures that another one made are not taken for its own."""
UNIT = 1e5
"""Units of the path tracer's scene in a metre: 10 µm each, for its tolerances are absolute."""
ALONG, ACROSS, INDEX = 0.35, 0.4, 1.55
"""Roughness along and across the fibre, and index of refraction of cellulose."""
BOUNCES, ROULETTE = 200, 40
"""At most, and from which on paths are ended by chance."""
BLACKEST = 1e-4
"""Of the colours of equation 9, whose absorption has no end at 0."""
SKY_ROWS = 64
"""Rows of the picture of a sky of two halves."""


def absorption(colour: ArrayLike) -> NDArray[np.float64]:
    """Absorption in a fibre of radius 1 at which a thick mass of fibres has a colour: Chiang et al., eq. 9, of `dyed`,
    as it leaves out what surfaces send back: by it alone a mass of 0.02 is one of 0.05, and of 0.05 one of 0.08."""
    powers = ACROSS ** np.arange(6)
    scale = powers @ [5.969, -0.215, 2.532, -10.73, 5.574, 0.245]
    return (np.log(np.maximum(dyed(colour), BLACKEST)) / scale) ** 2


def path_traced(subject: Subject, samples: int, threads: int) -> tuple[NDArray[np.float64], float]:
    """Linear premultiplied RGBA (size, size, 4) of so many samples a pixel, and the CPU time that it took [s]; from
    disk where it was made before."""
    import mitsuba  # pyright: ignore[reportMissingImports]

    case, particles = subject.case, subject.particles
    light = case.colour, case.key, case.towards, case.fill, case.sky, case.ground, case.away, case.share
    seen = particles.position, particles.radius, subject.starts, subject.size, samples
    made_of = digest(VERSION, mitsuba.__version__, *light, *seen)
    found, _ = kept("path-traced", made_of, lambda: _trace(subject, samples, threads))
    return found["rgba"].astype(np.float64), float(found["seconds"])


def _trace(subject: Subject, samples: int, threads: int) -> dict[str, NDArray]:
    import drjit  # pyright: ignore[reportMissingImports]
    import mitsuba as mi  # pyright: ignore[reportMissingImports]

    drjit.set_thread_count(threads)
    mi.set_variant("scalar_rgb")
    with tempfile.TemporaryDirectory() as folder:
        curves = Path(folder) / "fibres.txt"
        _write_curves(curves, subject)
        scene: Any = mi.load_dict(_scene(mi, subject, curves))
        begin = time.process_time()
        rgba = np.array(mi.render(scene, spp=samples))  # pyright: ignore[reportArgumentType]
    return {"rgba": rgba.astype(np.float32), "seconds": np.array(time.process_time() - begin)}


def _write_curves(file: Path, subject: Subject) -> None:
    """B-splines through the particles of each piece of fibre, half a step beyond both of its ends."""
    x, r = UNIT * subject.particles.position, UNIT * subject.particles.radius
    with file.open("w", encoding="ascii") as out:
        for a, b in zip(subject.starts[:-1], subject.starts[1:], strict=True):
            if b - a < 2:
                continue
            before, after = x[a] - x[a + 1], x[b - 1] - x[b - 2]
            ends = [x[a] + before, x[a] + before / 2], [x[b - 1] + after / 2, x[b - 1] + after]
            place = np.concatenate([ends[0], x[a:b], ends[1]])
            wide = np.concatenate([[r[a]] * 2, r[a:b], [r[b - 1]] * 2])
            out.writelines(f"{p[0]:.4f} {p[1]:.4f} {p[2]:.4f} {w:.4f}\n" for p, w in zip(place, wide, strict=True))
            out.write("\n")


def _scene(mi: Any, subject: Subject, curves: Path) -> dict[str, Any]:
    """As `load_dict` takes it."""
    case, camera = subject.case, subject.camera
    eye, to_world = UNIT * camera.eye, mi.ScalarTransform4f()
    film = {"type": "hdrfilm", "width": subject.size, "height": subject.size, "pixel_format": "rgba"}
    out: dict[str, Any] = {
        **in_no_light(curves, case.colour),
        "sensor": {
            "type": "perspective",
            "fov": FOV,
            "fov_axis": "y",
            "near_clip": 1.0,
            "far_clip": 1e6,
            "to_world": to_world.look_at(
                eye.tolist(), (eye + 100 * camera.forward).tolist(), (-camera.rotation[1]).tolist()
            ),
            "film": {**film, "rfilter": {"type": "box"}},
        },
    }
    if case.key > 0:
        towards = np.array(case.towards) / np.linalg.norm(case.towards)
        irradiance = _rgb([np.pi * case.key] * 3)
        out["key"] = {"type": "directional", "direction": (-towards).tolist(), "irradiance": irradiance}
    if case.fill > 0:
        out["sky"] = _sky(mi, case)
    return out


def in_no_light(curves: Path, colour: ArrayLike) -> dict[str, Any]:
    """Fibres of a colour, and how their light is traced."""
    fibre = {"type": "hair", "longitudinal_roughness": ALONG, "azimuthal_roughness": ACROSS, "scale_tilt": 0.0}
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": BOUNCES, "rr_depth": ROULETTE, "hide_emitters": True},
        "fibres": {
            "type": "bsplinecurve",
            "filename": str(curves),
            "bsdf": {**fibre, "int_ior": INDEX, "sigma_a": _rgb(absorption(colour))},
        },
    }


def _sky(mi: Any, case: Case) -> dict[str, Any]:
    """An even sky, or one of two halves."""
    above, below = (case.fill * np.asarray(colour) for colour in (case.sky, case.ground))
    if case.sky == case.ground:
        return {"type": "constant", "radiance": _rgb(above)}
    halves = np.empty((SKY_ROWS, 2 * SKY_ROWS, 3), np.float32)
    halves[: SKY_ROWS // 2], halves[SKY_ROWS // 2 :] = above, below
    return {"type": "envmap", "bitmap": mi.Bitmap(halves)}


def _rgb(value: Colour | ArrayLike) -> dict[str, Any]:
    return {"type": "rgb", "value": np.asarray(value, np.float64).tolist()}
