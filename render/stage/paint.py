"""Paint what stands behind the particles: the background's gradient, the floor's shadows, then the meshes.

Meshes are shaded like cloth without fibres: Lambert's law for every distant light and a fill that goes from the
ground's colour to the sky's as the normal turns upward (see `Lighting.ambient`), on smooth normals turned towards the
viewer. What is skin of them, or woven, has its own way with light, see `skin.py` and `woven.py`.
"""

from dataclasses import dataclass

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_cloth.ground.arrays import F32x1, F32x2, F32x3, I32x2, Int, Template
from taichi_cloth.ground.copies import DeviceArray, fetched, filled, zeros
from taichi_cloth.ground.mixing import under_sky
from taichi_cloth.ground.vectors import keep

from ..data.backdrop import Backdrop, padded, tiled
from ..data.camera import Camera
from ..data.light import Background, Lighting
from ..light.particle_light import LightMaps
from ..light.shade import rise
from ..light.view import DOME, EYE, GROUND, LENS, SKY, new_view, set_view
from ..tiles.mesh import Mesh, from_behind, normals_at, visible
from ..tiles.sort import usual_chunks
from .skin import BLEED, blurred, shine, sky_shine
from .stage import CELLS, Stage
from .woven import answered

__all__ = ["paint"]

LARGEST = 16384
"""Pixels along a side of a picture."""
LIFT = 1.5
"""Texels of the sky's maps that a vertex is lifted off the skin it belongs to."""
SPREAD = 6
"""Rounds by which a vertex's sky is evened out with its neighbours': there are few directions."""


@dataclass(frozen=True)
class Kinds:
    """What there is to shade: a compile-time switch. shadowed: lights cast shadows; skin, woven: of a mesh."""

    shadowed: bool
    skin: bool
    woven: bool


def paint(
    camera: Camera,
    *,
    background: Background | None = None,
    lighting: Lighting | None = None,
    mesh: Mesh | None = None,
    stage: Stage | None = None,
    maps: LightMaps | None = None,
    chunks: int | None = None,
    samples: int = 1,
) -> Backdrop | None:
    """The backdrop for `Splatter.render`; None when there is neither a mesh nor a stage.

    maps: what particles and mesh leave of the lights and of the sky, from `splatter.cast_light`; without them nothing
    casts a shadow on the mesh, and the floor's is a coarse one. The sky is looked up at its vertices.
    samples: of a mesh's colour along each side of a pixel, for smooth outlines.
    """
    if mesh is None and stage is None:
        return None
    lighting, background = lighting or Lighting(), background or Background()
    chunks = usual_chunks() if chunks is None else chunks
    depth = face = edges = None
    colour = zeros((camera.height, padded(camera.width), 3))
    if mesh is not None:
        depth, face, edges = visible(mesh, camera, chunks=chunks)
    if mesh is not None and samples > 1 and samples * max(camera.width, camera.height) <= LARGEST:
        options = {"background": background, "lighting": lighting, "mesh": mesh, "stage": stage, "maps": maps}
        fine = paint(camera.on_canvas(samples), chunks=chunks, **options)
        assert fine is not None
        if isinstance(colour, DeviceArray):
            _mean(samples, camera.width, fine.colour, colour)
        else:
            parts = fine.colour[:, : samples * camera.width].reshape(camera.height, samples, camera.width, samples, 3)
            colour[:, : camera.width] = parts.mean(axis=(1, 3))
        return Backdrop(colour, tiled(fetched(depth)), fetched(face), edges)
    view = new_view()
    set_view(view, camera, lighting)
    place, darkening = np.zeros((2, 3), np.float32), np.ones((1, 1, 3), np.float32)
    if stage is not None:
        place[0], place[1] = (stage.ground, *stage.centre), 1 / stage.cell
        darkening = stage.darkening(camera, lighting, None if maps is None else maps.lights[0])
    _floor(stage is not None, view, place, darkening, background.ends(), colour)
    if mesh is None or depth is None or face is None:
        return Backdrop(colour)
    lamps = [(lamp.towards(camera), np.multiply(lamp.intensity, lamp.colour)) for lamp in lighting.lights]
    lamps = np.array(lamps, np.float32) * np.array([[1.0], [2.0**lighting.exposure]], np.float32)
    lights = () if maps is None else maps.lights
    behind = from_behind(mesh, camera)
    passing = np.ones((1, 1, 1), np.float32)
    skin, woven = np.asarray(mesh.skin), np.asarray(mesh.woven)
    faces = np.column_stack([mesh.faces, behind]).astype(np.int32)
    if any(lights) and isinstance(depth, DeviceArray):
        passing = filled((len(lamps), *face.shape), 1.0)
        points, normals = zeros((face.size, 3)), zeros((face.size, 3))
        _surface(view, faces, mesh.normals, edges, face, depth, points, normals)
        for j, one in enumerate(lights):
            if one is not None:
                one.shadows_of(points, normals, passing[j].reshape(-1))
    elif any(lights):
        row, column = np.nonzero(face >= 0)
        at = unproject(camera, row, column, depth[row, column])
        normal = normals_at(mesh, face, edges, behind, row, column)
        passing = np.ones((len(lamps), *face.shape), np.float32)
        for j, one in enumerate(lights):
            if one is not None:
                passing[j, row, column] = one.shadow_on(at, normal)
    open_sky = np.ones((len(mesh.vertices), 2), np.float32)  # of the side that the normals point to, of the other
    if maps is not None and maps.sky is not None:
        for side, normals in enumerate((np.asarray(mesh.normals), -np.asarray(mesh.normals))):
            seen = maps.sky.seen_from(mesh.vertices + LIFT * maps.sky.texel * normals, normals)
            open_sky[:, side] = spread(seen, mesh.faces, SPREAD)
    surface = np.column_stack([mesh.colour, skin, woven]).astype(np.float32)
    _shade(
        Kinds(any(lights), bool(skin.any()), bool(woven.any())), view, lamps, faces, surface, mesh.normals, open_sky,
        edges, face, passing, colour,
    )  # fmt: skip
    return Backdrop(colour, tiled(fetched(depth)), fetched(face), edges)


def spread(values: NDArray, faces: NDArray, rounds: int) -> NDArray[np.float32]:
    """Values at vertices (n,), each the mean of its own and its neighbours' mean, so many times over."""
    out, size = np.asarray(values, np.float64), len(values)
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    one, two = np.concatenate([pairs, pairs[:, ::-1]]).T
    count = np.maximum(np.bincount(one, minlength=size), 1)
    for _ in range(rounds):
        out = (out + np.bincount(one, out[two], size) / count) / 2
    return out.astype(np.float32)


def unproject(camera: Camera, row: NDArray, column: NDArray, depth: NDArray) -> NDArray[np.float32]:
    """World points (n, 3) [m] of pixels (n,) at a depth (n,) [m]."""
    ray = np.stack([(column + 0.5 - camera.cx) / camera.focal, (row + 0.5 - camera.cy) / camera.focal], -1)
    at = np.concatenate([ray, np.ones((len(row), 1))], 1) * depth[:, None]
    return ((at - camera.translation) @ camera.rotation).astype(np.float32)


@ti.kernel
def _floor(on: Template, view: F32x2, place: F32x2, darkening: F32x3, background: F32x1, colour_out: F32x3):
    """The gradient, and where a pixel looks down on the floor, the floor's shadows.

    place: height of the floor, x and z of its middle [m]; cells per metre. darkening: `Stage.darkening`.
    """
    height = colour_out.shape[0]
    width = colour_out.shape[1]
    for i in range(height * width):
        y = i // width
        x = i % width
        down = (y + 0.5) / height
        shade = ti.Vector([1.0, 1.0, 1.0])
        if ti.static(on):
            u = (x + 0.5 - view[LENS, 1]) / view[LENS, 0]
            v = (y + 0.5 - view[LENS, 2]) / view[LENS, 0]
            ray_y = u * view[0, 1] + v * view[1, 1] + view[2, 1]
            above = view[EYE, 1] - place[0, 0]
            if ray_y < 0.0 and above > 0.0:
                far = -above / ray_y
                p = view[EYE, 0] + far * (u * view[0, 0] + v * view[1, 0] + view[2, 0]) - place[0, 1]
                q = view[EYE, 2] + far * (u * view[0, 2] + v * view[1, 2] + view[2, 2]) - place[0, 2]
                column = p * place[1, 0] + 0.5 * CELLS - 0.5
                row = q * place[1, 0] + 0.5 * CELLS - 0.5
                if 0.0 <= column < CELLS - 1.0 and 0.0 <= row < CELLS - 1.0:
                    left = ti.cast(column, ti.i32)
                    top = ti.cast(row, ti.i32)
                    f = column - left
                    g = row - top
                    for k in ti.static(range(3)):
                        one = darkening[top, left, k] * (1 - f) + darkening[top, left + 1, k] * f
                        two = darkening[top + 1, left, k] * (1 - f) + darkening[top + 1, left + 1, k] * f
                        shade[k] = one + g * (two - one)
        for k in ti.static(range(3)):
            colour_out[y, x, k] = (background[k] + (background[k + 3] - background[k]) * down) * shade[k]


@ti.func
def weights(edges: F32x2, f, x, y):
    """b0, b1, b2 of triangle f at the pixel with its middle at (x, y)."""
    b = ti.Vector([edges[f, 3 * k] * x + edges[f, 3 * k + 1] * y + edges[f, 3 * k + 2] for k in ti.static(range(3))])
    return b / ti.max(b.sum(), 1e-30)


@ti.func
def smooth_normal(faces: I32x2, normals: F32x2, f, b):
    """The vertices' normals blended, unit."""
    n = ti.Vector([0.0, 0.0, 0.0])
    for i in ti.static(range(3)):
        for k in ti.static(range(3)):
            n[k] += b[i] * normals[faces[f, i], k]
    return n / ti.max(n.norm(), 1e-12)


@ti.kernel
def _surface(
    view: F32x2, faces: I32x2, normals: F32x2, edges: F32x2, face: I32x2, depth: F32x2, points_out: F32x2,
    normals_out: F32x2,
):  # fmt: skip
    """The place [m] and the unit normal of what each pixel sees of a mesh, pixel after pixel."""
    width = face.shape[1]
    for i in range(face.shape[0] * width):
        y, x = i // width, i % width
        f = face[y, x]
        if f >= 0:
            n = smooth_normal(faces, normals, f, weights(edges, f, x + 0.5, y + 0.5))
            n *= 1.0 - 2.0 * faces[f, 3]  # pyright: ignore[reportIndexIssue]
            u, v = (x + 0.5 - view[LENS, 1]) / view[LENS, 0], (y + 0.5 - view[LENS, 2]) / view[LENS, 0]
            z = depth[y, x]
            for k in ti.static(range(3)):
                ray = u * view[0, k] + v * view[1, k] + view[2, k]
                points_out[i, k] = view[EYE, k] + z * ray
                normals_out[i, k] = n[k]


@ti.kernel
def _mean(samples: Int, width: Int, fine: F32x3, colour_out: F32x3):
    """Of samples × samples pixels each."""
    for i in range(colour_out.shape[0] * width):
        y, x = i // width, i % width
        for c in ti.static(range(3)):
            total = 0.0
            for j in range(samples * samples):
                total += fine[y * samples + j // samples, x * samples + j % samples, c]
            colour_out[y, x, c] = total / (samples * samples)


@ti.func
def fill(view: F32x2, up):
    """What comes from all round on a surface whose normal has the height `up`."""
    ground = ti.Vector([view[GROUND, k] for k in ti.static(range(3))])
    sky = ti.Vector([view[SKY, k] for k in ti.static(range(3))])
    dome = ti.Vector([view[DOME, k] for k in ti.static(range(3))])
    return ground + (sky - ground) * (0.5 + 0.5 * up) + dome * rise(up)


@ti.func
def to_eye(view: F32x2, x, y):
    """Unit direction, world, from what is seen at a place of the image [px] to the camera."""
    u, v = (x - view[LENS, 1]) / view[LENS, 0], (y - view[LENS, 2]) / view[LENS, 0]
    return -ti.Vector([u * view[0, k] + v * view[1, k] + view[2, k] for k in ti.static(range(3))]).normalized()


@ti.kernel
def _shade(
    kinds: Template,
    view: F32x2,
    lamps: F32x3,  # direction towards each, then its radiance
    # mesh:
    faces: I32x2,  # their corners, then whether they are seen from behind
    surface: F32x2,  # albedo, then how far it is skin, and cloth
    normals: F32x2,
    open_sky: F32x2,
    edges: F32x2,
    # pixels:
    face: I32x2,
    passing: F32x3,
    # out:
    colour_out: F32x3,
):
    """The mesh's own pixels over the backdrop: fill by its normal, then each lamp."""
    width = colour_out.shape[1]
    keep(colour_out, (0, 0, 0), width)
    for i in range(colour_out.shape[0] * width):
        y = i // width
        x = i % width
        f = face[y, x]
        if f >= 0:
            b = weights(edges, f, x + 0.5, y + 0.5)
            n = smooth_normal(faces, normals, f, b)
            side = faces[f, 3]  # pyright: ignore[reportIndexIssue]
            n *= 1.0 - 2.0 * side
            seen, soft, woven = 0.0, 0.0, 0.0
            own = ti.Vector([0.0, 0.0, 0.0])
            for j in ti.static(range(3)):
                corner = faces[f, j]  # pyright: ignore[reportIndexIssue]
                seen += b[j] * open_sky[corner, side]  # pyright: ignore[reportIndexIssue]
                soft += b[j] * surface[corner, 3]  # pyright: ignore[reportIndexIssue]
                woven += b[j] * surface[corner, 4]  # pyright: ignore[reportIndexIssue]
                for k in ti.static(range(3)):
                    own[k] += b[j] * surface[corner, k]  # pyright: ignore[reportIndexIssue]
            lit = fill(view, n[1]) * seen
            gloss = ti.Vector([0.0, 0.0, 0.0])
            eye = ti.Vector([0.0, 0.0, 0.0])
            if ti.static(kinds.skin or kinds.woven):
                eye = to_eye(view, x + 0.5, y + 0.5)
            if ti.static(kinds.woven):
                for k in ti.static(range(3)):
                    lit[k] *= 1.0 + woven * (under_sky(own[k], n.dot(eye)) - 1.0)
            if ti.static(kinds.skin):
                mirrored = 2.0 * n.dot(eye) * n[1] - eye[1]
                back = soft * sky_shine(n, eye)
                gloss = back * seen * fill(view, mirrored)
                lit *= 1.0 - back
            for j in range(lamps.shape[0]):
                towards = ti.Vector([lamps[j, 0, k] for k in ti.static(range(3))])
                cosine, passed, shining = n.dot(towards), 1.0, 0.0
                if ti.static(kinds.shadowed):
                    passed = passing[j, y, x]
                if ti.static(kinds.woven):
                    passed *= 1.0 + woven * (answered(cosine, n.dot(eye)) - 1.0)
                if ti.static(kinds.skin):
                    shining = soft * shine(n, towards, eye)
                for k in ti.static(range(3)):
                    share = ti.max(cosine, 0.0)
                    if ti.static(kinds.skin):
                        share = blurred(cosine, soft * ti.static(BLEED[k]))
                    lit[k] += passed * share * lamps[j, 1, k]
                    gloss[k] += passed * shining * lamps[j, 1, k]
            for k in ti.static(range(3)):
                colour_out[y, x, k] = own[k] * lit[k] + gloss[k]
