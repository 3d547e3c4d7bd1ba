"""Scenes whose cloth moves: what they refuse, mesh and fibres on one sheet, and a run that was killed goes on."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import taichi as ti
from taichi.lang import impl

from taichi_cloth.garment.sewn.worn import Worn
from taichi_cloth.ground.errors import InputError, Unstable
from taichi_cloth.motion.forces import SelfContact, StrainLimit
from taichi_cloth.motion.kernel_solver import KernelSolver
from taichi_cloth.motion.simulation import Simulation
from taichi_cloth.render.data.blocks import ParticleBlocks
from taichi_cloth.scenes import __main__ as command_line
from taichi_cloth.scenes.models.cloth_model import ClothModel
from taichi_cloth.scenes.models.garment_model import GarmentModel
from taichi_cloth.scenes.models.model import STATE
from taichi_cloth.scenes.models.moving_model import MovingModel
from taichi_cloth.scenes.paper.own_scenes import PAPER_DRAPE, scene_file
from taichi_cloth.scenes.picture.view import View
from taichi_cloth.scenes.plan.plan import plan
from taichi_cloth.scenes.prepare import garment_setup
from taichi_cloth.scenes.prepare.gaps import gaps_of
from taichi_cloth.scenes.prepare.garment_setup import Dressed, dressed_parts
from taichi_cloth.scenes.prepare.sheet_setup import forces_of, material_of, sheet_simulation, start_of
from taichi_cloth.scenes.scene.load import load_scene
from taichi_cloth.scenes.scene.schema import Scene
from taichi_cloth.sheet.materials import Material, named_material
from taichi_cloth.sheet.sheet import SheetState

SCENES = ("drape", "flag", "hanging", "stretch")
SAMPLE = Path(__file__).parents[1] / "data" / "patterns" / "skirt_4_panels.json"
SMALL = ["cloth.rows=9", "cloth.columns=9", "cloth.threads_per_key_point=2", "output.frames=4"]
SMALL += ["light.occlusion=false", "light.shadows=false", "stage.ground=false", "fabric.steps=1", "yarn.fibres=1"]
SMALL += ["forces.self_contact=false"]  # nothing here is of it, and its kernel takes a process seconds to load
PLANNED = ["cloth.rows=17", "cloth.columns=33", "cloth.length_m=0.4", "cloth.width_m=0.8"]
ANIMATE = ["animate", PAPER_DRAPE, *(part for text in SMALL for part in ("--set", text))]


pytestmark = pytest.mark.usefixtures("keep_taichi")


def small(name: str, *more: str) -> ClothModel:
    return ClothModel(load_scene(name, [*SMALL, *more]))


@pytest.fixture(scope="module")
def draped() -> ClothModel:
    model = small(PAPER_DRAPE)
    model.step(3)
    return model


def test_fibres_lie_on_the_sheet_that_the_mesh_shows(draped: ClothModel) -> None:
    """Same key points, byte for byte; no fibre farther from a key point than half a cell's diagonal and a thread."""
    mesh = small(PAPER_DRAPE, "cloth.representation=mesh")
    mesh.step(3)
    (panel,), (solid,) = draped.panels(), mesh.panels()
    assert (draped.simulation.positions == mesh.simulation.positions).all()
    assert isinstance(panel.particles, ParticleBlocks)
    fibres = panel.particles.position[panel.particles.radius > 0]
    vertices = solid.meshes[0].vertices
    nearest = np.min(np.linalg.norm(fibres[::37, None] - vertices, axis=-1), axis=1)
    assert nearest.max() < 0.125 * 0.5**0.5 + 0.01
    assert len(solid.particles) == 0
    assert solid.meshes[0].normals is not None
    assert np.linalg.norm(solid.meshes[0].normals, axis=1) == pytest.approx(1.0, abs=1e-5)


def unsewn(name: str, *more: str) -> GarmentModel:
    """A garment that lies flat beside its body."""
    scene = load_scene(name, ["garment.key_points=800", "light.occlusion=false", "light.shadows=false", *more])
    parts = dressed_parts(scene)
    worn = Worn(
        parts.garment.atlas.start().astype(np.float32), gap=0.0, depth=0.0, stretch=0.0, taut=0.0, speed=0.0, frames=0
    )
    return GarmentModel.of(scene, dressed=Dressed(**vars(parts), worn=worn, from_disk=True))


def test_whether_a_garment_fits_is_asked_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    asked, one = list[object](), unsewn("tshirt", "garment.representation=mesh").dressed
    for made_of, why in (("tight", "threads are too long"), ("loose", None)):

        def found(*given: object, why: str | None = why) -> str | None:
            asked.append(given)
            return why

        monkeypatch.setattr(garment_setup, "misfit", found)
        assert [replace(one, made_of=made_of).misfit() for _ in range(2)] == [why, why]
    assert len(asked) == 2
    assert one.misfit() is None  # not sewn here: asked each time
    assert len(asked) == 3


@pytest.mark.parametrize("made", [small, unsewn])
def test_fields_of_motion_come_first(monkeypatch: pytest.MonkeyPatch, made: Callable[[str], MovingModel]) -> None:
    """In a tree of their own, so that a process with other pictures finds the same kernel in the cache."""
    order: list[str] = []
    make_ready, field = KernelSolver.make_ready, ti.field

    def ready(self: KernelSolver, state: SheetState) -> None:
        order.append("motion")
        with monkeypatch.context() as of_motion:
            of_motion.setattr(ti, "field", field)
            make_ready(self, state)
        assert impl.root.empty  # none waits to be put beside others

    def noted(*args: Any, **kwargs: Any) -> Any:
        order.append("picture")
        return field(*args, **kwargs)

    monkeypatch.setattr(KernelSolver, "make_ready", ready)
    monkeypatch.setattr(ti, "field", noted)
    made(PAPER_DRAPE if made is small else scene_file("skirt"))
    assert order[0] == "motion"
    assert "picture" in order


def test_a_mesh_has_the_colours_of_the_threads() -> None:
    colours = small(
        PAPER_DRAPE, "cloth.representation=mesh", "weave.warp_colours='red'", "weave.weft_colours='red'"
    ).colours
    assert colours == pytest.approx(np.tile(colours[0], (81, 1)), abs=1e-6)
    checked = small(PAPER_DRAPE, "cloth.representation=mesh", "weave.warp_colours='black*8 white*9'").colours
    assert checked.reshape(9, 9, 3)[:, 0].max() < checked.reshape(9, 9, 3)[:, 8].min()


@pytest.mark.slow
def test_a_mesh_is_as_bright_as_the_fibres_on_its_sheet() -> None:
    """The middle of the cloth fills the picture; mean luminance of the light, within 20 %."""
    sheet = ["cloth.rows=21", "cloth.columns=21", "cloth.threads_per_key_point=14", "camera.zoom=3.5"]
    light, simulation = [], None
    for form in ("mesh", "fibre"):
        model = ClothModel(load_scene(PAPER_DRAPE, [*sheet, f"cloth.representation={form}"]))
        if simulation is None:
            model.step(20)
        model.simulation = simulation = simulation or model.simulation
        ((_, image),) = View(model, (240, 200)).turntable(1, [0])
        value = image / 255
        linear = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
        light.append(float((linear @ [0.2126, 0.7152, 0.0722]).mean()))
    assert light[0] == pytest.approx(light[1], rel=0.2)


def test_every_particle_knows_its_thread(draped: ClothModel) -> None:
    numbers = draped.numbers()
    (panel,) = draped.panels()
    drawn = panel.particles.radius > 0
    assert (numbers.yarn[drawn] >= 0).all()
    assert (numbers.yarn[~drawn] == -1).all()
    assert set(numbers.yarns) == set(range(17 + 17))


def test_going_back_a_frame_gives_the_frame_again(draped: ClothModel) -> None:
    there = draped.simulation.positions
    draped.step(1)
    draped.step(3)
    assert (draped.simulation.positions == there).all()


def test_a_run_that_was_killed_gives_the_same_states(tmp_path: Path, draped: ClothModel) -> None:
    one = small(PAPER_DRAPE)
    one.keep(tmp_path, 0)
    one.step(2)
    again = small(PAPER_DRAPE)
    again.keep(tmp_path, 2)
    assert again.simulation.frame == 2
    again.step(3)
    assert again.simulation.state.values.tobytes() == draped.simulation.state.values.tobytes()
    earlier = small(PAPER_DRAPE)
    earlier.keep(tmp_path, 1)  # frame 1 is to be drawn again: the state of frame 3 is of no use
    assert earlier.simulation.frame == 0
    with pytest.raises(InputError, match="another"):
        small(PAPER_DRAPE, "cloth.material=denim").keep(tmp_path, 3)


def test_an_animation_cut_off_and_resumed_is_the_one_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Frames and state, byte for byte."""
    command = [*ANIMATE, "--size", "48x32"]
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    assert command_line._status([*command, "--out", str(whole)]) == 0
    step = Simulation.step

    def killed(self: Simulation) -> None:
        if self.frame == 2:
            raise KeyboardInterrupt
        step(self)

    with monkeypatch.context() as patch:
        patch.setattr(Simulation, "step", killed)
        assert command_line._status([*command, "--out", str(cut)]) == 130
    assert not (cut / "frame_0003.png").exists()
    assert command_line._status([*command, "--out", str(cut), "--resume"]) == 0
    for name in ("frame_0002.png", "frame_0003.png"):
        assert (cut / name).read_bytes() == (whole / name).read_bytes()
    states = [np.load(folder / STATE) for folder in (whole, cut)]
    assert states[0]["values"].tobytes() == states[1]["values"].tobytes()


def test_a_state_that_is_no_cloth_ends_the_run_with_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, the frame and what to change; the last good state is on disk."""

    def spoiled(self: Simulation) -> None:
        raise Unstable("frame 1: key point (0, 0) is not finite", 1)

    with monkeypatch.context() as patch:
        patch.setattr(Simulation, "step", spoiled)
        assert command_line._status([*ANIMATE, "--size", "48x32", "--out", str(tmp_path / "a")]) == 2
    assert capsys.readouterr().err == "taichi-cloth: frame 1: key point (0, 0) is not finite\n"
    model = small(PAPER_DRAPE)
    model.simulation.restore(tmp_path / "a" / STATE)
    assert model.simulation.frame == 0


@pytest.mark.parametrize("name", SCENES)
def test_plan_says_what_moves(name: str) -> None:
    stages = {stage.name: stage for stage in plan(load_scene(name, PLANNED)).stages}
    assert stages["sheet"].built
    assert stages["solver"].built
    assert stages["fibre blocks"].built
    assert stages["wind"].built is (name in ("flag", "hanging"))
    assert stages["contact"].built is (name == "drape")
    assert stages["pins"].built is (name != "drape")
    mesh = plan(load_scene(name, [*PLANNED, "cloth.representation=mesh"]))
    assert not {stage.name: stage for stage in mesh.stages}["fibre blocks"].built


@pytest.mark.slow
@pytest.mark.parametrize("n", [21, 79])
def test_a_settled_drape_stays_out_of_the_ball_and_hardly_stretches(n: int) -> None:
    """Real cotton, dropped: it has come to rest, no key point is deeper than 1 mm in the ball, no thread longer by
    3 % than it was."""
    model = ClothModel(
        load_scene("drape", [f"cloth.rows={n}", f"cloth.columns={n}", "cloth.representation=mesh", "output.fps=60"])
    )
    assert model.scene.forces is not None
    ball = model.scene.forces.sphere
    assert ball is not None
    deepest = 0.0
    for frame in range(1, 241 if n == 79 else 121):
        model.step(frame)
        deepest = max(deepest, ball.radius_m - np.linalg.norm(model.simulation.positions, axis=-1).min())
    x = model.simulation.positions
    model.step(model.simulation.frame + 6)
    largest = max(float(family.max()) for family in model.simulation.sheet.stretch(model.simulation.positions))
    moved = float(np.abs(model.simulation.positions - x).max()) / 0.1
    print(f"{n}: deepest {1e3 * deepest:.3f} mm, largest stretch {100 * largest:.2f} %, moves {1e3 * moved:.1f} mm/s")
    assert deepest < 1e-3
    assert largest < 0.03
    assert moved < 0.1


def test_a_scene_asks_for_a_strain_limit_and_may_leave_out_cloth_on_cloth() -> None:
    forces = ["forces.strain_limit.percent=4", "forces.self_contact={thickness_mm=3, friction=0.2}"]
    scene = load_scene("drape", [*PLANNED, *forces])
    made = forces_of(scene.forces, gaps_of(scene))
    assert made.strain_limit == StrainLimit(strain=0.04, passes=3)
    assert made.self_contact == SelfContact(thickness=0.003, friction=0.2)
    without = ["forces.self_contact=false"]
    for changes, limited, meets in ((forces, True, True), ([], False, True), (without, False, False)):
        stages = {stage.name: stage for stage in plan(load_scene("drape", [*PLANNED, *changes])).stages}
        assert stages["strain limit"].built is limited
        assert stages["cloth on cloth"].built is meets
    assert "forces.self_contact" in stages["cloth on cloth"].why
    of_others = load_scene("skirt", [f"garment.pattern={SAMPLE}", "garment.representation=mesh"])
    whole = {stage.name: stage for stage in plan(of_others).stages}
    assert "self_contact={} asks for it" in whole["cloth on cloth"].why
    left = load_scene("drape", [*PLANNED, *without])
    again = Scene.model_validate(json.loads(left.model_dump_json(exclude_unset=True)))  # as a run is left to be resumed
    asked = (load_scene("dress", ["forces.self_contact=true"]), True), (load_scene("trousers"), True)
    paper = load_scene(scene_file("tshirt")), False
    for one, said in ((left, False), (again, False), paper, *asked):
        assert one.forces is not None
        assert (one.forces.self_contact is not None) is said


def test_plan_makes_no_field_of_taichi(monkeypatch: pytest.MonkeyPatch) -> None:
    """It comes before the start of Taichi, without which a field is an error."""
    forces = ["forces.strain_limit={}", "forces.self_contact={thickness_mm=3}"]
    with monkeypatch.context() as without:
        without.delattr("taichi.field")
        without.delattr("taichi.ndarray")
        plan(load_scene("drape", [*PLANNED, *forces]))


def test_properties_replace_those_of_the_preset() -> None:
    cloth = load_scene("drape", ["cloth.properties.bending_warp_un_m=50", "cloth.material=denim"]).cloth
    assert cloth is not None
    assert material_of(cloth).bending_warp == pytest.approx(50e-6)
    assert material_of(cloth).tensile_warp == named_material("denim").tensile_warp


def test_threads_whose_stiffness_a_scene_names_are_linear_and_so_are_all_of_verlet() -> None:
    """Unless the scene says from when on they get stiffer."""

    def material(*changes: str) -> Material:
        scene = load_scene(PAPER_DRAPE, list(changes))
        assert scene.cloth is not None
        return material_of(scene.cloth, scene.solver)

    preset, warp = named_material("cotton-shirting"), "cloth.properties.tensile_warp_n_per_m=1e9"
    assert (preset.drawn_warp, preset.drawn_weft) == (material().drawn_warp, material().drawn_weft)
    assert (material(warp).drawn_warp, material(warp).drawn_weft) == (0.0, preset.drawn_weft)
    curve = ["cloth.properties.drawn_warp_n_per_m=2e9", "cloth.properties.crimp_warp_percent=1"]
    assert (material(warp, *curve).drawn_warp, material(warp, *curve).crimp_warp) == (2e9, 0.01)
    assert not material("solver.name=verlet").curved
    assert material("solver.name=verlet").tensile_warp == preset.tensile_warp


def test_pleats_keep_the_length_of_the_sheet() -> None:
    """Width over that of the pleats is the fullness, to 1 %; no thread is stretched by more than the chords' 2 %."""
    scene = load_scene("hanging")
    assert scene.cloth is not None
    x = start_of(scene.cloth, seed=0)
    assert scene.cloth.width_m / np.ptp(x[0, :, 0]) == pytest.approx(scene.cloth.fullness, rel=0.01)
    strain = np.linalg.norm(np.diff(x, axis=1), axis=-1) / (scene.cloth.width_m / 128) - 1
    assert -0.02 < strain.min() <= strain.max() < 1e-6


def test_pulled_edges_part_by_what_the_scene_says() -> None:
    square = ["cloth.pins.pull_s=0.1", "cloth.pins.pull_mm=50", "cloth.length_m=0.25"]
    simulation = sheet_simulation(load_scene("stretch", [*SMALL, *square]))
    start = simulation.positions
    for _ in range(4):
        simulation.step()
    pulled = simulation.positions - start
    assert pulled[:, -1, 0] - pulled[:, 0, 0] == pytest.approx(0.05, abs=1e-6)
    assert pulled[:, [0, -1], 1:] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["cloth.rows=2"], "cloth.rows"),
        (["cloth.material=lace"], "lace"),
        (["weave.ends=40"], "weave.ends"),
        (["cloth.representation=solid"], "mesh"),
        (["cloth.pins.edges=['middle']"], "top"),
        (["cloth.pins.pull_mm=3"], "left"),
        (["cloth.pleats=3"], "upright"),
        (["solver.step_ms=5"], "at most"),
        (["forces.strain_limit.passes=102"], "101"),
        (["forces.self_contact.thickness_mm=100"], "4 times"),
        (["solver.name=implicit"], 'solver.name: there is no "implicit" any more; name "yarns"'),
        (["forces.sphere.radius_m=-1"], "radius_m"),
        (["cloth.properties.tensile_share=0.5"], "there is no tensile_share any more"),
        (["output.frame=120"], "119"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(changes: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words) as error:
        plan(load_scene("drape", changes))
    assert "\n" not in str(error.value)


def test_forces_without_cloth_are_refused() -> None:
    with pytest.raises(InputError, match="cloth"):
        load_scene("plain", ["forces.gravity_m_per_s2=9.81"])
