"""Searches for a better mapping from a take to a shape. Candidates are compared by all measures of
quality."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from enliven.document import RiggedCharacter
from enliven.mapping.automatic_mapping import RetargetedShape, retarget
from enliven.mapping.ground import stands_on_floor
from enliven.mapping.plan import Plan
from enliven.mapping.quality import MotionQuality, measure_quality
from enliven.mapping.softening import soften_plan

_MAX_FAULT_RATIO = 0.8
"""An alternative is offered only if its fault score is below this fraction of the current mapping's score."""
_GENTLE_WEIGHT = 0.6
"""Factor on the weight of all limbs in one of the candidate mappings. Limbs that move less collide less."""


@dataclass(frozen=True)
class NextBest:
    """An alternative mapping of a take to a shape.

    Attributes:
        how: description of the difference from the current mapping, in words or as command line options.
        plan: the mapping.
        quality: the measures of the motion with this mapping.
    """

    how: str
    plan: Plan
    quality: MotionQuality


def find_better_mapping(
    retargeted: RetargetedShape, shape: RiggedCharacter, quality: MotionQuality
) -> NextBest | None:
    """Returns the best mapping that differs from the current one in one choice.

    Returns None if all measures of the current mapping are within their bounds, or if no alternative is
    clearly better.

    Args:
        retargeted: the retargeted shape with its current mapping.
        shape: the shape at rest.
        quality: the measures of ``retargeted``.
    """
    if quality.total_excess == 0.0:
        return None
    alternatives = [
        NextBest(description, plan, _measure_alternative(retargeted, shape, plan))
        for description, plan in _find_other_mappings(retargeted, shape)
    ]
    best = min(alternatives, key=lambda candidate: candidate.quality.faults)
    return best if best.quality.faults < _MAX_FAULT_RATIO * quality.faults else None


def _measure_alternative(retargeted: RetargetedShape, shape: RiggedCharacter, plan: Plan) -> MotionQuality:
    alternative = retarget(shape, retargeted.clip, plan, clips=retargeted.clips)
    return measure_quality(
        alternative.project, alternative.shape_id, retargeted.clip, alternative.duration, alternative.plan
    )


def _find_other_mappings(retargeted: RetargetedShape, shape: RiggedCharacter) -> Iterator[tuple[str, Plan]]:
    """Yields each mapping that differs from the current one in one choice, with a description of the
    difference."""
    plan, clip = retargeted.plan, retargeted.clip
    soft = soften_plan(plan, clip, shape)
    if soft != plan:
        yield "with less motion where the surface stretches", soft
    for mode in ("move", "pose"):
        chains = tuple(replace(chain, mode=mode) for chain in plan.chains)
        if chains != plan.chains:
            yield f"with --mode {mode}", soften_plan(replace(plan, chains=chains), clip, shape)
    chains = tuple(
        chain if "whole" in chain.role else replace(chain, weight=_GENTLE_WEIGHT * chain.weight)
        for chain in plan.chains
    )
    yield f"with limb motion reduced to {_GENTLE_WEIGHT:.0%}", replace(plan, chains=chains)
    if stands_on_floor(shape):
        yield ("with --no-steps" if plan.steps else "with --steps"), replace(plan, steps=not plan.steps)
        if not plan.floor:
            yield "with --floor", replace(plan, floor=True)
        if plan.travel and not plan.pin:
            yield "with --pin", replace(plan, pin=True)
