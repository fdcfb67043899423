"""Which joint of a performer a control point is meant to follow: a first guess, by side and height.

guess_joints(clip.skeleton, puppet.rest)          # ("LeftHand end", "RightHand end", "Head end", ...)

Both are looked at from the front (+Z, left at +X), each scaled to its own width and height; a mesh that is
wider from the side is taken to look at +X. Ends of limbs are taken before what is between them, and no joint
twice while there are others.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from enliven.arrays import Float
from enliven.mapping.anatomy import Anatomy, Limb, anatomy_of
from enliven.mapping.facing import turned_level
from enliven.skeleton import Skeleton

_MIDDLE, _TRUNK, _OTHER = 0.25, 0.35, 0.6
"""What it costs, in widths and heights, to follow the middle of a limb, the trunk, or a finger."""
_DEPTH = 0.3
"""How much depth counts beside width and height."""
_SIDE = 0.3
"""What it costs to follow a side from the middle or the middle from a side; twice that, the other side."""
_DEEPER = 1.5
"""So many times deeper than wide, a mesh is looked at from the side."""
_ASIDE = 0.15
"""Share of half the width from which a place is on a side."""


class _Candidate(NamedTuple):
    joint: int
    cost: float
    side: int


def guess_joints(skeleton: Skeleton, rest: Float) -> tuple[str, ...]:
    """(P,) names of joints for control points at ``rest`` (P, 3) metres, in the mesh's own frame.

    A joint is guessed twice only where there are more control points than joints.
    """
    rest = np.asarray(rest, np.float64).reshape(-1, 3)
    if len(rest) == 0:
        return ()
    deep = np.ptp(rest, axis=0)
    if deep[2] > _DEEPER * deep[0]:
        rest = turned_level(rest, -np.pi / 2)
    anatomy = anatomy_of(skeleton)
    level = turned_level(skeleton.positions - skeleton.positions[0], -anatomy.facing)
    found = _candidates(anatomy, len(skeleton))
    joints = [one.joint for one in found]
    theirs, ours = _normal(level, level[joints]), _normal(rest, rest)
    away = np.abs(ours[:, None] - theirs[None]) @ [1.0, 1.0, _DEPTH]
    apart = np.abs(_sides(ours)[:, None] - [one.side for one in found])
    cost = away + [one.cost for one in found] + _SIDE * apart
    times = -(-len(rest) // len(joints))
    rows, columns = linear_sum_assignment(np.concatenate([cost + 10.0 * k for k in range(times)], axis=1))
    return tuple(skeleton.names[joints[column % len(joints)]] for column in columns[np.argsort(rows)])


def _candidates(anatomy: Anatomy, count: int) -> list[_Candidate]:
    """Every joint once, the cheapest of what it is: the end of a limb, its middle, the trunk, or anything."""
    cost, side = np.full(count, _OTHER), np.zeros(count, np.int64)
    singles: list[Limb] = [limb for limb in (anatomy.head, anatomy.tail) if limb is not None]
    limbs = [limb for pair in anatomy.pairs for limb in pair] + singles
    cost[list(anatomy.trunk)] = _TRUNK
    for limb in limbs:
        cost[list(limb.proper)] = _MIDDLE
    for limb in limbs:
        cost[limb.chain[-1]] = 0.0
    for left, right in anatomy.pairs:
        side[list(left.proper)], side[list(right.proper)] = 1, -1
    return [_Candidate(joint, float(cost[joint]), int(side[joint])) for joint in range(count)]


def _normal(all_points: Float, points: Float) -> Float:
    """(N, 3) points as shares: -1..1 across, 0..1 up, and as deep as they are high."""
    low, high = all_points.min(0), all_points.max(0)
    tall = max(float(high[1] - low[1]), 1e-9)
    middle = (low + high) / 2
    # Whoever is as good as flat across, a post, has no sides; dividing by its width would make some.
    wide = max(float(high[0] - low[0]) / 2, 0.05 * tall)
    return np.asarray((points - [middle[0], low[1], middle[2]]) / [wide, tall, tall])


def _sides(points: Float) -> Float:
    """(N,) 1 at the left, -1 at the right, 0 in the middle."""
    return np.asarray(np.sign(points[:, 0]) * (np.abs(points[:, 0]) > _ASIDE))
