"""Cutting: areas, blends, the atlas; ties: closed form; what is drawn of panels ends where they end."""

from dataclasses import replace

import numpy as np
import pytest
from figures import plain_figure

from taichi_cloth.constraints.ties import Ties
from taichi_cloth.garment.pattern.cut import cut, intervals, spacing_for, turned
from taichi_cloth.garment.pattern.drafts import DRAFTS, Cut, draft
from taichi_cloth.garment.pattern.hems import with_hems
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.garment.sewn.skin import beneath
from taichi_cloth.garment.sewn.surface import Surface
from taichi_cloth.garment.sewn.weaving import Colours, Weaving, crossings_shape
from taichi_cloth.ground.cache import digest, folder, kept
from taichi_cloth.ground.errors import InputError
from taichi_cloth.motion.forces import FrameForces
from taichi_cloth.scenes.prepare.garment_setup import key_points_of
from taichi_cloth.scenes.scene.garment_schema import GarmentSection
from taichi_cloth.sheet.materials import MATERIALS
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.verlet import Verlet

FLAT = Flat(np.eye(3), np.zeros(3))


def disc(radius=0.1, sides=720, grain=0.0):
    angle = 2 * np.pi * np.arange(sides + 1) / sides
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], -1)
    ring[-1] = ring[0]
    half = sides // 2
    return Panel("disc", (ring[: half + 1], ring[half:]), FLAT, grain=grain)


def test_lines_through_a_disc():
    for y in (-0.099, -0.03, 0.0, 0.08):
        ((low, high),) = intervals(disc().outline, y, 1)
        assert (low, high) == pytest.approx((-np.sqrt(0.01 - y * y), np.sqrt(0.01 - y * y)), abs=2e-5)
    assert intervals(disc().outline, 0.2, 1).shape == (0, 2)


@pytest.mark.parametrize("spacing", [(0.012, 0.012), (0.02, 0.013), (0.06, 0.07)])
def test_cloth_keeps_its_area(spacing):
    atlas = cut(Pattern("p", (disc(),), ()), spacing)
    area = atlas.cells.sum() * spacing[0] * spacing[1]
    assert area == pytest.approx(disc().area, rel=3e-3)  # 32 lines a cell


@pytest.mark.parametrize("spacing", [(0.012, 0.012), (0.02, 0.013)])
def test_a_hem_lies_double(spacing):
    """Of a disc whose whole rim is turned in: a ring. What is left out of the cloth is not of the hem either."""
    atlas = cut(Pattern("p", (replace(disc(), hems=(0, 1)),), ()), spacing)
    layers = with_hems(atlas, 0.02)
    assert ((layers > 0) == (atlas.cells > 0)).all()
    ring = (layers - atlas.cells).sum() * spacing[0] * spacing[1]
    assert ring == pytest.approx(np.pi * (0.1**2 - 0.08**2), rel=0.01)
    middle = tuple(n // 2 for n in layers.shape)
    assert layers[middle] == 1
    assert layers.max() <= 2.7  # a neighbour's sliver beside a whole cell
    half = with_hems(cut(Pattern("p", (replace(disc(), hems=(0,)),), ()), spacing), 0.02)
    assert (half - atlas.cells).sum() == pytest.approx((layers - atlas.cells).sum() / 2, rel=0.15)


@pytest.mark.parametrize("grain", [0.0, 0.6])
def test_blends_give_back_every_linear_function(grain):
    """Beyond the outline's cells too: what is left out is carried on straight."""
    panel = disc(grain=grain)
    atlas = cut(Pattern("p", (panel,), ()), (0.015, 0.015))
    piece = atlas.panels[0]
    nodes, shares = piece.embed(turned(panel.outline, grain))
    assert shares.sum(axis=1) == pytest.approx(1)
    assert atlas.present()[nodes[..., 0], nodes[..., 1]].all()
    back = np.einsum("nkc,nk->nc", piece.lattice()[nodes[..., 0], nodes[..., 1]], shares)
    assert np.abs(back - panel.outline).max() < 1e-12


@pytest.mark.parametrize("name", DRAFTS)
def test_atlas_of_a_garment(name):
    pattern = draft(name, plain_figure())
    a = spacing_for(pattern, 2000)
    atlas = cut(pattern, a)
    assert atlas.key_points == pytest.approx(2000, rel=0.01)
    assert atlas.cells.sum() * a[0] * a[1] == pytest.approx(sum(p.area for p in pattern.panels), rel=5e-3)
    owner = atlas.owner()
    for di, dj in ((0, 1), (1, 0), (1, 1)):  # no key points of two panels are neighbours
        one, two = owner[: owner.shape[0] - di, : owner.shape[1] - dj], owner[di:, dj:]
        assert not ((one >= 0) & (two >= 0) & (one != two)).any()
    garment = Garment(pattern, atlas, MATERIALS["cotton-shirting"].linear)
    nodes, weights = garment.seams()
    assert np.abs(weights.sum(axis=1)).max() < 1e-9
    start = atlas.start()
    assert np.isfinite(start).all()
    total = sum(pattern.seam_length(seam) for seam in pattern.seams)
    assert len(nodes) == pytest.approx(total / a[0], abs=2 * len(pattern.seams))


def test_a_panel_smaller_than_a_cell_is_refused():
    with pytest.raises(InputError, match="hold no cell"):
        cut(Pattern("p", (disc(0.004),), ()), (0.05, 0.05))


def test_shares_of_cells_keep_the_stable_step():
    material = MATERIALS["cotton-shirting"].linear
    springs = calibrate(material, spacing_x=0.015, spacing_y=0.015)
    atlas = cut(Pattern("p", (disc(),), ()), (0.015, 0.015))
    whole = Verlet(Sheet.rectangle(14, 14, material=material, springs=springs), forces=no_forces())
    part = Verlet(Sheet.of_cells(atlas.cells, material=material, springs=springs), forces=no_forces())
    assert part.choice.frequency < 1.02 * whole.choice.frequency


def no_forces():
    from taichi_cloth.motion.forces import Forces

    return Forces(gravity=(0.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def pair():
    """Two panels of one cell, 3 cm apart, tied at the middles of two facing edges, at rest."""
    material = replace(MATERIALS["cotton-shirting"].linear, air_damping=0.0)
    cells = np.array([[1.0, 0.0, 0.0, 0.5]])
    springs = calibrate(material, spacing_x=0.01, spacing_y=0.01)
    sheet = Sheet.of_cells(cells, material=material, springs=springs)
    positions = sheet.flat()
    positions[:, 3:, 0] += 0.01
    return sheet, positions


def tied(pair, **options):
    sheet, positions = pair
    nodes = np.array([[[0, 1], [1, 1], [0, 3], [1, 3]]])
    weights = np.array([[0.5, 0.5, -0.5, -0.5]])
    ties = Ties(sheet, nodes, weights, **options)
    return Verlet(sheet, no_forces(), frame_rate=100.0, constraints=(ties,)), ties, sheet.state(positions)


def test_ties_close_at_their_speed_and_keep_momentum(pair):
    sheet = pair[0]
    solver, ties, state = tied(pair, speed=0.5)
    assert ties.gaps(state) == pytest.approx([0.03])
    middle = (sheet.positions(state) * sheet.mass[..., None]).sum(axis=(0, 1)) / sheet.mass.sum()
    widths = []
    for _ in range(8):
        solver.advance(state, FrameForces())
        widths.append(float(ties.gaps(state)[0]))
    # Never wider than 5 mm a frame allow; narrower where the panels, stretched by the pull, spring on.
    assert widths[0] > 0.015
    assert all(w <= 0.03 - 0.005 * (k + 1) + 1e-5 or w < 1e-5 for k, w in enumerate(widths))
    assert widths[-1] < 1e-5
    after = (sheet.positions(state) * sheet.mass[..., None]).sum(axis=(0, 1)) / sheet.mass.sum()
    assert np.abs(after - middle).max() < 2e-7  # float32 positions


def test_a_place_holds_and_is_carried_by_its_bone(pair):
    sheet = pair[0]
    places = np.array([[0.0, 0.01, 0.0]])
    nodes, weights = np.array([[[1, 0]]]), np.array([[1.0]])
    ties = Ties(sheet, nodes, weights, places=places, bones=np.array([1]), speed=9.0)
    turn = np.tile(np.eye(4), (2, 1, 1))
    turn[1, :3, 3] = (0.0, 0.0, 0.004)
    assert ties.targets(turn)[0] == pytest.approx([0.0, 0.01, 0.004])
    assert ties.targets(None)[0] == pytest.approx(places[0])


def test_a_key_point_named_twice_counts_once_with_both_weights(pair):
    sheet, positions = pair
    after = []
    for nodes, weights in (
        ([[0, 1], [0, 1], [0, 3], [1, 3]], [0.25, 0.75, -0.5, -0.5]),
        ([[0, 1], [0, 3], [1, 3]], [1.0, -0.5, -0.5]),
    ):
        ties = Ties(sheet, np.array([nodes]), np.array([weights]))
        state = sheet.state(positions)
        Verlet(sheet, no_forces(), frame_rate=100.0, constraints=(ties,)).advance(state, FrameForces())
        assert ties.gaps(state)[0] < ties.gaps(sheet.state(positions))[0] - 0.004
        after.append(state.values)
    assert np.array_equal(*after)


def test_bad_ties_are_refused(pair):
    with pytest.raises(InputError, match="ties"):
        Ties(pair[0], np.zeros((0, 2, 2), np.int64), np.zeros((0, 2)))


def test_surface_is_cut_along_the_outline():
    atlas = cut(Pattern("p", (disc(),), ()), (0.015, 0.015))
    surface = Surface(atlas)
    flat = np.pad(atlas.panels[0].lattice(), ((0, 0), (0, 0), (0, 1)))
    points, normals = surface.points(flat)
    corner = points[surface.faces].astype(np.float64)
    square = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert square[:, 2].min() >= 0
    assert square[:, 2].sum() / 2 == pytest.approx(disc().area, rel=1e-4)
    assert normals[:, 2] == pytest.approx(1)
    assert np.linalg.norm(points, axis=1).max() == pytest.approx(0.1, abs=1e-5)


def test_surface_on_a_cylinder_has_its_normals():
    """Half a spacing's turn off at most: at an outline a key point's difference is one-sided."""
    spacing, radius = 0.01, 0.25
    atlas = cut(Pattern("p", (disc(),), ()), (spacing, spacing))
    surface = Surface(atlas)
    x, y = np.moveaxis(atlas.panels[0].lattice(), -1, 0)
    points, normals = surface.points(np.stack([radius * np.sin(x / radius), y, radius * np.cos(x / radius)], -1))
    out = points * [1, 0, 1] / np.linalg.norm(points[:, [0, 2]], axis=1, keepdims=True)
    angle = np.arccos(np.clip((normals * out).sum(axis=1), -1, 1))
    assert angle.max() < 0.5 * spacing / radius + 2e-3
    assert np.median(angle) < 1e-3  # central differences on a circle are exact; blends all but


def test_threads_end_at_the_outline():
    from taichi_cloth.fabric.fabric import build_fabric
    from taichi_cloth.scenes.prepare.weave_layout import prepare_fabric
    from taichi_cloth.scenes.scene.load import make_scene

    atlas = cut(Pattern("p", (disc(),), ()), (0.02, 0.02))
    k = 3
    picks, ends = crossings_shape(atlas, k)
    scene = make_scene(
        {
            "yarn": {"plies": 1, "fibres": 2},
            "weave": {"ends": ends, "picks": picks},
            "fabric": {"steps": 2, "ends_per_cm": 1.5, "picks_per_cm": 1.5, "variants": 1, "fringe": 0},
        }
    )
    cloth = build_fabric(prepare_fabric(scene).layout)
    red, blue = np.array([[0.8, 0, 0]]), np.array([[0, 0, 0.8], [0, 0.8, 0]])
    weaving = Weaving(atlas, cloth, k, {"disc": Colours(red, blue)})
    blocks, spans = weaving.fabric.layout.blocks, weaving.spans
    share = np.maximum(spans[:, 1] - spans[:, 0], 0)
    family = weaving.fabric.layout.kinds.family[blocks.kind]
    pitch = 0.02 / k
    for which in (0, 1):  # lengths of thread are the chords of the disc
        drawn = float(share[family == which].sum()) * pitch
        lines = pitch * (np.arange(-40, 40) + (0.0 if (picks - 1) % 2 == 0 else 0.5))
        chords = 2 * np.sqrt(np.maximum(0.01 - lines**2, 0)).sum()
        assert drawn == pytest.approx(chords, rel=1e-3)
    colours = weaving.fabric.thread_colour[blocks.thread[(family == 0) & (share > 0)]]
    assert np.abs(colours - red).max() < 1e-6
    wefts = np.flatnonzero((family == 1) & (share > 0))
    rows = np.divmod(blocks.key0[wefts], ends)[0]
    first = round(atlas.panels[0].origin[1] / pitch)
    assert np.abs(weaving.fabric.thread_colour[blocks.thread[wefts]] - blue[(rows + first) % 2]).max() < 1e-6


def test_skin_stays_beneath_cloth():
    u, v = np.meshgrid(np.linspace(-0.2, 0.2, 41), np.linspace(-0.2, 0.2, 41))
    skin = np.stack([u, 0 * u, v], -1).reshape(-1, 3)
    index = np.arange(41 * 41).reshape(41, 41)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    cloth = skin[(np.abs(skin[:, 0]) < 0.1) & (np.abs(skin[:, 2]) < 0.1)] + [0, -0.005, 0]
    out = beneath(skin, faces, cloth)
    under = (np.abs(skin[:, 0]) < 0.1) & (np.abs(skin[:, 2]) < 0.1)
    assert out[under, 1] == pytest.approx(-0.009, abs=1e-6)
    far = np.abs(skin[:, 0]) > 0.14
    assert out[far] == pytest.approx(skin[far], abs=1e-7)
    bones = np.where(skin[:, 0] < 0, 3, 5)
    none, one = np.zeros(len(cloth), np.int32), np.full(len(cloth), 1 << 5, np.int32)
    assert beneath(skin, faces, cloth, bone=bones, spared=none) == pytest.approx(out)
    passed = beneath(skin, faces, cloth, bone=bones, spared=one)  # cloth that what bone 5 carries does not wear
    assert passed[bones == 5] == pytest.approx(skin[bones == 5], abs=1e-7)
    assert passed[under & (skin[:, 0] < 0), 1] == pytest.approx(-0.009, abs=1e-6)


@pytest.mark.parametrize("height", [0.010, 0.004])
def test_the_far_side_of_a_finger_stays_where_it_is(height: float) -> None:
    """A finger of 8 mm radius, cloth 2 mm over it or 4 mm within it: the side that faces the cloth ends 4 mm below it
    at least, the other has not moved, and so comes out nowhere."""
    turn, along = np.meshgrid(np.linspace(0, 2 * np.pi, 24, endpoint=False), np.linspace(-0.04, 0.04, 17))
    skin = np.stack([0.008 * np.sin(turn), 0.008 * np.cos(turn), along], -1).reshape(-1, 3)
    index = np.arange(24 * 17).reshape(17, 24)
    a, b, c, d = index[:-1], np.roll(index, -1, 1)[:-1], np.roll(index, -1, 1)[1:], index[1:]
    faces = np.concatenate([np.stack([a, d, c], -1), np.stack([a, c, b], -1)]).reshape(-1, 3)
    u, v = np.meshgrid(np.linspace(-0.06, 0.06, 9), np.linspace(-0.06, 0.06, 9))
    out = beneath(skin, faces, np.stack([u, np.full_like(u, height), v], -1).reshape(-1, 3))
    top, bottom = skin[:, 1] > 0.0079, skin[:, 1] < -1e-6
    assert out[top, 1].max() < height - 0.004 + 1e-4
    assert out[:, 1].max() < height
    np.testing.assert_allclose(out[bottom], skin[bottom], atol=1e-7)


def test_cache_keeps_and_mends(tmp_path, monkeypatch):
    monkeypatch.setenv("TAICHI_CLOTH_CACHE", str(tmp_path))
    made = []

    def make():
        made.append(1)
        return {"x": np.arange(5.0), "word": np.array("silk")}

    key = digest("a", 1, np.arange(3))
    assert key != digest("a", 1, np.arange(4)) != digest("a", 1.0, np.arange(3))
    for expected in (1, 1):
        arrays, _ = kept("thing", key, make)
        assert len(made) == expected
        assert (arrays["x"] == np.arange(5.0)).all()
        assert str(arrays["word"]) == "silk"
    (file,) = folder().iterdir()
    whole = file.read_bytes()
    for damaged in (whole[:100], b"", whole[:-40] + bytes(40), whole.replace(b"x.npy", b"y.npy")):
        file.write_bytes(damaged)
        before = len(made)
        assert (kept("thing", key, make)[0]["x"] == np.arange(5.0)).all()
        assert len(made) == before + 1
        assert file.read_bytes() == whole or kept("thing", key, make)[1]


def test_nowhere_to_keep_is_no_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("TAICHI_CLOTH_CACHE", str(tmp_path / "file" / "below"))
    assert kept("thing", "k" * 32, lambda: {"x": np.ones(1)})[0]["x"] == 1


def test_a_wide_garment_takes_more_key_points():
    figure = plain_figure()
    made = [draft("skirt", figure, Cut(flare=flare, length=1.1)) for flare in (2.0, 4.5, 8.0)]
    counts = [key_points_of(GarmentSection(pattern="skirt"), pattern) for pattern in made]
    assert counts[0] == 6245
    assert 6245 < counts[1] < counts[2] <= 15_000
    assert counts[1] == pytest.approx(sum(panel.area for panel in made[1].panels) / 0.02**2, abs=1)
    assert [key_points_of(GarmentSection(pattern="skirt", key_points=300), pattern) for pattern in made] == [300] * 3
