"""Figures 10 to 16: the body and its primitives, garments as mesh and as fibres, magnified, stretched and in motion."""

import tempfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.build import built_in_body
from taichi_cloth.body.segment import segment

from ..render.caption import label
from ..render.mesh import Mesh
from .body_fit import GREY
from .body_picture import HUES, KIND_COLOURS, Shown, draw_panels, part_mesh, primitive_meshes
from .garment import GarmentModel, woven_garment
from .load import load_scene
from .models import build
from .prepare import prepare_fabric
from .standing import primitives_of
from .view import View

__all__ = ["body_parts", "dressed_twice", "magnified", "moving", "primitives", "skirt_and_shirt", "stretched"]

Image = NDArray[np.uint8]
TALL = (600, 900)
MOMENTS: tuple[int, ...] = (36, 45, 54, 63)
"""Frames of the walk."""


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
    model = build(load_scene(name, list(overrides)))
    assert isinstance(model, GarmentModel)
    return model


def _at_rest(model: GarmentModel, size: tuple[int, int]) -> Image:
    model.step(0)
    return next(image for _, image in View(model, size).turntable(1, [0]))


def _from_head_to_foot(model: GarmentModel) -> GarmentModel:
    """The same garment, in pictures as tall as who wears it."""
    skin = model.dressed.body.vertices[:, 1]
    model.bounds = np.array(model.bounds)
    model.bounds[:, 1] = skin.min(), skin.max()
    return model


def dressed_twice(quick: bool) -> Image:
    model = _from_head_to_foot(_garment("dress"))
    model.step(0)
    fibres = _at_rest(model, TALL)
    follower, model.follower = model.follower, None
    try:
        mesh = _at_rest(model, TALL)
    finally:
        model.follower = follower
    return np.concatenate([_named(mesh, "mesh"), _named(fibres, "fibres")], axis=1)


def _named(image: Image, words: str) -> Image:
    """The picture with words on a light plate in its lower left corner."""
    height, width = image.shape[:2]
    out = image.copy()
    top, right = round(0.92 * height), round(0.24 * width)
    out[top:, :right] = 255 - (255 - out[top:, :right].astype(np.uint16)) // 5
    return label(out, words, (0.12 * width, 0.97 * height))


def magnified(quick: bool) -> Image:
    """Whole, then nearer and nearer to a place on the chest; from 16 times on with more fibres in each thread."""
    model = _garment("tshirt")
    model.step(0)
    size = (600, 600)
    view = View(model, size, scale=1 if quick else 2)
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
        images.append(_named(image, "whole" if times == 1 else f"{times} x"))
    return np.concatenate([np.concatenate(images[:2], axis=1), np.concatenate(images[2:], axis=1)], axis=0)


def _finer(model: GarmentModel, place: NDArray) -> GarmentModel:
    """The surroundings of a place, their threads of as many fibres as a near picture shows."""
    scene = load_scene("tshirt", ["yarn.fibres=20", "fabric.steps=8"])
    prepared = prepare_fabric(woven_garment(scene, model.dressed.garment.atlas), streamed=True)
    return GarmentModel(scene, prepared, model.dressed, near=(place, 0.05))


def stretched(quick: bool) -> Image:
    scene = load_scene("stretch", [])
    model = build(scene)
    return np.concatenate([image for _, image in View(model, (1200, 480)).animation([0, model.frames - 1])], axis=0)


def skirt_and_shirt(quick: bool) -> Image:
    shirt = _at_rest(_garment("tshirt"), TALL)
    return np.concatenate([_at_rest(_garment("skirt"), TALL), shirt], axis=1)


def moving(quick: bool) -> Image:
    model = _from_head_to_foot(_garment("dress", "body.motion=walk"))
    moments = [k // 2 for k in MOMENTS] if quick else list(MOMENTS)
    return np.concatenate([image for _, image in View(model, (320, 640)).animation(moments)], axis=1)
