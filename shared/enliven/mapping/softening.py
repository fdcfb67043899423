"""A mapping made gentler where the surface would stretch: the limbs that stretch it are moved by less.

A performer's arms reach farther than a fox's forelegs were made to. The surface itself says how far a joint
may turn: movements are weighted down, both sides alike, until stretch is within the bound.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Bool, Int32
from enliven.document import Clip, Project, Shape
from enliven.mapping.applying import apply_plan
from enliven.mapping.gait import legs_that_step
from enliven.mapping.plan import ChainPlan, Plan
from enliven.mapping.quality import BOUND, stretches
from enliven.mapping.steps import stepped

_AIM = 0.97
"""Share of the bound that is aimed at: other moments than those looked at stretch a little more."""
_LESS = 0.85
"""Factor by which the movement of a limb is weighted down at a time."""
_LEAST = 0.4
"""Weight below which a limb's movement is not brought: less is no movement of the performer's."""
_BLAMED = 0.4
"""Share of the most blamed limb's blame from which others are weighted down with it."""
_ROUNDS = 12
"""Times that the mapping is changed at most."""


def softened(plan: Plan, clip: Clip, shape: Shape) -> Plan:
    """The mapping with less movement in the limbs that would stretch the surface beyond the bound."""
    # What stretches because the take does is meant to.
    bare = replace(plan, travel=False, stretch=False)
    best, least, striding = plan, np.inf, _striding(plan, clip, shape)
    for _ in range(_ROUNDS):
        project, based = apply_plan(Project(), shape, clip, bare)
        project = stepped(project, shape.id, clip, based, bare)
        edges, stretch = stretches(project, shape.id, based.duration)
        at = float(np.percentile(stretch, 99)) if stretch.size else 1.0
        if at < least:
            best, least = replace(plan, chains=bare.chains, stride=bare.stride), at
        blame = _blame(bare, shape, edges, stretch > _AIM * BOUND)
        blame = {role: much for role, much in blame.items() if _weight(bare, role) * _LESS >= _LEAST}
        if at <= _AIM * BOUND or not blame:
            break
        most = max(blame.values())
        chosen = {role for role, much in blame.items() if much >= _BLAMED * most}
        bare = replace(bare, chains=tuple(_lessened(chain, chosen) for chain in bare.chains))
        if chosen & striding:
            bare = replace(bare, stride=bare.stride * _LESS)
    return best


def limb_of(chain: ChainPlan) -> str:
    """The role of a chain without its side: what both sides have in common."""
    words = [word for word in chain.role.split() if word not in ("left", "right", "girdle")]
    return " ".join(words)


def _striding(plan: Plan, clip: Clip, shape: Shape) -> set[str]:
    """The roles of the chains of legs that step: how far they do is weighted down as well."""
    legs = {joint for limb in legs_that_step(shape, clip, plan) for joint in limb.proper[1:]}
    return {limb_of(c) for c in plan.chains if shape.skeleton.index(c.target[-1]) in legs}


def _lessened(chain: ChainPlan, roles: set[str]) -> ChainPlan:
    return replace(chain, weight=chain.weight * _LESS) if limb_of(chain) in roles else chain


def _weight(plan: Plan, role: str) -> float:
    return min(chain.weight for chain in plan.chains if limb_of(chain) == role)


def _blame(plan: Plan, shape: Shape, edges: Int32, torn: Bool) -> dict[str, float]:
    """How many torn edges (T, E) there are at the bones of each limb."""
    skeleton, skin = shape.skeleton, shape.skin
    if skin is None:
        return {}
    limbs: list[str] = [""] * len(skeleton)
    for chain in plan.chains:
        path = skeleton.path(skeleton.index(chain.target[0]), skeleton.index(chain.target[-1]))
        for j in path[1:]:
            limbs[j] = limb_of(chain)
    for j in range(1, len(skeleton)):
        limbs[j] = limbs[j] or limbs[skeleton.parents[j]]
    count = np.bincount(edges.ravel(), np.repeat(torn.sum(0), 2).astype(float), len(skin.indices))
    blame: dict[str, float] = {}
    for k in range(skin.indices.shape[1]):
        share = np.bincount(skin.indices[:, k], count * skin.weights[:, k], len(skeleton))
        for limb, much in zip(limbs, share, strict=True):
            if limb and much > 0.0:
                blame[limb] = blame.get(limb, 0.0) + float(much)
    return blame
