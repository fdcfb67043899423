"""Suggests a performer's joint for each control point, by side, height and amount of motion.

guess_joints(clip.skeleton, puppet.rest)          # ("LeftHand end", "RightHand end", "Head end", ...)
guess_joints(clip.skeleton, puppet.rest, motion=joint_motion(clip))     # prefers moving joints

Skeleton and mesh are compared from the front (+Z, left at +X), each scaled to its own width and height. A
mesh that is deeper than wide is assumed to face +X. Ends of limbs are preferred to the joints between them.
No joint is suggested twice while others are unused.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import scipy

from enliven.arrays import Float, Int
from enliven.document import Clip, Skeleton
from enliven.examples.performer import performed
from enliven.examples.puppet_examples import IdentityKey
from enliven.mapping import Anatomy, SkeletonLimb, anatomy_of, rotate_about_y

_LIMB_MIDDLE_COST = 0.65
"""Cost of a joint in the middle of a limb. Costs are distances, in widths and heights of the body. The end of
a limb costs nothing."""
_TRUNK_COST = 0.5
"""Cost of following the trunk, which moves less than a limb."""
_OTHER_JOINT_COST = 0.9
"""Cost of following any other joint, such as a finger's."""
_LIMB_END_FRACTION = 0.4
"""Fraction of a limb's length, from its end, that counts as its end."""
_WIDTH_WEIGHT = 0.5
"""Weight of width relative to height. Arms held out are wider than legs, which may not hold for those of a
mesh."""
_DEPTH_WEIGHT = 0.3
"""Weight of depth relative to height."""
_WRONG_SIDE_COST = 0.3
"""Cost of following a side joint from the middle, or a middle joint from a side. The opposite side costs
twice that."""
_MAX_POST_HALF_WIDTH = 0.1
"""Maximum half width of a mesh that counts as a post without left and right side, as a fraction of its
height."""
_BASE_HEIGHT_FRACTION = 0.1
"""Fraction of the height below which a control point is at the base of a mesh."""
_MIN_DEPTH_RATIO = 1.5
"""Ratio of depth to width above which a mesh is compared from the side."""
_MIN_JOINT_MOTION = 0.01
"""A joint is still if it moves less than this fraction of body height relative to the hips."""
_MIN_UPRIGHT_RATIO = 0.6
"""Minimum ratio of height to length of a mesh that stands on a single foot. A fish is longer."""
_LAST_RESORT_COST = 1000.0
"""Cost of a joint that is chosen only if no other joint is left."""
_SIDE_WIDTH_FRACTION = 0.15
"""Minimum distance of a position on a side from the middle, as a fraction of half the width."""
_WRONG_GROUND_COST = 0.3
"""Cost of a foot joint for a point above the ground, and of another joint for a point on it, if the feet
move."""
_STILL_JOINT_COST = 0.8
"""Cost of a joint that hardly moves. The joint that moves most costs nothing."""
_SAME_END_COST = 5.0
"""Cost of a wrist or a finger relative to the end of the hand, which moves in the same way."""
_CROSSED_SIDES_COST = 100.0
"""Cost of a side joint for a point in the middle, and of a middle joint for two mirror images."""
_CACHED_TAKES = 16
"""Number of takes in the least-recently-used cache of :func:`joint_motion`."""
_HAND_FRACTION = 0.35
"""Fraction of a limb, from its end, that is its hand or foot."""


_Unit = tuple[int, ...]
"""Rows or columns that are assigned together: one, or two mirror images."""


class _Candidate(NamedTuple):
    joint: int
    cost: float
    side: int


@dataclass(frozen=True)
class JointMotion:
    """The motion of a performer's joints in a take, relative to the hips and without yaw.

    Attributes:
        still: names of the joints that do not move, including the hips.
        shares: by name, 0 to 1: the variance of the joint's position, divided by the largest of all joints. A
            joint and its mirror image both have the larger of their two values.
    """

    still: frozenset[str]
    shares: Mapping[str, float]


def joint_motion(clip: Clip) -> JointMotion:
    """Returns how much each joint moves in a take, from a cache if possible."""
    return _take_motion(IdentityKey(clip))


@lru_cache(maxsize=_CACHED_TAKES)
def _take_motion(take: IdentityKey[Clip]) -> JointMotion:
    clip = take()
    skeleton = clip.skeleton
    poses = performed(clip, skeleton.names).poses
    far, tall = np.ptp(poses, axis=0).max(1), float(np.ptp(skeleton.positions, axis=0).max())
    variance = np.var(poses, axis=0).sum(1)
    variance = np.maximum(variance, variance[_mirror_images(anatomy_of(skeleton), len(skeleton))])
    shares = variance / max(float(variance.max()), 1e-12)
    still = frozenset(
        name for name, moved in zip(skeleton.names, far, strict=True) if moved <= _MIN_JOINT_MOTION * tall
    )
    return JointMotion(still, dict(zip(skeleton.names, shares.tolist(), strict=True)))


def guess_joints(
    skeleton: Skeleton,
    rest: Float,
    taken: Collection[str] = (),
    wanted: Sequence[int] | None = None,
    motion: JointMotion | None = None,
    partners: Sequence[int] | None = None,
) -> tuple[str, ...]:
    """Suggests (P,) names of joints for control points at ``rest`` (P, 3) metres, in the mesh's own frame.

    A joint is suggested twice only if there are more control points than joints.

    Args:
        taken: joints that other points already follow.
        wanted: numbers of the control points that need a joint; None for all. The other points only define
            the size of the mesh.
        motion: how much the joints move in the take. Joints that move more are preferred. A still joint is
            suggested only for the base of a mesh that stands on one foot.
        partners: (P,) numbers of the control points' mirror images; a point on the symmetry plane has its own
            number. Mirror images follow the corresponding joints of both sides. Points on the plane follow
            middle joints.
    """
    still = frozenset[str]() if motion is None else motion.still
    rest = np.asarray(rest, np.float64).reshape(-1, 3)
    if len(rest) == 0:
        return ()
    deep = np.ptp(rest, axis=0)
    # Mirror images define left and right, even for a fish, which is longer than wide. Without them, the
    # longer horizontal side of the mesh is its side-to-side axis.
    if partners is None and deep[2] > _MIN_DEPTH_RATIO * deep[0]:
        rest = rotate_about_y(rest, -np.pi / 2)
    anatomy = anatomy_of(skeleton)
    root = skeleton.names[anatomy.trunk[0]]
    level = rotate_about_y(skeleton.positions - skeleton.positions[0], -anatomy.facing)
    level = _extend_arms(level, anatomy)
    candidates = [
        candidate
        for candidate in _joint_costs(anatomy, skeleton)
        if skeleton.names[candidate.joint] not in taken
    ]
    candidates = candidates or _joint_costs(anatomy, skeleton)
    candidates = [
        candidate for candidate in candidates if skeleton.names[candidate.joint] not in {*still} - {root}
    ] or candidates
    rows_wanted = list(range(len(rest))) if wanted is None else list(wanted)
    bounds_points, ours = level, _normalize_points(rest, rest[rows_wanted])
    base = np.zeros(len(ours), np.bool_)
    long = float(np.ptp(rest[:, [0, 2]], axis=0).max())
    sides = _point_sides(_normalize_points(rest, rest), partners)
    if (
        not _stands_on_feet(_normalize_points(rest, rest), sides)
        and np.ptp(rest[:, 1]) >= _MIN_UPRIGHT_RATIO * long
    ):
        # A mesh that stands on a single foot, like a chess piece, has a head and hips, but no legs.
        upper = _upper_body_candidates(candidates, anatomy, skeleton)
        if len(upper) >= len(ours):
            candidates, bounds_points = upper, level[[candidate.joint for candidate in upper]]
            base[ours[:, 1].argmin()] = True
    joints = [candidate.joint for candidate in candidates]
    theirs = _normalize_points(bounds_points, level[joints])
    away = np.abs(ours[:, None] - theirs[None]) @ [_WIDTH_WEIGHT, 1.0, _DEPTH_WEIGHT]
    side_difference = np.abs(sides[rows_wanted][:, None] - [candidate.side for candidate in candidates])
    feet = foot_joints(skeleton)
    unlike = (ours[:, 1] < _BASE_HEIGHT_FRACTION)[:, None] != [
        skeleton.names[joint] in feet for joint in joints
    ]
    acting = 1.0 if motion is None else max((motion.shares[name] for name in feet), default=0.0)
    cost = (
        away
        + [candidate.cost for candidate in candidates]
        + _WRONG_SIDE_COST * side_difference
        + _WRONG_GROUND_COST * acting * unlike
    )
    if motion is not None:
        quiet = [_STILL_JOINT_COST * (1.0 - motion.shares[skeleton.names[joint]]) for joint in joints]
        cost += np.where(base[:, None], 0.0, quiet)
    for column, joint in enumerate(joints):
        if skeleton.names[joint] in still:
            cost[~base | (ours[:, 1] > _BASE_HEIGHT_FRACTION), column] += _LAST_RESORT_COST
    rows, columns = _point_units(rows_wanted, partners), [(column,) for column in range(len(joints))]
    if partners is not None:
        columns = _joint_units(joints, anatomy, skeleton)
    chosen = _assign_units(cost, rows, columns)
    return tuple(skeleton.names[joints[chosen[row]]] for row in range(len(rows_wanted)))


def mirror_joint(skeleton: Skeleton, name: str) -> str:
    """Returns the same joint of the other side, or the joint itself if it is in the middle."""
    return skeleton.names[int(_mirror_images(anatomy_of(skeleton), len(skeleton))[skeleton.index(name)])]


def foot_joints(skeleton: Skeleton) -> frozenset[str]:
    """Returns the names of the joints of feet: the last part of each leg and all joints below it."""
    limbs = [limb for pair in anatomy_of(skeleton).legs for limb in pair]
    return frozenset(skeleton.names[joint] for limb in limbs for joint in _hand_joints(skeleton, limb))


def keep_one_point_per_hand(skeleton: Skeleton, joints: Sequence[str], partners: Sequence[int]) -> list[int]:
    """Selects control points such that only one joint of each hand or foot is followed.

    Points that share a joint because there are not enough joints are kept.

    Args:
        joints: (P,) the joint of each point, the most important first.
        partners: (P,) the mirror image of each point, which is kept or dropped together with it.
    """
    anatomy = anatomy_of(skeleton)
    parts = {joint: limb.chain[-1] for limb in _all_limbs(anatomy) for joint in _hand_joints(skeleton, limb)}
    taken, dropped = dict[int, str](), set[int]()
    for number, joint in enumerate(joints):
        part = parts.get(skeleton.index(joint))
        if part is not None and taken.get(part, joint) != joint:
            dropped |= {number, partners[number]}
        elif part is not None and number not in dropped:
            taken[part] = joint
    return [number for number in range(len(joints)) if number not in dropped]


def _assign_units(cost: Float, rows: Sequence[_Unit], columns: Sequence[_Unit]) -> dict[int, int]:
    """Solves the assignment problem unit by unit. Returns the column of each row of a cost matrix (R, C)."""
    units, ways = np.empty((len(rows), len(columns))), dict[tuple[int, int], tuple[int, ...]]()
    for r, row in enumerate(rows):
        for c, column in enumerate(columns):
            units[r, c], ways[r, c] = _unit_cost(cost, row, column)
    times = max(-(-len(rows) // len(columns)), 1)
    assignment = scipy.optimize.linear_sum_assignment(
        np.concatenate([units + 10.0 * _LAST_RESORT_COST * k for k in range(times)], axis=1)
    )
    chosen = dict[int, int]()
    for r, c in zip(*assignment, strict=True):
        chosen.update(zip(rows[r], ways[r, c % len(columns)], strict=True))
    return chosen


def _unit_cost(cost: Float, row: _Unit, column: _Unit) -> tuple[float, tuple[int, ...]]:
    """Returns the cost of a unit of columns for a unit of rows, and the column of each row."""
    if len(row) == len(column) == 1:
        return float(cost[row[0], column[0]]), column
    if len(row) == len(column):
        ways = [column, column[::-1]]
        least = min(ways, key=lambda way: cost[row, way].sum())
        return float(cost[row, least].sum()), least
    alone = [(single_column,) * len(row) for single_column in column]
    least = min(alone, key=lambda way: cost[row, way].sum())
    return float(cost[row, least].sum()) + _CROSSED_SIDES_COST, least


def _point_units(wanted: Sequence[int], partners: Sequence[int] | None) -> list[_Unit]:
    """Returns the rows of the wanted control points, in pairs if both mirror images are wanted."""
    row = {point: number for number, point in enumerate(wanted)}
    units = list[_Unit]()
    for point, number in row.items():
        other = row.get(point if partners is None else partners[point], number)
        if number <= other:
            units.append((number,) if number == other else (number, other))
    return units


def _joint_units(joints: Sequence[int], anatomy: Anatomy, skeleton: Skeleton) -> list[_Unit]:
    """Returns the columns of middle joints one by one, and those of the sides in pairs."""
    column = {joint: number for number, joint in enumerate(joints)}
    images = _mirror_images(anatomy, len(skeleton))
    aside = {joint for limb in _all_limbs(anatomy) for joint in skeleton.below(_limb_joints(limb)[0])}
    units = list[_Unit]()
    for joint, number in column.items():
        other = int(images[joint])
        if joint not in aside:
            units.append((number,))
        elif other > joint and other in column:
            units.append((number, column[other]))
    return units or [(number,) for number in column.values()]


def _mirror_images(anatomy: Anatomy, count: int) -> Int:
    """Returns (J,) the joint of the other side for each joint of a paired limb. Other joints map to
    themselves."""
    images = np.arange(count)
    for left, right in anatomy.pairs:
        for left_joint, right_joint in zip(_limb_joints(left)[::-1], _limb_joints(right)[::-1], strict=False):
            images[left_joint], images[right_joint] = right_joint, left_joint
    return images


def _all_limbs(anatomy: Anatomy) -> Iterable[SkeletonLimb]:
    return (limb for pair in anatomy.pairs for limb in pair)


def _hand_joints(skeleton: Skeleton, limb: SkeletonLimb) -> set[int]:
    """Returns the joints of the last part of a limb: a hand with its fingers, or a foot with its toes."""
    proper = limb.proper
    left = np.cumsum(skeleton.lengths[list(proper[1:])][::-1])[::-1]
    first = next(
        (j for j, rest in zip(proper[1:], left[1:], strict=False) if rest < _HAND_FRACTION * left[0]), None
    )
    return set(skeleton.below(first)) if first is not None else {limb.chain[-1]}


def _limb_joints(limb: SkeletonLimb) -> tuple[int, ...]:
    """Returns the joints of a limb without the junction that it starts from."""
    return limb.chain[max(limb.start, 1) :]


def _stands_on_feet(points: Float, sides: Float) -> bool:
    """Returns True if the lowest points (N, 3), in fractions of the size, are on both sides (N,), or if there
    are none."""
    low = sides[points[:, 1] < _BASE_HEIGHT_FRACTION]
    return not len(low) or {1.0, -1.0} <= set(low.tolist())


def _upper_body_candidates(found: list[_Candidate], anatomy: Anatomy, skeleton: Skeleton) -> list[_Candidate]:
    """Returns the candidates without legs, with no cost for the hips."""
    legs = {joint for pair in anatomy.legs for limb in pair for joint in skeleton.below(limb.chain[1])}
    upper = [candidate for candidate in found if candidate.joint not in legs]
    return [
        candidate._replace(cost=0.0) if candidate.joint == anatomy.trunk[0] else candidate
        for candidate in upper
    ]


def _extend_arms(level: Float, anatomy: Anatomy) -> Float:
    """Returns (N, 3) joints with the arms held out to the sides. In a hanging arm, the hand would be below
    its elbow."""
    out = level.copy()
    for left, right in anatomy.arms:
        for limb, side in ((left, 1.0), (right, -1.0)):
            for joint, before in zip(limb.proper[1:], limb.proper, strict=False):
                long = float(np.linalg.norm(level[joint] - level[before]))
                out[joint] = out[before] + [side * long, 0.0, 0.0]
    return out


def _joint_costs(anatomy: Anatomy, skeleton: Skeleton) -> list[_Candidate]:
    """Returns each joint once, with the cost of its kind: end of a limb, middle of a limb, trunk, or other.

    Joints near the end, such as a wrist before fingers, have a high cost, since the end moves in the same
    way.
    """
    cost, side = np.full(len(skeleton), _OTHER_JOINT_COST), np.zeros(len(skeleton), np.int64)
    singles: list[SkeletonLimb] = [limb for limb in (anatomy.head, anatomy.tail) if limb is not None]
    limbs = [limb for pair in anatomy.pairs for limb in pair] + singles
    cost[list(anatomy.trunk)] = _TRUNK_COST
    for limb in limbs:
        proper = list(limb.proper)
        lengths_left = np.cumsum(skeleton.lengths[proper[1:]][::-1])[::-1]
        # The first joint of a limb, a hip or a shoulder, moves with the trunk, so it does not count as a
        # middle joint.
        middle = [
            joint
            for joint, length in zip(proper[1:], lengths_left[1:], strict=False)
            if length > _LIMB_END_FRACTION * lengths_left[0]
        ]
        cost[middle] = _LIMB_MIDDLE_COST
    for limb in limbs:
        cost[list(_hand_joints(skeleton, limb))] = _SAME_END_COST
        cost[limb.chain[-1]] = 0.0
    if anatomy.head is None:  # The head is too short to be found as a limb.
        single = np.setdiff1d(np.arange(len(skeleton)), [joint for limb in limbs for joint in limb.chain[1:]])
        cost[single[skeleton.positions[single, 1].argmax()]] = 0.0
    for left_limb, right_limb in anatomy.pairs:
        side[list(left_limb.proper)], side[list(right_limb.proper)] = 1, -1
    return [_Candidate(joint, float(cost[joint]), int(side[joint])) for joint in range(len(skeleton))]


def _normalize_points(all_points: Float, points: Float) -> Float:
    """Scales points (N, 3): width to -1..1, height to 0..1, and depth in heights."""
    low, high = all_points.min(0), all_points.max(0)
    tall = max(float(high[1] - low[1]), 1e-9)
    middle = (low + high) / 2
    wide = float(high[0] - low[0]) / 2
    # A narrow mesh, such as a post, has no left and right side. Dividing by its width would turn noise into
    # sides.
    across = 1.0 / wide if wide > _MAX_POST_HALF_WIDTH * tall else 0.0
    return np.asarray((points - [middle[0], low[1], middle[2]]) * [across, 1.0 / tall, 1.0 / tall])


def _point_sides(points: Float, partners: Sequence[int] | None) -> Float:
    """Returns (N,) 1 on the left, -1 on the right, 0 in the middle. Known mirror images define the middle
    exactly."""
    if partners is None:
        aside = np.abs(points[:, 0]) > _SIDE_WIDTH_FRACTION
    else:
        aside = np.asarray(partners) != np.arange(len(points))
    return np.asarray(np.sign(points[:, 0]) * aside)
