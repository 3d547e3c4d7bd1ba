"""Layers that never pass through each other: patches that cannot meet themselves, blows, retries, and that all that
comes near is known after searches of some key points."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import taichi as ti
from layers import ROWS, SPACING, THICKNESS, layers, sheet_of, triangles
from numpy.typing import NDArray

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.crossings.crossings import Crossings, find_crossings
from taichi_cloth.ground.arrays import F32x2
from taichi_cloth.ground.errors import InputError
from taichi_cloth.layers.layer_contact import HALVINGS, LayerContact, LayerFields
from taichi_cloth.layers.nearest import FACES
from taichi_cloth.layers.patches import slack_of
from taichi_cloth.layers.tangles import Tangles
from taichi_cloth.layers.tree import TOP, levels_of
from taichi_cloth.motion.forces import Forces, SelfContact
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.sheet import PAD, Sheet
from taichi_cloth.solvers.verlet import Verlet


@ti.kernel
def slacks(boxes: F32x2, out: F32x2):
    for k in range(boxes.shape[0]):
        s = [(boxes[k, 3 * m], boxes[k, 3 * m + 1], boxes[k, 3 * m + 2]) for m in ti.static(range(4))]
        out[k, 0] = slack_of(s[0], s[1], s[2], s[3])


def slack(patches: NDArray) -> NDArray:
    """Of patches (n, rows, cols, 3), threads of length 1."""
    s, t = np.diff(patches, axis=2), np.diff(patches, axis=1)
    boxes = [pick(v, axis=(1, 2)) for v in (s, t) for pick in (np.min, np.max)]
    out = np.zeros((len(patches), 1), np.float32)
    slacks(np.concatenate(boxes, axis=1).astype(np.float32), out)
    return out[:, 0]


def faces(rows: int, cols: int) -> NDArray:
    a = (np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)).ravel()
    return np.concatenate([np.stack([a, a + 1, a + cols + 1], -1), np.stack([a, a + cols + 1, a + cols], -1)])


def bent(angle: float, rows: int = 5, cols: int = 9) -> NDArray:
    """A patch whose rows turn by an angle from the first thread to the last."""
    turn = np.linspace(-0.5, 0.5, cols - 1) * angle
    x, z = (np.concatenate([[0.0], np.cumsum(f(turn))]) for f in (np.cos, np.sin))
    out = np.zeros((1, rows, cols, 3))
    out[..., 0], out[..., 1], out[..., 2] = x, np.arange(rows)[:, None], z
    return out


def test_slack_of_simple_patches() -> None:
    """Flat: half a thread's length. Bent by 90°: of the box of its threads. Bent over, or folded flat: none."""
    assert slack(bent(0.0)) == pytest.approx(0.5, abs=1e-6)
    low, high = np.cos(np.pi / 4), np.sin(np.pi / 4)  # its threads are from (low, 0, −high) to (1, 0, high)
    assert low < 1 < 1 + high
    assert slack(bent(np.pi / 2)) == pytest.approx(low / 2, abs=1e-3)
    assert slack(bent(np.pi))[0] < 1e-6
    assert slack(bent(2 * np.pi))[0] < 0


def test_a_patch_with_slack_never_meets_itself() -> None:
    """300 patches, bent and crumpled at random, each key point then moved so that threads turn by almost their slack:
    none of those that have some meets itself, by the exact test; of those that have none some do."""
    rng = np.random.default_rng(2)
    patches = np.concatenate([bent(a) for a in rng.uniform(0, 3.5, 300)])
    patches += 0.35 * rng.uniform(size=(300, 1, 1, 1)) * rng.normal(size=patches.shape)
    have = slack(patches)
    shift = rng.normal(size=patches.shape)
    shift *= (0.499 * np.maximum(have, 0) / np.linalg.norm(shift, axis=-1).max(axis=(1, 2)))[:, None, None, None]
    meet = np.array([find_crossings(p.reshape(-1, 3), faces(5, 9)).count > 0 for p in patches + shift])
    assert 60 < (have > 0).sum() < 240
    assert not meet[have > 0].any()
    assert meet[have <= 0].sum() > 20


def test_levels_of_blocks() -> None:
    levels = levels_of(83, 80)
    assert levels[:4].tolist() == [[0, 83, 80], [6640, 42, 40], [6640 + 1680, 21, 20], [6640 + 1680 + 424, 11, 10]]
    assert levels[4:].max() == 0
    assert levels[3, 1] * levels[3, 2] <= TOP


@cache
def thrown(speed: float) -> tuple[Sheet, list[NDArray], Any]:
    """Two panels 6 mm apart, the upper 3 mm off to a side, thrown at the lower at `speed` [m/s]: four frames."""
    sheet, x, v = layers(speed)
    forces = Forces(gravity=(0.0, 0.0, 0.0), self_contact=SelfContact(thickness=THICKNESS))
    solver = Verlet(sheet, forces, threads=2, constraints=constraints_for(sheet, forces))  # shares its kernel
    simulation = Simulation(sheet, solver, forces=forces, positions=x, velocities=v)
    paths = []
    for _ in range(4):
        simulation.step()
        paths.append(simulation.positions)
    return sheet, paths, solver.constraints[0]


@pytest.mark.parametrize("speed", [2.0, 20.0])
def test_nothing_passes_through_at_any_speed(speed: float) -> None:
    """At 20 m/s they come 2.6 mm nearer in a substep, and are kept 3 mm apart: they still do not change sides, but
    what hangs over the lower one's rim is past it by then."""
    sheet, paths, contact = thrown(speed)
    assert [find_crossings(x.reshape(-1, 3), sheet.triangles).count for x in paths] == [0, 0, 0, 0]
    assert not contact.let_off, "it is proven for every interval between"
    assert paths[-1][0:16, :, 1].mean() < -1e-3, "the lower one was struck"
    above = paths[-1][20:34, 1:-1, 1].mean() > paths[-1][2:14, 1:-1, 1].mean()
    assert above or speed > 2, "and is below still"


def test_a_frame_that_is_not_proven_is_taken_again_more_carefully(monkeypatch: pytest.MonkeyPatch) -> None:
    """Until it is, or until no more care can be taken: then the next frame looks for what passes through, only beside
    cells that were let off if all of them are known."""
    sheet = thrown(2.0)[0]
    one = LayerContact(sheet, SelfContact(thickness=THICKNESS))
    cells = np.zeros(sheet.padded_shape, np.int32)
    cells[PAD + 3, 2] = 1
    room = SimpleNamespace(overflow={None: 0}, tangle=SimpleNamespace(to_numpy=cells.ravel))
    contacts = SimpleNamespace(overflow={None: 0}, blended=room)
    certificate = SimpleNamespace(let_off={None: 3})
    fields = SimpleNamespace(unproven={None: 1}, search=room, near=room, contacts=contacts, certificate=certificate)
    monkeypatch.setattr(LayerContact, "fields", fields)
    assert [one.again() for _ in range(HALVINGS + 1)] == [True] * HALVINGS + [False]
    assert one.let_off == 4
    assert one._open is None, "key points had left their room: all of it"
    fields.unproven[None], certificate.let_off[None] = 0, 0
    assert not one.again()
    assert one.let_off == 0
    corners = (np.array([[3], [4]]) * sheet.shape[1] + [2, 3]).ravel()
    np.testing.assert_array_equal(one._open, np.isin(sheet.triangles, corners).any(axis=1))
    room.overflow[None] = 7
    assert [one.again() for _ in range(HALVINGS)] == [True] * HALVINGS
    with pytest.raises(InputError, match="no room for 7 cells"):
        one.again()


def test_cloth_that_flies_apart_is_left_to_the_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    """It has no room for what it meets, as on steps that are too long: the solver sees it and takes shorter ones."""
    sheet = sheet_of(1)
    one = LayerContact(sheet, SelfContact(thickness=THICKNESS))
    monkeypatch.setattr(LayerContact, "_full", lambda _: "no room")
    fields = SimpleNamespace(unproven={None: 0}, certificate=SimpleNamespace(pushed={None: 0}))
    monkeypatch.setattr(LayerContact, "fields", fields)
    whole, apart = sheet.state(sheet.flat()), sheet.state(3 * sheet.flat())
    one.end(whole)
    assert one.again(), "more carefully"
    one.end(apart)
    assert not one.again()
    assert np.isfinite(whole.values).all()
    assert np.isnan(apart.values[:3]).all()


def test_a_start_that_passes_through_itself_is_untangled(monkeypatch: pytest.MonkeyPatch) -> None:
    """The upper panel hangs through the lower: it comes apart within half a second, without a blow, and then stays so.
    What is tangled meanwhile is that alone: no more triangles pass through others than at the start. All of the cloth
    is asked what it meets once; that tangles alone are asked from then on finds the same."""
    find, asked = Tangles.find, list[float]()

    def both(tangles: Tangles, positions: NDArray, among: NDArray | None = None) -> Crossings:
        found, whole = find(tangles, positions, among), find(tangles, positions)
        asked.append(1.0 if among is None else among.mean())
        for name in ("pairs", "places", "edges", "faces", "at", "of"):
            np.testing.assert_array_equal(getattr(found, name), getattr(whole, name))
        return found

    monkeypatch.setattr(Tangles, "find", both)
    sheet = thrown(2.0)[0]
    x = sheet.flat()[..., [0, 2, 1]]
    upper = np.arange(ROWS) >= 18
    x[upper] += [0.003, 0.0, 0.004 - 18 * SPACING]
    middle = x[upper].mean(axis=(0, 1))
    away = ((x[upper] - middle)[..., [0, 2]] ** 2).sum(axis=-1)
    x[upper, :, 1] = 0.004 - 0.008 * np.exp(-away / 0.02**2)
    forces = Forces(gravity=(0.0, 0.0, 0.0), self_contact=SelfContact(thickness=THICKNESS))
    solver = Verlet(sheet, forces, threads=2, constraints=constraints_for(sheet, forces))
    simulation = Simulation(sheet, solver, forces=forces, positions=x)
    counts = [find_crossings(x.reshape(-1, 3), sheet.triangles).count]
    for _ in range(30):
        simulation.step()
        counts.append(find_crossings(simulation.positions.reshape(-1, 3), sheet.triangles).count)
    assert counts[0] > 20
    assert max(counts) <= counts[0] + 4
    assert counts[counts.index(0) :] == [0] * (len(counts) - counts.index(0))
    assert len(asked) > 2
    assert asked[0] == 1
    assert max(asked[1:]) < 0.5
    assert simulation.positions[20:34, 1:-1, 1].mean() > simulation.positions[2:14, 1:-1, 1].mean() + 1e-3
    assert max(part.max() for part in sheet.stretch(simulation.positions)) < 0.02


def from_faces(points: NDArray, faces: NDArray) -> NDArray:
    """(points, faces) distances of points (n, 3) from triangles (m, 3, 3), by the nearest of places of a fine grid on
    each: at most too large."""
    u, v = (g.ravel() for g in np.meshgrid(*(np.linspace(0, 1, 13),) * 2))
    u, v = u[u + v <= 1 + 1e-9], v[u + v <= 1 + 1e-9]
    weights = np.stack([1 - u - v, u, v])  # (3, places)
    places = np.einsum("cp,mcx->mpx", weights, faces)
    best = np.full((len(points), len(faces)), np.inf)
    for k in range(places.shape[1]):
        best = np.minimum(best, np.linalg.norm(points[:, None] - places[None, :, k], axis=-1))
    return best


def listed(fields: LayerFields, sheet: Sheet) -> set[tuple[int, ...]]:
    """The point and the corners of the face of each near pair, key points numbered row by row."""
    pairs, width = fields.near.pairs, sheet.width
    at = np.stack([corner.to_numpy()[: pairs.count[FACES]] for corner in pairs.point], axis=1)
    number = (at // width - PAD) * sheet.shape[1] + at % width
    return {tuple(int(n) for n in row) for row in number}


@pytest.mark.parametrize("speed", [2.0, 20.0])
def test_what_comes_near_is_listed_after_searches_of_some(speed: float) -> None:
    """Two panels thrown at each other. Paths of what is not listed stay further apart than the reach: so what is nearer
    than that at the end of a frame, less what it is off its path, has to be among the near pairs."""
    sheet, x, v = layers(speed)
    forces = Forces(gravity=(0.0, 0.0, 0.0), self_contact=SelfContact(thickness=THICKNESS))
    solver = Verlet(sheet, forces, threads=2, constraints=constraints_for(sheet, forces))
    simulation = Simulation(sheet, solver, forces=forces, positions=x, velocities=v)
    fields: LayerFields = solver.constraints[0].fields  # pyright: ignore[reportAttributeAccessIssue]
    corners, cols = triangles(sheet), sheet.shape[1]
    upper = corners[:, 0] >= 18 * cols
    renewed = near = 0
    for _ in range(6):
        simulation.step()
        renewed += fields.renewals[None]
        off = np.linalg.norm([a.to_numpy()[: sheet.width * sheet.padded_shape[0]] for a in fields.paths.off], axis=0)
        off = off.reshape(sheet.padded_shape)[PAD:-PAD, : sheet.shape[1]].ravel()
        y, known = simulation.positions.reshape(-1, 3).astype(float), listed(fields, sheet)
        for above in (True, False):
            points = np.flatnonzero(sheet.present.ravel())
            points = points[(points >= 18 * cols) != above]
            others = corners[upper == above]
            closest = from_faces(y[points], y[others])
            sure = fields.reach[None] - off[points][:, None] - off[others].max(axis=1)
            for p, f in np.argwhere(closest < sure - 1e-6):
                near += 1
                assert (int(points[p]), *map(int, others[f])) in known
    assert renewed > 3
    assert near > 100


@pytest.mark.parametrize("nested", [False, True])
def test_bent_layers_are_kept_apart_by_the_thickness_of_the_smooth_cloth_through_them(nested: bool) -> None:
    """Arcs of 60 mm through key points 10 mm apart stand 10²/(8 · 60) mm out of their chords: back to back they are
    kept apart by twice that more than the thickness, one within the other, where both stand out alike, by no more."""
    thickness, radius, gap = 3e-4, 0.06, 8e-4
    sheet, x, _ = layers(0.0)
    for panel, upper in ((slice(0, 17), False), (slice(18, None), True)):
        own = radius + (gap if upper and nested else 0.0)
        arc = (x[panel, :, 2] - x[panel, 0, 2].mean() + 0.002 * upper) / own
        y = own * np.cos(arc) - radius
        x[panel, :, 1], x[panel, :, 2] = gap - y if upper and not nested else y, own * np.sin(arc)
    forces = Forces(gravity=(0.0, 0.0, 0.0), self_contact=SelfContact(thickness=thickness))
    solver = Verlet(sheet, forces, threads=2, constraints=constraints_for(sheet, forces))
    simulation = Simulation(sheet, solver, forces=forces, positions=x)
    simulation.step()
    pairs = solver.constraints[0].fields.near.pairs  # pyright: ignore[reportAttributeAccessIssue]
    count = pairs.count[FACES]
    panel = [(corner.to_numpy()[:count] // sheet.width - PAD) >= 18 for corner in pairs.point[:2]]
    kept = pairs.kept.to_numpy()[:count][panel[0] != panel[1]]
    assert len(kept) > 20
    if nested:
        assert np.median(kept) == pytest.approx(thickness, rel=0.05)
    else:
        assert kept.max() == pytest.approx(thickness + 2 * SPACING**2 / (8 * radius), rel=0.05)
