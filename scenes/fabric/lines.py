"""A ticket as lines of text: columns, each number with its band and where it is from."""

import re
from collections.abc import Iterable, Iterator

from taichi_cloth.mechanics.fibre_mechanics import FibreMechanics
from taichi_cloth.yarn.count import in_count
from taichi_cloth.yarn.yarn import Yarn

from .piece import Piece
from .ticket import Ticket

__all__ = ["ticket_lines"]

OUNCE = 33.906
"""g/m² of an ounce a square yard."""


def ticket_lines(ticket: Ticket) -> Iterator[str]:
    """A ticket as a person reads it."""
    if ticket.title:
        yield ticket.title
        yield ""
    yield from _columns(_made_of(ticket))
    yield ""
    yield from _columns(_woven(ticket.piece))
    yield ""
    yield from _columns(_yarn_needed(ticket.piece))
    yield ""
    yield from _columns(_properties(ticket))
    for note in ticket.notes:
        yield f"note: {note}"


def _columns(rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """Rows of words, each column as wide as its widest."""
    kept = list(rows)
    widths = [max(len(row[k]) for row in kept) for k in range(len(kept[0]))]
    for row in kept:
        yield "  ".join(f"{word:<{width}}" for word, width in zip(row, widths, strict=True)).rstrip()


def _made_of(ticket: Ticket) -> list[tuple[str, ...]]:
    made, (warp, weft) = ticket.construction, ticket.construction.families
    same = made.weft == made.warp
    return [
        ("fibre", warp.fibre.name if warp.fibre == weft.fibre else f"{warp.fibre.name}, weft {weft.fibre.name}"),
        ("yarn" if same else "warp yarn", _yarn(made.warp, warp.fibre)),
        *([] if same else [("weft yarn", _yarn(made.weft, weft.fibre))]),
        ("weave", f"{_short(made.draft.name)}, mean float of warp {_float(warp.turns)}, of weft {_float(weft.turns)}"),
        *([("finish", made.finish)] if made.finish != "plain" else []),
    ]


def _short(name: str) -> str:
    """Of a draft; a program may have left a path of its own machine in a file."""
    return re.split(r"[\\/](?!\d)", name)[-1] or "draft"


def _float(turns: float) -> str:
    """How many threads a float goes over, in the mean."""
    return f"{1.0 / turns:.2g}" if turns > 0 else "all"


def _yarn(yarn: Yarn, fibre: FibreMechanics) -> str:
    """Its count in tex and in the words of its trade, twist, and diameter."""
    plies = f"{yarn.plies} × " if yarn.plies > 1 else ""
    words = f"{plies}{in_count(yarn.count_tex, 'den'):.3g} den"
    if fibre.form == "spun":
        ne, nm = (f"{in_count(yarn.count_tex, system):.3g}" for system in ("Ne", "Nm"))
        words = f"Ne {ne}/{yarn.plies}, Nm {yarn.plies}/{nm}" if plies else f"Ne {ne}, Nm {nm}"
    return (
        f"{plies}{yarn.count_tex:.3g} tex ({words}), {yarn.twist_per_m:.0f} turns/m {yarn.twist}, "
        f"{1e3 * yarn.woven_diameter:.3f} mm"
    )


def _woven(piece: Piece) -> list[tuple[str, ...]]:
    along, across = piece.length, piece.width
    rows = [
        ("", "in the reed", "on the loom", "finished"),
        (
            "ends/cm",
            f"{piece.ends_per_cm_in_reed:.2f}",
            f"{piece.ends_per_cm_on_loom:.2f}",
            f"{piece.ends_per_cm_finished:.2f}",
        ),
        ("picks/cm", "", f"{piece.picks_per_cm_on_loom:.2f}", f"{piece.picks_per_cm_finished:.2f}"),
        ("width", f"{piece.width_in_reed:.3f} m", f"{across.on_loom:.3f} m", f"{across.size:.3f} m"),
        ("length", f"{along.yarn:.3f} m of warp", f"{along.on_loom:.3f} m", f"{along.size:.3f} m"),
        (
            "take-up",
            "",
            f"warp {100 * along.take_up:.1f} %, weft {100 * across.take_up:.1f} %",
            f"crimp {100 * along.crimp:.1f} % and {100 * across.crimp:.1f} %",
        ),
        ("shrinkage", "", "", f"length {100 * along.shrinkage:g} %, width {100 * across.shrinkage:g} %"),
    ]
    for name, way in (("warp", along), ("weft", across)):
        if way.yarn_shrinkage > 1e-9:
            rows.append(("", "", "", f"the {name} itself shrinks by {100 * way.yarn_shrinkage:.1f} %"))
    return rows


def _yarn_needed(piece: Piece) -> list[tuple[str, ...]]:
    waste = f", {piece.waste:g} m of warp wasted" if piece.waste else ""
    rows = [(f"yarn for {piece.length.size:g} × {piece.width.size:g} m{waste}", "threads", "m", "g")]
    rows += [(f"  {y.family} {y.colour}", f"{y.threads:,}", f"{y.metres:,.0f}", f"{y.grams:,.1f}") for y in piece.yarn]
    total = sum(y.metres for y in piece.yarn), sum(y.grams for y in piece.yarn)
    rows.append(("  in all", f"{piece.ends + piece.picks:,}", f"{total[0]:,.0f}", f"{total[1]:,.1f}"))
    return rows


def _properties(ticket: Ticket) -> list[tuple[str, ...]]:
    drawn: dict[str, str] = {}
    if ticket.drawn is not None:
        drawn = {
            "areal_density": f"{ticket.drawn_mass:.1f} g/m²",
            "body_thickness": f"{ticket.drawn.facts.thickness_mm:.3f} mm",
            "crimp_warp": f"{100 * ticket.drawn.facts.warp_crimp:.1f} %",
            "crimp_weft": f"{100 * ticket.drawn.facts.weft_crimp:.1f} %",
        }
    rows = [("", "from the construction", "", "drawn", "simulated" if ticket.simulated else "")]
    for key, quantity in ticket.properties.items():
        moves = ticket.simulated.get(key)
        own = moves is not None and moves.provenance != quantity.provenance
        shown = "" if moves is None else moves.shown + (f" ({moves.provenance})" if own else "")
        more = f" ({quantity.value / OUNCE:.3g} oz/yd²)" if key == "areal_density" else ""
        rows.append((quantity.name, quantity.shown + more, quantity.provenance, drawn.get(key, ""), shown))
    return rows
