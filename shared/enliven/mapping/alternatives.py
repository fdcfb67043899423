"""Another mapping, offered where the one that was found does what is seen: judged by all that is measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from enliven.document import Shape
from enliven.mapping.automatic_mapping import Retargeted, retarget
from enliven.mapping.ground import stands
from enliven.mapping.plan import Plan
from enliven.mapping.quality import MotionQuality, quality_of
from enliven.mapping.softening import softened

_BETTER = 0.8
"""Share of the faults that another mapping has at most, to be worth offering."""
_GENTLE = 0.6
"""Weight of limbs that are moved less so that they keep out of one another."""


@dataclass(frozen=True)
class NextBest:
    """Another mapping of a take to a shape.

    Attributes:
        how: it differs, in words of the command line.
    """

    how: str
    plan: Plan
    quality: MotionQuality


def next_best(made: Retargeted, shape: Shape, quality: MotionQuality) -> NextBest | None:
    """The mapping with the least faults of those that differ in one thing from what was made; None where
    nothing of that is beyond its bound, or none has clearly less of it.

    Args:
        quality: of what was made.
    """
    if quality.beyond == 0.0:
        return None
    found = [NextBest(how, plan, _measured(made, shape, plan)) for how, plan in _others(made, shape)]
    best = min(found, key=lambda one: one.quality.faults)
    return best if best.quality.faults < _BETTER * quality.faults else None


def _measured(made: Retargeted, shape: Shape, plan: Plan) -> MotionQuality:
    other = retarget(shape, made.clip, plan, clips=made.clips)
    return quality_of(other.project, other.shape_id, made.clip, other.duration, other.plan)


def _others(made: Retargeted, shape: Shape) -> Iterator[tuple[str, Plan]]:
    """Mappings that differ in one thing, and how."""
    plan, clip = made.plan, made.clip
    soft = softened(plan, clip, shape)
    if soft != plan:
        yield "moved less where it stretches", soft
    for mode in ("move", "pose"):
        chains = tuple(replace(chain, mode=mode) for chain in plan.chains)
        if chains != plan.chains:
            yield f"with --mode {mode}", softened(replace(plan, chains=chains), clip, shape)
    chains = tuple(
        chain if "whole" in chain.role else replace(chain, weight=_GENTLE * chain.weight)
        for chain in plan.chains
    )
    yield f"with limbs moved by {_GENTLE:.0%}", replace(plan, chains=chains)
    if stands(shape):
        yield ("with --no-steps" if plan.steps else "with --steps"), replace(plan, steps=not plan.steps)
        if not plan.floor:
            yield "with --floor", replace(plan, floor=True)
        if plan.travel and not plan.pin:
            yield "with --pin", replace(plan, pin=True)
