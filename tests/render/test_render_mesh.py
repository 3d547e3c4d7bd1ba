"""Meshes against closed forms, an independent rasteriser, and among particles."""

import numpy as np
import pytest
import trimesh

from taichi_cloth.ground.copies import fetched
from taichi_cloth.ground.errors import InputError
from taichi_cloth.render.data.backdrop import OPEN
from taichi_cloth.render.data.camera import Camera, look_at
from taichi_cloth.render.data.light import Background, Lighting
from taichi_cloth.render.data.particles import Particles
from taichi_cloth.render.splat.splat import Splatter
from taichi_cloth.render.stage import paint as paint_module
from taichi_cloth.render.stage.paint import paint, unproject
from taichi_cloth.render.tiles.mesh import Mesh, join, visible

FOCAL = 100.0


def camera(width: int = 64, height: int = 48) -> Camera:
    """At the origin, looking along z: at depth 1 m one pixel is 1 cm."""
    return Camera(np.eye(3), np.zeros(3), FOCAL, width / 2, height / 2, width, height, near=0.01)


def quad(depth: float, half: float = 10.0, colour: tuple[float, float, float] = (0.5, 0.5, 0.5)) -> Mesh:
    corners = [[-half, -half, depth], [half, -half, depth], [half, half, depth], [-half, half, depth]]
    return Mesh(corners, [[0, 1, 2], [0, 2, 3]], colour)


def drawn(mesh: Mesh, view: Camera, chunks: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Depth and triangles of `visible`."""
    depth, face, _ = visible(mesh, view, chunks=chunks)
    return fetched(depth), fetched(face)


def rays(view: Camera) -> np.ndarray:
    """(h, w, 3), of length 1 along z."""
    x, y = np.meshgrid(np.arange(view.width) + 0.5, np.arange(view.height) + 0.5)
    return np.stack([(x - view.cx) / view.focal, (y - view.cy) / view.focal, np.ones_like(x)], -1)


def test_slanted_plane_has_the_depth_of_its_rays() -> None:
    normal = np.array([0.3, -0.5, -1.0])
    across, down = np.cross(normal, [0.0, 1.0, 0.0]), np.cross(normal, np.cross(normal, [0.0, 1.0, 0.0]))
    corners = np.array([0, 0, 2.0]) + 9 * np.array([-across - down, across - down, across + down, down - across])
    depth, face = drawn(Mesh(corners, [[0, 1, 2], [0, 2, 3]], (1, 1, 1)), camera())
    expected = 2 * normal[2] / (rays(camera()) @ normal)
    seen = (expected > 0.01) & (expected < 5)  # some of it is behind the camera
    assert seen.mean() > 0.7
    np.testing.assert_allclose(depth[seen], expected[seen], rtol=2e-5)
    assert (face[seen] >= 0).all()


def test_ball_has_the_depth_and_normals_of_a_sphere() -> None:
    view = look_at((0.3, 0.2, 1.0), (0.0, 0.0, 0.0), width=160, height=120, fov=20)
    ball = trimesh.creation.icosphere(5, radius=0.12)
    mesh = Mesh(ball.vertices, ball.faces, (1, 1, 1))
    np.testing.assert_allclose(np.asarray(mesh.normals), np.asarray(ball.vertices) / 0.12, atol=5e-3)
    depth, face = drawn(mesh, view)
    ray = rays(view)
    middle, square = ray @ view.translation, (ray**2).sum(-1)
    inside = middle**2 - square * (view.translation @ view.translation - 0.12**2)
    assert ((face[:, :160] >= 0) == (inside > 0)).mean() > 0.998
    both = (face[:, :160] >= 0) & (inside > 1e-4)
    expected = (middle - np.sqrt(np.maximum(inside, 0))) / square
    assert np.abs(depth[:, :160] - expected)[both].max() < 5e-4


@pytest.mark.parametrize("chunks", [1, 2, 7])
def test_covers_what_a_point_in_triangle_test_covers(chunks: int) -> None:
    random = np.random.default_rng(3)
    at = np.concatenate([random.uniform(-0.5, 0.5, (90, 2)), random.uniform(0.8, 1.6, (90, 1))], 1)
    mesh = Mesh(at, np.arange(90).reshape(-1, 3), (1, 1, 1))
    depth, face = drawn(mesh, camera(), chunks)
    pixel = camera().project(at)
    best, oracle = np.full((48, 64), OPEN), np.full((48, 64), -1)
    y, x = np.mgrid[:48, :64] + 0.5
    for f, (a, b, c) in enumerate(pixel.reshape(-1, 3, 3)):
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        w = [((q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0])) / area for p, q in ((b, c), (c, a), (a, b))]
        z = 1 / (w[0] / a[2] + w[1] / b[2] + w[2] / c[2])
        nearer = (np.minimum.reduce(w) >= 0) & (z < best)
        best[nearer], oracle[nearer] = z[nearer], f
    assert (face[:, :64] != oracle).sum() <= 2  # pixels whose middle lies on an edge
    same = (face[:, :64] == oracle) & (oracle >= 0)
    np.testing.assert_allclose(depth[:, :64][same], best[same], rtol=1e-5)


def test_shared_edges_leave_no_gap() -> None:
    plane = trimesh.creation.icosphere(4, radius=1.0)  # seen from inside: every ray meets it
    view = look_at((0.1, 0.2, 0.05), (1.0, 0.3, 0.2), width=320, height=240, fov=70)
    _, face = drawn(Mesh(plane.vertices, plane.faces, (1, 1, 1)), view)
    assert (face[:, :320] >= 0).all()


def test_triangles_astride_the_camera_and_without_area() -> None:
    floor = Mesh([[-50, 0.5, -50], [50, 0.5, -50], [0, 0.5, 90]], [[0, 1, 2]], (1, 1, 1))
    depth, face = drawn(floor, camera())
    down = rays(camera())[..., 1]
    seen = down > 0.5 / 40
    np.testing.assert_allclose(depth[:, :64][seen], 0.5 / down[seen], rtol=1e-4)
    assert (face[:, :64][down <= 0] == -1).all()
    line = Mesh([[0, 0, 1], [1, 0, 1], [2, 0, 1], [np.nan, 0, 1]], [[0, 1, 2], [0, 0, 1], [0, 1, 3]], (1, 1, 1))
    assert (drawn(line, camera())[1] == -1).all()
    behind = quad(-1.0)
    assert (drawn(behind, camera())[1] == -1).all()


def test_facing_square_is_lit_by_lamberts_law() -> None:
    light = Lighting(direction=(0, 0, 1), key=0.6, key_colour=(1, 1, 1), fill=0.0)  # towards the viewer
    backdrop = paint(camera(), mesh=quad(1.0, colour=(0.5, 0.25, 1.0)), lighting=light)
    assert backdrop is not None
    np.testing.assert_allclose(fetched(backdrop.colour)[20, 30], [0.3, 0.15, 0.6], rtol=1e-5)


@pytest.mark.parametrize("thread", [False, True])
def test_mesh_hides_what_is_behind_and_not_what_is_in_front(thread: bool) -> None:
    place = [[-0.1, 0.0, 0.9], [0.1, 0.0, 1.1]]
    both = Particles(place, 0.05, (0, 1, 0), (1, 0, 0), (0, 0, -1), 0.05 if thread else None, opacity=1.0)
    splatter = Splatter(64, 48).load(both)
    backdrop = paint(camera(), mesh=quad(1.0, half=0.2))
    splatter.render(camera(), backdrop=backdrop)
    alpha = splatter.linear()[..., 3]
    assert alpha[24, 21] > 0.8
    assert alpha[24, 41] == 0
    image = splatter.render(camera(), backdrop=backdrop, background=Background(top=(1, 0, 0)))
    assert (image[24, 41] == image[30, 32]).all()
    assert image[24, 21, 1] > image[24, 21, 0]


def test_far_mesh_changes_no_particle() -> None:
    random = np.random.default_rng(1)
    place = np.stack([random.uniform(-0.3, 0.3, 500), random.uniform(-0.2, 0.2, 500), random.uniform(1, 2, 500)], 1)
    cloud = Particles(place, 0.02, random.random((500, 3)), (1, 0, 0), (0, 0, -1), opacity=0.6)
    splatter = Splatter(64, 48, opaque=0.0).load(cloud)
    splatter.render(camera())
    alone = splatter.linear()
    splatter.render(camera(), backdrop=paint(camera(), mesh=quad(3.0, half=50.0)))
    assert (splatter.linear() == alone).all()


def test_without_mesh_and_stage_nothing_is_painted(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object, **options: object) -> None:
        raise AssertionError("a mesh was rasterised")

    for name in ("visible", "_floor", "_shade"):
        monkeypatch.setattr(paint_module, name, refuse)
    assert paint(camera()) is None


def test_points_come_back_from_depth() -> None:
    view = look_at((0.3, 0.2, 1.0), (0.0, 0.0, 0.0), width=160, height=120, fov=20)
    row, column = np.array([3, 77]), np.array([5, 130])
    points = unproject(view, row, column, np.array([0.8, 1.4]))
    np.testing.assert_allclose(view.project(points), [[5.5, 3.5, 0.8], [130.5, 77.5, 1.4]], rtol=1e-5)


def test_bad_meshes_are_refused_and_parts_are_joined() -> None:
    with pytest.raises(InputError, match=r"mesh\.faces: 0 to 3; allowed: 0 to 2"):
        Mesh(np.zeros((3, 3)), [[0, 1, 3]], (1, 1, 1))
    with pytest.raises(InputError, match=r"allowed: \(v, 3\)"):
        Mesh(np.zeros((3, 2)), [[0, 1, 2]], (1, 1, 1))
    with pytest.raises(InputError, match=r"mesh\.colour"):
        Mesh(np.zeros((3, 3)), [[0, 1, 2]], (1, 1))
    with pytest.raises(InputError, match="no meshes"):
        join([])
    one, two = quad(1.0), Mesh(quad(2.0).vertices, quad(2.0).faces, (1, 0, 0), part=4)
    both = join([one, two])
    assert np.asarray(both.part).tolist() == [0, 0, 4, 4]
    assert both.faces.max() == 7


def test_samples_smooth_the_outline_and_leave_the_depth() -> None:
    camera = look_at((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), width=64, height=48, fov=30.0)
    corners = np.array([[-0.2, -0.3, 0], [0.31, -0.17, 0], [-0.05, 0.3, 0]], np.float32)
    mesh = Mesh(corners, [[0, 1, 2]], (0.5, 0.5, 0.5))
    light = Lighting(key=0.0, fill=1.0, sky=(1.0, 1.0, 1.0), ground=(1.0, 1.0, 1.0))
    black = Background(top=(0.0, 0.0, 0.0))
    plain, smooth = (paint(camera, mesh=mesh, lighting=light, background=black, samples=n) for n in (1, 4))
    assert plain is not None
    assert smooth is not None
    assert (plain.wall == smooth.wall).all()
    shares = fetched(smooth.colour)[..., 0] / fetched(plain.colour)[..., 0].max()
    area = 0.5 * abs(np.linalg.det(corners[1:, :2] - corners[0, :2])) * (camera.focal / 2.0) ** 2
    assert shares.sum() == pytest.approx(area, rel=5e-3)  # 16 samples a pixel of some 90 along the outline
    assert ((shares > 0.1) & (shares < 0.9)).sum() > 40
