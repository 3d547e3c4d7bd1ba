"""Threads free of key points: the surface through key points, blocks worked out against blocks laid out, streaming."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree

from taichi_cloth.detail.cell_stream import HIDING, CellStream, Seen
from taichi_cloth.detail.patches import CELL, LEVEL, PATCH_ENDS, PATCH_PICKS
from taichi_cloth.fabric.cells import CellCloth, CellPanel, CellThreads, sheet_of_cells
from taichi_cloth.fabric.crossings import refine_points
from taichi_cloth.fabric.fabric import Fabric, build_fabric
from taichi_cloth.fabric.layout import Detail, FabricLayout, drawn_density, families_of, lay_out
from taichi_cloth.fabric.repeat import FLOATING, WeaveRepeat, bank_of, levels_of
from taichi_cloth.fabric.surface import nodes_of, surface_points
from taichi_cloth.fabric.templates import COLUMN
from taichi_cloth.ground.copies import fetched
from taichi_cloth.ground.errors import InputError
from taichi_cloth.ground.mixing import SURFACE_SHARE
from taichi_cloth.ground.particles import COLOUR, HALF_LENGTH, NORMAL, POSITION, RADIUS, ROWS, TANGENT
from taichi_cloth.render.data.camera import frame
from taichi_cloth.render.light.thin import chain_step
from taichi_cloth.render.splat.stream import STREAMED
from taichi_cloth.weave.cloth_set import fit_set, set_sizes
from taichi_cloth.weave.draft import Draft, named_weave, tile
from taichi_cloth.yarn.unevenness import ROWS as ROWS_UNEVEN
from taichi_cloth.yarn.unevenness import SHIFT, thick_places
from taichi_cloth.yarn.yarn import Hairiness, Yarn

PITCH = 5e-4
SEED = 3


def layout_of(
    draft: Draft, *, per_cm: float | None = 20.0, fibres: int = 3, fringe: float = 0.0, unevenness: float = 0.0
) -> FabricLayout:
    yarn = Yarn(count_tex=12.0, hairiness=Hairiness(ends_per_m=0, loops_per_m=0), unevenness=unevenness)
    diameter, rooms = set_sizes(draft, (yarn.woven_diameter, yarn.woven_diameter), (per_cm, per_cm), 1.5)
    cloth = fit_set(draft.warp_up, rooms, diameter, flattening=1.5, balance=0.5).cloth
    grey = [np.full((n, 3), 0.5, np.float32) for n in (draft.ends, draft.picks)]
    families = families_of(cloth, rooms, (grey[0], grey[1]), (yarn, yarn))
    return lay_out(cloth, *families, detail=Detail(fibres=fibres, steps=3, variants=2, fringe=fringe, seed=SEED))


def repeat_of(draft: Draft, **options: float | None) -> WeaveRepeat:
    return WeaveRepeat.of(layout_of(tile(draft, ends=draft.ends + 1, picks=draft.picks + 1), **options))  # pyright: ignore[reportArgumentType]


@dataclass(frozen=True)
class Sheet:
    """A sheet of cells, and the same cloth with every block laid out."""

    cells: CellCloth
    swatch: Fabric

    @property
    def shape(self) -> tuple[int, int]:
        return self.cells.shape


def sheet(weave: str, shape: tuple[int, int], per_cell: tuple[int, int], unevenness: float = 0.0) -> Sheet:
    """The swatch takes of each block's yarn the same part, and the same filling: what the cells choose at random."""
    ends, picks = (shape[1] - 1) * per_cell[0] + 1, (shape[0] - 1) * per_cell[1] + 1
    draft = named_weave(weave)
    grey = [np.full((n, 3), 0.5, np.float32) for n in (ends, picks)]
    cells = sheet_of_cells(shape, per_cell, repeat_of(draft, unevenness=unevenness), (grey[0], grey[1]), seed=SEED)
    layout = layout_of(tile(draft, ends=ends, picks=picks), unevenness=unevenness)
    # Two lengths hold whole turns alike, and rounding tells which is taken.
    periods = {name: getattr(cells.repeats[0].layout, name) for name in ("warp_period", "weft_period")}
    layout = replace(layout, **periods)
    blocks = layout.blocks
    warp = layout.kinds.family[blocks.kind] == 0
    along = np.where(warp, blocks.key0 // ends, blocks.key0 % ends)
    periods = np.where(warp, layout.warp_period.blocks, layout.weft_period.blocks)
    phase = ((cells._arrays["begin"][blocks.thread].astype(np.int64) + along) % periods).astype(np.int32)
    variant = (hashed(blocks.thread, along) % cells.bank.variants).astype(np.int32)
    wide = np.empty((len(along), 2), np.float32)
    for family, mine in enumerate((warp, ~warp)):
        row = cells._arrays["uneven"][ROWS_UNEVEN * family : ROWS_UNEVEN * (family + 1)]
        for end in (0, 1):
            wide[mine, end] = thick_places(row, cells._arrays["begin"][blocks.thread[mine]], along[mine] + end)
    return Sheet(cells, build_fabric(replace(layout, blocks=replace(blocks, phase=phase, variant=variant, wide=wide))))


def hashed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    x = (a.astype(np.int64) * 73856093 + b.astype(np.int64) * 19349663 + 83492791) & 0xFFFFFFFF
    for _ in range(2):
        x = ((x ^ (x >> 16)) * 73244475) & 0xFFFFFFFF
    return (x ^ (x >> 16)) & 0xFFFFFF


def flat(shape: tuple[int, int], per_cell: tuple[int, int]) -> np.ndarray:
    points = np.zeros((*shape, 3))
    points[..., 0] = np.arange(shape[1]) * per_cell[0] * PITCH
    points[..., 2] = -np.arange(shape[0])[:, None] * per_cell[1] * PITCH
    return points


def all_particles(cells: CellCloth) -> np.ndarray:
    """(ROWS, n) of the finest level, as many as are drawn."""
    stream = CellStream(cells)
    patch = stream._whole.copy()
    patch[:, LEVEL] = 0
    grid, none = np.zeros((len(patch), 2), np.int32), np.zeros(len(patch), np.float32)
    counts = stream._counts(cells.pack(), patch, grid)
    seen = Seen(np.zeros((len(patch), 4), np.int16), counts, none, none, patch, none + 1.0, grid, None)
    groups, count = stream.lay(seen, np.arange(len(patch), dtype=np.int32))
    groups = fetched(groups)
    return groups.reshape(ROWS, -1)[:, :count].copy()


def differ(cells: CellCloth, cloud: np.ndarray, radius: np.ndarray) -> float:
    """How far the farthest particle is from its like [m]; one to one."""
    ours = all_particles(cells)
    assert ours.shape[1] == len(cloud)
    away, which = KDTree(cloud).query(ours[POSITION : POSITION + 3].T)
    assert len(np.unique(which)) == len(cloud)
    assert ours[RADIUS] == pytest.approx(radius[which], rel=1e-4)
    return float(away.max())


def bumpy(shape: tuple[int, int], per_cell: tuple[int, int], seed: int = 1) -> np.ndarray:
    points = flat(shape, per_cell)
    return points + np.random.default_rng(seed).normal(0.0, 0.2 * PITCH, points.shape)


def test_the_surface_is_that_of_the_splines_and_its_slopes_have_no_step() -> None:
    points = bumpy((5, 6), (4, 4))
    nodes = nodes_of(points)
    u, v = np.meshgrid(np.arange(21) / 4, np.arange(17) / 4)
    ours = surface_points(nodes, 6, u.ravel(), v.ravel())[0].reshape(17, 21, 3)
    assert np.abs(ours - refine_points(points, None, 4)).max() < 1e-8
    for at in ((2.0, 1.3), (3.4, 2.0)):
        before, after = (surface_points(nodes, 6, [at[0] + s], [at[1] + s]) for s in (-1e-7, 1e-7))
        for one, other in zip(before, after, strict=True):
            assert one == pytest.approx(other, abs=1e-8)


def test_a_key_point_that_is_not_there_takes_no_part() -> None:
    points = flat((4, 5), (4, 4))
    mask = np.ones((4, 5), bool)
    mask[0, 0] = mask[3, 4] = False
    torn = np.where(mask[..., None], points, 1e3)
    u, v = np.array([1.5, 0.4, 2.7]), np.array([0.5, 1.5, 2.9])
    assert surface_points(nodes_of(torn, mask), 5, u, v)[0] == pytest.approx(
        surface_points(nodes_of(points), 5, u, v)[0]
    )


@pytest.mark.parametrize("weave", ["plain", "twill-2/1", "satin-5"])
def test_a_flat_cloth_is_a_swatch_of_the_same_sett(weave: str) -> None:
    """Every particle where `Fabric.cloud` lays it, to float32 rounding at 2 cm."""
    shape, per_cell = (4, 4), (5, 7)
    one = sheet(weave, shape, per_cell)
    points = flat(shape, per_cell)
    one.cells.move(points)
    x, z = np.arange(16) * PITCH, -np.arange(22) * PITCH
    crossings = np.stack(np.broadcast_arrays(x, 0.0, z[:, None]), -1)
    cloud = one.swatch.cloud(crossings)
    assert differ(one.cells, cloud.position, cloud.radius) < 1e-8


@pytest.mark.parametrize("push", [False, True])
def test_thick_and_thin_places_are_those_of_the_swatch_and_push_their_neighbours_apart(push: bool) -> None:
    shape, per_cell = (4, 4), (5, 7)
    one = sheet("plain", shape, per_cell, unevenness=0.2)
    one.cells.move(flat(shape, per_cell))
    uneven = one.cells._arrays["uneven"]
    if not push:
        uneven[[SHIFT, ROWS_UNEVEN + SHIFT]] = 0.0
    x, z = np.arange(16) * PITCH, -np.arange(22) * PITCH
    cloud = one.swatch.cloud(np.stack(np.broadcast_arrays(x, 0.0, z[:, None]), -1))
    if not push:
        assert differ(one.cells, cloud.position, cloud.radius) < 1e-8
        return
    ours = all_particles(one.cells)
    threads = one.swatch.threads()
    ends = [x[cells_threads(one.cells) == k].mean() for x in (ours[POSITION],) for k in range(16)]
    even = [cloud.position[threads == k, 0].mean() for k in range(16)]
    wide = [cloud.radius[threads == k].mean() / cloud.radius[threads < 16].mean() for k in range(16)]
    moved = np.diff(ends) - np.diff(even)
    room = (np.array(wide)[1:] + np.array(wide)[:-1]) / 2 - 1.0
    assert 0.0 < np.abs(moved).max() < 0.2 * PITCH
    assert np.corrcoef(moved, room)[0, 1] > 0.5


def test_one_thread_to_a_cell_is_cloth_whose_threads_follow_key_points() -> None:
    one = sheet("twill-2/1", (6, 7), (1, 1))
    points = bumpy((6, 7), (1, 1))
    one.cells.move(points)
    cloud = one.swatch.cloud(points)
    assert differ(one.cells, cloud.position, cloud.radius) < 1e-8


def test_a_bent_cloth_stays_on_its_cylinder_and_no_thread_stretches() -> None:
    """Key points 2.5 mm apart round a cylinder of 10 mm: of the thickness t, particles leave it by less than t/20, and
    neighbouring crossings lie a pitch apart to 0.6 %, on average to 0.1 %."""
    shape, per_cell, radius = (4, 9), (5, 5), 0.01
    one = sheet("plain", shape, per_cell)
    points = flat(shape, per_cell)
    angle = (points[..., 0] - points[..., 0].mean()) / radius
    bent = np.stack([radius * np.sin(angle), radius * np.cos(angle), points[..., 2]], -1)
    one.cells.move(bent)
    ours = all_particles(one.cells)
    x, y = ours[POSITION], ours[POSITION + 1]
    lies = all_particles_flat(one, points)
    inner = (x > radius * np.sin(angle[0, 1])) & (x < radius * np.sin(angle[0, -2]))
    thick = 2 * np.abs(lies).max()
    height = np.hypot(x, y) - radius
    assert np.abs(np.abs(height[inner]).max() - thick / 2) < thick / 20
    u = np.linspace(1, 7, 31)
    place, _, _ = surface_points(one.cells.node, shape[1], u, np.full(31, 1.0))
    steps = np.linalg.norm(np.diff(place, axis=0), axis=1)
    assert steps == pytest.approx(PITCH, rel=6e-3)
    assert steps.mean() == pytest.approx(PITCH, rel=1e-3)


def all_particles_flat(one: Sheet, points: np.ndarray) -> np.ndarray:
    """Heights of all particles with the cloth flat [m]."""
    one_more = sheet_of_cells(
        one.shape, one.cells.per_cell, one.cells.repeats[0], (np.full((41, 3), 0.5), np.full((16, 3), 0.5)), seed=SEED
    )
    one_more.move(points)
    return all_particles(one_more)[POSITION + 1]


def test_threads_of_unlike_spacing_lie_where_the_draft_has_them() -> None:
    """Reed marks: every third warp end stands apart. Places as of a swatch of that draft, over several repeats."""
    draft = replace(named_weave("plain", ends=6, picks=4), warp_spacing_m=np.tile([1.0, 1.0, 1.6], 2) * PITCH / 1.2)
    draft = replace(draft, weft_spacing_m=np.full(4, PITCH))
    shape, per_cell = (3, 3), (6, 4)
    cells = sheet_of_cells(
        shape, per_cell, repeat_of(draft, per_cm=None), (np.full((13, 3), 0.5), np.full((9, 3), 0.5)), seed=SEED
    )
    cells.move(flat(shape, per_cell))
    swatch = layout_of(tile(draft, ends=13, picks=9), per_cm=None)
    ours = all_particles(cells)
    end = cells_threads(cells) < 13
    along = np.abs(ours[TANGENT + 2]) > 0.5  # of warp ends
    assert along[end].mean() > 0.95
    mean = [ours[POSITION][cells_threads(cells) == k].mean() for k in range(12)]
    assert np.diff(mean) == pytest.approx(np.diff(swatch.warp.position[:12]), abs=0.05 * PITCH)


def cells_threads(cells: CellCloth) -> np.ndarray:
    stream = CellStream(cells)
    patch = stream._whole.copy()
    grid, none = np.zeros((len(patch), 2), np.int32), np.zeros(len(patch), np.float32)
    counts = stream._counts(cells.pack(), patch, grid)
    seen = Seen(np.zeros((len(patch), 4), np.int16), counts, none, none, patch, none + 1.0, grid, None)
    return stream.numbers(seen, np.arange(len(patch), dtype=np.int32))[0]


def test_what_an_outline_cuts_away_is_not_drawn() -> None:
    """Ends 3 to 8 kept from crossing 2.5 to 6 of each, picks not at all."""
    shape, per_cell = (3, 3), (6, 4)
    threads = CellThreads(
        np.full((22, 3), 0.5, np.float32),
        np.tile(np.array([2.5, 6.0], np.float32), (6, 1)),
        np.concatenate([np.zeros(3), np.arange(6), np.full(14, 6)]).astype(np.int32),
    )
    repeat = repeat_of(named_weave("plain"))
    cells = CellCloth(shape, per_cell, (repeat,), (CellPanel(0, 0, *shape),), threads, seed=SEED)
    cells.move(flat(shape, per_cell))
    ours, thread = all_particles(cells), cells_threads(cells)
    drawn = ours[RADIUS] > 0
    assert set(thread[drawn]) == set(range(3, 9))
    z = -ours[POSITION + 2][drawn] / PITCH
    assert z.min() == pytest.approx(2.5, abs=0.3)
    assert z.max() == pytest.approx(6.0, abs=0.3)


def test_a_turned_hem_lies_under_the_first_layer() -> None:
    shape, per_cell = (3, 3), (6, 6)
    hem = np.full((9, 9), 1.0, np.float32)
    hem[:, :5] = -1.0  # the left cell
    repeat = repeat_of(named_weave("plain"))
    threads = CellThreads.whole(np.full((26, 3), 0.5, np.float32))
    cells = CellCloth(shape, per_cell, (repeat,), (CellPanel(0, 0, *shape),), threads, hem=hem, seed=SEED)
    cells.move(flat(shape, per_cell))
    ours = all_particles(cells)
    ours = ours[:, ours[RADIUS] > 0]
    high, right = ours[POSITION + 1], ours[POSITION] > 7 * PITCH
    height = cells.bank.height
    assert np.abs(high[right]).max() < 1.4 * height
    assert high[~right].min() == pytest.approx(-3 * height, rel=0.3)
    assert (high < -1.5 * height).mean() == pytest.approx(1 / 3, abs=0.08)


@pytest.fixture(scope="module")
def streamed() -> CellStream:
    one = sheet("plain", (9, 9), (8, 8))
    one.cells.move(flat((9, 9), (8, 8)))
    return CellStream(one.cells)


def seen_from(distance: float, size: int = 96) -> Any:
    points = flat((9, 9), (8, 8)).reshape(-1, 3)
    camera = frame(points, width=size, height=size, elevation=60)
    return replace(camera, focal=camera.focal / distance)


def rows_of(stream: CellStream, one: Seen) -> np.ndarray:
    groups, count = stream.lay(one, np.arange(len(one.counts), dtype=np.int32))
    groups = fetched(groups)
    return groups.reshape(ROWS, -1)[:, :count].copy()


def test_near_it_is_fibres_and_far_a_sheet_and_between_both_fade(streamed: CellStream) -> None:
    """What a share of fibres has of all their area, radius times length, is that share; and the sheet has the rest."""
    near, far = streamed.survey(seen_from(0.05)), streamed.survey(seen_from(8.0))
    assert (near.grid == 0).all()
    assert (near.share == 1.0).all()
    assert (far.grid > 0).all()
    assert (far.share == 1.0).all()
    assert far.counts.sum() < 0.02 * streamed.cloth.particles
    seen = [streamed.survey(seen_from(float(distance))) for distance in np.geomspace(0.05, 8.0, 60)]
    both = max(seen, key=lambda one: int(((one.share > 0.4) & (one.share < 0.6)).sum()))
    between, is_sheet = (both.share > 0.4) & (both.share < 0.6), both.grid[:, 0] > 0
    fibres, sheet = (np.flatnonzero(between & one).astype(np.int32) for one in (~is_sheet, is_sheet))
    assert len(fibres) >= len(sheet) > 3
    whole = replace(both, share=np.ones_like(both.share))
    for chosen in (fibres, sheet):
        wanted = float(both.share[chosen].mean())
        areas: list[float] = []
        for one in (both, whole):
            groups, count = streamed.lay(one, chosen)
            groups = fetched(groups)
            rows = groups.reshape(ROWS, -1)[:, :count]
            areas.append(float((rows[RADIUS] * rows[HALF_LENGTH]).sum()))
        assert areas[0] / areas[1] == pytest.approx(wanted, abs=0.02)


def test_a_crossing_is_drawn_once_at_any_distance() -> None:
    """Of one level shares add up to one. Where it and the sheet fade into one another, to a little less, as some of a
    thread's fibres hide more than their share; of two levels, which cover some of the same by chance, to a little more.
    """
    grey = [np.full((65, 3), 0.5, np.float32) for _ in range(2)]
    cloth = sheet_of_cells((9, 9), (8, 8), repeat_of(named_weave("plain"), fibres=40), (grey[0], grey[1]), seed=SEED)
    cloth.move(flat((9, 9), (8, 8)))
    stream = CellStream(cloth)
    whole = np.bincount(stream._whole[:, CELL], weights=stream._whole[:, PATCH_ENDS] * stream._whole[:, PATCH_PICKS])
    levels = set()
    for size in np.geomspace(6000, 12, 48):
        seen = stream.survey(seen_from(1.0, int(size)))
        crossings = seen.patch[:, PATCH_ENDS] * seen.patch[:, PATCH_PICKS]
        drawn = np.bincount(seen.patch[:, CELL], weights=crossings * seen.share)
        shown = np.unique(seen.patch[:, CELL])
        here = tuple(np.unique(seen.patch[seen.grid[:, 0] == 0, LEVEL]))
        over = drawn[shown] / whole[shown]
        assert over.min() > 1.0 - HIDING * 4 / 27 - 1e-5  # f² (1 - f) is 4/27 at most
        assert over.max() < (1.25 if len(here) > 1 else 1.0) + 1e-5
        levels.add(here)
    assert levels >= {(0,), (0, 1), (1, 2), ()}


def test_surfels_lie_on_the_side_that_is_seen_in_the_colours_of_their_threads() -> None:
    """Warp red, weft green from half its length on: a surfel is red and green by what shows on its side, and black or
    green weft by where it lies."""
    shape, per_cell = (5, 5), (8, 8)
    warp = np.tile(np.array([1, 0, 0], np.float32), (33, 1))
    weft = np.tile(np.array([0, 1, 0], np.float32), (33, 1))
    weft[:16] = 0
    cells = sheet_of_cells(shape, per_cell, repeat_of(named_weave("twill-3/1")), (warp, weft), seed=SEED)
    cells.move(flat(shape, per_cell))
    stream = CellStream(cells)
    camera: Any = frame(flat(shape, per_cell).reshape(-1, 3), width=40, height=40, elevation=70)
    above = rows_of(stream, stream.survey(replace(camera, focal=camera.focal / 3)))
    below: Any = frame(flat(shape, per_cell).reshape(-1, 3), width=40, height=40, elevation=-70)
    under = rows_of(stream, stream.survey(replace(below, focal=below.focal / 3)))
    for rows, up in ((above, 1.0), (under, -1.0)):
        rows = rows[:, rows[RADIUS] > 0]
        assert (np.sign(rows[POSITION + 1]) == up).all()
        assert np.average(rows[NORMAL + 1], weights=rows[RADIUS] ** 2) * up > 0.8
        later = -rows[POSITION + 2] > 16.5 * PITCH
        # The darkest there is, more open than the red beside it.
        assert rows[COLOUR + 1][-rows[POSITION + 2] < 14.5 * PITCH].max() < 1.2 * SURFACE_SHARE
        red, green = rows[COLOUR][later].mean(), rows[COLOUR + 1][later].mean()
        assert (red > 2 * green) if up > 0 else (green > 2 * red)


def test_light_gets_to_surfels_one_by_one_and_along_fibres() -> None:
    """Surfels of a sheet lean to all sides in turn: none tells what light gets to the next. Fibres' pieces do."""
    shape, per_cell = (5, 5), (8, 8)
    grey = np.full((33, 3), 0.5, np.float32)
    cells = sheet_of_cells(shape, per_cell, repeat_of(named_weave("plain")), (grey, grey), seed=SEED)
    cells.move(flat(shape, per_cell))
    stream = CellStream(cells)
    camera: Any = frame(flat(shape, per_cell).reshape(-1, 3), width=40, height=40, elevation=70)
    for source, want in ((stream, False), (CellStream(cells, target=0.0), True)):
        seen = source.survey(replace(camera, focal=camera.focal / 3))
        assert bool((seen.grid[:, 0] > 0).all()) is not want
        blocks = fetched(source.lay(seen, np.flatnonzero(seen.counts).astype(np.int32))[0])
        assert (chain_step(STREAMED, blocks) is not None) is want


def test_an_outline_cuts_surfels_too() -> None:
    shape, per_cell = (3, 3), (6, 4)
    kept = np.tile(np.array([2.5, 6.0], np.float32), (22, 1))
    kept[13:] = 0.0, 99.0
    threads = CellThreads(np.full((22, 3), 0.5, np.float32), kept, np.arange(23, dtype=np.int32))
    cells = CellCloth(shape, per_cell, (repeat_of(named_weave("plain")),), (CellPanel(0, 0, *shape),), threads)
    cells.move(flat(shape, per_cell))
    stream = CellStream(cells)
    camera: Any = frame(flat(shape, per_cell).reshape(-1, 3), width=14, height=14, elevation=89)
    rows = rows_of(stream, stream.survey(replace(camera, focal=camera.focal / 1.5)))
    area, z = rows[RADIUS] ** 2, -rows[POSITION + 2] / PITCH
    assert area[(z < 1.9) | (z > 6.6)].sum() == 0.0
    assert area.sum() / np.median(area[(z > 3) & (z < 5.5)]) == pytest.approx(len(z) * 3.5 / 8, rel=0.1)


def test_patches_of_a_picture_are_each_crossing_once(streamed: CellStream) -> None:
    streamed.target, target = 0.0, streamed.target
    try:
        seen = streamed.survey(seen_from(1.2))
        assert int((seen.patch[:, PATCH_PICKS] * seen.patch[:, PATCH_ENDS]).sum()) == 65 * 65
        assert int(seen.counts.sum()) == all_particles(streamed.cloth).shape[1]
    finally:
        streamed.target = target


def test_only_what_is_in_view_is_made(streamed: CellStream) -> None:
    camera = replace(seen_from(0.02), cx=48.0, cy=48.0)
    seen = streamed.survey(camera)
    assert 0 < int((seen.patch[:, PATCH_PICKS] * seen.patch[:, PATCH_ENDS]).sum()) < 0.1 * 65 * 65
    again = streamed.survey(camera)
    assert (again.counts == seen.counts).all()


def test_levels_are_fewer_and_thicker_fibres() -> None:
    assert levels_of(87, 10, 200) == ((87, 10), (36, 8), (12, 4), (4, 4))
    assert levels_of(6, 2, 200) == ((6, 2), (4, 2))
    assert levels_of(87, 10, 9) == ((9, 10), (4, 4))
    assert levels_of(57, 10, 19, FLOATING) == ((19, 10), (12, 6), (8, 4))


def test_the_density_of_what_is_drawn_is_the_mills_sum() -> None:
    """Threads/cm · tex · (1 + crimp), with crimps of a plain weave of a few per cent."""
    repeat = repeat_of(named_weave("plain"))
    tex = 2 * 12.0 / np.cos(repeat.layout.warp.yarn.ply_helix_angle)
    assert drawn_density(repeat.layout) == pytest.approx(1e-3 * 2 * 20 * tex / 10, rel=0.15)
    assert drawn_density(repeat.layout) > 1e-3 * 2 * 20 * tex / 10


def test_cells_refuse_what_does_not_fit() -> None:
    repeat = repeat_of(named_weave("plain"))
    with pytest.raises(InputError, match="threads"):
        sheet_of_cells((3, 3), (4, 4), repeat, (np.zeros((9, 3)), np.zeros((8, 3))))
    with pytest.raises(InputError, match="without fringe"):
        WeaveRepeat.of(layout_of(named_weave("plain", ends=4, picks=4), fringe=1.0))
    cells = sheet_of_cells((3, 3), (4, 4), repeat, (np.zeros((9, 3)), np.zeros((9, 3))))
    with pytest.raises(InputError, match="points: shape"):
        cells.move(np.zeros((4, 3, 3)))


def test_thick_fibres_are_as_open_as_the_outermost_of_those_that_they_stand_for() -> None:
    """Of the outermost tenth of each level: without it they had half of the openness, and a cloth a tenth less sky. And
    they look out of the cloth, as do those that are seen of many: without it cloth of few had 0.8 of its light."""
    bank, found, upright = bank_of((repeat_of(named_weave("plain"), fibres=2000),)), [], []
    for level in range(bank.levels):
        first, last = (bank.start[(level + k) * bank.templates] for k in (0, 1))
        particle = bank.particle[first:last]
        top = particle[:, COLUMN.offset + 2] + particle[:, COLUMN.radius]
        found.append(float(particle[top > np.quantile(top, 0.9), COLUMN.openness].mean()))
        upright.append(float(particle[particle[:, COLUMN.offset + 2] > 0.0, COLUMN.normal + 2].mean()))
    assert len(found) == 4
    assert (np.diff(upright) > 0.03).all()
    assert upright[-1] > 0.5
    assert max(found) < 1.0
    assert found[1:] == pytest.approx([found[0]] * 3, rel=0.4)
    assert min(found) > 0.95 * found[0]
