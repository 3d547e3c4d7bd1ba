"""A small scene with all that is drawn: fibres, a mesh, a floor, two lights with shadows, the sky.

python tests/device_picture.py FILE.npy saves its picture as a CPU draws it.
"""

import sys

import numpy as np
import trimesh

from taichi_cloth.ground import runtime
from taichi_cloth.render.data.camera import look_at
from taichi_cloth.render.data.finish import Finish
from taichi_cloth.render.data.light import KeyLight, Lighting
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.render.stage.paint import paint
from taichi_cloth.render.tiles.mesh import Mesh

SIZE = 96


def picture() -> np.ndarray:
    """(96, 96, 3) uint8. Taichi is running."""
    s, row = np.meshgrid(np.linspace(-0.1, 0.1, 81), np.linspace(-0.1, 0.1, 41))
    height = 0.03 * np.cos(30 * s) + 0.06
    at = np.stack([s, height, row], -1).reshape(-1, 3)
    slope = (-0.9 * np.sin(30 * s)).ravel()
    along = np.stack([np.ones_like(slope), slope, 0 * slope], -1) / np.hypot(1, slope)[:, None]
    normal = np.stack([-along[:, 1], along[:, 0], 0 * slope], -1)
    colour = np.array([[0.7, 0.2, 0.2], [0.2, 0.3, 0.7]])[np.arange(at.size // 3) // 81 % 2]
    cloth = Particles(at, 0.0018, colour, along, normal, half_length=0.003)
    ball = trimesh.creation.icosphere(2, radius=0.035)
    mesh = Mesh(ball.vertices + np.array([0, 0.02, 0.13]), ball.faces, (0.6, 0.6, 0.5))
    light = Lighting(
        direction=(0.4, 0.8, 0.3), key_follows_camera=False, shadows=True, occlusion=True,
        others=(KeyLight(direction=(-0.4, 0.3, 0.8), casts_shadow=True, follows_camera=False),),
    )  # fmt: skip
    camera = look_at((0.1, 0.25, 0.4), (0, 0.04, 0), width=SIZE, height=SIZE, fov=40)
    splatter = Splatter(SIZE, SIZE).load(cloth, mesh=mesh)
    backdrop = paint(camera, mesh=mesh, lighting=light, maps=splatter.cast_light(camera, light))
    return splatter.render(camera, lighting=light, finish=Finish(model="marschner"), backdrop=backdrop)


if __name__ == "__main__":
    runtime.start("cpu")
    np.save(sys.argv[1], picture())
