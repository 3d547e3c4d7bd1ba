"""Figures 1 to 9: fibre, twist, weaves, springs, and one sheet as a mesh and as fibres."""

import cv2
import numpy as np
from numpy.typing import NDArray

from ...render.image.caption import caption, label, legend
from ..models.build import build
from ..models.cloth_model import ClothModel
from ..models.fabric_model import FabricModel
from ..picture.view import View
from ..scene.load import load_scene
from .own_scenes import PAPER_DRAPE

__all__ = ["drape", "fibre", "picture", "springs", "textured", "twist", "weaves"]

Image = NDArray[np.uint8]
INKS = {"structural": (196, 38, 34), "shear": (22, 132, 62), "bending": (28, 70, 190)}
"""sRGB."""
SHIFT = 4  # bits of a fraction of a pixel in OpenCV's drawing


def picture(name: str, *overrides: str, size: tuple[int, int], frames: list[int] | None = None) -> list[Image]:
    """Images of a scene: the first view of its turntable, or frames of its animation, `size` (width, height) [px]."""
    view = View(build(load_scene(name, list(overrides))), size)
    drawn = view.turntable(1, [0]) if frames is None else view.animation(frames)
    return [image for _, image in drawn]


def fibre(quick: bool) -> Image:
    spacing = 0.8 if quick else 0.5
    images = []
    for kind in ("cotton", "wool", "silk"):
        own = [f"fibre.kind={kind}", "fibre.length_um=80", f"fibre.spacing_um={spacing}", "camera.margin=0.06"]
        images += picture("fibre", *own, size=(800, 1200))
    return np.concatenate(images, axis=1)


def twist(quick: bool) -> Image:
    rows = picture("twist", size=(2400, 640), frames=[0, 12, 30, 71])
    named = [label(row, f"({letter})", (60.0, 60.0)) for row, letter in zip(rows, "abcd", strict=True)]
    return np.concatenate(named, axis=0)


def weaves(quick: bool) -> Image:
    """Four weaves, each of as many threads as make a square of it."""
    own = ["camera.zoom=1.15", "fabric.pose=flat", "camera.elevation_deg=60", "camera.azimuth_deg=12"]
    if not quick:
        own += ["yarn.fibres=24", "fabric.steps=12"]
    images = []
    for name, ends, picks in (("plain", 20, 16), ("twill", 26, 16), ("satin", 40, 20), ("herringbone", 20, 16)):
        shown = picture(name, f"weave.ends={ends}", f"weave.picks={picks}", *own, size=(1200, 860))[0]
        images.append(caption(shown, name))
    return np.concatenate([np.concatenate(images[:2], axis=1), np.concatenate(images[2:], axis=1)], axis=0)


def textured(quick: bool) -> Image:
    """Coloured cloth in soft folds."""
    own = ["fabric.pose=wave", "fabric.pose_amount=0.9", "camera.zoom=1.04", "camera.elevation_deg=52"]
    return np.concatenate([picture(name, *own, size=(1200, 1000))[0] for name in ("tartan", "houndstooth")], axis=1)


def springs(quick: bool) -> Image:
    """The mass-spring network of six by six key points, drawn over the weave it stands for."""
    own = ["weave.ends=6", "weave.picks=6", "fabric.pose=flat", "fabric.fringe=0.8", "camera.elevation_deg=58"]
    own += ["camera.azimuth_deg=18", "yarn.fibres=24", "fabric.steps=16", "weave.warp_colours='#e6dfcf'"]
    own += ["weave.weft_colours='#c9d3dc'", "yarn.hairiness.ends_per_m=0", "yarn.hairiness.loops_per_m=0"]
    own += ["camera.zoom=1.12"]
    model = build(load_scene("plain", own))
    assert isinstance(model, FabricModel)
    view = View(model, (1200, 1000))
    ((_, plain),) = view.turntable(1, [0])
    (shot,) = view.shots()
    camera = shot.camera
    rows, cols = model.points.shape[:2]
    seen = camera.project(model.points.reshape(-1, 3))[:, :2].reshape(rows, cols, 2)
    left, right = plain.copy(), plain.copy()
    right[:] = 255 - (255 - right) // 2
    for ends, ink, bend, wide in _network(seen):
        _line(right, ends, ink, bend, wide)
    for image in (left, right):
        for at in seen.reshape(-1, 2):
            centre = tuple(int(v) for v in np.round(at * (1 << SHIFT)))
            cv2.circle(image, centre, 11 << SHIFT, (255, 255, 255), -1, cv2.LINE_AA, SHIFT)
            cv2.circle(image, centre, 8 << SHIFT, (30, 30, 34), -1, cv2.LINE_AA, SHIFT)
    both = np.concatenate([left, right], axis=1)
    strip = legend(both.shape[1], [(f"{n} springs", [v / 255 for v in ink]) for n, ink in INKS.items()], height=64)
    return np.concatenate([both, strip], axis=0)


def _network(at: NDArray) -> list[tuple[NDArray, tuple[int, int, int], float, int]]:
    """Ends (2, 2) [px], ink, how far the line bulges as a share of its length, and width [px] of every spring."""
    out = []
    rows, cols = at.shape[:2]
    kinds = (
        ("bending", ((0, 2), (2, 0)), 0.07, 3),
        ("shear", ((1, 1), (1, -1)), 0.0, 4),
        ("structural", ((0, 1), (1, 0)), 0.0, 6),
    )
    for name, steps, bend, wide in kinds:
        for di, dj in steps:
            for i in range(rows - di):
                for j in range(max(0, -dj), cols - max(0, dj)):
                    bulge = bend if (i + j) % 2 else -bend
                    out.append((np.stack([at[i, j], at[i + di, j + dj]]), INKS[name], bulge, wide))
    return out


def _line(image: Image, ends: NDArray, ink: tuple[int, int, int], bulge: float, wide: int) -> None:
    """A line or an arc between two points, over the image."""
    share = np.linspace(0, 1, 24 if bulge else 2)[:, None]
    along = ends[1] - ends[0]
    course = ends[0] + share * along + 4 * share * (1 - share) * bulge * np.array([-along[1], along[0]])
    points = np.round(course * (1 << SHIFT)).astype(np.int32)
    cv2.polylines(image, [points.reshape(-1, 1, 2)], False, ink, wide, cv2.LINE_AA, SHIFT)


def drape(quick: bool) -> Image:
    images, simulation = [], None
    for form in ("mesh", "fibre"):
        model = build(load_scene(PAPER_DRAPE, [f"cloth.representation={form}", "camera.zoom=1.3"]))
        assert isinstance(model, ClothModel)
        model.simulation = simulation or model.simulation
        model.step(min(model.frames - 1, 45) if quick else model.frames - 1)
        simulation = model.simulation
        images += [caption(image, form) for _, image in View(model, (1200, 1000)).turntable(1, [0])]
    return np.concatenate(images, axis=1)
