"""What a scene builds: one class a subject, all with the same few verbs; those of other subjects are not loaded.

model = build(scene)      everything constant, made once
model.step(frame)         move to a frame; only a twisting yarn and a cloth move
model.panels()            what is to be drawn now, side by side
model.facts()             what can be said of it, beside the textbook
"""

from collections.abc import Callable

from ..prepare.weave_layout import Prepared, prepare_fabric
from ..scene.schema import Scene
from .fabric_model import FabricModel
from .model import Model

__all__ = ["build", "shown_frame"]


def build(scene: Scene, prepared: Prepared | None = None, each: Callable[[str, int, int], None] | None = None) -> Model:
    """Build a scene. `prepared` saves laying a fabric out again when that was done for `plan`. each: told the stage,
    how much of it is done and how much there is at most, where building takes long."""
    if scene.subject == "garment":
        from .garment_model import GarmentModel

        return GarmentModel.of(scene, prepared, each=each)
    if scene.subject == "outfit":
        from .outfit_model import OutfitModel

        return OutfitModel.worn(scene, each=each)
    if scene.subject == "cloth":
        from .cloth_model import ClothModel

        return ClothModel(scene, prepared)
    if scene.subject == "fabric":
        return FabricModel(scene, prepared or prepare_fabric(scene, streamed=True))
    if scene.subject == "fibre":
        from .fibre_model import FibreModel

        return FibreModel(scene)
    if scene.subject == "yarn":
        from .yarn_model import YarnModel

        return YarnModel(scene)
    from .twist_model import TwistModel

    return TwistModel(scene)


def shown_frame(scene: Scene, model: Model) -> int:
    """The frame that a single picture shows: the one that the scene names, or the last; a garment's is the first, in
    which it rests."""
    if scene.output.frame is not None:
        return scene.output.frame
    return 0 if scene.is_worn else model.frames - 1
