"""Several garments worn by one body, in the order worn, each of its own cloth: they move as one, and touch."""

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.garment.outfit.outfit import Outfit
from taichi_cloth.garment.outfit.passing import passing

from ...render.tiles.mesh import Mesh
from ..prepare.construction import fabric_properties
from ..prepare.garment_setup import Dressed, Progress, dress
from ..prepare.outfit_setup import woven
from ..prepare.sheet_setup import moved_by
from ..prepare.thread_colours import outer_colours
from ..scene.schema import Scene
from .facts import Fact
from .garment_model import GarmentCells, GarmentModel
from .model import Panel

__all__ = ["OutfitModel"]

F32 = NDArray[np.float32]


class OutfitModel(GarmentModel):
    """An outfit in motion on its body. Make it with `OutfitModel.worn`."""

    def __init__(self, scene: Scene, dressed: Dressed) -> None:
        super().__init__(scene, dressed)
        self.worn_fibres: list[GarmentCells] = []
        through = passing(self.outfit, dressed.worn.positions)
        self.misfit = "; ".join(filter(None, (self.misfit, through))) or None

    @staticmethod
    def worn(scene: Scene, dressed: Dressed | None = None, each: Progress | None = None) -> "OutfitModel":
        """The scene's garments, sewn unless they were before, with their fibres where it shows them."""
        model = OutfitModel(scene, dressed or dress(scene, each))
        if scene.outfit[0].representation == "fibre":
            every = zip(scene.garments, model.outfit.parts, strict=True)
            model.worn_fibres = [
                GarmentCells(one, model.alone(k), woven(one, part)) for k, (one, part) in enumerate(every)
            ]
        return model

    def alone(self, number: int) -> Dressed:
        """One of the garments as it is worn, without the others."""
        worn = self.dressed.worn
        own = replace(worn, positions=self.outfit.of(number, worn.positions))
        return replace(self.dressed, garment=self.outfit.parts[number], worn=own)

    def panels(self) -> list[Panel]:
        """Of fibres the outermost garment, and those drawn before it, each with the skin and what is worn under it as
        meshes, shadowed by what is worn over it."""
        if not self.worn_fibres:
            return super().panels()
        positions, solids, framed = self.simulation.positions, self.solids(), self.framed()
        meshes = [self._mesh_of(k) for k in range(len(self.outfit.parts))]
        panels = [
            Panel(
                fibres.follow(self.outfit.of(k, positions)),
                framed,
                meshes=(*solids, *meshes[:k]),
                source=fibres.source,
                shading=tuple(meshes[k + 1 :]),
                scene=self.scene.garments[k],
            )
            for k, fibres in enumerate(self.worn_fibres)
        ]
        return [replace(panels[-1], within=tuple(panels[:-1]))]

    def _mesh_of(self, number: int) -> Mesh:
        """The mesh of one garment."""
        whole = self.mesh()
        own = [k for k in range(len(self.outfit.atlas.panels)) if self.outfit.wearer(k) == number]
        mine = np.isin(self.surface.panel[self.surface.faces[:, 0]], own)
        return replace(whole, faces=whole.faces[mine], part=0)

    @property
    def outfit(self) -> Outfit:
        assert isinstance(self.dressed.garment, Outfit)
        return self.dressed.garment

    @cached_property
    def mesh_colours(self) -> F32:
        shades = []
        for one, part in zip(self.scene.garments, self.outfit.parts, strict=True):
            shades += outer_colours(one, [piece.panel.name for piece in part.atlas.panels]).values()
        return np.stack(shades)[self.surface.panel].astype(np.float32)

    def cloth_facts(self) -> list[Fact]:
        facts = [Fact("worn, innermost first", ", ".join(self.outfit.names))]
        mass = self.simulation.sheet.mass
        for number, (name, part) in enumerate(zip(self.outfit.names, self.outfit.parts, strict=True)):
            grams = 1e3 * float(self.outfit.of(number, mass).sum())
            facts.append(
                Fact(name, f"{len(part.pattern.panels)} panels, {part.atlas.key_points:,} key points, {grams:.0f} g")
            )
        return [*facts, *self.sewn_facts()]

    def facts(self) -> list[Fact]:
        """What is worn; then what each garment weighs and moves by."""
        facts = self.cloth_facts()
        for one, part in zip(self.scene.garments, self.outfit.parts, strict=True):
            facts.append(Fact(f"{one.title}: weight", f"{1e3 * part.material.density:.0f} g/m²"))
            if fabric_properties(one) is not None:
                moved = moved_by(one)
                facts += [
                    Fact(f"{one.title}: {q.name}", q.shown, q.provenance)
                    for key, q in moved.items()
                    if key != "areal_density"
                ]
        return facts
