"""What drawing takes: the memory of a particle and of a picture, and whether there is a floor to draw."""

from taichi_cloth.fabric.layout import PARTICLE_BYTES
from taichi_cloth.ground.memory import require_memory

from ..scene.schema import Scene

__all__ = [
    "CELLS_BYTES",
    "CELLS_LIT",
    "DRAW_BYTES",
    "HELD",
    "LAYERS_BYTES",
    "LIT",
    "MESH_BYTES",
    "MOTION_BYTES",
    "PROCESS_BYTES",
    "SAMPLED_BYTES",
    "STREAM_BYTES",
    "drawn_bytes",
    "has_floor",
    "picture_bytes",
    "require_picture",
]

DRAW_BYTES = 130  # what the splatter keeps for a particle while it draws
PIXEL_BYTES = 210
"""What a picture takes for a pixel of its canvas, with what stands behind and the conversion to a file: 190 to 202 were
measured at 512² and 3072²."""

MESH_PIXEL_BYTES = 70
"""What meshes take for a pixel more, painted at two samples each way: with `drape` at 64 × 48 and 1080 × 720 px."""
SAMPLED_BYTES = 180
"""What a picture takes for a pixel more where it has four samples (`picture.samples`): `swatch` at 1080 × 720 px."""
MESH_BYTES = 110_000_000
"""What they take besides: the kernels of painting and lighting them."""
LAYERS_BYTES = 190_000_000
"""Of cloth on cloth more, of sheets and garments of up to 16,384 elements."""
MOTION_BYTES = 110_000_000
"""The kernels of a solver and of contact, and what they are compiled with: with the above, `drape` and `flag`."""

PROCESS_BYTES = 185_000_000
"""The program, its libraries and compiled kernels, before anything of a scene: 163 to 191 MB were measured with a yarn,
a twist and a weave of 6 × 6 threads."""

HELD = 4_000_000
"""Particles of a fabric beyond which it is drawn in batches."""
LIT = 1_000_000
"""Particles of the sample of it that then casts light."""
CELLS_LIT = 250_000
"""Of cloth woven on cells: surfels, which lie evenly (`CellStream.sample`)."""
STREAM_BYTES = 400_000_000  # a batch of a million particles, a sample of as many, what the splatter keeps of them
CELLS_BYTES = 60_000_000
"""The same of cloth woven on cells: `flag` takes 844 MB in all."""


def drawn_bytes(particles: int) -> int:
    """Memory of particles that are held and drawn at once."""
    return particles * (PARTICLE_BYTES + DRAW_BYTES)


def has_floor(scene: Scene) -> bool:
    """Whether the subject lies on a floor that shows its shadow: fabrics do unless the scene says otherwise, a moving
    cloth where there is one to fall on."""
    if scene.stage.ground is not None:
        return scene.stage.ground
    return scene.subject == "fabric" or (scene.forces is not None and scene.forces.plane is not None)


def picture_bytes(size: tuple[int, int], supersample: int = 1, *, meshes: bool = False) -> int:
    """Memory of drawing one picture of (width, height) [px] with so many samples a pixel each way."""
    return (PIXEL_BYTES + MESH_PIXEL_BYTES * meshes) * size[0] * size[1] * supersample**2


def require_picture(size: tuple[int, int], supersample: int = 1) -> None:
    """Refuses, with InputError, a picture that this machine has no memory for."""
    finer = f", {supersample} × {supersample} samples a pixel" if supersample > 1 else ""
    remedy = "take a smaller output.size" + (" or fewer samples" if supersample > 1 else "")
    require_memory(f"a picture of {size[0]} × {size[1]} px{finer}", picture_bytes(size, supersample), remedy)
