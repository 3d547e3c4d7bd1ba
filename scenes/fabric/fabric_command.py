"""`taichi-cloth fabric`: the mill's ticket of a scene or a draft, as a table or as JSON."""

import json
from dataclasses import replace
from pathlib import Path

from taichi_cloth.ground.errors import InputError

from ..scene.load import load_scene
from .lines import ticket_lines
from .ticket import PieceAsked, Ticket, ticket_of

__all__ = ["print_ticket"]


def print_ticket(
    name: str,
    overrides: list[str],
    asked: PieceAsked,
    *,
    measured: Path | None,
    as_json: bool,
    draped: bool = False,
    shadow: Path | None = None,
) -> None:
    """One ticket to standard output. draped: with the drape coefficient of a simulated disc, which starts Taichi.
    shadow: a .png for its shadow. Raises InputError before anything is printed."""
    if shadow is not None and (not draped or shadow.suffix.lower() != ".png" or not shadow.parent.is_dir()):
        raise InputError(f"--shadow: {shadow}; allowed with --drape: a .png in a folder that is there")
    ticket = ticket_of(load_scene(name, overrides), asked, None if measured is None else str(measured))
    if overrides:  # a title is of the scene as it stands in its file
        ticket = replace(ticket, title=f"{ticket.title}, with {', '.join(overrides)}")
    if as_json:
        drape = _drape(ticket, shadow) if draped else None
        print(json.dumps(ticket.as_dict() | ({} if drape is None else {"drape": drape}), indent=2, ensure_ascii=False))
        return
    for line in ticket_lines(ticket):
        print(line, flush=True)
    if draped:
        drape = _drape(ticket, shadow)
        each = ", ".join(f"{one:.0f}" for one in drape["of_each_percent"])
        folds = "/".join(str(one) for one in drape["folds"])
        print(
            f"draped disc (30 cm on 18, simulated): coefficient {drape['coefficient_percent']:.0f} %, "
            f"specimens {each}; {folds} folds, {drape['key_points']:,} key points"
        )


def _drape(ticket: Ticket, shadow: Path | None) -> dict:
    """Of the disc that is simulated, for JSON."""
    from taichi_cloth.ground import runtime

    from ...render.image.image import write_png
    from ..commands.progress import staged
    from .drapemeter import drape, picture_of

    runtime.start("cpu")
    with staged() as (each, _):
        found = drape(ticket.material, each=lambda done, most: each("drape", done, most))
    if shadow is not None:
        write_png(shadow, picture_of(found))
    return {
        "coefficient_percent": found.coefficient,
        "of_each_percent": found.coefficients.tolist(),
        "folds": found.folds.tolist(),
        "key_points": found.key_points,
        "spacing_mm": 1e3 * found.spacing,
    }
