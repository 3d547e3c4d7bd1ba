"""A pattern of another's, fitted to a body: parts, stacking, what carries it, grading, widening, places and holds."""

from dataclasses import replace

import numpy as np

from taichi_cloth.garment.fit.grade import even_out, find_rings, grade
from taichi_cloth.garment.fit.holding import held, hung
from taichi_cloth.garment.fit.landmarks import SMPL_ORIGIN, Landmarks, drafting_body
from taichi_cloth.garment.fit.lay_out import at_waist, drawn_for, lay_out
from taichi_cloth.garment.fit.let_out import LetOut, let_out
from taichi_cloth.garment.fit.limbs import lay_sleeves, turn_legs
from taichi_cloth.garment.fit.parts import assign, crotch_of, is_floor
from taichi_cloth.garment.fit.piece import UP, Work, pieces_of
from taichi_cloth.garment.fit.stack import Carried, carried, stack
from taichi_cloth.garment.fit.stand import halves_apart, stand, start_of
from taichi_cloth.garment.fit.widen import lengthen_jumpsuit, raise_tight, widen
from taichi_cloth.garment.pattern.folded import halved
from taichi_cloth.garment.pattern.pattern import Pattern
from taichi_cloth.ground.errors import InputError

__all__ = ["OVER_SHOULDERS", "fitted", "placed"]

TALLEST, SHORTEST = 1.15, 0.85
"""How much taller or shorter than the drafting body a file's own body may be taken to be."""
TOP_OF_SHOULDER = 0.04
"""Of the neck's side over the neck ends of a file's shoulder seams [m]."""
OVER_SHOULDERS = 0.04
"""Of what shoulders carry from where it comes to rest: it closes over them before it comes down [m]."""
BELOW_WAIST = 0.027
"""Of GarmentCode's waist under the narrowest girth [m]."""


def fitted(pattern: Pattern, worn: Landmarks, tight: LetOut | None = None) -> Pattern:
    """The pattern graded for a body and stood round it, held where its seams say that the waist or the bust carries it;
    panels are labelled with their part of the body. What was changed is in its notes. tight: what it was found to be
    when it was tried on as it is without.

    Raises InputError where nothing could carry it.
    """
    work, by, notes = placed(pattern, worn, tight)
    holds, more = held(work, by, worn)
    hangs = hung(work, by, worn)  # where shoulders belong, before halves go aside
    halves_apart(work)
    panels = [
        replace(
            piece.panel,
            edges=tuple(edges),
            place=place,
            label=piece.part,
        )
        for piece, edges, place in ((piece, *start_of(work, piece, worn)) for piece in work.pieces.values())
    ]
    made = Pattern(pattern.name, tuple(panels), work.seams, holds, (*pattern.notes, *notes, *more), hung=hangs)
    return halved(made)


def placed(pattern: Pattern, worn: Landmarks, tight: LetOut | None = None) -> tuple[Work, Carried, list[str]]:
    """All pieces graded and stood round the body; what carries them; what was widened."""
    work = pieces_of(pattern)
    laid = pattern.drafted is None
    floor = laid and is_floor(work)
    drafted = drafting_body(floor) if pattern.drafted is None else drawn_for(worn, pattern.drafted)
    if not laid:
        lay_out(work, drafted)
    elif not floor:
        for piece in work.pieces.values():
            piece.at = piece.at + SMPL_ORIGIN * UP
    if laid:
        assign(work, drafted)
    find_rings(work)
    stack(work)
    by = carried(work, drafted)
    if not laid:
        by = at_waist(work, by, drafted)
    if floor:
        tall = _stature(work, by, drafted)
        if abs(tall - 1) > 0.02:
            drafted = drafted.scaled(tall)
            assign(work, drafted)
            by = carried(work, drafted)
    if not by.by:
        raise InputError(
            f"pattern {pattern.name}: does not fit: no closed loop of cloth over waist, bust or shoulders that could "
            "carry it; allowed: a garment"
        )
    lift = by.lift
    fork = crotch_of(work)
    if by.by == "waist" and fork is not None and fork > drafted.height["crotch"] - 0.01:
        lift += drafted.height["crotch"] - 0.02 - fork  # drawn too high: they hang on the hips
    for piece in work.pieces.values():
        if not piece.part.startswith("arm"):
            piece.lift += lift
    grade(work, drafted, worn, None if by.armhole is None else by.armhole + lift)
    even_out(work)
    notes = raise_tight(work, worn)
    if by.by == "shoulders":
        notes += lengthen_jumpsuit(work, worn)
    higher = OVER_SHOULDERS if by.by == "shoulders" else 0.0
    notes += widen(work, worn, higher)
    notes += lay_sleeves(work, drafted, worn)
    even_out(work)
    widen(work, worn, higher, last=True)
    turn_legs(work, worn)
    notes += let_out(work, tight or {})
    stand(work, worn)
    if by.by == "shoulders":
        for piece in work.pieces.values():
            if not piece.part.startswith("arm"):
                piece.shift = piece.shift + OVER_SHOULDERS * UP
    return work, by, notes


def _stature(work: Work, by: Carried, drafted: Landmarks) -> float:
    """Whom the file was drafted for, over the usual body: it does not say, but its own top does."""
    h = drafted.height
    tall = 1.0
    if by.by == "shoulders":
        tall = (h["neck"] - by.lift + TOP_OF_SHOULDER) / h["neck"]
    elif by.by == "waist":
        around = work.of("trunk", "skirt", "leg_l", "leg_r")
        tall = max(float(piece.level().max()) for piece in around) / (h["waist"] - BELOW_WAIST)
    return float(np.clip(tall, SHORTEST, TALLEST))
