"""Patterns that say on which part of the body a panel is worn but not where it stands, as DXF: a place for each.

Heights need only be near: seams stack panels as they are worn, and the waist, the bust or the shoulders carry them.
What is drawn for the wearer's own body is not graded, as its girths and heights are the wearer's.
"""

from dataclasses import replace

import numpy as np

from taichi_cloth.garment.fit.landmarks import Landmarks
from taichi_cloth.garment.fit.piece import UP, Piece, Work
from taichi_cloth.garment.fit.stack import Carried
from taichi_cloth.ground.errors import InputError

__all__ = ["at_waist", "drawn_for", "lay_out"]

GIRTHS = {
    "bust": ("bust", "underbust", "upper_arm"),
    "waist": ("waist",),
    "hip": ("hip", "thigh", "knee"),
}
"""Which girths of a body go by a stated one."""


def drawn_for(worn: Landmarks, measures: dict[str, float]) -> Landmarks:
    """Whom a pattern was drawn for: the wearer but for what is stated, stature, bust, waist and hip [m]."""
    tall = measures.get("stature", worn.height["top"]) / worn.height["top"]
    out = worn.scaled(tall)
    girth = dict(worn.girth)
    for name, all_of in GIRTHS.items():
        if name in measures:
            girth |= {key: worn.girth[key] * measures[name] / worn.girth[name] for key in all_of}
    across = measures["bust"] / worn.girth["bust"] if "bust" in measures else 1.0
    return replace(out, girth=girth, shoulder=worn.shoulder * np.sqrt(across))


def lay_out(work: Work, drafted: Landmarks) -> None:
    """Gives each piece its part, its side and a place. Raises InputError for a leg that is one piece round."""
    for piece in work.pieces.values():
        piece.part = piece.panel.label
        piece.side = _side(piece)
        piece.tube = _tube(work, piece)
        if piece.tube and piece.part.startswith("leg"):
            raise InputError(f"panel {piece.name}: a leg of one piece; allowed: a front and a back for each leg")
        if piece.part.startswith("arm"):
            _along_arm(piece, drafted)
            continue
        w = piece.world()
        top = drafted.height["waist" if piece.part in ("skirt", "leg_l", "leg_r") else "neck"]
        edge = w[:, 1].min() if piece.part == "head" else w[:, 1].max()
        piece.at = piece.at + (top - edge) * UP
        if piece.part.startswith("leg"):
            _leg(piece)


def at_waist(work: Work, by: Carried, drafted: Landmarks) -> Carried:
    """With its top at the waist, where that carries it."""
    if by.by != "waist":
        return by
    around = work.of("trunk", "skirt", "leg_l", "leg_r")
    return replace(by, lift=drafted.height["waist"] - max(float(piece.level().max()) for piece in around))


def _side(piece: Piece) -> str:
    n = piece.normal
    if abs(n[2]) > 0.5:
        return "front" if n[2] > 0 else "back"
    return "left" if n[0] > 0 else "right"


def _tube(work: Work, piece: Piece) -> bool:
    """Whether it is sewn to itself along two edges that share no end: a dart's share one."""
    for seam in work.seams:
        if seam.first.panel == seam.second.panel == piece.name:
            one, two = (piece.edges[side.edge][[0, -1]] for side in (seam.first, seam.second))
            if np.linalg.norm(one[:, None] - two[None], axis=2).min() > 1e-4:
                return True
    return False


def _along_arm(piece: Piece, drafted: Landmarks) -> None:
    """A sleeve, drawn with its cap up, in a plane before or behind the arm."""
    sign = 1.0 if piece.part == "arm_l" else -1.0
    way = (drafted.arm[2] - drafted.arm[0]) * [sign, 1, 0]
    way /= np.linalg.norm(way)
    out = np.array([0.0, 0.0, -1.0 if piece.side == "back" and not piece.tube else 1.0])
    piece.side = "front" if out[2] > 0 else "back"
    piece.rotation = np.stack([np.cross(-way, out), -way, out], axis=1)
    outline = np.concatenate([edge[:-1] for edge in piece.edges])
    cap = np.array([(outline[:, 0].min() + outline[:, 0].max()) / 2, outline[:, 1].max(), 0.0])
    piece.at = drafted.arm[0] * [sign, 1, 0] - piece.rotation @ cap


def _leg(piece: Piece) -> None:
    """Half a leg with the inner end of its top in the middle plane: the fork reaches over to the other leg."""
    sign = 1.0 if piece.part == "leg_l" else -1.0
    w = piece.world()
    high = w[w[:, 1] > w[:, 1].max() - 0.15 * np.ptp(w[:, 1])]
    piece.at = piece.at - np.array([sign * float((sign * high[:, 0]).min()), 0.0, 0.0])
