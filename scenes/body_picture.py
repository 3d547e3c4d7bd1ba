"""Figures 10 and 11: a body with each part in its colour, and the primitives that stand for it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.primitives import Primitive

from ..render.camera import box_corners, frame
from ..render.caption import caption
from ..render.image import srgb_to_linear, write_png
from ..render.light import Background, KeyLight, Lighting
from ..render.mesh import Mesh, join
from ..render.paint import paint
from ..render.particles import Particles
from ..render.splat import Splatter
from ..render.stage import stage_under

__all__ = ["KIND_COLOURS", "draw_panels", "part_mesh", "primitive_meshes"]

F64 = NDArray[np.float64]
Image = NDArray[np.uint8]
KIND_COLOURS = {"cylinder": (0.80, 0.16, 0.15), "sphere": (0.16, 0.33, 0.80), "elliptic": (0.20, 0.62, 0.27)}
"""sRGB. Cylinders red, spheres blue, elliptic cylinders green, as in Figure 11."""
HUES = (
    (0.93, 0.77, 0.60), (0.85, 0.48, 0.38), (0.36, 0.55, 0.74), (0.92, 0.71, 0.32), (0.55, 0.45, 0.70),
    (0.44, 0.68, 0.62), (0.89, 0.55, 0.56), (0.62, 0.71, 0.42), (0.74, 0.52, 0.42), (0.52, 0.62, 0.80),
    (0.80, 0.66, 0.78), (0.47, 0.60, 0.50), (0.90, 0.82, 0.48), (0.60, 0.40, 0.45), (0.50, 0.74, 0.80),
    (0.72, 0.72, 0.66), (0.40, 0.42, 0.58),
)  # fmt: skip
"""sRGB, of parts and segments in turn; quiet, and neighbours in number unlike."""

NOTHING = Particles(np.zeros((0, 3)), np.zeros(0), *np.zeros((3, 0, 3)))


def part_mesh(vertices: F64, faces: NDArray, normals: F64, colours: NDArray) -> Mesh:
    """A mesh with one sRGB colour a face, (f, 3), shaded smoothly by its vertices' normals."""
    corners = faces.ravel()
    shown = np.repeat(srgb_to_linear(colours), 3, axis=0)
    return Mesh(vertices[corners], np.arange(len(corners)).reshape(-1, 3), shown, normals[corners])


def primitive_meshes(primitives: Sequence[Primitive]) -> Mesh:
    """The primitives' surfaces, in the colours of their kinds."""
    return join([_primitive_mesh(p) for p in primitives])


def _primitive_mesh(p: Primitive, sides: int = 48, rings: int = 12) -> Mesh:
    """A closed surface as stacked rings round the axis; normals by the mesh itself."""
    axis = p.end - p.start
    length = float(np.linalg.norm(axis))
    axis = axis / length if length > 0 else np.array([0.0, 1.0, 0.0])
    if p.across is not None:
        across = p.across
    else:
        across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        across /= np.linalg.norm(across)
    other = np.cross(axis, across)
    turn = np.linspace(0, np.pi / 2, rings)
    if p.kind == "elliptic":
        r = p.rounding
        out = np.concatenate([[-min(p.radii) + r], r * np.sin(turn)])  # beyond the inner ellipse
        up = np.concatenate([[0.0], r * (1 - np.cos(turn))])
        profile = [(u, o) for u, o in zip(up, out, strict=True)]
        profile += [(length - u, o) for u, o in zip(up[::-1], out[::-1], strict=True)]
        circle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
        a, b = p.radii[0] - r, p.radii[1] - r
        inner = np.stack([a * np.cos(circle), b * np.sin(circle)], axis=-1)
        normal = np.stack([np.cos(circle) / a, np.sin(circle) / b], axis=-1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        flat = [(h, inner + o * normal if o >= 0 else inner * 1e-6) for h, o in profile]
    else:
        r0, r1 = p.radii if p.kind == "cylinder" else (p.radii[0], p.radii[0])
        lean = np.arcsin(np.clip((r0 - r1) / length, -1, 1)) if length > 0 else 0.0
        low, high = np.linspace(-np.pi / 2, lean, rings), np.linspace(lean, np.pi / 2, rings)
        profile = [(r0 * np.sin(t), r0 * np.cos(t)) for t in low] + [
            (length + r1 * np.sin(t), r1 * np.cos(t)) for t in high
        ]
        circle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
        round_ = np.stack([np.cos(circle), np.sin(circle)], axis=-1)
        flat = [(h, max(o, 1e-9) * round_) for h, o in profile]
    points = np.concatenate([p.start + h * axis + ring[:, :1] * across + ring[:, 1:] * other for h, ring in flat])
    i = np.arange(sides)
    j = (i + 1) % sides
    quads = [
        np.concatenate([np.stack([k + i, k + j, k + sides + j], 1), np.stack([k + i, k + sides + j, k + sides + i], 1)])
        for k in sides * np.arange(len(flat) - 1)
    ]
    return Mesh(points, np.concatenate(quads), srgb_to_linear(KIND_COLOURS[p.kind]))


def draw_panels(
    panels: Sequence[tuple[Mesh, float, str]],
    bounds: tuple[F64, F64],
    path: Path,
    *,
    size: tuple[int, int] = (560, 900),
    scale: int = 2,
) -> Image:
    """Draw meshes side by side, each (mesh, azimuth [degrees], caption), framed alike, to a PNG; returns the picture.

    bounds: lowest and highest corner of what is shown [m]. size: of one panel [px]. Taichi must have been started.
    """
    background = Background(top=(0.93, 0.935, 0.94), bottom=(0.80, 0.80, 0.795))
    rim = KeyLight(direction=(0.8, 0.5, -0.6), intensity=0.35)
    lighting = Lighting(key=0.75, fill=0.42, others=(rim,))
    width, height = size[0] * scale, size[1] * scale
    splatter = Splatter(width, height).load(NOTHING)
    images = []
    for mesh, azimuth, words in panels:
        corners = box_corners(*bounds)
        camera = frame(corners, width=width, height=height, azimuth=azimuth, elevation=6.0, fov=22.0, margin=0.03)
        stage = stage_under(NOTHING, mesh)
        backdrop = paint(camera, mesh=mesh, stage=stage, lighting=lighting, background=background)
        image = splatter.render(camera, lighting=lighting, background=background, backdrop=backdrop)
        image = image.reshape(size[1], scale, size[0], scale, 3).mean(axis=(1, 3)).round().astype(np.uint8)
        images.append(caption(image, words) if words else image)
    whole = np.concatenate(images, axis=1)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_png(path, whole)
    return whole
