"""Templates cut into octets: the eight particles that one vector instruction moves.

The cloth's frame at a particle depends on its ratio along the block alone, and the fibres of a block are cut at the
same ratios. So a template's particles are put into octets such that many octets have the same eight ratios; those
that do follow one another, in a *run*, and share one frame for each lane.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_cloth.fabric.templates import TemplateBank
from taichi_cloth.ground.particles import OCTET

__all__ = ["Octets", "octets_of"]

Octet = tuple[int, ...]
"""Numbers of up to eight particles, in the order of the lanes."""
I64 = NDArray[np.int64]


@dataclass(frozen=True)
class Octets:
    """Where a bank's particles stand. Octets and runs are numbered through, template by template.

    octet, run: (templates + 1,) first octet and first run of each template. start: (runs + 1,) first octet of each run.
    ratio: (runs, 8) float32. place: (particles,) place of each particle of the bank, of those of its own template.
    source: (octets, 8) the particle that stands in each place; in those that are left over, another one of the run.
    """

    octet: I64
    run: I64
    start: NDArray[np.int32]
    ratio: NDArray[np.float32]
    place: I64
    source: I64


def octets_of(bank: TemplateBank) -> Octets:
    """The octets of all templates."""
    known: dict[bytes, list[list[Octet]]] = {}
    octet, run, sizes, ratio, source = [0], [0], [], [], []
    place = np.zeros(len(bank.u), np.int64)
    for begin, end in zip(bank.start[:-1].tolist(), bank.start[1:].tolist(), strict=True):
        u = bank.u[begin:end]
        runs = known.setdefault(u.tobytes(), [])
        if not runs:
            runs += min((_runs(cut, u) for cut in (_in_order(u), _by_ratio(u))), key=_cost)
        for part in runs:
            first = part[0] + part[0][-1:] * (OCTET - len(part[0]))
            for one in part:
                place[begin + np.array(one)] = OCTET * (len(source) - octet[-1]) + np.arange(len(one))
                source.append([begin + k for k in one + first[len(one) :]])
            ratio.append(u[list(first)])
            sizes.append(len(part))
        octet.append(len(source))
        run.append(len(sizes))
    return Octets(
        octet=np.array(octet),
        run=np.array(run),
        start=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32),
        ratio=np.array(ratio, np.float32).reshape(-1, OCTET),
        place=place,
        source=np.array(source, np.int64).reshape(-1, OCTET),
    )


def _in_order(u: NDArray) -> list[Octet]:
    """The particles as they come."""
    return [tuple(range(k, min(k + OCTET, len(u)))) for k in range(0, len(u), OCTET)]


def _by_ratio(u: NDArray) -> list[Octet]:
    """Eight different ratios at a time, of those that as many particles have, as often as these fill the lanes."""
    _values, which = np.unique(u, return_inverse=True)
    owners = [np.flatnonzero(which == k).tolist() for k in range(int(which.max(initial=-1)) + 1)]
    out: list[Octet] = []
    for count in sorted({len(mine) for mine in owners}, reverse=True):
        alike = [mine for mine in owners if len(mine) == count]
        if count == 1:
            alone = [mine[0] for mine in alike]
            out += [tuple(alone[k : k + OCTET]) for k in range(0, len(alone), OCTET)]
            continue
        for first in range(0, len(alike), OCTET):
            out += zip(*alike[first : first + OCTET], strict=True)
    return out


def _runs(cut: list[Octet], u: NDArray) -> list[list[Octet]]:
    """Octets with the same ratios side by side, the longest first, so that a part of one joins the whole."""
    found: dict[bytes, list[Octet]] = {}
    for one in sorted(cut, key=len, reverse=True):
        pattern = u[list(one)].tobytes()
        key = next((known for known in found if known.startswith(pattern)), pattern)
        found.setdefault(key, []).append(one)
    return list(found.values())


def _cost(runs: list[list[Octet]]) -> int:
    """In the time of one octet, which is also that of a run's frames: places that stay empty are written and drawn."""
    return sum(len(part) for part in runs) + len(runs)
