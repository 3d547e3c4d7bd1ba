"""Figures 10 to 16: the body and its primitives, garments as mesh and as fibres, magnified, stretched and in motion."""

import tempfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.figure.build import built_in_body
from taichi_cloth.body.parts.segment import segment

from ...render.data.camera import box_corners
from ...render.image.caption import caption, tag
from ...render.tiles.mesh import Mesh
from ..body.body_fit import GREY
from ..body.body_picture import HUES, KIND_COLOURS, Shown, draw_panels, part_mesh, primitive_meshes
from ..models.build import build
from ..models.garment_model import GarmentModel
from ..picture.view import View
from ..prepare.body_setup import primitives_of
from ..prepare.garment_setup import woven_garment
from ..prepare.weave_layout import prepare_fabric
from ..scene.load import load_scene
from .own_scenes import scene_file

__all__ = ["body_parts", "dressed_twice", "magnified", "moving", "primitives", "skirt_and_shirt", "stretched"]

Image = NDArray[np.uint8]
TALL, STRIDING = (600, 860), (300, 640)
MOMENTS: tuple[int, ...] = (42, 48, 60, 66)
"""Frames of the walk: lifting a foot, striding, the feet passing, striding on the other side."""
FINE = 60
"""Fibres of a thread where it is seen near."""
FLOOR = "stage.ground=true"


def body_parts(quick: bool) -> Image:
    body, parts = _body()
    plain = Mesh(body.vertices, body.faces.astype(np.int64), GREY)
    mesh = part_mesh(body.vertices, body.faces.astype(np.int64), np.asarray(plain.normals), parts.labels)
    shown = [Shown(mesh, 25.0, f"{len(parts.names)} parts"), Shown(mesh, 205.0)]
    return _panels(shown, body, [(name, HUES[k % len(HUES)]) for k, name in enumerate(parts.names)])


def primitives(quick: bool) -> Image:
    body, _ = _body()
    plain = Mesh(body.vertices, body.faces.astype(np.int64), GREY)
    solids = primitives_of(body)
    mesh = primitive_meshes(solids)
    shown = [Shown(mesh, 25.0, f"{len(solids)} primitives under the skin", plain), Shown(mesh, 205.0)]
    words = {"cylinder": "cylinders", "sphere": "spheres", "elliptic": "elliptic cylinders"}
    counts = {kind: sum(p.kind == kind for p in solids) for kind in KIND_COLOURS}
    return _panels(shown, body, [(f"{n} {words[kind]}", KIND_COLOURS[kind]) for kind, n in counts.items() if n])


@lru_cache(maxsize=1)
def _body():
    body = built_in_body(gender="female")
    return body, segment(body.vertices, body.faces.astype(np.int64))


def _panels(shown: list[Shown], body, entries: list) -> Image:
    box = (body.vertices.min(axis=0), body.vertices.max(axis=0))
    with tempfile.TemporaryDirectory() as folder:
        return draw_panels(shown, box, Path(folder) / "body.png", size=(600, 860), entries=entries)


@lru_cache(maxsize=1)
def _garment(name: str, *overrides: str) -> GarmentModel:
    """The last garment that was drawn; another takes its place."""
    model = build(load_scene(scene_file(name), [FLOOR, *overrides]))
    assert isinstance(model, GarmentModel)
    return model


def _at_rest(model: GarmentModel, quick: bool) -> Image:
    """From head to foot; unless quickly on a canvas twice as large, so that threads finer than a pixel come out
    smooth."""
    model.bounds = _whole(model, [0])
    return next(image for _, image in View(model, TALL, scale=_canvas(quick)).animation([0]))


def _canvas(quick: bool) -> int:
    return 1 if quick else 2


def _whole(model: GarmentModel, frames: list[int]) -> NDArray[np.float32]:
    """Corners (8, 3) [m] of the box that holds who wears a garment in some frames, and the garment at rest."""
    fps, body = model.scene.output.fps, model.dressed.body
    skins = [body.posed(model.motion.pose(frame / fps)) for frame in frames]
    garment = model.dressed.worn.positions[model.simulation.sheet.present]
    points = np.concatenate([*skins, garment])
    return box_corners(points.min(axis=0), points.max(axis=0)).astype(np.float32)


def dressed_twice(quick: bool) -> Image:
    model = _garment("dress")
    drawn = _at_rest(model, quick)
    fibres, model.fibres = model.fibres, None
    try:
        mesh = _at_rest(model, quick)
    finally:
        model.fibres = fibres
    return np.concatenate([caption(mesh, "(a) mesh"), caption(drawn, "(b) fibres")], axis=1)


def magnified(quick: bool) -> Image:
    """Whole, then nearer and nearer to a place on the chest; from 16 times on with more fibres in each thread."""
    model = _garment("tshirt")
    model.step(0)
    size = (600, 600)
    view = View(model, size, scale=_canvas(quick))
    camera = view.camera()
    points = model.simulation.positions[model.simulation.sheet.present]
    seen = camera.project(points)
    low, high = points.min(axis=0), points.max(axis=0)
    aim = low + np.array([0.56, 0.62, 1.0]) * (high - low)
    apart = np.abs(points[:, :2] - aim[:2]).sum(axis=1) + np.where(seen[:, 2] < np.median(seen[:, 2]), 0.0, 1.0)
    place = points[apart.argmin()]
    x, y, _ = seen[apart.argmin()]
    images = []
    for times in (1, 4, 16, 60):
        if times == 16 and not quick:
            view = View(_finer(model, place), size, scale=2)
        share = 0.0 if times == 1 else 1.0
        cx = camera.width / 2 + times * (camera.cx - (share * x + (1 - share) * camera.width / 2))
        cy = camera.height / 2 + times * (camera.cy - (share * y + (1 - share) * camera.height / 2))
        image = view.seen_by(replace(camera, focal=times * camera.focal, cx=float(cx), cy=float(cy)))
        images.append(tag(image, "whole" if times == 1 else f"{times} x"))
    return np.concatenate([np.concatenate(images[:2], axis=1), np.concatenate(images[2:], axis=1)], axis=0)


def _finer(model: GarmentModel, place: NDArray) -> GarmentModel:
    """The surroundings of a place, their threads of as many fibres as a near picture shows."""
    scene = load_scene(scene_file("tshirt"), [f"yarn.fibres={FINE}", "fabric.steps=8", "light.exposure=-0.6"])
    prepared = prepare_fabric(woven_garment(scene, model.dressed.garment.atlas), streamed=True)
    return GarmentModel.of(scene, prepared, model.dressed, near=(place, 0.05))


def stretched(quick: bool) -> Image:
    scene = load_scene("stretch", [])
    model = build(scene)
    drawn = View(model, (1200, 480), scale=_canvas(quick)).animation([0, model.frames - 1])
    return np.concatenate([caption(image, w) for (_, image), w in zip(drawn, ("(a)", "(b)"), strict=True)], axis=0)


def skirt_and_shirt(quick: bool) -> Image:
    return np.concatenate([_at_rest(_garment(name), quick) for name in ("skirt", "tshirt")], axis=1)


def moving(quick: bool) -> Image:
    """The moments of a walk from one camera, from head to foot."""
    model = _garment("dress", "body.motion=walk")
    moments = [k // 2 for k in MOMENTS] if quick else list(MOMENTS)
    model.bounds = _whole(model, moments)
    drawn = View(model, STRIDING, scale=_canvas(quick)).animation(moments)
    fps = model.scene.output.fps
    return np.concatenate([caption(image, f"t = {frame / fps:.1f} s") for frame, image in drawn], axis=1)
