"""From a scene's words to cloth woven on cells: its repeat, counted and not built."""

from dataclasses import replace

import numpy as np

from taichi_cloth.fabric.layout import Detail, families_of, lay_out
from taichi_cloth.fabric.repeat import WeaveRepeat, bytes_of_bank
from taichi_cloth.fabric.templates import particles_per_body_block
from taichi_cloth.ground.memory import require_memory
from taichi_cloth.weave.draft import Draft, tile

from ..scene.schema import FabricSection, Scene
from .drawing import CELLS_BYTES
from .fibre_count import EVERY, stated_fibres
from .sett import Sett, sett_of, threads_to_a_cell
from .weave_layout import Cells, Prepared, woven, yarns_for

__all__ = ["prepare_cells", "prepare_sheet"]

THREAD_BYTES = 40
"""Of a thread's record: its colour, where its period begins, what an outline leaves of it."""


def prepare_sheet(scene: Scene) -> Prepared | None:
    """A [cloth] with a sett, as `on_cells` gave it; None where none is stated. Raises InputError as weaving would."""
    sett = sett_of(scene)
    if sett is None or scene.cloth is None:
        return None
    per_cell = threads_to_a_cell(scene, sett)
    cells = scene.cloth.columns - 1, scene.cloth.rows - 1
    threads = cells[0] * per_cell[0] + 1, cells[1] * per_cell[1] + 1
    true = Sett((threads[0] - 1) / scene.cloth.width_m, (threads[1] - 1) / scene.cloth.length_m, sett.draft)
    return prepare_cells(scene, (true,), per_cell, threads, cells[0] * cells[1])


def prepare_cells(
    scene: Scene, setts: tuple[Sett, ...], per_cell: tuple[int, int], threads: tuple[int, int], cells: int
) -> Prepared:
    """Lay out a repeat of each draft of a cloth. threads: ends and picks of it all. cells: there are. Raises InputError
    where it cannot be woven, or is too large for this machine."""
    made = [_repeat(scene, sett) for sett in setts]
    repeats = tuple(repeat for repeat, _ in made)
    notes = tuple(dict.fromkeys(note for _, mine in made for note in mine))
    layout = repeats[0].layout
    blocks = 2 * cells * per_cell[0] * per_cell[1]
    of_block = [
        particles_per_body_block(family.yarn, layout.detail.fibres, layout.detail.steps)
        for family in (layout.warp, layout.weft)
    ]
    total = bytes_of_bank(repeats) * 3 + sum(threads) * THREAD_BYTES + CELLS_BYTES  # made, sorted, packed
    require_memory("the templates of a weave", total, "lower yarn.fibres or fabric.steps, or take a smaller draft")
    counted = Cells(per_cell, threads, blocks, repeats)
    particles = blocks // 2 * sum(of_block)
    return Prepared(setts[0].draft, layout, particles, total, notes, in_batches=True, cells=counted)


def _repeat(scene: Scene, sett: Sett) -> tuple[WeaveRepeat, tuple[str, ...]]:
    """A repeat of a draft, and the notes of what it took."""
    assert scene.yarn is not None
    section = scene.fabric or FabricSection()
    draft = _spaced(sett)
    free = section.model_copy(update={"ends_per_cm": None, "picks_per_cm": None})
    yarns = yarns_for(scene, draft, free)
    cloth, spacing, notes = woven(draft, free, yarns)
    grey = tuple(np.zeros((count, 3), np.float32) for count in (draft.ends, draft.picks))
    detail = Detail(
        fibres=stated_fibres(scene) or EVERY,
        steps=section.steps,
        variants=section.variants,
        fringe=0.0,
        irregularity=0.0,
        seed=scene.seed,
    )
    families = families_of(cloth, spacing, (grey[0], grey[1]), yarns, section.flattening)
    layout = lay_out(cloth, *families, detail=detail)
    return WeaveRepeat.of(layout), (*sett.draft.notes, *notes)


def _spaced(sett: Sett) -> Draft:
    """The draft's repeat and its first end and pick once more, spaced to the sett."""
    draft = sett.draft
    spacing = []
    for own, count, per_m in (
        (draft.warp_spacing_m, draft.ends, sett.ends),
        (draft.weft_spacing_m, draft.picks, sett.picks),
    ):
        room = np.full(count, 1.0) if own is None else np.asarray(own, np.float64)
        spacing.append(room * (count / per_m / float(room.sum())))
    spaced = replace(draft, warp_spacing_m=spacing[0], weft_spacing_m=spacing[1], warp_colour=None, weft_colour=None)
    return tile(spaced, ends=draft.ends + 1, picks=draft.picks + 1)
