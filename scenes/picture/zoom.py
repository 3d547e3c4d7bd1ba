"""One continuous move from the whole cloth to one fibre (the paper's Figure 13): the camera's path, and its frames."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.refine import RefiningStream
from taichi_cloth.detail.thinning import NO_GAINS, Gains
from taichi_cloth.fabric.layout import BODY
from taichi_cloth.ground.cache import digest, kept
from taichi_cloth.ground.errors import InputError

from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import Camera
from ...render.data.finish import Finish
from ...render.data.light import Lighting
from ...render.splat.splat import Splatter
from ..models.fabric_model import FabricModel
from ..models.model import Model
from ..prepare.drawing import LIT, has_floor
from ..prepare.sett import sett_of
from ..scene.schema import Scene
from .gains import fit_gains, fit_near, views_of
from .samples import averaged, samples_of, shown
from .streamed import Closer, Streamed
from .view import Shot, View, first_of
from .zoom_cells import zoom_cells
from .zoom_path import nearing, skin_in

__all__ = ["path", "require_threads", "source_of", "target_of", "zoom"]

Image = NDArray[np.uint8]
F64 = NDArray[np.float64]
FINER = 0.01
"""Across [m], of what has maps of light of its own where the camera is near."""
FITTED = 12
"""Version of how gains are fitted, which takes long: they are kept."""


def require_threads(scene: Scene, name: str) -> None:
    """Raises InputError for a scene that no zoom can show."""
    if scene.outfit:
        raise InputError(
            f"zoom: {name} has several garments; zoom shows one cloth, such as that of {scene.garments[0].title}"
        )
    moving = scene.cloth or scene.garment
    if scene.weave is None or (scene.subject != "fabric" and moving is None):
        raise InputError(f"zoom: {name} has no [weave]; use a woven scene, such as swatch or tshirt")
    if moving is not None and moving.representation != "fibre":
        raise InputError(f"zoom: {name} is drawn as a mesh, which has no fibres; set {scene.subject}.representation")
    if moving is not None and sett_of(scene) is None:
        raise InputError(f"zoom: {name} states no sett; set fabric.ends_per_cm and fabric.picks_per_cm")


def zoom(view: View, count: int, numbers: list[int]) -> Iterator[tuple[int, Image]]:
    """The frames `numbers` of `count`, lit as a still is: light maps of the whole cloth, made once a light direction.

    Raises InputError for a scene that is neither of a fabric nor of cloth that is made where a camera looks.
    """
    if not isinstance(view.model, FabricModel):
        yield from zoom_cells(view, count, numbers)
        return
    light, panel = view.lighting, view.model.panels()[0]
    first = first_of(view.scene, view.size, panel.bounds)
    source = source_of(view.model, light.without_maps(), view.finish, first)
    target = target_of(source)
    cameras = path(view.scene, first, source, target, count)
    width, height = (samples_of(panel, cameras[0]) * side for side in view.size)
    splatter = Splatter(width, height)
    closer = Closer(target[0], (FINER,), lambda size: ParticleBlocks(source.base.sample(LIT, target[0], size)))
    streamed = Streamed(splatter, panel.particles, floor=has_floor(view.scene), closer=closer)
    options = {"lighting": light, "finish": view.finish, "background": view.background}
    for k in numbers:
        samples = samples_of(panel, cameras[k])
        camera = cameras[k].on_canvas(samples)
        splatter.resize(camera.width, camera.height)
        rgba = np.zeros((camera.height, camera.width, 4), np.float32) if samples > 1 else None
        image, behind = streamed.draw(camera, source, linear=rgba, **options)
        if rgba is not None:
            shot = Shot(panel, splatter, camera, behind, linear=rgba)
            image = shown(light.tone, averaged(view.light_of(shot), samples))
        yield k, image


def source_of(
    model: Model,
    lighting: Lighting | None = None,
    finish: Finish | None = None,
    farthest: Camera | None = None,
) -> RefiningStream:
    """The model's fabric, refined where the camera is near down to the surface of the scene's own fibre; few thick
    fibres lean to the eye, and what a still lays whole is never thinned, so that the one begins with the other's
    picture.

    lighting, finish: in which what is thinned keeps its brightness. farthest: a view than which none will be
    farther away or at a lower angle; None keeps it everywhere.
    """
    if not isinstance(model, FabricModel):
        raise InputError("zoom: needs a woven scene, such as swatch; this one has no [weave]")
    skin = skin_in(model.scene)
    fabric, points = model.fabric, model.points
    options = {"lighting": lighting, "finish": finish, "to_eye": model.to_eye}

    thins = model.source is not None
    views = None if farthest is None or not thins else views_of(fabric, points, farthest)

    def fit() -> dict[str, NDArray]:
        far = fit_gains(fabric, points, views=views, **options) if thins else NO_GAINS
        near = fit_near(fabric, points, skin, **options)
        return {"tilt": far.tilt, "factor": far.factor, "parted": near[0], "surface": near[1]}

    made_of = digest(FITTED, fabric.bank, fabric.layout.blocks, points, skin, *options.values(), views)
    fitted, _ = kept("gains", made_of, fit)
    gains = Gains(fitted["tilt"], fitted["factor"])
    parted, surface = fitted["parted"], fitted["surface"]
    gained = {"gains": gains, "parted_gain": parted, "surface_gain": surface, "target": None if thins else 0.0}
    return RefiningStream(fabric, points, skin, to_eye=model.to_eye, **gained)


def path(scene: Scene, first: Camera, source: RefiningStream, target: tuple[F64, F64], count: int) -> list[Camera]:
    """`count` cameras from a first one, which shows the whole cloth, to a `target_of` it, see `nearing`."""
    points = source.base.arrays.point
    end, normal = target
    centre = (points.min(axis=0) + points.max(axis=0)).astype(np.float64) / 2
    diameter = source.base.fabric.layout.warp.yarn.fibre_diameter
    return nearing(first, scene.camera.fov_deg, centre, end, normal, diameter, count, crop=scene.camera.zoom)


def target_of(source: RefiningStream) -> tuple[F64, F64]:
    """A place on a fibre on the crown of a thread near the middle of the cloth [m], and the cloth's normal there."""
    base = source.base
    layout = base.fabric.layout
    picks, ends = layout.cloth.warp_up.shape
    body = np.flatnonzero(layout.kinds.section[layout.blocks.kind] == BODY)
    middle = (picks // 2) * ends + ends // 2
    centre = base.arrays.point[middle].astype(np.float64)
    normal = base.arrays.normal[middle].astype(np.float64)
    about = (base.arrays.point[layout.blocks.key0[body]] + base.arrays.point[layout.blocks.key1[body]]) / 2
    nearest = body[np.argsort(np.linalg.norm(about - centre, axis=1), kind="stable")[:24]]
    starts, sizes = (
        base.fabric.bank.start[base.fabric.bank.template[nearest]],
        base.size[base.fabric.bank.template[nearest]],
    )
    best, place = -np.inf, centre
    for block, start, size in zip(nearest, starts, sizes, strict=True):
        bank, mine = base.fabric.bank, slice(int(start), int(start + size))
        usable = bank.openness[mine] < 1.0  # hairs stand open on all sides
        height = np.where(usable, bank.offset[mine, 2] + bank.radius[mine], -np.inf)
        top = int(np.argmax(height))
        p0, p1 = (base.arrays.point[k[block]].astype(np.float64) for k in (layout.blocks.key0, layout.blocks.key1))
        up = base.arrays.normal[layout.blocks.key0[block]].astype(np.float64)
        along = (p1 - p0) / np.linalg.norm(p1 - p0)
        u, offset = float(bank.u[mine][top]), bank.offset[mine][top].astype(np.float64)
        spot = p0 + u * (p1 - p0) + offset[0] * along + offset[1] * np.cross(up, along) + height[top] * up
        score = float(height[top]) - 0.02 * float(np.linalg.norm(spot - centre))
        if score > best:
            best, place, normal = score, spot, up
    return place, normal
