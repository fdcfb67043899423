"""Which joint of a performer a control point is meant to follow: a first guess, by side and height.

guess_joints(clip.skeleton, puppet.rest)          # ("LeftHand end", "RightHand end", "Head end", ...)
guess_joints(clip.skeleton, puppet.rest, still=still_joints(clip))    # none that does not move in that take

Both are looked at from the front (+Z, left at +X), each scaled to its own width and height; a mesh that is
wider from the side is taken to look at +X. Ends of limbs are taken before what is between them, and no joint
twice while there are others.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.document import Clip, Skeleton
from enliven.examples.performer import performed
from enliven.mapping import Anatomy, SkeletonLimb, anatomy_of, turned_about_y

_MIDDLE = 0.25
"""Cost, in widths and heights, of following the middle of a limb; its end costs nothing."""
_TRUNK = 0.35
"""The same, of following the trunk: it moves less than a limb."""
_OTHER = 0.6
"""The same, of following any other joint, such as a finger's."""
_END = 0.4
"""Share of a limb, from its end, that counts as its end."""
_DEPTH = 0.3
"""How much depth counts beside width and height."""
_SIDE = 0.3
"""What it costs to follow a side from the middle or the middle from a side; twice that, the other side."""
_NARROW = 0.1
"""Half the width, in heights, up to which a mesh is a post and has no sides."""
_BASE = 0.1
"""Share of the height below which a control point is at a mesh's foot."""
_DEEPER = 1.5
"""So many times deeper than wide, a mesh is looked at from the side."""
_STILL = 0.01
"""Share of the performer's height by which a joint moves beside the hips at most while it is still."""
_UPRIGHT = 0.6
"""Height in lengths from which what has no two feet stands on one; a fish is longer."""
_NEVER = 1000.0
"""Cost of a joint that is not to be taken while there is any other."""
_ASIDE = 0.15
"""Share of half the width from which a place is on a side."""


class _Candidate(NamedTuple):
    joint: int
    cost: float
    side: int


def still_joints(clip: Clip) -> frozenset[str]:
    """The joints that do not move in a take, seen from the hips as a mesh sees them: the hips themselves."""
    names = clip.skeleton.names
    poses = performed(clip, names).poses
    far, tall = np.ptp(poses, axis=0).max(1), float(np.ptp(clip.skeleton.positions, axis=0).max())
    return frozenset(name for name, moved in zip(names, far, strict=True) if moved <= _STILL * tall)


def guess_joints(
    skeleton: Skeleton,
    rest: Float,
    taken: Collection[str] = (),
    wanted: Sequence[int] | None = None,
    still: Collection[str] = (),
) -> tuple[str, ...]:
    """(P,) names of joints for control points at ``rest`` (P, 3) metres, in the mesh's own frame.

    A joint is guessed twice only where there are more control points than joints.

    Args:
        taken: joints that others follow already.
        wanted: numbers of the control points that need one; None for all. The others only say how large
            and how wide the mesh is.
        still: joints that do not move: none is guessed, but for the base of what stands on one foot.
    """
    rest = np.asarray(rest, np.float64).reshape(-1, 3)
    if len(rest) == 0:
        return ()
    deep = np.ptp(rest, axis=0)
    if deep[2] > _DEEPER * deep[0]:
        rest = turned_about_y(rest, -np.pi / 2)
    anatomy = anatomy_of(skeleton)
    root = skeleton.names[anatomy.trunk[0]]
    level = turned_about_y(skeleton.positions - skeleton.positions[0], -anatomy.facing)
    level = _arms_out(level, anatomy)
    found = [one for one in _candidates(anatomy, skeleton) if skeleton.names[one.joint] not in taken]
    found = found or _candidates(anatomy, skeleton)
    found = [one for one in found if skeleton.names[one.joint] not in {*still} - {root}] or found
    rows_wanted = list(range(len(rest))) if wanted is None else list(wanted)
    whole, ours = level, _normal(rest, rest[rows_wanted])
    base = np.zeros(len(ours), np.bool_)
    long = float(np.ptp(rest[:, [0, 2]], axis=0).max())
    if not _on_feet(_normal(rest, rest)) and np.ptp(rest[:, 1]) >= _UPRIGHT * long:
        # What stands on one foot, as a chess piece does, has a head and hips, and no legs.
        kept = _upper(found, anatomy, skeleton)
        if len(kept) >= len(ours):
            found, whole = kept, level[[one.joint for one in kept]]
            base[ours[:, 1].argmin()] = True
    joints = [one.joint for one in found]
    theirs = _normal(whole, level[joints])
    away = np.abs(ours[:, None] - theirs[None]) @ [1.0, 1.0, _DEPTH]
    apart = np.abs(_sides(ours)[:, None] - [one.side for one in found])
    cost = away + [one.cost for one in found] + _SIDE * apart
    for column, joint in enumerate(joints):
        if skeleton.names[joint] in still:
            cost[~base | (ours[:, 1] > _BASE), column] += _NEVER
    times = max(-(-len(ours) // len(joints)), 1)
    rows, columns = scipy.optimize.linear_sum_assignment(
        np.concatenate([cost + 10.0 * _NEVER * k for k in range(times)], axis=1)
    )
    return tuple(skeleton.names[joints[column % len(joints)]] for column in columns[np.argsort(rows)])


def _on_feet(points: Float) -> bool:
    """Whether there are points (N, 3), as shares, at the foot on both sides; or none at the foot at all."""
    low = _sides(points[points[:, 1] < _BASE])
    return not len(low) or {1.0, -1.0} <= set(low.tolist())


def _upper(found: list[_Candidate], anatomy: Anatomy, skeleton: Skeleton) -> list[_Candidate]:
    """The candidates without legs, of which the hips cost nothing."""
    legs = {joint for pair in anatomy.legs for limb in pair for joint in skeleton.below(limb.chain[1])}
    kept = [one for one in found if one.joint not in legs]
    return [one._replace(cost=0.0) if one.joint == anatomy.trunk[0] else one for one in kept]


def _arms_out(level: Float, anatomy: Anatomy) -> Float:
    """(N, 3) joints with arms held out to the sides: hanging down, a hand would be lower than its elbow."""
    out = level.copy()
    for left, right in anatomy.arms:
        for limb, side in ((left, 1.0), (right, -1.0)):
            for joint, before in zip(limb.proper[1:], limb.proper, strict=False):
                long = float(np.linalg.norm(level[joint] - level[before]))
                out[joint] = out[before] + [side * long, 0.0, 0.0]
    return out


def _candidates(anatomy: Anatomy, skeleton: Skeleton) -> list[_Candidate]:
    """Every joint once, the cheapest of what it is: the end of a limb, its middle, the trunk, or anything.

    What is near the end, as a wrist before fingers, is neither: the end says as much.
    """
    cost, side = np.full(len(skeleton), _OTHER), np.zeros(len(skeleton), np.int64)
    singles: list[SkeletonLimb] = [limb for limb in (anatomy.head, anatomy.tail) if limb is not None]
    limbs = [limb for pair in anatomy.pairs for limb in pair] + singles
    cost[list(anatomy.trunk)] = _TRUNK
    for limb in limbs:
        proper = list(limb.proper)
        left = np.cumsum(skeleton.lengths[proper[1:]][::-1])[::-1]
        middle = [joint for joint, rest in zip(proper, left, strict=False) if rest > _END * left[0]]
        cost[middle] = _MIDDLE
    for limb in limbs:
        cost[limb.chain[-1]] = 0.0
    if anatomy.head is None:  # too short for a limb
        single = np.setdiff1d(np.arange(len(skeleton)), [joint for limb in limbs for joint in limb.chain[1:]])
        cost[single[skeleton.positions[single, 1].argmax()]] = 0.0
    for one, other in anatomy.pairs:
        side[list(one.proper)], side[list(other.proper)] = 1, -1
    return [_Candidate(joint, float(cost[joint]), int(side[joint])) for joint in range(len(skeleton))]


def _normal(all_points: Float, points: Float) -> Float:
    """(N, 3) points as shares: -1..1 across, 0..1 up, and as deep as they are high."""
    low, high = all_points.min(0), all_points.max(0)
    tall = max(float(high[1] - low[1]), 1e-9)
    middle = (low + high) / 2
    wide = float(high[0] - low[0]) / 2
    # What is narrow, a post, has no sides; dividing by its width would make some.
    across = 1.0 / wide if wide > _NARROW * tall else 0.0
    return np.asarray((points - [middle[0], low[1], middle[2]]) * [across, 1.0 / tall, 1.0 / tall])


def _sides(points: Float) -> Float:
    """(N,) 1 at the left, -1 at the right, 0 in the middle."""
    return np.asarray(np.sign(points[:, 0]) * (np.abs(points[:, 0]) > _ASIDE))
