"""`taichi-cloth fabric`: the mill's ticket of a scene or a draft, as a table or as JSON."""

import json
from pathlib import Path

from ..scene.load import load_scene
from .lines import ticket_lines
from .ticket import PieceAsked, ticket_of

__all__ = ["print_ticket"]


def print_ticket(name: str, overrides: list[str], asked: PieceAsked, *, measured: Path | None, as_json: bool) -> None:
    """One ticket to standard output. Raises InputError before anything is printed."""
    ticket = ticket_of(load_scene(name, overrides), asked, None if measured is None else str(measured))
    if as_json:
        print(json.dumps(ticket.as_dict(), indent=2, ensure_ascii=False))
        return
    for line in ticket_lines(ticket):
        print(line)
