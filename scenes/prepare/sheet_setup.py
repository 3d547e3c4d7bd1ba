"""From a scene's words to a sheet in motion: material, pins, forces, solver, and where it starts."""

from dataclasses import replace
from math import pi, radians
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import j0

from taichi_cloth.constraints.constraints_for import constraints_for
from taichi_cloth.ground.errors import InputError
from taichi_cloth.mechanics.presets import PRESET_KEYS, WITHIN, preset_properties
from taichi_cloth.mechanics.properties import BANDS
from taichi_cloth.mechanics.quantity import Quantity
from taichi_cloth.motion.forces import Forces, Plane, SelfContact, Sphere, StrainLimit, Wind
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.motion.solver import Solver
from taichi_cloth.sheet.materials import Material, named_material
from taichi_cloth.sheet.pins import Pins
from taichi_cloth.sheet.sheet import Sheet
from taichi_cloth.sheet.springs import calibrate
from taichi_cloth.solvers.choice import Choice, choose
from taichi_cloth.solvers.named import named_solver

from ..scene.cloth_schema import BodyPinSection, ClothSection, ForcesSection, PinsSection, SolverSection
from ..scene.garment_schema import GarmentSection
from ..scene.schema import FabricSection, Scene
from .construction import fabric_properties, own_material
from .gaps import Gap, SheetGaps, gaps_of

if TYPE_CHECKING:  # only a scene with a body loads it
    from .body_setup import Standing

__all__ = [
    "choice_of",
    "forces_of",
    "material_of",
    "moved_by",
    "sheet_of",
    "sheet_simulation",
    "solver_of",
    "standing_in",
    "start_of",
    "woven_scene",
]

F64 = NDArray[np.float64]
UNITS = {  # a key of cloth.properties: the field of Material, and its unit in SI
    "tensile_warp_n_per_m": ("tensile_warp", 1.0),
    "tensile_weft_n_per_m": ("tensile_weft", 1.0),
    "drawn_warp_n_per_m": ("drawn_warp", 1.0),
    "drawn_weft_n_per_m": ("drawn_weft", 1.0),
    "crimp_warp_percent": ("crimp_warp", 1e-2),
    "crimp_weft_percent": ("crimp_weft", 1e-2),
    "shear_n_per_m": ("shear", 1.0),
    "bending_warp_un_m": ("bending_warp", 1e-6),
    "bending_weft_un_m": ("bending_weft", 1e-6),
    "couple_warp_mn": ("couple_warp", 0.5e-3),
    "couple_weft_mn": ("couple_weft", 0.5e-3),
    "torsion_un_m": ("torsion", 1e-6),
    "shear_hysteresis_n_per_m": ("shear_friction", 0.5),
    "locking_angle_deg": ("locking", pi / 180),
    "density_g_per_m2": ("density", 1e-3),
    "air_damping_per_s": ("air_damping", 1.0),
    "fibre_damping_ms": ("fibre_damping", 1e-3),
}


def woven_scene(scene: Scene) -> Scene:
    """The fabric of a moving cloth as a scene of its own: as many threads as the sheet has, as far apart."""
    cloth = scene.cloth
    assert cloth is not None
    assert scene.weave is not None
    k = cloth.threads_per_key_point
    ends, picks = ((n - 1) * k + 1 for n in (cloth.columns, cloth.rows))
    per_cm = {"ends_per_cm": 0.01 * (ends - 1) / cloth.width_m, "picks_per_cm": 0.01 * (picks - 1) / cloth.length_m}
    return scene.model_copy(
        update={
            "weave": scene.weave.model_copy(update={"ends": ends, "picks": picks}),
            "fabric": (scene.fabric or FabricSection()).model_copy(update=per_cm),
        }
    )


def material_of(
    cloth: ClothSection | GarmentSection, solver: SolverSection | None = None, own: Material | None = None
) -> Material:
    """What the cloth is woven of, or the preset, with what the scene changes. Threads whose stiffness a scene names are
    linear unless it says from when on they get stiffer; where it names Verlet, which has springs of one stiffness, all
    are. own: `own_material` of the scene. Raises InputError."""
    given = {UNITS[k][0]: UNITS[k][1] * v for k, v in cloth.properties.numbers.items()}
    preset = named_material(cloth.material or "cotton-shirting") if own is None else own
    for family in ("warp", "weft"):
        if f"tensile_{family}" in given or (solver is not None and solver.name == "verlet"):
            preset = replace(preset, **{f"drawn_{family}": 0.0, f"crimp_{family}": 0.0})
    return replace(preset, **given)


def moved_by(scene: Scene) -> dict[str, Quantity]:
    """What the cloth of a scene moves by, each number with who says so, by the keys of `mechanics.properties`. Raises
    InputError."""
    section = scene.cloth or scene.garment
    assert section is not None
    own, properties = own_material(scene), fabric_properties(scene)
    material = material_of(section, scene.solver, own)
    stated = {UNITS[key][0]: key for key in section.properties.numbers}
    found = {}
    for key, (field, unit) in PRESET_KEYS.items():
        value = unit * getattr(material, field)
        name, printed, _ = BANDS[key]
        if field in stated:
            found[key] = Quantity(name, value, printed, "stated", f"properties.{stated[field]}")
        elif value > 0 or not field.startswith(("drawn", "crimp")):  # 0: threads stay as stiff as they are at first
            preset = Quantity(name, value, printed, "preset", f"preset {scene.material}")
            found[key] = preset if properties is None else properties[key]
    beside = [one for keys in WITHIN.values() for one in keys.items() if getattr(material, one[1][0]) > 0]
    for key, (field, unit) in beside:
        name, printed, _ = BANDS[key]
        if field in stated:
            value = unit * getattr(material, field)
            found[key] = Quantity(name, value, printed, "stated", f"properties.{stated[field]}")
        else:
            found[key] = (properties or preset_properties(scene.material))[key]
    return found


def sheet_of(cloth: ClothSection, solver: SolverSection | None = None, own: Material | None = None) -> Sheet:
    """The sheet with its springs and pins. solver, own: see `material_of`. Raises InputError where no springs make such
    a sheet."""
    material = material_of(cloth, solver, own)
    springs = calibrate(
        material,
        spacing_x=cloth.width_m / (cloth.columns - 1),
        spacing_y=cloth.length_m / (cloth.rows - 1),
        bending=cloth.bending,
    )
    return Sheet.rectangle(cloth.rows, cloth.columns, material=material, springs=springs, pinned=_pinned(cloth))


def forces_of(section: ForcesSection | None, gaps: SheetGaps) -> Forces:
    """What acts on a sheet from outside. gaps: kept, and how cloth rubs on cloth, where the section states nothing."""
    section = section or ForcesSection()

    def kept(stated_mm: float | None, gap: Gap) -> float:
        return gap.size if stated_mm is None else 1e-3 * stated_mm

    wind, ball, floor = section.wind, section.sphere, section.plane
    limit, layers = section.strain_limit, section.self_contact
    return Forces(
        gravity=(0.0, -section.gravity_m_per_s2, 0.0),
        wind=wind
        and Wind(
            velocity=wind.velocity_m_per_s,
            gusts=wind.gusts,
            period=wind.period_s,
            drag=wind.drag,
            lift=wind.lift,
            seed=wind.seed,
        ),
        sphere=ball
        and Sphere(
            centre=ball.centre_m, radius=ball.radius_m, friction=ball.friction, gap=kept(ball.gap_mm, gaps.ball)
        ),
        plane=floor and Plane(height=floor.height_m, friction=floor.friction, gap=kept(floor.gap_mm, gaps.floor)),
        strain_limit=limit and StrainLimit(strain=1e-2 * limit.percent, passes=limit.passes),
        self_contact=layers
        and SelfContact(
            thickness=kept(layers.thickness_mm, gaps.layers),
            friction=gaps.friction if layers.friction is None else layers.friction,
        ),
    )


def choice_of(sheet: Sheet, forces: Forces, section: SolverSection | None, *, seams: bool = False) -> Choice:
    """The solver of a sheet, which the scene names or which costs less, and what each costs."""
    section = section or SolverSection()
    step = None if section.step_ms is None else 1e-3 * section.step_ms
    best = choose(sheet, forces, seams=seams, safety=section.safety, step=step)
    return best if section.name == "auto" else replace(best, name=section.name, why="the scene names it")


def solver_of(sheet: Sheet, forces: Forces, section: SolverSection | None, *, frame_rate: float) -> Solver:
    """The solver of `choice_of`. It needs no Taichi before its first frame. Raises InputError on a step that is too
    long, and on forces that the solver or the sheet cannot have."""
    section = section or SolverSection()
    step = None if section.step_ms is None else 1e-3 * section.step_ms
    kind = named_solver(choice_of(sheet, forces, section).name)
    constraints = constraints_for(sheet, forces, answered=kind.answers)
    return kind(sheet, forces, frame_rate=frame_rate, step=step, safety=section.safety, constraints=constraints)


def standing_in(scene: Scene) -> "Standing | None":
    """The body that the scene's sheet meets; None where it has none. Raises InputError."""
    cloth = scene.cloth
    assert cloth is not None
    if scene.body is None:
        return None
    from .body_setup import standing

    return standing(scene.body, friction=cloth.friction, gaps=gaps_of(scene))


def sheet_simulation(scene: Scene, body: "Standing | None" = None) -> Simulation:
    """The scene's sheet, ready to move by one frame of the video at a time. body: `standing_in` of the same scene."""
    cloth = scene.cloth
    assert cloth is not None
    sheet, forces = sheet_of(cloth, scene.solver, own_material(scene)), forces_of(scene.forces, gaps_of(scene))
    if body is not None:
        forces = replace(forces, body=body.colliders)
    positions = start_of(cloth, seed=scene.seed)
    return Simulation(
        sheet,
        solver_of(sheet, forces, scene.solver, frame_rate=float(scene.output.fps)),
        forces=forces,
        positions=positions,
        pins=(*_pins(cloth, positions), *_body_pins(cloth, positions, body)),
    )


def start_of(cloth: ClothSection, *, seed: int) -> F64:
    """Key points (rows, columns, 3) [m] at the start. Lying: the first row in front; upright: at the bottom."""
    u = np.linspace(-0.5, 0.5, cloth.columns) * cloth.width_m
    v = np.linspace(-0.5, 0.5, cloth.rows)[:, None] * cloth.length_m
    out = np.zeros((cloth.rows, cloth.columns, 3))
    bump = np.zeros((cloth.rows, cloth.columns))
    if cloth.roughness_mm:
        random = np.random.Generator(np.random.Philox(key=[seed, 21]))
        bump = 1e-3 * cloth.roughness_mm * random.standard_normal(bump.shape)
        bump[_pinned(cloth)] = 0.0
    if cloth.hang == "flat":
        out[..., 0], out[..., 1], out[..., 2] = u, cloth.height_m + bump, -v
    else:
        x, z = _pleated(u, cloth)
        out[..., 0], out[..., 1], out[..., 2] = x, cloth.height_m + v, z + bump
    c, s = np.cos(radians(cloth.turn_deg)), np.sin(radians(cloth.turn_deg))
    x, z = cloth.centre_m
    turned = [x + c * out[..., 0] + s * out[..., 2], out[..., 1], z + c * out[..., 2] - s * out[..., 0]]
    return np.stack(turned, axis=-1)


def _pleated(u: F64, cloth: ClothSection) -> tuple[F64, F64]:
    """A curve of the sheet's length in even folds, seen from above: its direction swings as θ sin(2π n u / width).

    The mean of its cosine is J₀(θ), which is 1 over the fullness.
    """
    if not cloth.pleats:
        return u, np.zeros_like(u)
    swing = float(brentq(lambda a: j0(a) - 1 / cloth.fullness, 0.0, 2.4))  # pyright: ignore[reportArgumentType]
    fine = np.linspace(-0.5, 0.5, 16 * (len(u) - 1) + 1)
    angle = swing * np.sin(2 * pi * cloth.pleats * fine)
    step = cloth.width_m * np.diff(fine)
    course = [np.concatenate([[0.0], np.cumsum(step * (f[1:] + f[:-1]) / 2)]) for f in (np.cos(angle), np.sin(angle))]
    x, z = (c[::16] for c in course)
    return x - x[-1] / 2, z - (z.max() + z.min()) / 2


def _pinned(cloth: ClothSection) -> NDArray[np.bool_]:
    """All key points that are held, (rows, columns). Raises InputError where two pins hold the same."""
    held = _held(cloth, {*cloth.pins.edges, *cloth.pins.corners})
    for number, pin in enumerate(cloth.pins.body):
        region = _region(cloth, pin)
        if not region.any():
            raise InputError(f"cloth.pins.body.{number}: no key point there; widen its columns or rows")
        if (held & region).any():
            raise InputError(f"cloth.pins.body.{number}: key points that are held already; pins may not overlap")
        held |= region
    return held


def _region(cloth: ClothSection, pin: BodyPinSection) -> NDArray[np.bool_]:
    """Key points of a region, (rows, columns)."""
    (left, right), (low, high) = pin.columns, pin.rows
    u, v = np.linspace(0, 1, cloth.columns), np.linspace(0, 1, cloth.rows)[:, None]
    near = 1e-9
    return (u >= left - near) & (u <= right + near) & (v >= low - near) & (v <= high + near)


def _body_pins(cloth: ClothSection, start: F64, body: "Standing | None") -> tuple[Pins, ...]:
    """A group for each bone that carries key points."""
    out = []
    for bone in dict.fromkeys(pin.bone for pin in cloth.pins.body):
        assert body is not None
        mask = np.logical_or.reduce([_region(cloth, pin) for pin in cloth.pins.body if pin.bone == bone])
        if body.bones is None:
            out.append(Pins(mask))
        else:
            out.append(Pins.on_bone(mask, start, body.bones, body.body.skeleton.index(bone)))
    return tuple(out)


def _held(cloth: ClothSection, names: set[str]) -> NDArray[np.bool_]:
    """Key points of edges and corners by name, (rows, columns)."""
    out = np.zeros((cloth.rows, cloth.columns), bool)
    every = slice(None)
    at = {"left": (every, 0), "right": (every, -1), "bottom": (0, every), "top": (-1, every)}
    for name in names:
        if name in at:
            out[at[name]] = True
        else:
            row, column = name.split("-")
            out[at[row][0], at[column][1]] = True
    return out


def _pins(cloth: ClothSection, start: F64) -> tuple[Pins, ...]:
    section: PinsSection = cloth.pins
    held = _held(cloth, {*section.edges, *section.corners})
    if not held.any():
        return ()
    if not section.pull_mm:
        return (Pins(held),)
    pulled = _held(cloth, {"left", "right"})
    side = np.where(np.arange(cloth.columns) == 0, -0.5, 0.5) * np.ones((cloth.rows, 1))
    turn = radians(cloth.turn_deg)
    away = 1e-3 * section.pull_mm * side[pulled][:, None] * np.array([np.cos(turn), 0.0, -np.sin(turn)])
    begin = start[pulled]

    def path(time: float) -> F64:
        share = min(time / section.pull_s, 1.0)
        return begin + share * share * (3 - 2 * share) * away

    rest = held & ~pulled
    return (Pins(pulled, path), *((Pins(rest),) if rest.any() else ()))
