"""Meshes and particles take light from one another, from the key light and from the sky."""

import numpy as np
import trimesh

from taichi_cloth.ground.copies import fetched
from taichi_cloth.render.data.camera import look_at
from taichi_cloth.render.data.light import Lighting
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.light.particle_light import LightMaps
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.render.stage.paint import LIFT, paint
from taichi_cloth.render.tiles.mesh import Mesh

RADIUS = 0.05
ABOVE = Lighting(direction=(0, 1, 0), key_follows_camera=False, size=0.0, shadows=True, occlusion=True)
VIEW = look_at((0, 0.2, 0.5), (0, 0, 0), width=96, height=96, fov=30)


def ball() -> Mesh:
    sphere = trimesh.creation.icosphere(4, radius=RADIUS)
    return Mesh(sphere.vertices, sphere.faces, (0.6, 0.6, 0.6), np.asarray(sphere.vertices) / RADIUS)


def patch(height: float, half: float, step: float = 0.002) -> Particles:
    x = np.arange(-half, half + step / 2, step)
    grid = np.stack(np.meshgrid(x, [height], x, indexing="ij"), -1).reshape(-1, 3)
    return Particles(grid, step, (0.5, 0.5, 0.5), (1, 0, 0), (0, 1, 0), opacity=1.0)


def maps_of(particles: Particles, mesh: Mesh | None) -> tuple[Splatter, LightMaps]:
    splatter = Splatter(96, 96).load(particles, mesh)
    return splatter, splatter.cast_light(VIEW, ABOVE)


def test_patch_shadows_the_ball_beneath() -> None:
    mesh = ball()
    splatter, maps = maps_of(patch(0.08, 0.02), mesh)
    key = maps.lights[0]
    assert key is not None
    x = np.linspace(-0.045, 0.045, 91)
    normal = np.stack([x / RADIUS, np.sqrt(1 - (x / RADIUS) ** 2), 0 * x], 1)
    light = key.shadow_on(normal * RADIUS, normal)
    assert light[np.abs(x) < 0.016].max() < 0.05  # edges are three texels of 3.3 mm wide
    assert light[(np.abs(x) > 0.0265) & (np.abs(x) < 0.04)].min() > 0.95  # and it does not shadow itself
    assert key.shadow_at([[0, -0.06, 0], [0.04, -0.06, 0], [0.06, -0.06, 0]]).round(2).tolist() == [0, 0, 1]
    assert maps.sky is not None
    top, bottom = maps.sky.seen_from([[0, RADIUS, 0], [0, -RADIUS, 0]], [[0, 1, 0], [0, -1, 0]])
    assert top < 0.7
    assert bottom > 0.97
    dark, bare = paint(VIEW, mesh=mesh, lighting=ABOVE, maps=maps), paint(VIEW, mesh=mesh, lighting=ABOVE)
    assert dark is not None
    assert bare is not None
    column, row, _ = VIEW.project([[0, RADIUS, 0]])[0].astype(int)
    one, other = fetched(dark.colour), fetched(bare.colour)
    assert one[row + 1, column].max() < 0.5 * other[row + 1, column].min()
    splatter.render(VIEW, lighting=ABOVE, backdrop=dark)
    assert splatter.light.lookups == 2


def test_ball_does_not_stand_before_its_own_sky() -> None:
    """Seen from anywhere on a ball the sky is whole, and from within it is not there, whatever hangs in chains of long
    particles beside it."""
    mesh, count = ball(), 4096
    along = np.linspace(-0.1, 0.1, count)
    line = np.stack([along, np.full(count, -0.3), np.zeros(count)], 1)
    chain = Particles(line, 2e-4, (0.5, 0.5, 0.5), (1, 0, 0), (0, 1, 0), opacity=1.0, half_length=1e-4)
    for particles in (patch(-0.3, 0.01), chain):
        _, maps = maps_of(particles, mesh)
        assert maps.sky is not None
        normals = np.asarray(mesh.normals)
        out, into = (maps.sky.seen_from(mesh.vertices + LIFT * maps.sky.texel * n, n) for n in (normals, -normals))
        assert out.min() > 0.9
        assert out.mean() > 0.99
        assert into.max() < 0.1


def test_ball_shadows_the_patch_beneath() -> None:
    """Under a ball at twice its radius a level place loses (R / h)^2 = 1/4 of the sky; all of the light above."""
    below = patch(-2 * RADIUS, 0.09)
    splatter, maps = maps_of(below, ball())
    splatter.render(VIEW, lighting=ABOVE)
    light = splatter.light._light
    assert light is not None
    light = fetched(light)
    key, sky = (light[:, k].reshape(-1)[: len(below)] for k in (0, 1))
    away = np.hypot(below.position[:, 0], below.position[:, 2])
    assert key[away < 0.9 * RADIUS].max() < 0.05
    assert key[(away > 1.1 * RADIUS) & (away < 0.08)].min() > 0.9
    # Ten directions see a ball of 60 degrees coarsely: one more or less of those nearly above is a tenth.
    assert abs(sky[away < 0.01].mean() - 0.75) < 0.1
    _, without = maps_of(below, None)
    assert without.sky is not None
    middle = below.position[away < 0.01]
    assert without.sky.seen_from(middle, np.tile([0, 1, 0], (len(middle), 1))).mean() > 0.95
    assert maps.nbytes > without.nbytes > 0
