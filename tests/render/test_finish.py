"""Hems, stitches and prints: where they lie, on flat and bent cloth, and what files they refuse."""

import cv2
import numpy as np
import pytest

from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.follow import FibreFollower
from taichi_cloth.garment.pattern.cut import cut, inside
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern, Seam, Side
from taichi_cloth.garment.pattern.prints import Print
from taichi_cloth.garment.sewn.stitches import FROM_INNER, FROM_SEAM, PIECES, STRANDS, Stitches, inset
from taichi_cloth.garment.sewn.weaving import Weaving, crossings_shape
from taichi_cloth.ground.errors import InputError
from taichi_cloth.scenes.prepare.print_images import print_of
from taichi_cloth.scenes.prepare.weave_layout import prepare_fabric
from taichi_cloth.scenes.scene.garment_schema import PrintSection
from taichi_cloth.scenes.scene.load import make_scene

SIZE, SPACING, K = 0.12, 0.02, 3
HEM, PITCH, THREAD = 0.03, 3e-3, 5e-4
RED = np.array([0.7, 0.0, 0.0])


def square(name: str = "front", hems: tuple[int, ...] = (0,)) -> Panel:
    """Anticlockwise from its lower left corner at the origin; edge 0 is the lower one."""
    corner = np.array([[0, 0], [SIZE, 0], [SIZE, SIZE], [0, SIZE], [0, 0.0]])
    return Panel(name, tuple(corner[k : k + 2] for k in range(4)), Flat(np.eye(3), np.zeros(3)), hems=hems)


def woven(pattern: Pattern, **options) -> Weaving:
    atlas = cut(pattern, (SPACING, SPACING))
    picks, ends = crossings_shape(atlas, K)
    per_cm = 0.01 * K / SPACING
    fabric = {"steps": 2, "ends_per_cm": per_cm, "picks_per_cm": per_cm, "variants": 1, "fringe": 0}
    yarn = {"plies": 1, "fibres": 2, "hairiness": {"ends_per_m": 0}}
    scene = make_scene({"yarn": yarn, "weave": {"ends": ends, "picks": picks}, "fabric": fabric})
    return Weaving(atlas, build_fabric(prepare_fabric(scene).layout), K, **options)


def level(weaving: Weaving) -> np.ndarray:
    """Crossings where the panels lie flat at z = 0."""
    return weaving.crossings(weaving.atlas.start().astype(np.float32))


def test_points_inside_a_polygon():
    ring = np.array([[0, 0], [2, 0], [2, 1], [1, 0.5], [0, 1.0]])
    points = np.array([[0.1, 0.1], [1.0, 0.6], [1.0, 0.4], [1.9, 0.9], [-0.1, 0.1], [2.1, 0.5], [1.0, -0.1]])
    assert inside(ring, points).tolist() == [True, False, True, True, False, False, False]


def test_inset_of_an_arc_is_an_arc():
    t = np.linspace(0, np.pi / 2, 400)
    arc = np.stack([np.cos(t), np.sin(t)], -1)
    for anticlockwise, radius in ((True, 0.9), (False, 1.1)):
        moved = inset(arc, 0.1, anticlockwise=anticlockwise)
        assert np.linalg.norm(moved, axis=1) == pytest.approx(radius, abs=1e-5)


def test_a_hem_is_a_second_layer_inside_with_its_stitches_on_top():
    """Its share of the threads is hem over height; it lies within a cloth's thickness of the first layer, behind it.
    Off, nothing is added."""
    pattern = Pattern("patch", (square(),), ())
    whole = Print(np.broadcast_to(np.array([*RED, 1.0], np.float32), (1, 1, 4)), (SIZE / 2, SIZE / 2), SIZE / 2)
    plain, hemmed = woven(pattern), woven(pattern, hem=HEM, prints={"front": whole})
    first = len(plain.spans)
    drawn = np.maximum(hemmed.spans[:, 1] - hemmed.spans[:, 0], 0)
    assert drawn[:first].sum() == pytest.approx(np.maximum(plain.spans[:, 1] - plain.spans[:, 0], 0).sum())
    assert drawn[first:].sum() / drawn[:first].sum() == pytest.approx(HEM / SIZE, rel=0.2)  # 18 lines a panel
    assert len(plain.fabric.bank.u) < len(hemmed.fabric.bank.u)
    stitches = Stitches(pattern, hemmed, hem=HEM, pitch=PITCH, diameter=THREAD)
    follower = FibreFollower(
        hemmed.fabric, present=hemmed.present, spans=hemmed.spans, shades=hemmed.shades, others=len(stitches)
    )
    crossings = level(hemmed)
    follower.follow(crossings)
    cloud = follower.cloud()
    h = hemmed.height
    before = FibreFollower.count(plain.fabric, present=plain.present, spans=plain.spans)
    assert len(cloud) / before - 1 == pytest.approx(HEM / SIZE, rel=0.2)
    inner = cloud.position[:, 2] < -1.05 * h
    assert inner.any()
    assert cloud.position[inner, 1].max() < HEM + SPACING / K
    assert cloud.position[inner, 2].min() >= -3 * h - 0.2 * h
    x, y = cloud.position[~inner, :2].T
    reds = np.abs(cloud.colour[~inner][:, 1:]).max(axis=1) < 1e-6
    far = np.maximum(np.abs(x - SIZE / 2), np.abs(y - SIZE / 2)) - SIZE / 4
    assert reds[far < -SPACING / K].all()
    assert not reds[far > SPACING / K].any()
    assert not (np.abs(cloud.colour[inner][:, 1:]).max(axis=1) < 1e-6).any()
    stitches.dress(follower.others, np.array([0.0, 0.5, 0.0]))
    stitches.follow(crossings, follower.others)
    rows = follower.others.reshape(len(follower.others), -1)
    assert (rows[3, : len(stitches)] > 0).all()
    assert (rows[3, len(stitches) :] == 0).all()
    assert np.isfinite(rows).all()


def test_stitches_stand_on_the_cloth_a_pitch_apart_and_bend_with_it():
    pattern = Pattern("pair", (square("a"), square("b", ())), (Seam(Side("a", 2), Side("b", 0), alike=False),))
    weaving = woven(pattern)
    stitches = Stitches(pattern, weaving, hem=HEM, pitch=PITCH, diameter=THREAD)
    each = round(SIZE / PITCH)
    assert len(stitches) == 3 * each * STRANDS * PIECES  # the hem of a, and both sides of the seam
    position, tangent, normal = (v.reshape(3, each, STRANDS, PIECES, 3) for v in stitches.placed(level(weaving)))
    middle = position.mean(axis=(2, 3))
    for row, y in enumerate((SIZE - FROM_SEAM, HEM - FROM_INNER, FROM_SEAM)):
        np.testing.assert_allclose(middle[row, :, 1], y, atol=1e-6)
        np.testing.assert_allclose(np.abs(np.diff(middle[row, :, 0])), PITCH, atol=1e-6)
    top = position[..., 2].max(axis=(2, 3))
    assert (top > weaving.height).all()
    assert (top < weaving.height + THREAD).all()
    assert (position[..., 0, 2] < weaving.height).all()  # it dives through the cloth at its ends
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=-1), 1, atol=1e-5)
    np.testing.assert_allclose((tangent * normal).sum(axis=-1), 0, atol=1e-5)

    radius = 0.1
    flat = level(weaving).astype(np.float64)
    bent = np.stack([radius * np.sin(flat[..., 0] / radius), flat[..., 1], radius * np.cos(flat[..., 0] / radius)], -1)
    around = stitches.placed(bent)[0].reshape(position.shape)
    away = np.hypot(around[..., 0], around[..., 2]) - radius
    sag = (SPACING / K) ** 2 / 8 / radius + PITCH**2 / 8 / radius  # of a cell's chord, and of a straight stitch
    np.testing.assert_allclose(away, position[..., 2], atol=2 * sag)


def test_a_print_lies_the_right_way_up():
    image = np.ones((2, 4, 4), np.float32)
    image[0, 0, :3], image[1, 3, 3] = RED, 0.0
    print_ = Print(image, (1.0, 1.0), 0.4)
    found = print_.at(np.array([[0.85, 1.05], [1.05, 1.05], [1.15, 0.95], [0.79, 1.0], [1.0, 1.11]]))
    np.testing.assert_allclose(found[:2], np.stack([RED, np.ones(3)]), rtol=1e-6)
    assert np.isnan(found[2:]).all()  # transparent, and beside it on two sides


@pytest.mark.parametrize(("channels", "kind"), [(1, np.uint8), (3, np.uint8), (3, np.uint16), (4, np.uint8)])
def test_pictures_of_every_kind_are_read(tmp_path, channels, kind):
    full = np.iinfo(kind).max
    image = np.full((3, 5, channels), full, kind)
    if channels > 1:
        image[..., :2] = 0  # red: OpenCV writes blue first
    path = tmp_path / "picture.png"
    cv2.imwrite(str(path), image)
    made = print_of(PrintSection(file=str(path), width_cm=5, right_cm=1, up_cm=-2), square())
    assert made.width == pytest.approx(0.05)
    assert made.middle == pytest.approx((0.07, 0.04))
    np.testing.assert_allclose(made.image[1, 2], [1, 1, 1, 1] if channels == 1 else [1, 0, 0, 1])


@pytest.mark.parametrize(
    ("content", "match"),
    [(None, "No such file"), (b"", "not an image"), (b"\x89PNG\r\n\x1a\nhalf of one", "not an image")],
)
def test_what_is_no_picture_is_refused(tmp_path, content, match):
    path = tmp_path / "picture.png"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=rf"garment\.prints\.front\.file: .*{match}.*give a PNG"):
        print_of(PrintSection(file=str(path)), square())
