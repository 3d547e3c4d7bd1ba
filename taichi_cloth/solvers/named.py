"""Solvers by the name that a scene gives them."""

from taichi_cloth.ground.errors import InputError, did_you_mean
from taichi_cloth.solvers.verlet import Verlet
from taichi_cloth.solvers.yarns import Yarns

__all__ = ["SOLVERS", "named_solver"]

SOLVERS: dict[str, type[Verlet] | type[Yarns]] = {"verlet": Verlet, "yarns": Yarns}


def named_solver(name: str) -> type[Verlet] | type[Yarns]:
    """Raises InputError on a name that is not known."""
    if name not in SOLVERS:
        raise InputError(f"solver.name: {name!r}; known: {', '.join(SOLVERS)}{did_you_mean(name, SOLVERS)}")
    return SOLVERS[name]
