"""Softens a mapping: reduces the movement of limbs that stretch the surface too much.

A performer's arms swing farther than a fox's forelegs can. The stretch of the surface limits the rotation of
a joint. The weights of limbs are reduced, the same on both sides, until the stretch is within its bound.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Bool, Int32
from enliven.document import Clip, Project, RiggedCharacter
from enliven.mapping.applying import apply_plan
from enliven.mapping.legs.gait import legs_that_step
from enliven.mapping.legs.steps import apply_steps
from enliven.mapping.plan import ChainPlan, Plan
from enliven.mapping.quality import MAX_STRETCH, stretch_over_time

_TARGET_STRETCH = 0.97
"""Target stretch as a fraction of the bound. It is below 1, because stretch may be slightly larger between
the measured times."""
_WEIGHT_FACTOR = 0.85
"""Factor that multiplies the weight of a limb in each round."""
_MIN_WEIGHT = 0.4
"""Minimum weight of a limb. With a smaller weight, the performer's movement would not be recognisable."""
_MIN_BLAME_FRACTION = 0.4
"""The weights of the worst limb and of all limbs with at least this fraction of its overstretched edges are
reduced together."""
_MAX_ROUNDS = 12
"""Maximum number of times that the mapping is changed."""


def soften_plan(plan: Plan, clip: Clip, shape: RiggedCharacter) -> Plan:
    """Returns the mapping with reduced weights for limbs that would stretch the surface beyond the bound."""
    # Length changes that the take itself contains are intended, so they are not measured.
    plan_in_place = replace(plan, travel=False, stretch=False)
    best_plan, least_stretch, stepping_roles = plan, np.inf, _stepping_roles(plan, clip, shape)
    for _ in range(_MAX_ROUNDS):
        project, rebased_clip = apply_plan(Project(), shape, clip, plan_in_place)
        project = apply_steps(project, shape.id, clip, rebased_clip, plan_in_place)
        edges, stretch = stretch_over_time(project, shape.id, rebased_clip.duration)
        stretch_percentile = float(np.percentile(stretch, 99)) if stretch.size else 1.0
        if stretch_percentile < least_stretch:
            best_plan, least_stretch = (
                replace(plan, chains=plan_in_place.chains, stride=plan_in_place.stride),
                stretch_percentile,
            )
        edge_counts = _find_overstretched_edges(
            plan_in_place, shape, edges, stretch > _TARGET_STRETCH * MAX_STRETCH
        )
        edge_counts = {
            role: edge_count
            for role, edge_count in edge_counts.items()
            if _limb_weight(plan_in_place, role) * _WEIGHT_FACTOR >= _MIN_WEIGHT
        }
        if stretch_percentile <= _TARGET_STRETCH * MAX_STRETCH or not edge_counts:
            break
        max_count = max(edge_counts.values())
        reduced_roles = {
            role for role, edge_count in edge_counts.items() if edge_count >= _MIN_BLAME_FRACTION * max_count
        }
        plan_in_place = replace(
            plan_in_place,
            chains=tuple(_with_less_weight(chain, reduced_roles) for chain in plan_in_place.chains),
        )
        if reduced_roles & stepping_roles:
            plan_in_place = replace(plan_in_place, stride=plan_in_place.stride * _WEIGHT_FACTOR)
    return best_plan


def limb_name(chain: ChainPlan) -> str:
    """Returns the role of a chain without side and "girdle", such as "arm" for "left arm girdle"."""
    words = [word for word in chain.role.split() if word not in ("left", "right", "girdle")]
    return " ".join(words)


def _stepping_roles(plan: Plan, clip: Clip, shape: RiggedCharacter) -> set[str]:
    """Returns the limb names of the chains that drive stepping legs."""
    legs = {joint for limb in legs_that_step(shape, clip, plan) for joint in limb.proper[1:]}
    return {limb_name(c) for c in plan.chains if shape.skeleton.index(c.target[-1]) in legs}


def _with_less_weight(chain: ChainPlan, roles: set[str]) -> ChainPlan:
    return replace(chain, weight=chain.weight * _WEIGHT_FACTOR) if limb_name(chain) in roles else chain


def _limb_weight(plan: Plan, role: str) -> float:
    return min(chain.weight for chain in plan.chains if limb_name(chain) == role)


def _find_overstretched_edges(
    plan: Plan, shape: RiggedCharacter, edges: Int32, is_overstretched: Bool
) -> dict[str, float]:
    """Returns the number of overstretched edges at the bones of each limb. ``is_overstretched`` (T, E) marks
    these edges over time."""
    skeleton, skin = shape.skeleton, shape.skin
    if skin is None:
        return {}
    limbs: list[str] = [""] * len(skeleton)
    for chain in plan.chains:
        path = skeleton.path(skeleton.index(chain.target[0]), skeleton.index(chain.target[-1]))
        for j in path[1:]:
            limbs[j] = limb_name(chain)
    for j in range(1, len(skeleton)):
        limbs[j] = limbs[j] or limbs[skeleton.parents[j]]
    count = np.bincount(edges.ravel(), np.repeat(is_overstretched.sum(0), 2).astype(float), len(skin.indices))
    count_by_limb: dict[str, float] = {}
    for k in range(skin.indices.shape[1]):
        edge_counts = np.bincount(skin.indices[:, k], count * skin.weights[:, k], len(skeleton))
        for limb, edge_count in zip(limbs, edge_counts, strict=True):
            if limb and edge_count > 0.0:
                count_by_limb[limb] = count_by_limb.get(limb, 0.0) + float(edge_count)
    return count_by_limb
