"""Numbers of yarns and parts for every subject, and a mesh among the fibres in all passes."""

from dataclasses import replace

import numpy as np
import pytest

from taichi_cloth.ground.copies import fetched
from taichi_cloth.render.tiles.mesh import Mesh
from taichi_cloth.scenes.commands.still import shoot
from taichi_cloth.scenes.models import fibre_model
from taichi_cloth.scenes.models.build import build
from taichi_cloth.scenes.models.model import Model, Panel
from taichi_cloth.scenes.picture.view import View
from taichi_cloth.scenes.scene.load import load_scene


def numbered(panel: Panel):
    assert panel.numbers is not None
    numbers = panel.numbers()
    assert len(numbers.yarn) == len(numbers.part) == len(panel.particles)
    assert set(np.unique(numbers.yarn)) <= {-1, *numbers.yarns}
    assert set(np.unique(numbers.part)) <= set(numbers.parts)
    return numbers


def test_a_yarn_numbers_its_fibres_and_plies(taichi_runtime) -> None:
    model = build(load_scene("yarn", ["yarn.length_mm=1", "yarn.fibres=4", "yarn.hairiness.ends_per_m=20000"]))
    numbers = numbered(model.panels()[0])
    plies = len(numbers.parts)
    body = [k for k, what in numbers.yarns.items() if what["system"] == "fibre"]
    assert len(numbers.yarns) > len(body) >= 4 * plies
    for k in body:
        assert len(np.unique(numbers.part[numbers.yarn == k])) == 1
    position = model.panels()[0].particles.position
    one = position[numbers.yarn == body[0]]  # one fibre runs on from point to point
    apart = np.linalg.norm(np.diff(one, axis=0), axis=1)
    assert apart.max() < 2 * np.median(apart)


def test_a_twisting_yarn_numbers_its_singles(taichi_runtime) -> None:
    model = build(load_scene("twist", ["twist.duration_s=0.05", "twist.turns_per_s=1", "output.frames=2"]))
    model.step(0)
    panel = model.panels()[0]
    numbers = numbered(panel)
    assert set(np.unique(numbers.yarn)) == {-1, 0, 1}
    assert ((numbers.yarn == -1) == (numbers.part == 1)).all()
    middle = [panel.particles.position[numbers.yarn == k].mean(axis=0) for k in (0, 1)]
    assert np.linalg.norm(middle[0] - middle[1]) > 2 * panel.particles.radius.mean()  # they lie side by side


def test_a_fibre_numbers_its_two_pictures(taichi_runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fibre_model, "SURFACE_POINTS", 20_000)
    panels = build(load_scene("fibre", ["fibre.length_um=20", "fibre.spacing_um=2"])).panels()
    assert [int(numbered(panel).part[0]) for panel in panels] == [0, 1]


@pytest.mark.slow
def test_a_mesh_lies_in_all_passes(taichi_runtime) -> None:
    """A level square under a cloth: where it is seen it has its own depth, normal and part, and takes shadow."""
    scene = load_scene("swatch", ["weave.ends=6", "weave.picks=6", "fabric.steps=4", "yarn.fibres=3"])
    model = build(scene)
    (panel,) = model.panels()
    low, high = panel.bounds.min(axis=0), panel.bounds.max(axis=0)
    x, z, y = (high - low)[0], (high - low)[2], low[1] - 0.2 * (high - low)[0]
    corners = [[low[0] - x, y, low[2] - z], [high[0] + x, y, low[2] - z]]
    corners += [[high[0] + x, y, high[2] + z], [low[0] - x, y, high[2] + z]]
    square = Mesh(corners, [[0, 2, 1], [0, 3, 2]], (0.5, 0.5, 0.5), part=7)

    class WithMesh:
        frames = 1

        def __init__(self) -> None:
            self.scene = scene

        def step(self, frame: int) -> None: ...

        def panels(self) -> list[Panel]:
            return [replace(panel, meshes=(square,))]

        def facts(self) -> list:
            return []

    with_mesh: Model = WithMesh()
    (shot,) = list(View(with_mesh, (96, 72)).shots())
    assert shot.backdrop is not None
    assert shot.backdrop.face is not None
    seen = shot.backdrop.face[:, :96] >= 0
    light = fetched(shot.backdrop.colour)[:, :96].mean(axis=-1)[seen]
    assert light.min() < 0.75 * np.median(light)  # under the cloth
    files = shoot(with_mesh, scene, (96, 72), ("depth", "normal", "mask", "id"), "png", 1)
    assert {"depth.png", "normal.png", "mask.png", "part.png", "yarn.png"} < set(files)
