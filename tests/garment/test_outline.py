"""What of a garment can meet cloth: pieces of cells along its outline, points that are one; that it is kept apart."""

from itertools import pairwise

import numpy as np
import pytest
from layers import SOFT
from numpy.typing import NDArray

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.garment.pattern.cut import cut
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern, Seam, Side
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.garment.sewn.joined import _turned
from taichi_cloth.garment.sewn.surface import Surface
from taichi_cloth.layers.layer_fields import LayerFields
from taichi_cloth.layers.nearest import EDGES, FACES
from taichi_cloth.layers.outline import MEETS, PIECES, Tables, crossings_of
from taichi_cloth.layers.paths import CELL, EAST, NORTH, POINT
from taichi_cloth.motion.capacity import capacity_of
from taichi_cloth.motion.forces import Forces, SelfContact
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.sheet import LANES, PAD
from taichi_cloth.solvers.verlet import Verlet

SPACING, SIDE, RADIUS = 0.015, 0.12, 0.004
HERE = Flat(np.eye(3), np.zeros(3))


def square(name: str, grain: float) -> Panel:
    ring = SIDE * np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]])
    return Panel(name, tuple(ring[k : k + 2] for k in range(4)), HERE, grain=grain)


def two_squares() -> Garment:
    """Sewn along x = SIDE of the first and x = 0 of the second; their warps at different angles to it."""
    seam = Seam(Side("a", 1), Side("b", 3), alike=False)
    pattern = Pattern("two", (square("a", 0.3), square("b", -0.2)), (seam,))
    return Garment(pattern, cut(pattern, (SPACING, SPACING)), SOFT)


def own(garment: Garment, number: int) -> NDArray:
    """Key points of a panel in its own coordinates (rows, cols, 2), 0 elsewhere."""
    out = np.zeros((*garment.atlas.shape, 2))
    piece = garment.atlas.panels[number]
    out[piece.row : piece.row + piece.shape[0], piece.col : piece.col + piece.shape[1]] = piece.lattice()
    return out


def folded(garment: Garment) -> tuple[NDArray, NDArray]:
    """Positions of key points, the second panel bent round over the first by half a turn; and how far along (rows,
    cols), below 0 on the first panel and above on the second."""
    along, across = np.zeros(garment.atlas.shape), np.zeros(garment.atlas.shape)
    for number in (0, 1):
        mine = garment.atlas.owner() == number
        at = own(garment, number)[mine]
        along[mine], across[mine] = at[:, 0] - (SIDE if number == 0 else 0.0), at[:, 1]
    turn = np.clip(along / RADIUS + np.pi / 2, 0, np.pi)
    over = np.maximum(np.abs(along) - np.pi / 2 * RADIUS, 0)
    x = RADIUS * np.sin(turn) - over
    return np.stack([x, across, RADIUS * (1 - np.cos(turn))], -1), along


def test_pieces_cover_the_panel_and_hang_together() -> None:
    """Of a panel with a round bay and its warp askew: triangles turn one way, cover its area, and are no slivers; an
    edge has two triangles but on the outline, as long as that."""
    angle = np.linspace(0, np.pi, 60)
    bay = np.stack([0.06 + 0.04 * np.cos(angle), 0.12 - 0.05 * np.sin(angle)], -1)
    ring = np.concatenate([[[0, 0], [0.12, 0], [0.12, 0.12]], bay, [[0, 0.12], [0, 0]]])
    panel = Panel("bay", (ring[:3], ring[2:-1], ring[-2:]), HERE, grain=0.4)
    surface = Surface(cut(Pattern("p", (panel,), ()), (SPACING, SPACING)))
    corner = surface.flat[surface.faces]
    u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    assert area.min() > 0.003 * SPACING**2
    assert area.sum() == pytest.approx(panel.area, rel=1e-4)
    edges = np.sort(np.concatenate([surface.faces[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))]), axis=1)
    found, count = np.unique(edges, axis=0, return_counts=True)
    assert count.max() == 2
    border = np.diff(surface.flat[found[count == 1]], axis=1)
    length = np.linalg.norm(np.diff(ring, axis=0), axis=1).sum()
    assert np.linalg.norm(border, axis=2).sum() == pytest.approx(length, rel=1e-3)


def test_points_are_blends_of_the_triangle_they_are_in() -> None:
    """At key points anywhere: each triangle lies in the plane of one of the two of its cell, but for those beside the
    outline one of whose points has become one beyond its half of the cell."""
    garment = two_squares()
    surface, cols = Surface(garment.atlas), garment.atlas.shape[1]
    positions = np.random.default_rng(1).normal(size=(*garment.atlas.shape, 3))
    points = surface.places(positions)
    grid = positions.reshape(-1, 3)
    grid[surface.ghosts] = surface.ghost_blend @ grid
    assert surface.blend.sum(axis=1) == pytest.approx(1)
    a, b, c, d = (grid[surface.cell + k] for k in (0, 1, cols, cols + 1))
    corner = surface.lattice[surface.faces] - np.stack([surface.cell % cols, surface.cell // cols], -1)[:, None]
    below = np.subtract(*corner.mean(axis=1).T) > 0
    ahead = np.where(below[:, None], 1, -1) * (corner[..., 0] - corner[..., 1])
    within = (np.abs(corner - 0.5).max(axis=(1, 2)) < 0.5 + 1e-9) & (ahead.min(axis=1) > -1e-9)
    assert within.mean() > 0.95
    normal = np.where(below[:, None], np.cross(b - a, d - a), np.cross(d - a, c - a))
    off = np.einsum("mkc,mc->mk", points[surface.faces] - a[:, None], normal)
    assert np.abs(off[within]).max() < 1e-6


def test_both_sides_of_a_seam_have_the_same_points() -> None:
    """Wherever key points are: each point of a seam is one of both panels, as far along it on either and in one place,
    none nearer to the next than a twentieth of a cell; and the surface ends nowhere but where panels do."""
    garment = two_squares()
    surface = garment.surface
    points = surface.places(np.random.default_rng(2).normal(size=(*garment.atlas.shape, 3)))
    sewn = np.flatnonzero(np.bincount(surface.same)[surface.same] > 1)
    one, other = sewn[np.argsort(surface.same[sewn], kind="stable")].reshape(-1, 2).T
    assert (surface.panel[one] != surface.panel[other]).all()
    assert np.abs(points[one] - points[other]).max() < 1e-9
    along = []
    for side in (one, other):
        turn = np.where(surface.panel[side] == 0, 0.3, -0.2)
        along.append(-np.sin(turn) * surface.flat[side, 0] + np.cos(turn) * surface.flat[side, 1])
    assert np.abs(along[0] - along[1]).max() < 0.01 * SPACING
    assert np.diff(np.sort(along[0])).min() > 0.05 * SPACING
    assert np.ptp(along[0]) == pytest.approx(SIDE)
    edges = np.concatenate([surface.faces[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))])
    _, first, count = np.unique(np.sort(surface.same[edges], axis=1), axis=0, return_index=True, return_counts=True)
    border = np.diff(surface.flat[edges[first[count == 1]]], axis=1)
    assert np.linalg.norm(border, axis=2).sum() == pytest.approx(6 * SIDE, rel=1e-3)
    u, v = (np.diff(surface.flat[surface.faces[:, [0, k]]], axis=1)[:, 0] for k in (1, 2))
    assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).min() > 0


def test_tables_have_all_triangles_edges_and_points_once() -> None:
    garment = two_squares()
    sheet, outline = garment.sheet(), garment.outline
    tables = Tables(sheet, outline, capacity_of(sheet.padded_shape))
    met = tables.has >> MEETS
    edges = np.sort(np.concatenate([outline.faces[:, [i, j]] for i, j in ((0, 1), (1, 2), (2, 0))]), axis=1)
    whole = ((met & CELL) != 0).sum()
    assert 2 * whole + tables.faces.shape[1] == len(outline.faces)
    assert ((tables.has & PIECES) != 0).sum() + whole == len(np.unique(outline.cell))
    regular = whole + ((met & EAST) != 0).sum() + ((met & NORTH) != 0).sum()
    assert regular + tables.edges.shape[1] == len(np.unique(edges, axis=0))
    assert ((met & POINT) != 0).sum() + tables.points.shape[1] == len(outline.corner)


def test_panels_that_are_sewn_together_do_not_pass_through_each_other() -> None:
    """The second, folded over the first, comes down on it at 3 m/s where it is farthest from the seam; without contact
    it passes through. Momentum stays, but for what the air takes."""
    garment = two_squares()
    sheet = garment.sheet()
    x, along = folded(garment)
    v = np.zeros_like(x)
    v[..., 2] = np.where(along > 0, -3.0 * along / SIDE, 0.0)
    assert crossings_of(garment.outline, x).count == 0
    counts = {}
    for contact in (None, SelfContact(thickness=0.0015)):
        forces = Forces(gravity=(0.0, 0.0, 0.0), self_contact=contact)
        constraints = constraints_for(sheet, forces, outline=garment.outline)
        solver = Verlet(sheet, forces, threads=1, constraints=constraints)
        simulation = Simulation(sheet, solver, forces=forces, positions=x, velocities=v)
        counts[contact is not None] = []
        for _ in range(3):
            simulation.step()
            counts[contact is not None].append(crossings_of(garment.outline, simulation.positions).count)
    assert max(counts[False]) > 20
    assert counts[True] == [0, 0, 0]
    lower = (along < -0.05) & sheet.present
    assert simulation.positions[lower][:, 2].mean() < -1e-4, "the lower one was struck"


def test_what_is_not_held_keeps_its_momentum() -> None:
    """As in the last test, and each key point thrown about at 2 m/s besides: held in the room round their paths they
    are driven along these, and all is flung to one side."""
    garment = two_squares()
    mass = garment.sheet().mass[..., None]
    x, along = folded(garment)
    v = np.random.default_rng(0).normal(0.0, 2.0, x.shape)
    v -= (mass * v).sum(axis=(0, 1)) / mass.sum()
    v[..., 2] -= np.where(along > 0, 3.0 * along / SIDE, 0.0)
    was = (mass * v).sum(axis=(0, 1)) / mass.sum()
    changed = {}
    for held in (True, False):
        forces = Forces(gravity=(0.0, 0.0, 0.0), self_contact=SelfContact(thickness=0.0015, held=held))
        simulation = garment.simulation(forces, x, air_damping=0.0, speeds=v.astype(np.float32))
        simulation.step()
        now = simulation.sheet.steps(simulation.state) / simulation.solver.step
        changed[held] = float(np.linalg.norm((mass * now).sum(axis=(0, 1)) / mass.sum() - was))
        assert crossings_of(garment.outline, simulation.positions).count == 0
    assert changed[True] > 0.1
    assert changed[False] < 0.5 * changed[True]


def threads_of(faces: NDArray) -> set[tuple[int, int]]:
    """Ends of the edges of triangles (m, 3), the lower number first."""
    return {(min(a, b), max(a, b)) for face in faces.tolist() for a, b in pairwise((*face, face[0]))}


def test_what_is_beside_pieces_beyond_their_cells_is_near() -> None:
    """Corners that became one with others lie in the plane of no triangle of their cell: each point beside such a
    piece, and each two edges of such, have to be among the near pairs, of its own cell as of others."""
    garment = two_squares()
    sheet, outline = garment.sheet(), garment.outline
    forces = Forces(gravity=(0.0, 0.0, 0.0), self_contact=SelfContact(thickness=0.0015))
    solver = Verlet(sheet, forces, threads=1, constraints=constraints_for(sheet, forces, outline=outline))
    simulation = Simulation(sheet, solver, forces=forces, positions=folded(garment)[0])
    simulation.step()
    fields: LayerFields = solver.constraints[0].fields  # pyright: ignore[reportAttributeAccessIssue]
    pairs, size = fields.near.pairs, fields.near.tangle.shape[0]
    number, own = np.full(fields.blends.of.shape[0], -1), outline.corner >= 0
    row, column = np.divmod(outline.corner[own], sheet.shape[1])
    number[(row + PAD) * sheet.width + column] = np.flatnonzero(own)
    number[size + np.arange((~own).sum())] = np.flatnonzero(~own)
    known = set()
    for kind, begin in ((FACES, 0), (EDGES, pairs.rooms[0] + LANES)):
        some = np.s_[begin : begin + pairs.count[kind]]
        corners = np.stack([np.asarray(corner.to_numpy())[some] for corner in pairs.point], axis=1).astype(int)
        at = number[corners].tolist()
        known |= {frozenset((frozenset(one[:kind]), frozenset(one[kind:]))) for one in at}
    points, beyond = outline.places(simulation.positions), outline.faces[~outline.part]
    edges = np.array(sorted(threads_of(beyond) - threads_of(outline.faces[outline.part])))
    expected = 0
    for one, other in ((np.arange(len(points))[:, None], beyond), (edges, edges)):
        corners = one[:, None, :, None], other[None, :, None]
        near = np.linalg.norm(points[corners[0]] - points[corners[1]], axis=-1).min(axis=(2, 3)) < 0.25 * SPACING
        near &= (outline.same[corners[0]] != outline.same[corners[1]]).all(axis=(2, 3))
        for a, b in np.argwhere(near):
            expected += 1
            assert frozenset((frozenset(one[a].tolist()), frozenset(other[b].tolist()))) in known
    assert expected > 50


def test_two_thin_triangles_of_the_same_corners_keep_their_diagonal():
    """As where a dart's point is sewn together: turned, each would have a corner twice."""
    place = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 1e-5], [0.5, -1.0]])
    twice = np.array([[0, 1, 2], [1, 0, 2]])
    assert _turned(twice, np.arange(2), place, 1e-3)[0].tolist() == twice.tolist()
    thin = np.array([[0, 1, 2], [1, 0, 3]])
    turned = _turned(thin, np.arange(2), place, 1e-3)[0]
    assert sorted(map(sorted, turned.tolist())) == [[0, 2, 3], [1, 2, 3]]
