"""Softens a mapping: reduces the movement of limbs that stretch the surface too much.

A performer's arms swing farther than a fox's forelegs can. The stretch of the surface determines how far a
joint may rotate. Weights of limbs are reduced, the same on both sides, until stretch is within its bound.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Bool, Int32
from enliven.document import Clip, Project, Shape
from enliven.mapping.applying import apply_plan
from enliven.mapping.gait import legs_that_step
from enliven.mapping.plan import ChainPlan, Plan
from enliven.mapping.quality import MAX_STRETCH, stretch_over_time
from enliven.mapping.steps import stepped

_TARGET_STRETCH = 0.97
"""Target stretch as a fraction of the bound. Moments that are not measured stretch slightly more."""
_WEIGHT_FACTOR = 0.85
"""Factor on the weight of a limb in each round."""
_MIN_WEIGHT = 0.4
"""Minimum weight of a limb. With less, the performer's movement would not be recognisable."""
_MIN_BLAME_FRACTION = 0.4
"""Limbs with at least this fraction of the worst limb's overstretched edges are reduced together with it."""
_MAX_ROUNDS = 12
"""Maximum number of times that the mapping is changed."""


def soften_plan(plan: Plan, clip: Clip, shape: Shape) -> Plan:
    """Returns the mapping with less movement in limbs that would stretch the surface beyond the bound."""
    # Stretch that the take itself contains is intended, so it is not measured.
    bare = replace(plan, travel=False, stretch=False)
    best, least, striding = plan, np.inf, _stepping_roles(plan, clip, shape)
    for _ in range(_MAX_ROUNDS):
        project, based = apply_plan(Project(), shape, clip, bare)
        project = stepped(project, shape.id, clip, based, bare)
        edges, stretch = stretch_over_time(project, shape.id, based.duration)
        at = float(np.percentile(stretch, 99)) if stretch.size else 1.0
        if at < least:
            best, least = replace(plan, chains=bare.chains, stride=bare.stride), at
        blame = _overstretched_edges(bare, shape, edges, stretch > _TARGET_STRETCH * MAX_STRETCH)
        blame = {
            role: edge_count
            for role, edge_count in blame.items()
            if _limb_weight(bare, role) * _WEIGHT_FACTOR >= _MIN_WEIGHT
        }
        if at <= _TARGET_STRETCH * MAX_STRETCH or not blame:
            break
        most = max(blame.values())
        chosen = {role for role, edge_count in blame.items() if edge_count >= _MIN_BLAME_FRACTION * most}
        bare = replace(bare, chains=tuple(_with_less_weight(chain, chosen) for chain in bare.chains))
        if chosen & striding:
            bare = replace(bare, stride=bare.stride * _WEIGHT_FACTOR)
    return best


def limb_name(chain: ChainPlan) -> str:
    """Returns the role of a chain without its side and "girdle", which is the same for both sides."""
    words = [word for word in chain.role.split() if word not in ("left", "right", "girdle")]
    return " ".join(words)


def _stepping_roles(plan: Plan, clip: Clip, shape: Shape) -> set[str]:
    """Returns the roles of the chains of stepping legs. The stride of these legs is reduced as well."""
    legs = {joint for limb in legs_that_step(shape, clip, plan) for joint in limb.proper[1:]}
    return {limb_name(c) for c in plan.chains if shape.skeleton.index(c.target[-1]) in legs}


def _with_less_weight(chain: ChainPlan, roles: set[str]) -> ChainPlan:
    return replace(chain, weight=chain.weight * _WEIGHT_FACTOR) if limb_name(chain) in roles else chain


def _limb_weight(plan: Plan, role: str) -> float:
    return min(chain.weight for chain in plan.chains if limb_name(chain) == role)


def _overstretched_edges(plan: Plan, shape: Shape, edges: Int32, torn: Bool) -> dict[str, float]:
    """Returns the number of overstretched edges at the bones of each limb, from ``torn`` (T, E)."""
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
    count = np.bincount(edges.ravel(), np.repeat(torn.sum(0), 2).astype(float), len(skin.indices))
    blame: dict[str, float] = {}
    for k in range(skin.indices.shape[1]):
        edge_counts = np.bincount(skin.indices[:, k], count * skin.weights[:, k], len(skeleton))
        for limb, edge_count in zip(limbs, edge_counts, strict=True):
            if limb and edge_count > 0.0:
                blame[limb] = blame.get(limb, 0.0) + float(edge_count)
    return blame
