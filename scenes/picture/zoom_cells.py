"""One continuous move from a whole garment or sheet to one fibre of it: where it goes, and its frames.

The cloth lies as the scene's `still` shows it, and the lights stay where they are in the first picture. Everything is
laid about the place that the camera goes to, as a metre from there a single-precision number is a tenth of a micrometre
from the next, which is two pixels of the last picture.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.detail.cell_stream import TARGET, CellStream
from taichi_cloth.detail.near_cells import NearCells
from taichi_cloth.detail.pieces import COVERED
from taichi_cloth.fabric.cells import CellCloth
from taichi_cloth.fabric.surface import surface_points
from taichi_cloth.ground.cache import digest, kept
from taichi_cloth.ground.copies import fetched
from taichi_cloth.ground.errors import InputError

from ...render.data.blocks import ParticleBlocks
from ...render.data.camera import Camera, frame
from ...render.data.finish import Finish
from ...render.data.light import Lighting
from ...render.splat.splat import Splatter
from ...render.tiles.mesh import Mesh, join, visible
from ..models.moving_model import MovingModel
from ..prepare.drawing import LIT, has_floor
from .flat_piece import flat_piece
from .gains import PROBE, colours_at, matched
from .sheet_look import fit_look
from .streamed import Closer, Streamed
from .view import View, first_of
from .zoom_path import RESOLUTION, TURN, nearing, skin_in

__all__ = ["zoom_cells"]

Image = NDArray[np.uint8]
F64 = NDArray[np.float64]

MIDDLE, CHEST = (0.5, 0.5), (0.5, 0.36)
"""Where a zoom goes unless a scene says, of a sheet and of a garment: shares of the first picture."""
BEHIND = 0.01
"""Cloth so far behind skin [m] is not seen."""
GRAZING = 0.3
"""Cosine of the angle between the cloth's normal and the view below which a zoom does not go there."""
CLOSE = COVERED[0]
"""Mean radius of a fibre [px] at which points on its skin cover it: there both must be as bright."""
REGIONS = 0.05, 0.01
"""Across [m], in which maps of light tell thread from thread, and fibre from fibre."""
LIT_BY = Lighting(key_follows_camera=False, shadows=True, occlusion=True)
SIZE = 320, 192
THREADS, CROSSINGS = 40, 6
VERSION = 8


def zoom_cells(view: View, count: int, numbers: list[int]) -> Iterator[tuple[int, Image]]:
    """The frames `numbers` of `count`. Raises InputError for a scene whose cloth is not made where a camera looks."""
    model, scene = view.model, view.scene
    if not isinstance(model, MovingModel) or not isinstance(model.source, CellStream):
        raise InputError("zoom: needs a woven scene, such as swatch, or cloth drawn as fibres with a sett; no other is")
    panel = model.panels()[0]
    width, height = view.size
    section, first = scene.camera, first_of(scene, view.size, panel.bounds)
    source, finish = model.source, view.finish
    source.target = TARGET
    source.look = fit_look(source, finish)
    near = NearCells(source, skin_in(scene))
    near.skins.gain = _skin_gain(near, finish)
    mesh = join(panel.meshes) if panel.meshes else None
    aim = section.aim or (CHEST if scene.subject == "garment" else MIDDLE)
    end, normal = near.crown(*_cell_at(source.cloth, first, aim, mesh), first.eye, TURN)
    # All of it about that place.
    assert model.fibres is not None
    sample: ParticleBlocks = model.fibres.follow((model.simulation.positions - end).astype(np.float32))
    mesh = None if mesh is None else replace(mesh, vertices=(mesh.vertices - end).astype(np.float32))
    first = replace(first, translation=first.translation + first.rotation @ end)
    middle = np.asarray(panel.bounds, np.float64)
    middle = (middle.min(axis=0) + middle.max(axis=0)) / 2 - end
    diameter = source.cloth.repeats[0].layout.warp.yarn.fibre_diameter
    way = nearing(first, section.fov_deg, middle, np.zeros(3), normal, diameter, count, crop=section.zoom)
    lighting = _standing(view.lighting, first)
    closer = Closer(np.zeros(3), REGIONS, lambda size: ParticleBlocks(near.around(np.zeros(3), size, LIT)))
    splatter = Splatter(width, height)
    streamed = Streamed(splatter, sample, floor=has_floor(scene), mesh=mesh, resolution=RESOLUTION, closer=closer)
    for k in numbers:
        image, _ = streamed.draw(way[k], near, lighting=lighting, finish=finish, background=view.background)
        yield k, image


def _standing(lighting: Lighting, camera: Camera) -> Lighting:
    """The lights as a camera has them, from where they follow it no more."""
    key, *others = lighting.lights
    others = tuple(replace(one, direction=tuple(one.towards(camera)), follows_camera=False) for one in others)
    return replace(lighting, direction=tuple(key.towards(camera)), key_follows_camera=False, others=others)


def _cell_at(cloth: CellCloth, camera: Camera, aim: tuple[float, float], mesh: Mesh | None) -> tuple[int, float, float]:
    """The cell that is seen at a place of a picture, or next to it, and where in it, along the weft and the warp."""
    cols = cloth.shape[1]
    rows, columns = np.divmod(cloth.cells, cols)
    place, by_u, by_v = surface_points(cloth.node, cols, columns + 0.5, rows + 0.5)
    at = camera.project(place)
    size = float(np.sqrt(np.median(np.linalg.norm(np.cross(by_u, by_v), axis=1))))
    wanted = np.multiply(aim, (camera.width, camera.height))
    away = np.linalg.norm(at[:, :2] - wanted, axis=1)
    normal, towards = np.cross(by_u, by_v), camera.eye - place
    tilt = np.abs((normal * towards).sum(axis=1))
    tilt /= np.maximum(np.linalg.norm(normal, axis=1) * np.linalg.norm(towards, axis=1), 1e-30)
    pixel = np.floor(at[:, :2]).astype(np.int64)
    inside = (at[:, 2] > camera.near) & (pixel >= 0).all(axis=1) & (pixel < (camera.width, camera.height)).all(axis=1)
    shown = inside & (tilt > GRAZING) & _woven(cloth)
    if mesh is not None:
        wall = fetched(visible(mesh, camera, chunks=2)[0])
        x, y = np.where(inside[:, None], pixel, 0).T
        shown &= at[:, 2] < wall[y, x] + BEHIND
    if not shown.any():
        raise InputError("zoom: no cloth is in the first picture; set camera.azimuth_deg or camera.box_m")
    reach = away[shown].min() + 1.5 * size * camera.focal / float(np.median(at[shown, 2]))
    shown &= away <= reach
    shown &= at[:, 2] <= at[shown, 2].min() + 3.0 * size  # what lies behind other cloth is not seen
    best = int(np.flatnonzero(shown)[np.argmin(away[shown])])
    share = (np.arange(16) + 0.5) / 16
    u, v = (a.ravel() for a in np.meshgrid(share, share))
    inner, _, _ = surface_points(cloth.node, cols, columns[best] + u, rows[best] + v)
    nearest = int(np.argmin(np.linalg.norm(camera.project(inner)[:, :2] - wanted, axis=1)))
    return int(cloth.cells[best]), float(u[nearest]), float(v[nearest])


def _woven(cloth: CellCloth) -> NDArray[np.bool_]:
    """Whether an outline leaves all of a cell, (cells,)."""
    rows, columns = np.divmod(cloth.cells, cloth.shape[1])
    starts = np.cumsum(cloth.counts.ravel()) - cloth.counts.ravel()
    out = np.zeros(len(cloth.cells), bool)
    ends, picks = cloth.per_cell
    for k, (cell, row, col) in enumerate(zip(cloth.cells.tolist(), rows.tolist(), columns.tolist(), strict=True)):
        number = int(cloth.of_cell[cell])
        panel = cloth.panels[number]
        i, j = (row - panel.row) * picks, (col - panel.col) * ends
        threads = (starts[2 * number] + j + ends // 2, i, picks), (starts[2 * number + 1] + i + picks // 2, j, ends)
        out[k] = True
        for thread, begin, length in threads:
            spans = cloth.threads.spans[cloth.threads.first[thread] : cloth.threads.first[thread + 1]]
            out[k] &= bool(((spans[:, 0] <= begin) & (spans[:, 1] >= begin + length)).any())
    return out


def _skin_gain(near: NearCells, finish: Finish) -> NDArray[np.float32]:
    """The factors by which points on the skin of fibres are as bright as the fibres' splats: of a flat piece, from
    above, in the light of maps that tell them apart. Kept on disk."""
    cloth = near.cells.cloth
    family = cloth.family_of_thread()
    own = np.stack([cloth.threads.colour[family == k].mean(axis=0) for k in (0, 1)]).astype(np.float64)
    made_of = digest(VERSION, cloth.bank.particle, near.cells.pitch, near.skins.skin, finish, own)

    def make() -> dict[str, NDArray]:
        flat = flat_piece(cloth, 0, THREADS, near.cells.pitch, probe=PROBE)
        flat.sheets = False
        points = flat.cloth.node[:, :3].astype(np.float64)
        splatter, skin = Splatter(*SIZE), NearCells(flat, near.skins.skin)
        base = frame(points, width=SIZE[0], height=SIZE[1], elevation=90.0, fov=4)
        away = flat.cloth.bank.radius[0] * base.focal / CLOSE
        first = replace(base, translation=-base.rotation @ (points.mean(axis=0) - base.forward * away))
        splatter.load(ParticleBlocks(skin.around(points.mean(axis=0), REGIONS[-1], LIT)))
        splatter.light.hold(splatter.cast_light(first, LIT_BY), each=True)
        looks = []
        for source in (flat, skin):
            total = np.zeros(3)
            for k in range(CROSSINGS):
                about = points.mean(axis=0) + np.array([flat.pitch[0] * (k % 3), 0.0, flat.pitch[1] * (k // 3)])
                camera = replace(base, translation=-base.rotation @ (about - base.forward * away), near=1e-4)
                total += colours_at(splatter, source, camera, lighting=LIT_BY, finish=finish)[:3]
            looks.append(total)
        return {"gain": matched(looks[0], looks[1], own)}

    return kept("skin", made_of, make)[0]["gain"]
