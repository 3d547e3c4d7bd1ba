"""Figures 10 and 11: a body with each part in its colour, and the primitives that stand for it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from taichi_cloth.body.primitives.primitives import Primitive

from ...render.data.camera import box_corners, frame
from ...render.data.light import Background, KeyLight, Lighting
from ...render.data.particles import Particles
from ...render.image.caption import caption, legend
from ...render.image.image import srgb_to_linear, write_png
from ...render.splat.splat import Splatter
from ...render.stage.paint import paint
from ...render.stage.stage import stage_under
from ...render.tiles.mesh import Mesh, join

__all__ = ["HUES", "KIND_COLOURS", "Shown", "draw_panels", "part_mesh", "primitive_meshes"]

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

EVENED = 8
"""Rounds of evening out the shares of parts before their edges are drawn."""
VEIL = 0.42
"""How much of a veil is seen."""

NOTHING = Particles(np.zeros((0, 3)), np.zeros(0), *np.zeros((3, 0, 3)))


@dataclass(frozen=True, eq=False)
class Shown:
    """A panel: what is drawn, from which azimuth [degrees], the words under it. veil: drawn half through over it."""

    mesh: Mesh
    azimuth: float
    words: str = ""
    veil: Mesh | None = None


def part_mesh(vertices: F64, faces: NDArray, normals: F64, labels: NDArray, *, levels: int = 3) -> Mesh:
    """A skin with each part in its hue. Labels are of faces, (f,); where parts meet the edge is drawn smoothly.

    Each vertex gets the shares of the parts round it, evened out over its neighbours; faces in which shares disagree
    are split in four, `levels` times, and take the part whose share is largest at their middle.
    """
    parts = int(labels.max()) + 1
    n = len(vertices)
    member = sparse.csr_matrix((np.ones(faces.size), (faces.ravel(), np.repeat(labels, 3))), shape=(n, parts))
    share = np.asarray(member.todense(), np.float64)
    share /= np.maximum(share.sum(axis=1, keepdims=True), 1)
    ends = (
        np.concatenate([faces, np.roll(faces, 1, axis=1)]).ravel(),
        np.concatenate([np.roll(faces, 1, axis=1), faces]),
    )
    beside = sparse.csr_matrix((np.ones(2 * faces.size), (ends[0], ends[1].ravel())), shape=(n, n))
    beside = sparse.diags(1 / np.maximum(np.asarray(beside.sum(axis=1)).ravel(), 1)) @ beside
    for _ in range(EVENED):
        share = (share + beside @ share) / 2
    soup = np.concatenate([vertices, normals, share], axis=1)[faces]
    whole = []
    for _ in range(levels):
        owner = soup[..., 6:].argmax(axis=2)
        mixed = (owner != owner[:, :1]).any(axis=1)
        whole.append(soup[~mixed])
        a, b, c = soup[mixed].transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        pieces = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        soup = np.concatenate([np.stack(piece, axis=1) for piece in pieces])
    soup = np.concatenate([*whole, soup])
    hues = srgb_to_linear(np.array(HUES)[soup[..., 6:].mean(axis=1).argmax(axis=1) % len(HUES)])
    flat = soup.reshape(-1, soup.shape[2])
    return Mesh(flat[:, :3], np.arange(len(flat)).reshape(-1, 3), np.repeat(hues, 3, axis=0), flat[:, 3:6])


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
    panels: Sequence[Shown],
    bounds: tuple[F64, F64],
    path: Path,
    *,
    size: tuple[int, int] = (560, 900),
    scale: int = 2,
    entries: Sequence[tuple[str, Sequence[float]]] = (),
) -> Image:
    """Draw panels side by side, framed alike, to a PNG, a strip with (name, sRGB) of `entries` below; the picture.

    bounds: lowest and highest corner of what is shown [m]. size: of one panel [px]. Taichi must have been started.
    """
    background = Background(top=(0.93, 0.935, 0.94), bottom=(0.80, 0.80, 0.795))
    rim = KeyLight(direction=(0.8, 0.5, -0.6), intensity=0.35)
    lighting = Lighting(direction=(-0.5, 1.3, 0.85), size=16.0, key=0.85, fill=0.46, others=(rim,))
    width, height = size[0] * scale, size[1] * scale
    splatter = Splatter(width, height).load(NOTHING)
    images = []
    stages = {id(mesh): stage_under(NOTHING, mesh) for mesh in {id(p.mesh): p.mesh for p in panels}.values()}
    for panel in panels:
        corners = box_corners(*bounds)
        camera = frame(corners, width=width, height=height, azimuth=panel.azimuth, elevation=9.0, fov=22.0, margin=0.02)
        layers = []
        for mesh in filter(None, (panel.mesh, panel.veil)):
            backdrop = paint(camera, mesh=mesh, stage=stages[id(panel.mesh)], lighting=lighting, background=background)
            image = splatter.render(camera, lighting=lighting, background=background, backdrop=backdrop)
            layers.append(cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32))
        image = layers[0] if len(layers) == 1 else (1 - VEIL) * layers[0] + VEIL * layers[1]
        image = image.round().astype(np.uint8)
        images.append(caption(image, panel.words) if panel.words else image)
    whole = np.concatenate(images, axis=1)
    if entries:
        whole = np.concatenate([whole, legend(whole.shape[1], entries)])
    path.parent.mkdir(parents=True, exist_ok=True)
    write_png(path, whole)
    return whole
