"""Layout, templates and particles of a fabric: counted right, without a seam, and rigid under rigid motion."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.frames import frames
from taichi_cloth.fabric.layout import BODY, END, START, Detail, Threads, lay_out, required_bytes
from taichi_cloth.fabric.pose import pose_points
from taichi_cloth.fabric.templates import build_templates, particle_count
from taichi_cloth.ground.errors import InputError
from taichi_cloth.weave.crimp import Interlacing, centreline
from taichi_cloth.weave.draft import known_weaves, named_weave
from taichi_cloth.weave.interpenetration import deepest_interpenetration
from taichi_cloth.yarn.thick_fibres import covered
from taichi_cloth.yarn.yarn import Hairiness, Yarn

FLATTENING = 2.0


def woven(
    weave: str = "twill-2/2", *, ends: int = 12, picks: int = 10, yarn: Yarn | None = None, opening=1.05, **detail
):
    """A fabric of one yarn, spaced a little wider than closest."""
    yarn = yarn or Yarn(count_tex=20, plies=2, twist_per_m=700, singles_twist_per_m=250)
    root = FLATTENING**0.5
    thick, flat = yarn.woven_diameter / root, yarn.woven_diameter * (root - 1 / root)
    pitch = opening * (3**0.5 * thick + flat)
    cloth = Interlacing(
        warp_up=named_weave(weave, ends=ends, picks=picks).warp_up,
        warp_spacing_m=np.full(ends, pitch),
        weft_spacing_m=np.full(picks, pitch),
        warp_diameter_m=np.full(ends, thick),
        weft_diameter_m=np.full(picks, thick),
        warp_flat_m=np.full(ends, flat),
        weft_flat_m=np.full(picks, flat),
        periodic=False,
    )
    families = [
        Threads(
            pitch * np.arange(n),
            np.full(n, thick),
            np.full(n, thick + flat),
            np.full((n, 3), shade, np.float32),
            yarn,
        )
        for n, shade in ((ends, 0.2), (picks, 0.8))
    ]
    settings = {"fibres": 5, "steps": 8, "variants": 3, "irregularity": 0.0, "seed": 4, **detail}
    return lay_out(cloth, *families, detail=Detail(**settings))


def test_every_yarn_has_its_blocks():
    layout = woven(ends=7, picks=5)
    section = layout.kinds.section[layout.blocks.kind]
    family = layout.kinds.family[layout.blocks.kind]
    assert layout.key_points == 35
    assert np.sum((family == 0) & (section == BODY)) == 7 * 4
    assert np.sum((family == 1) & (section == BODY)) == 5 * 6
    for end in (START, END):
        assert np.sum(section == end) == 12
    assert layout.blocks.thread.max() == 11


def test_a_plain_weave_has_two_shapes_of_path_a_family():
    layout = woven("plain", ends=8, picks=8, fringe=0.0)
    assert np.bincount(layout.kinds.family).tolist() == [2, 2]


@pytest.mark.parametrize("hairy", [False, True])
def test_the_count_is_exact(hairy: bool):
    hairiness = Hairiness(ends_per_m=900, loops_per_m=700) if hairy else Hairiness()
    layout = woven(yarn=Yarn(count_tex=20, hairiness=hairiness))
    fabric = build_fabric(layout)
    assert particle_count(layout) == fabric.particles == len(fabric.cloud(pose_points(layout)))


def test_thrown_silk_covers_its_width_without_gaps_between_plies():
    """Three singles of 20/22 den, folded a hundred times a metre: as many fibres as of a yarn that is folded tightly,
    and all along they hide its width, of which that of a cord of three leaves gaps."""
    silk = Yarn(count_tex=2.33, plies=3, twist_per_m=108, fineness_dtex=1.2, fibre_density=1340)
    layout = woven("plain", ends=4, picks=4, yarn=silk, fibres=19, fringe=0.0)
    fabric = build_fabric(layout)
    assert particle_count(layout) == fabric.particles
    bank = fabric.bank
    first = slice(bank.start[0], bank.start[1])
    rows = (3 * 19, layout.detail.steps)
    across = bank.offset[first, 1].astype(np.float64).reshape(rows)
    hidden = covered(across, bank.radius[first].astype(np.float64).reshape(rows)[:, 0])
    assert hidden > 0.9 * layout.kinds.width[0]


def test_only_templates_in_use_are_made_and_they_are_shared():
    layout = woven("plain", ends=60, picks=60, variants=2)
    bank = build_templates(layout)
    templates = len(bank.start) - 1
    assert templates == len(np.unique(bank.template))
    assert templates < len(layout.blocks.kind) / 2


def test_fibres_run_on_from_block_to_block():
    """Across every block boundary a fibre's distance from one particle to the next is what it is inside."""
    layout = woven(variants=3, fringe=0.0, steps=12)
    fabric = build_fabric(layout)
    cloud = fabric.cloud(pose_points(layout))
    fibres = 2 * layout.detail.fibres
    rows = cloud.position.reshape(-1, fibres, layout.detail.steps, 3)  # no hairs: all blocks alike
    thread = layout.blocks.thread
    inside = np.linalg.norm(np.diff(rows, axis=2), axis=-1)
    follows = np.flatnonzero((thread[1:] == thread[:-1]) & (layout.blocks.key1[:-1] == layout.blocks.key0[1:]))
    assert len(follows) == 12 * 8 + 10 * 10
    across = np.linalg.norm(rows[follows + 1, :, 0] - rows[follows, :, -1], axis=-1)
    assert across.max() < 1.15 * inside.max()
    tangents = cloud.tangent.reshape(rows.shape)
    turn_inside = np.sum(tangents[:, :, 1:] * tangents[:, :, :-1], -1).min()
    turn_across = np.sum(tangents[follows + 1, :, 0] * tangents[follows, :, -1], -1).min()
    assert turn_across > turn_inside - 0.05


def test_rigid_motion_moves_all_particles_rigidly():
    layout = woven()
    fabric = build_fabric(layout)
    points = pose_points(layout, "wave").astype(np.float64)
    axis, angle = np.array([1.0, 2.0, -1.5]) / np.sqrt(7.25), 0.8
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
    moved = fabric.cloud((points @ turn.T + [0.01, -0.02, 0.03]).astype(np.float32))
    still = fabric.cloud(points.astype(np.float32))
    np.testing.assert_allclose(moved.position, still.position @ turn.T + [0.01, -0.02, 0.03], atol=3e-8)
    np.testing.assert_allclose(moved.tangent, still.tangent @ turn.T, atol=2e-4)
    np.testing.assert_allclose(moved.normal, still.normal @ turn.T, atol=2e-4)


def test_the_upper_yarn_is_on_top():
    layout = woven("twill-3/1", fringe=0.0, steps=9)
    cloud = build_fabric(layout).cloud(pose_points(layout))
    body = cloud.position.reshape(-1, 2 * layout.detail.fibres, layout.detail.steps, 3)
    up = layout.cloth.warp_up.ravel()
    family = layout.kinds.family[layout.blocks.kind]
    for which in (0, 1):
        blocks = np.flatnonzero(family == which)
        height = body[blocks][:, :, 0, 1].mean(axis=1)  # at the crossing where the block begins
        warp_on_top = up[layout.blocks.key0[blocks]]
        on_top = warp_on_top if which == 0 else ~warp_on_top
        assert height[on_top].min() > 0 > height[~on_top].max()


def test_fibres_stay_inside_their_thread():
    yarn = Yarn(count_tex=20, plies=1, twist_per_m=500)
    layout = woven("plain", yarn=yarn, fringe=0.0, variants=1)
    bank = build_templates(layout)
    thickness, width = layout.warp.thickness[0], layout.warp.width[0]
    top = layout.cloth.balance * (thickness + thickness) / 2 + thickness / 2
    slack = 0.12 * width  # the bend that tells variants apart, and the fibre's own radius
    assert np.abs(bank.offset[:, 1]).max() < width / 2 + slack
    assert np.abs(bank.offset[:, 2]).max() < top + slack


def test_covered_width_by_hand():
    """Fibres of radius 1 at two places: side by side with a gap, half over each other; one hidden by a wider one."""
    across = np.array([[-3.0, -0.5], [1.0, 0.5]])
    assert covered(across, np.ones(2)) == pytest.approx((4 + 3) / 2)
    assert covered(np.array([[0.5], [0.0]]), np.array([1.0, 3.0])) == pytest.approx(6)


@pytest.mark.parametrize(("plies", "fibres", "least"), [(1, 6, 0.96), (1, 12, 0.96), (2, 4, 0.88)])
def test_few_drawn_fibres_hide_what_their_thread_hides(plies: int, fibres: int, least: float):
    yarn = Yarn(count_tex=300, plies=plies, twist_per_m=180)
    layout = woven(yarn=yarn, fibres=fibres, fringe=0.0, variants=1, steps=4)
    bank = build_templates(layout)
    of_template = (len(np.diff(bank.start)), plies * fibres, 4)  # every one has as many particles: none has hairs
    across, radius = bank.offset[:, 1].reshape(of_template), bank.radius.reshape(of_template)
    width = np.mean([covered(a.astype(float), r[:, 0].astype(float)) for a, r in zip(across, radius, strict=True)])
    assert least * layout.warp.width[0] < width < 1.02 * layout.warp.width[0]
    assert (np.abs(across) + radius).max() < 0.75 * layout.warp.pitch  # nor does it reach the thread after the next


def test_same_seed_same_bytes_other_seed_other_fibres():
    a, b, c = (build_fabric(woven(seed=s)).cloud(pose_points(woven(seed=s))) for s in (4, 4, 5))
    assert a.position.tobytes() == b.position.tobytes()
    assert a.position.tobytes() != c.position.tobytes()


@pytest.mark.parametrize("pose", ["flat", "wave", "roll"])
def test_poses_keep_lengths_along_the_yarns(pose):
    layout = woven(ends=60, picks=8)
    points = pose_points(layout, pose, amount=1.0).astype(np.float64)
    across = np.linalg.norm(np.diff(points, axis=1), axis=-1)
    along = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    np.testing.assert_allclose(across, layout.warp.pitch, rtol=5e-3)
    np.testing.assert_allclose(along, layout.weft.pitch, rtol=1e-4)


@pytest.mark.parametrize("pose", ["wave", "roll"])
def test_a_pose_may_bend_the_warp(pose):
    layout = woven(ends=8, picks=60, irregularity=0.0)
    points = pose_points(layout, pose, bent="warp").astype(np.float64)
    across = np.linalg.norm(np.diff(points, axis=1), axis=-1)
    along = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    np.testing.assert_allclose(across, layout.warp.pitch, rtol=1e-4)
    np.testing.assert_allclose(along, layout.weft.pitch, rtol=5e-3)
    np.testing.assert_allclose(points[..., 1], points[:, :1, 1].repeat(8, axis=1), atol=1e-9)  # picks stay level
    assert np.ptp(points[..., 1]) > 0.05 * np.ptp(layout.weft.position)


def test_frames_of_a_plane_and_of_single_threads():
    layout = woven(ends=4, picks=3)
    f = frames(pose_points(layout))
    np.testing.assert_allclose(f.weft, np.broadcast_to([1, 0, 0], f.weft.shape), atol=1e-6)
    np.testing.assert_allclose(f.warp, np.broadcast_to([0, 0, -1], f.warp.shape), atol=1e-6)
    np.testing.assert_allclose(f.normal, np.broadcast_to([0, 1, 0], f.normal.shape), atol=1e-6)
    for shape in ((1, 1), (1, 4), (4, 1)):
        grid = pose_points(woven("plain", ends=shape[1], picks=shape[0]))
        lonely = frames(grid)
        for v in (lonely.weft, lonely.warp, lonely.normal):
            np.testing.assert_allclose(np.linalg.norm(v, axis=-1), 1.0, atol=1e-6)


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (5, 1), (2, 2)])
def test_cloth_of_very_few_threads(size: tuple[int, int]):
    layout = woven("plain", ends=size[0], picks=size[1])
    cloud = build_fabric(layout).cloud(pose_points(layout))
    assert len(cloud) == particle_count(layout) > 0
    assert np.isfinite(cloud.position).all()


def test_wrong_grid_and_unknown_pose_are_refused():
    layout = woven()
    with pytest.raises(ValueError, match="this fabric needs"):
        build_fabric(layout).cloud(np.zeros((3, 3, 3), np.float32))
    with pytest.raises(InputError, match=r'unknown pose .*did you mean "wave"'):
        pose_points(layout, "wavy")  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match=r"unknown bent 'wrap'; known: weft, warp"):
        pose_points(layout, "wave", bent="wrap")  # pyright: ignore[reportArgumentType]


def test_bytes_are_counted_before_anything_is_laid_out():
    assert required_bytes(10**9, 10**9, 100) > 10**18


@pytest.mark.parametrize("weave", known_weaves())
def test_flat_threads_touch_and_do_not_cross(weave: str):
    """Sweep each racetrack section by five round threads and measure all of them, with no use of `round_core`."""
    layout = woven(weave, ends=10, picks=10, fringe=0.0, opening=1.02)
    assert deepest_interpenetration(layout.cloth).fraction < 0.05
    depth = _swept_depth(layout)
    assert depth / layout.warp.thickness[0] < 0.05


def test_the_sweep_finds_threads_that_cross():
    layout = woven("plain", ends=6, picks=6, fringe=0.0)
    fat = replace(layout, warp=replace(layout.warp, thickness=1.4 * layout.warp.thickness))
    assert _swept_depth(fat) / layout.warp.thickness[0] > 0.15


def _swept_depth(layout, samples: int = 24, sweeps: int = 5) -> float:
    """Deepest overlap [m] of the round threads that sweep the flat ones, by brute force over 3-D points."""
    tracks = {}
    for family, threads in ((0, layout.warp), (1, layout.weft)):
        flat = (threads.width - threads.thickness)[0]
        found = []
        for b in np.flatnonzero(layout.kinds.family[layout.blocks.kind] == family):
            kind = layout.blocks.kind[b]
            u = (np.arange(samples) + 0.5) / samples
            p = layout.kinds.path
            path = type(p)(*(np.array([a[kind]]) for a in (p.pitch, p.z0, p.z1, p.r0, p.r1)))
            way = u * layout.kinds.pitch[kind]
            inner = np.clip((way - layout.kinds.flat[kind]) / p.pitch[kind], 0, 1)
            z = centreline(path, inner)[0][0]
            i, j = np.divmod(layout.blocks.key0[b], layout.cloth.ends)
            for shift in np.linspace(-flat / 2, flat / 2, sweeps):
                if family == 1:
                    xyz = [layout.warp.position[j] + way, layout.weft.position[i] + shift + 0 * way, z]
                else:
                    xyz = [layout.warp.position[j] + shift + 0 * way, layout.weft.position[i] + way, z]
                found.append(np.stack(xyz, -1))
        tracks[family] = np.concatenate(found)
    from scipy.spatial import KDTree

    near, _ = KDTree(tracks[0]).query(tracks[1])
    return float((layout.warp.thickness[0] + layout.weft.thickness[0]) / 2 - near.min())


def test_a_draft_that_states_spacing_alone_gets_yarn_that_fills_it():
    from taichi_cloth.fibre.contours import FIBRES
    from taichi_cloth.scenes.prepare.yarns import yarn_of
    from taichi_cloth.scenes.scene.schema import YarnSection

    section = YarnSection(count_tex=None, twist_per_m=700)
    thin, thick = (yarn_of(section, FIBRES["cotton"], diameter=d) for d in (0.3e-3, 0.6e-3))
    assert thin.woven_diameter == pytest.approx(0.3e-3, rel=1e-6)
    assert thick.woven_diameter == pytest.approx(0.6e-3, rel=1e-6)
    assert thick.twist_per_m == pytest.approx(thin.twist_per_m / 2, rel=1e-6)  # the same twist multiplier
    stated = yarn_of(YarnSection(count_tex=30), FIBRES["cotton"], diameter=0.6e-3)
    assert stated.count_tex == 30
