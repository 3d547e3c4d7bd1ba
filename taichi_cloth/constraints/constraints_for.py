"""Which constraints a sheet needs (paper 4.1), put together above the solver, which runs what it is given."""

from taichi_cloth.constraints.contact import Contact
from taichi_cloth.constraints.contact_middles import MiddleContact
from taichi_cloth.constraints.strain_limit import ThreadLimit
from taichi_cloth.constraints.thin_limbs import let_through
from taichi_cloth.constraints.ties import Ties
from taichi_cloth.layer_loops.layer_loops import LayerLoops
from taichi_cloth.layers.layer_contact import LayerContact
from taichi_cloth.layers.outline import Outline
from taichi_cloth.motion.constraint import Constraint
from taichi_cloth.motion.forces import Forces
from taichi_cloth.sheet.sheet import Sheet

__all__ = ["constraints_for"]


def constraints_for(
    sheet: Sheet,
    forces: Forces,
    *,
    ties: tuple[Ties, ...] = (),
    outline: Outline | None = None,
    answered: tuple[str, ...] = (),
) -> tuple[Constraint, ...]:
    """In the order in which a substep goes through them: ties, cloth on cloth, strain limit, the body.

    (Seams and strain limit, which are repeated, come after all others of a substep; see `Frame`.) outline: of cloth
    whose cells are not all whole, or that is sewn. answered: fields of the forces that the solver sees to itself. No
    Taichi needed: fields are made when a solver first runs.
    Raises InputError on forces that the sheet cannot have.
    """
    out: list[Constraint] = [*ties]
    if forces.self_contact is not None:
        out.append(LayerContact(sheet, forces.self_contact, outline, keeps=not ties, loops_of=LayerLoops))
    if forces.strain_limit is not None and "strain_limit" not in answered:
        out.append(ThreadLimit(sheet))
    if forces.body is not None:
        contact = Contact(forces.body, sheet)
        out.append(contact)
        thin = let_through(forces.body, sheet.springs.diagonal_length)
        if len(thin):
            out.append(MiddleContact(contact, sheet, thin))
    return tuple(out)
