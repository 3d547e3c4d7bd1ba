"""Plans and facts as lines of text."""

from collections.abc import Iterator

from ..models.facts import Fact
from .plan import MATERIAL, Plan

__all__ = ["fact_lines", "plan_lines"]


def plan_lines(plan: Plan, *, material: bool = True) -> Iterator[str]:
    """A plan as a person reads it. material: with what the cloth weighs and moves by, which facts say too."""
    for word, built in (("built", True), ("left out", False)):
        for stage in plan.stages:
            if stage.built is built and (material or stage.name != MATERIAL):
                yield f"{word:<9} {stage.name:<14} {stage.why}"
    about = "at most " if plan.about else ""
    yield f"{plan.key_points:,} key points, {plan.blocks:,} blocks, {about}{plan.particles:,} particles"
    yield f"about {plan.bytes / 1e6:,.0f} MB of {plan.limit / 1e6:,.0f} MB allowed"
    for note in plan.notes:
        yield f"note: {note}"


def fact_lines(facts: list[Fact]) -> Iterator[str]:
    """Facts in columns: what, ours, the textbook's."""
    if not facts:
        return
    name = max(len(f.name) for f in facts)
    value = max(len(f.value) for f in facts)
    for f in facts:
        yield f"{f.name:<{name}}  {f.value:<{value}}  {f.textbook}".rstrip()
