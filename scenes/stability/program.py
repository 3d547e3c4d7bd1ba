"""The rest of the program at its edges: twist, weaves, patterns, bodies, cameras, pictures; each works or says no."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.body.colliders.grid import part_grids
from taichi_cloth.body.figure.build import built_in_body
from taichi_cloth.body.files.meshfile import body_from_mesh
from taichi_cloth.fabric.fabric import build_fabric
from taichi_cloth.fabric.pose import pose_points
from taichi_cloth.garment.pattern.cut import cut
from taichi_cloth.garment.pattern.pattern import Flat, Panel, Pattern, Seam, Side
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.motion.forces import Forces
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.sheet.materials import named_material
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import Springs, calibrate
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.yarn.twist import transient_twist, zone_twist

from ...render.data.camera import look_at
from ...render.splat.splat import Splatter
from ..measure.picture import Swatch
from ..models.build import build
from ..prepare.drawing import require_picture
from ..prepare.weave_layout import prepare_fabric
from ..scene.load import load_scene
from .limit import found_limit

__all__ = ["program_cases"]

F64 = NDArray[np.float64]
TIMES = np.linspace(0.0, 2.0, 5)


def _finite(*values: object) -> None:
    assert all(np.isfinite(np.asarray(v, np.float64)).all() for v in values), "not finite"


def _twist(b: float, speed: float, spin: float = 60.0) -> str:
    options = {"a_m": 0.3, "b_m": b, "speed_m_s": speed, "spin_turns_s": spin}
    exact = np.array(transient_twist(TIMES, **options))
    found = zone_twist(TIMES, a_m=0.3, b_m=b, speed_m_s=speed, spin_turns_s=spin)
    off = np.abs(np.array([found.twist_a, found.twist_b]) - exact).max()
    _finite(exact, off)
    assert off <= 1e-3 * max(np.abs(exact).max(), 1e-30), f"off by {off:g} turns/m"
    return f"scheme within {off:.2g} turns/m of the closed form"


def _fabric(*changes: str) -> str:
    scene = load_scene("swatch", list(changes))
    layout = prepare_fabric(scene).layout
    cloud = build_fabric(layout).cloud(pose_points(layout))
    _finite(cloud.position, cloud.radius, cloud.tangent)
    return f"{len(cloud.position):,} particles"


def _yarn() -> str:
    model = build(load_scene("yarn", ["yarn.twist_per_m=0", "yarn.singles_twist_per_m=0", "yarn.length_mm=3"]))
    (panel,) = model.panels()
    _finite(panel.bounds)
    return f"{len(panel.particles):,} particles"


def _slivers() -> str:
    """A sheet whose outer cells are a millionth cloth, let go for a second."""
    material, shares = named_material("cotton-shirting").linear, np.ones((11, 11))
    shares[0], shares[:, -1] = 1e-6, 1e-3
    sheet = Sheet.of_cells(shares, material=material, springs=calibrate(material, spacing_x=0.02, spacing_y=0.02))
    simulation = Simulation(sheet, Verlet(sheet, Forces()), forces=Forces(), positions=sheet.flat())
    for _ in range(60):
        simulation.step()
    _finite(simulation.positions)
    stretch = max(float(part.max()) for part in sheet.stretch(simulation.positions))
    assert stretch < 0.1, f"stretched by {100 * stretch:.0f} %"
    return f"largest stretch {100 * stretch:.2g} %"


def _panel(*corners: tuple[float, float]) -> Panel:
    ring = np.array([*corners, corners[0]])
    return Panel("p", tuple(ring[k : k + 2] for k in range(len(corners))), Flat(np.eye(3), np.zeros(3)))


def _needle() -> str:
    """A panel 0.5 m long that ends in a point of 2 degrees."""
    atlas = cut(Pattern("needle", (_panel((0, 0), (0.5, 0.0), (0.0, 0.0175)),), ()), (0.01, 0.01))
    _finite(atlas.cells)
    return f"{atlas.key_points} key points"


def _dart() -> str:
    """A seam whose two edges meet in a point, moved for half a second."""
    panel = _panel((0, 0), (0.2, 0), (0.2, 0.2), (0.11, 0.2), (0.1, 0.05), (0.09, 0.2), (0, 0.2))
    pattern = Pattern("dart", (panel,), (Seam(Side("p", 3), Side("p", 4)),))
    garment = Garment(pattern, cut(pattern, (0.01, 0.01)), named_material("cotton-shirting").linear)
    simulation = garment.simulation(Forces(gravity=(0.0, 0.0, 0.0)), garment.atlas.start(), frame_rate=60.0)
    for _ in range(30):
        simulation.step()
    _finite(simulation.positions[simulation.sheet.present])
    return f"{garment.atlas.key_points} key points, sewn for 0.5 s"


def _doubled_body() -> str:
    """Every triangle with corners of its own, so that all vertices coincide with others."""
    body = built_in_body(gender="female")
    vertices = body.vertices[body.faces].reshape(-1, 3)
    made = body_from_mesh(vertices, np.arange(len(vertices)).reshape(-1, 3))
    _finite(made.vertices)
    return f"{len(vertices):,} vertices merged to {len(made.vertices):,}"


def _flat_triangles() -> str:
    """A closed box one corner of which stands there twice, with a triangle of no area between."""
    v = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    v, faces = np.concatenate([v, v[:1]]), np.concatenate([faces, [[0, 8, 1]]])
    (grid,) = part_grids(v, faces, np.zeros(len(faces), int), [("box", 0)], spacing=0.05)
    points = np.random.Generator(np.random.Philox(key=2)).uniform(-0.03, 1.03, (2000, 3))
    outside = np.maximum(np.maximum(-points, points - 1), 0.0)
    inside = -np.minimum(points, 1 - points).min(axis=1)
    exact = np.where((outside > 0).any(axis=1), np.linalg.norm(outside, axis=1), inside)
    off = np.abs(grid.at(points)[0] - exact)[np.abs(exact) < grid.spacing].max()
    _finite(grid.values)
    assert off < grid.spacing / 2, f"off by {off:g} m"
    return f"within {1e3 * off:.2g} mm of the surface in a grid of {1e3 * grid.spacing:g} mm"


def _inside_the_cloth() -> str:
    """From a crossing of the swatch, along the cloth."""
    swatch = Swatch("yarn.fibres=2")
    middle = swatch.particles.position[len(swatch.particles) // 2].astype(np.float64)
    camera = look_at(middle, middle + np.array([1e-3, 0.0, 1e-4]), width=96, height=64, near=1e-5)
    splatter = Splatter(96, 64)
    swatch.drawing(splatter, camera)()
    _finite(splatter.linear())
    return f"coverage {splatter.linear()[..., 3].mean():.2f}"


def _picture(width: int, height: int) -> str:
    require_picture((width, height))
    swatch = Swatch("yarn.fibres=1")
    splatter = Splatter(width, height)
    swatch.drawing(splatter, swatch.camera((width, height)))()
    _finite(splatter.linear())
    return "drawn"


def _allowed(width: int, height: int) -> str:
    """Whether there is memory for such a picture; it is not drawn, as that takes minutes."""
    require_picture((width, height))
    return "allowed: there is memory for it here; not drawn"


def _springs() -> str:
    Springs(
        structural_x=1.0,
        structural_y=1.0,
        diagonal=1.0,
        second_x=0.0,
        second_y=0.0,
        hinge_x=0.0,
        hinge_y=0.0,
        spacing_x=0.0,
        spacing_y=0.01,
        law="hinge",
    )
    return "made"


def _limit(points: int, pulled: float = 0.0, **changes: float) -> str:
    """pulled: strain both ways of a sheet whose whole border is held there."""
    material = replace(named_material("cotton-shirting").linear, **changes)
    held = np.zeros((points, points), bool)
    held[0] = True
    if pulled:
        held[[0, -1]] = held[:, [0, -1]] = True
    springs = calibrate(material, spacing_x=0.02, spacing_y=0.02)
    sheet = Sheet.rectangle(points, points, material=material, springs=springs, pinned=held)
    shape = (1 + pulled) * sheet.flat()
    found, said = found_limit(sheet, shape)
    assert abs(found / said - 1) < 0.02, f"found {found:.4g} s, predicted {said:.4g} s"
    solver = Verlet(sheet, Forces())
    usual = Simulation(sheet, solver, forces=Forces(), positions=shape, pins=(Pins(held),)).solver.step
    assert usual < found, f"the automatic step of {usual:.4g} s is beyond {found:.4g} s"
    return f"found {1e6 * found:.4g} µs, predicted {1e6 * said:.4g} µs; the automatic step is {1e6 * usual:.4g} µs"


def program_cases(quick: bool = False) -> list[tuple[str, str, Callable[[], str]]]:
    """Part, case and what it runs. quick: without those that take seconds."""
    cases: list[tuple[str, str, Callable[[], str]]] = [
        ("twist", "a = b", partial(_twist, 0.3, 0.5)),
        ("twist", "V = 1e-12 m/s", partial(_twist, 0.2, 1e-12)),
        ("twist", "V = 0", partial(_twist, 0.2, 0.0)),
        ("twist", "V = −0.5 m/s", partial(_twist, 0.2, -0.5)),
        ("twist", "no spin", partial(_twist, 0.2, 0.5, 0.0)),
        ("yarn", "no twist", _yarn),
        ("weave", "1 × 1", partial(_fabric, "weave.ends=1", "weave.picks=1")),
        ("weave", "one end, 20 picks", partial(_fabric, "weave.ends=1", "weave.picks=20")),
        ("weave", "20 ends, one pick", partial(_fabric, "weave.ends=20", "weave.picks=1")),
        ("springs", "no rest length", _springs),
        ("panel", "a needle of 2°", _needle),
        ("panel", "no width", lambda: str(cut(Pattern("n", (_panel((0, 0), (1, 0), (0.5, 0)),), ()), (0.01, 0.01)))),
        ("body", "a corner twice, a triangle of no area", _flat_triangles),
        ("picture", "16384 × 16384", partial(_allowed, 16384, 16384)),
        ("picture", "0 × 0", partial(_picture, 0, 0)),
    ]
    if not quick:
        cases += [
            ("Verlet's limit", "cotton, 12 × 12", partial(_limit, 12)),
            ("Verlet's limit", "no shear", partial(_limit, 12, shear=0.0)),
            ("Verlet's limit", "stiff bending", partial(_limit, 12, bending_warp=1e-3, bending_weft=1e-3)),
            ("Verlet's limit", "pulled by half", partial(_limit, 12, pulled=0.5)),
            ("Verlet's limit", "damped along the springs", partial(_limit, 12, fibre_damping=2e-4)),
            ("sheet", "slivers of 1e-6", _slivers),
            ("seam", "edges that meet in a point", _dart),
            ("body", "every vertex twice and more", _doubled_body),
            ("camera", "inside the cloth", _inside_the_cloth),
            ("picture", "1 × 1", partial(_picture, 1, 1)),
            ("picture", "16384 × 1", partial(_picture, 16384, 1)),
        ]
    return cases
