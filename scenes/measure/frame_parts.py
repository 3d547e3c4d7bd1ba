"""Where a frame of moving cloth goes: its kernel's stages by what they are for, as a `StageClock` has timed them."""

from collections.abc import Hashable, Mapping

from taichi_cloth.constraints.contact import Contact
from taichi_cloth.constraints.contact_middles import MiddleContact
from taichi_cloth.constraints.strain_limit import ThreadLimit
from taichi_cloth.constraints.ties import Ties
from taichi_cloth.ground.errors import InputError
from taichi_cloth.layers.layer_contact import LayerContact
from taichi_cloth.motion.stage_clock import StageClock

__all__ = ["KERNEL_PARTS", "clock_or_none", "kernel_parts"]

STAGES = {
    "ahead": "springs",
    "friction within": "springs",
    "springs": "springs",
    "threads": "yarns",
    "shapes": "ball and plane",
    "state": "state",
}
LAYERS = {
    "copies": "layers: proof",
    "paths": "layers: proof",
    "proof": "layers: proof",
    "boxes": "layers: search",
    "descent": "layers: search",
    "sieve": "layers: search",
    "thin": "layers: search",
    "near pairs": "layers: near pairs",
    "near pieces": "layers: near pairs",
    "contacts": "layers: contacts",
}
"""Of what is done between substeps; what contacts do within them is cloth on cloth."""
CONSTRAINTS = {
    Contact: "contact",
    MiddleContact: "contact",
    LayerContact: "cloth on cloth",
    ThreadLimit: "strain limit",
}
KERNEL_PARTS = (
    "springs", "yarns", "strain limit", "seams", "holds", "ball and plane", "contact", "cloth on cloth",
    *dict.fromkeys(LAYERS.values()), "state",
)  # fmt: skip
"""In the order in which they are printed. springs: all that are not solved whole, with gravity and wind; of Verlet with
fixed shapes. contact: with a body. state: from the host and back."""


def clock_or_none() -> StageClock | None:
    """None where kernels cannot ask for the time. Taichi is running."""
    try:
        return StageClock()
    except InputError:
        return None


def kernel_parts(reading: Mapping[Hashable, float]) -> dict[str, float]:
    """What `StageClock.read` gives, by KERNEL_PARTS, those there are."""
    out: dict[str, float] = {}
    for stage, took in reading.items():
        part = _part(stage)
        out[part] = out.get(part, 0.0) + took
    return out


def _part(stage: Hashable) -> str:
    if isinstance(stage, str):
        return STAGES.get(stage) or LAYERS[stage]
    if isinstance(stage, Ties):
        return "seams" if stage.repeated else "holds"
    return CONSTRAINTS[type(stage)]  # pyright: ignore[reportArgumentType]
