"""Garments of any shape, on any body, are moved by kernels that the first of them compiled."""

import pytest
from taichi.lang.kernel_impl import Kernel

from taichi_cloth.body.colliders.colliders import Colliders
from taichi_cloth.body.figure.anthropometry import Gender
from taichi_cloth.garment.pattern.cut import cut, spacing_for
from taichi_cloth.garment.pattern.drafts import draft
from taichi_cloth.garment.pattern.measure import figure_of
from taichi_cloth.garment.sewn.garment import Garment
from taichi_cloth.garment.sewn.sew import sew
from taichi_cloth.motion.forces import Forces, StrainLimit
from taichi_cloth.scenes.prepare.body_setup import primitives_of
from taichi_cloth.scenes.scene.body_section import BodySection, prepare_body
from taichi_cloth.sheet.materials import MATERIALS

KEY_POINTS = 800
LIMIT = StrainLimit(strain=0.03, passes=2)


def sew_and_wear(name: str, gender: Gender) -> tuple[int, int]:
    """A few frames of sewing and of wearing. Returns the shape of its padded grid."""
    body = prepare_body(BodySection(gender=gender))
    colliders = Colliders(primitives=primitives_of(body))
    pattern = draft(name, figure_of(body))
    garment = Garment(pattern, cut(pattern, spacing_for(pattern, KEY_POINTS)), MATERIALS["cotton-shirting"].linear)
    worn = sew(garment, colliders, limit=LIMIT, closing=2, settling=2)
    simulation = garment.simulation(Forces(body=colliders, strain_limit=LIMIT), worn.positions)
    simulation.step()
    return simulation.sheet.padded_shape


@pytest.mark.slow
def test_garments_after_the_first_compile_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    materialize = Kernel.materialize

    def counted(self, key=None, args=None, arg_features=None) -> None:
        if key is None or key not in self.compiled_kernels:
            made.append(self.func.__qualname__)
        materialize(self, key, args, arg_features)

    monkeypatch.setattr(Kernel, "materialize", counted)
    shapes = {sew_and_wear("tshirt", "male")}
    assert made.count("Frame.run") <= 1
    made.clear()
    shapes |= {sew_and_wear(name, "female") for name in ("tshirt", "skirt", "dress")}
    assert len(shapes) == 4
    assert made == []
