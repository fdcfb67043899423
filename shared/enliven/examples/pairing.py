"""Suggests a performer's joint for each control point. The criteria are side, height and amount of motion.

guess_joints(clip.skeleton, puppet.rest)          # ("LeftHand end", "RightHand end", "Head end", ...)
guess_joints(clip.skeleton, puppet.rest, motion=measure_joint_motion(clip))     # prefers moving joints

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

from enliven.arrays import Bool, Float, Int
from enliven.document import Clip, Skeleton
from enliven.examples.performer import extract_performer_clip
from enliven.examples.puppet_examples import IdentityKey
from enliven.skeletons.anatomy import Anatomy, SkeletonLimb, find_anatomy
from enliven.skeletons.facing import rotate_about_y

_LIMB_MIDDLE_COST = 0.65
"""Cost of a joint in the middle of a limb. Costs are in the unit of the normalized distances: fractions of
the body's width and height. The end of a limb has no cost."""
_TRUNK_COST = 0.5
"""Cost of following the trunk, which moves less than a limb."""
_OTHER_JOINT_COST = 0.9
"""Cost of following any other joint, such as a finger's."""
_LIMB_END_FRACTION = 0.4
"""Fraction of a limb's length, from its end, that counts as its end."""
_WIDTH_WEIGHT = 0.5
"""Weight of width relative to height. It is below 1, because outstretched arms reach farther to the side than
legs, but a mesh may have other proportions."""
_DEPTH_WEIGHT = 0.3
"""Weight of depth relative to height."""
_WRONG_SIDE_COST = 0.3
"""Cost if a point in the middle follows a joint on a side, or a point on a side follows a joint in the
middle. The opposite side has twice this cost."""
_MAX_POST_HALF_WIDTH = 0.1
"""Maximum half width of a mesh that counts as a post without left and right side, as a fraction of its
height."""
_BASE_HEIGHT_FRACTION = 0.1
"""A control point below this fraction of the height is at the base of a mesh."""
_MIN_DEPTH_RATIO = 1.5
"""A mesh is compared from the side if its depth divided by its width is above this ratio."""
_MIN_JOINT_MOTION = 0.01
"""A joint is still if it moves less than this fraction of body height relative to the hips."""
_MIN_UPRIGHT_RATIO = 0.6
"""Minimum ratio of height to length of a mesh that can stand on a single foot. A fish, which has no foot, has
a lower ratio."""
_LAST_RESORT_COST = 30.0
"""Cost of a still joint. It is chosen only if no moving joint of its kind is left, because this cost is
between :data:`_SAME_END_COST` and :data:`_CROSSED_SIDES_COST`."""
_SIDE_WIDTH_FRACTION = 0.15
"""Minimum distance from the middle at which a position counts as left or right, as a fraction of half the
width."""
_WRONG_GROUND_COST = 0.3
"""Cost of a foot joint for a point above the ground, and of any other joint for a point on the ground, if the
feet move."""
_STILL_JOINT_COST = 0.8
"""Cost of a joint that hardly moves. The joint that moves most has no cost."""
_SAME_END_COST = 5.0
"""Cost of a wrist or a finger relative to the end of the hand, which moves in the same way."""
_CROSSED_SIDES_COST = 100.0
"""Cost of a side joint for a point in the middle, and of a middle joint for two mirror images."""
_CACHED_TAKES = 16
"""Number of takes in the least-recently-used cache of :func:`measure_joint_motion`."""
_HAND_FRACTION = 0.35
"""Fraction of a limb, from its end, that is its hand or foot."""


_Unit = tuple[int, ...]
"""Rows or columns of the cost matrix that are assigned together: one row or column, or those of two mirror
images."""


class _Candidate(NamedTuple):
    joint: int
    cost: float
    side: int


@dataclass(frozen=True)
class JointMotion:
    """The motion of a performer's joints in a take, relative to the hips and without yaw.

    Attributes:
        still: names of the joints that do not move, including the hips.
        relative_variances: for each joint name, the variance of the joint's position divided by the largest
            variance of all joints, 0 to 1. A joint and its mirror image share the larger of their two values.
    """

    still: frozenset[str]
    relative_variances: Mapping[str, float]


def measure_joint_motion(clip: Clip) -> JointMotion:
    """Measures how much each joint moves in a take, or returns the cached result."""
    return _take_motion(IdentityKey(clip))


@lru_cache(maxsize=_CACHED_TAKES)
def _take_motion(take: IdentityKey[Clip]) -> JointMotion:
    clip = take()
    skeleton = clip.skeleton
    poses = extract_performer_clip(clip, skeleton.names).poses
    travel, body_size = np.ptp(poses, axis=0).max(1), float(np.ptp(skeleton.positions, axis=0).max())
    variance = np.var(poses, axis=0).sum(1)
    variance = np.maximum(variance, variance[_mirror_images(find_anatomy(skeleton), len(skeleton))])
    motion_shares = variance / max(float(variance.max()), 1e-12)
    still_joints = frozenset(
        name
        for name, distance in zip(skeleton.names, travel, strict=True)
        if distance <= _MIN_JOINT_MOTION * body_size
    )
    return JointMotion(still_joints, dict(zip(skeleton.names, motion_shares.tolist(), strict=True)))


def guess_joints(
    skeleton: Skeleton,
    rest: Float,
    taken: Collection[str] = (),
    requested_points: Sequence[int] | None = None,
    motion: JointMotion | None = None,
    partners: Sequence[int] | None = None,
) -> tuple[str, ...]:
    """Suggests (P,) names of joints for control points at ``rest`` (P, 3) metres, in the mesh's own frame.

    A joint is suggested twice only if there are more control points than joints.

    Args:
        taken: joints that other control points already follow.
        requested_points: numbers of the control points that need a joint. None means all. The other control
            points only help to define the extent of the mesh.
        motion: the motion of the joints in the take. Joints that move more are preferred. A still joint is
            suggested only for the base of a mesh that stands on one foot. With ``partners``, it is also
            suggested if its mirror image moves, or if too few middle joints or pairs move.
        partners: (P,) numbers of the control points' mirror images. A point on the symmetry plane has its own
            number. Mirror images follow the corresponding joints of both sides. Points on the plane follow
            middle joints.
    """
    rest = np.asarray(rest, np.float64).reshape(-1, 3)
    if len(rest) == 0:
        return ()
    extents = np.ptp(rest, axis=0)
    # If mirror images are known, they define left and right. This also works for a fish, which is longer than
    # wide. Otherwise, the longer horizontal extent of the mesh is its left-right axis.
    if partners is None and extents[2] > _MIN_DEPTH_RATIO * extents[0]:
        rest = rotate_about_y(rest, -np.pi / 2)
    anatomy = find_anatomy(skeleton)
    level = rotate_about_y(skeleton.positions - skeleton.positions[0], -anatomy.facing)
    level = _extend_arms(level, anatomy)
    rows_wanted = list(range(len(rest))) if requested_points is None else list(requested_points)
    candidates = _list_candidates(skeleton, anatomy, taken, motion, rows_wanted, partners)
    points, bounds_points = _normalize_points(rest, rest[rows_wanted]), level
    base = np.zeros(len(points), np.bool_)
    sides = _point_sides(_normalize_points(rest, rest), partners)
    if _stands_on_one_foot(rest, sides):
        # A mesh that stands on a single foot, like a chess piece, has a head and hips, but no legs.
        upper = _upper_body_candidates(candidates, anatomy, skeleton)
        if len(upper) >= len(points):
            candidates, bounds_points = upper, level[[candidate.joint for candidate in upper]]
            base[points[:, 1].argmin()] = True
    joints = [candidate.joint for candidate in candidates]
    joint_positions = _normalize_points(bounds_points, level[joints])
    cost = _compute_shape_cost(skeleton, candidates, joint_positions, points, sides[rows_wanted], motion)
    if motion is not None:
        _add_motion_cost(cost, [skeleton.names[joint] for joint in joints], points, base, motion)
    rows, columns = _point_units(rows_wanted, partners), [(column,) for column in range(len(joints))]
    if partners is not None:
        columns = _joint_units(joints, anatomy, skeleton)
    chosen = _assign_units(cost, rows, columns)
    return tuple(skeleton.names[joints[chosen[row]]] for row in range(len(rows_wanted)))


def _list_candidates(
    skeleton: Skeleton,
    anatomy: Anatomy,
    taken: Collection[str],
    motion: JointMotion | None,
    requested_points: Sequence[int],
    partners: Sequence[int] | None,
) -> list[_Candidate]:
    """Returns the joints that are neither taken nor still. If these are too few, includes the others.

    The arguments are those of :func:`guess_joints`.
    """
    every = _joint_costs(anatomy, skeleton)
    candidates = [each for each in every if skeleton.names[each.joint] not in taken] or every
    still_joints = frozenset[str]() if motion is None else motion.still
    root = skeleton.names[anatomy.trunk[0]]
    immobile = {skeleton.index(name) for name in still_joints - {root}}
    usable = _find_usable_candidates(candidates, immobile, requested_points, partners, skeleton)
    return usable or candidates


def _compute_shape_cost(
    skeleton: Skeleton,
    candidates: Sequence[_Candidate],
    joint_positions: Float,
    points: Float,
    sides: Float,
    motion: JointMotion | None,
) -> Float:
    """Returns the costs (P, C) of pairing control points with joints, by position, side and height.

    Args:
        joint_positions: (C, 3) normalized positions of the candidates.
        points: (P, 3) normalized positions of the control points.
        sides: (P,) 1 for points on the left, -1 on the right, 0 in the middle.
        motion: the less the feet move, the less the height of a point matters. None counts as full motion.
    """
    distances = np.abs(points[:, None] - joint_positions[None]) @ [_WIDTH_WEIGHT, 1.0, _DEPTH_WEIGHT]
    side_difference = np.abs(sides[:, None] - [candidate.side for candidate in candidates])
    feet = foot_joints(skeleton)
    base_mismatch = (points[:, 1] < _BASE_HEIGHT_FRACTION)[:, None] != [
        skeleton.names[candidate.joint] in feet for candidate in candidates
    ]
    acting = 1.0 if motion is None else max((motion.relative_variances[name] for name in feet), default=0.0)
    return np.asarray(
        distances
        + [candidate.cost for candidate in candidates]
        + _WRONG_SIDE_COST * side_difference
        + _WRONG_GROUND_COST * acting * base_mismatch
    )


def _add_motion_cost(
    cost: Float, names: Sequence[str], points: Float, base: Bool, motion: JointMotion
) -> None:
    """Adds the costs of joints that move little or not at all to the matrix ``cost`` (P, C).

    Args:
        names: (C,) names of the joints.
        points: (P, 3) normalized positions of the control points.
        base: (P,) True for the foot of a mesh that stands on a single foot. It may follow a still joint.
    """
    quiet = [_STILL_JOINT_COST * (1.0 - motion.relative_variances[name]) for name in names]
    cost += np.where(base[:, None], 0.0, quiet)
    needs_motion = ~base | (points[:, 1] > _BASE_HEIGHT_FRACTION)
    is_still = np.array([name in motion.still for name in names])
    cost[np.outer(needs_motion, is_still)] += _LAST_RESORT_COST


def mirror_joint(skeleton: Skeleton, name: str) -> str:
    """Returns the corresponding joint of the other side, or the joint itself if it is in the middle."""
    return skeleton.names[int(_mirror_images(find_anatomy(skeleton), len(skeleton))[skeleton.index(name)])]


def foot_joints(skeleton: Skeleton) -> frozenset[str]:
    """Returns the names of the joints of feet: the last part of each leg and all joints below it."""
    limbs = [limb for pair in find_anatomy(skeleton).legs for limb in pair]
    return frozenset(skeleton.names[joint] for limb in limbs for joint in _hand_joints(skeleton, limb))


def keep_one_point_per_hand(skeleton: Skeleton, joints: Sequence[str], partners: Sequence[int]) -> list[int]:
    """Selects control points such that they follow only one joint of each hand or foot.

    Points that share a joint because there are not enough joints are kept.

    Args:
        joints: (P,) the joint of each point, the most important first.
        partners: (P,) the mirror image of each point, which is kept or dropped together with it.
    """
    anatomy = find_anatomy(skeleton)
    parts = {
        joint: limb.chain[-1] for limb in _list_all_limbs(anatomy) for joint in _hand_joints(skeleton, limb)
    }
    joint_of_part, dropped = dict[int, str](), set[int]()
    for number, joint in enumerate(joints):
        part = parts.get(skeleton.index(joint))
        if part is not None and joint_of_part.get(part, joint) != joint:
            dropped |= {number, partners[number]}
        elif part is not None and number not in dropped:
            joint_of_part[part] = joint
    return [number for number in range(len(joints)) if number not in dropped]


def _assign_units(cost: Float, rows: Sequence[_Unit], columns: Sequence[_Unit]) -> dict[int, int]:
    """Solves the assignment problem for a cost matrix (R, C). Mirror images are assigned together as units.
    Returns the column of each row.
    """
    units, assignments = np.empty((len(rows), len(columns))), dict[tuple[int, int], tuple[int, ...]]()
    for r, row in enumerate(rows):
        for c, column in enumerate(columns):
            units[r, c], assignments[r, c] = _unit_cost(cost, row, column)
    times = max(-(-len(rows) // len(columns)), 1)
    assignment = scipy.optimize.linear_sum_assignment(
        np.concatenate([units + 10.0 * _LAST_RESORT_COST * k for k in range(times)], axis=1)
    )
    chosen = dict[int, int]()
    for r, c in zip(*assignment, strict=True):
        chosen.update(zip(rows[r], assignments[r, c % len(columns)], strict=True))
    return chosen


def _find_usable_candidates(
    candidates: list[_Candidate],
    still: Collection[int],
    requested_points: Sequence[int],
    partners: Sequence[int] | None,
    skeleton: Skeleton,
) -> list[_Candidate]:
    """Returns the candidates that move.

    With ``partners``, a joint is also usable if its mirror image moves. If too few middle joints or pairs
    move, all of them are usable. Otherwise a point in the middle would have to follow a side joint, which
    would move the mesh to one side.
    """
    if partners is None:
        return [candidate for candidate in candidates if candidate.joint not in still]
    anatomy, joints = find_anatomy(skeleton), {candidate.joint for candidate in candidates}
    images, side = _mirror_images(anatomy, len(skeleton)), _side_joints(anatomy, skeleton)
    usable = {joint for joint in joints if not {joint, int(images[joint])} <= set(still)}
    points_on_plane = sum(partners[point] == point for point in requested_points)
    if len(usable - side) < points_on_plane:
        usable |= joints - side
    paired = {joint for joint in side if images[joint] != joint}
    if len(usable & paired) < len(requested_points) - points_on_plane:
        usable |= joints & paired
    return [candidate for candidate in candidates if candidate.joint in usable]


def _unit_cost(cost: Float, row: _Unit, column: _Unit) -> tuple[float, tuple[int, ...]]:
    """Returns the lowest cost of assigning a unit of columns to a unit of rows, and the column of each
    row.
    """
    if len(row) == len(column) == 1:
        return float(cost[row[0], column[0]]), column
    if len(row) == len(column):
        pairings = [column, column[::-1]]
        cheapest = min(pairings, key=lambda way: cost[row, way].sum())
        return float(cost[row, cheapest].sum()), cheapest
    single_assignments = [(single_column,) * len(row) for single_column in column]
    cheapest = min(single_assignments, key=lambda way: cost[row, way].sum())
    return float(cost[row, cheapest].sum()) + _CROSSED_SIDES_COST, cheapest


def _point_units(requested_points: Sequence[int], partners: Sequence[int] | None) -> list[_Unit]:
    """Groups the rows of the requested control points into units. Two mirror images form a pair if both are
    requested.
    """
    row = {point: number for number, point in enumerate(requested_points)}
    units = list[_Unit]()
    for point, number in row.items():
        partner_row = row.get(point if partners is None else partners[point], number)
        if number <= partner_row:
            units.append((number,) if number == partner_row else (number, partner_row))
    return units


def _joint_units(joints: Sequence[int], anatomy: Anatomy, skeleton: Skeleton) -> list[_Unit]:
    """Groups the columns of the joints into units: a middle joint alone, and two corresponding side joints as
    a pair."""
    column = {joint: number for number, joint in enumerate(joints)}
    images = _mirror_images(anatomy, len(skeleton))
    side_joints = _side_joints(anatomy, skeleton)
    units = list[_Unit]()
    for joint, number in column.items():
        mirror_joint_number = int(images[joint])
        if joint not in side_joints:
            units.append((number,))
        elif mirror_joint_number > joint and mirror_joint_number in column:
            units.append((number, column[mirror_joint_number]))
    return units or [(number,) for number in column.values()]


def _side_joints(anatomy: Anatomy, skeleton: Skeleton) -> set[int]:
    """Returns the joints of paired limbs, with all joints below them."""
    return {
        joint for limb in _list_all_limbs(anatomy) for joint in skeleton.list_subtree(_limb_joints(limb)[0])
    }


def _mirror_images(anatomy: Anatomy, count: int) -> Int:
    """Returns the joint (J,) of the other side for each joint of a paired limb. Other joints map to
    themselves.
    """
    images = np.arange(count)
    for left, right in anatomy.pairs:
        for left_joint, right_joint in zip(_limb_joints(left)[::-1], _limb_joints(right)[::-1], strict=False):
            images[left_joint], images[right_joint] = right_joint, left_joint
    return images


def _list_all_limbs(anatomy: Anatomy) -> Iterable[SkeletonLimb]:
    return (limb for pair in anatomy.pairs for limb in pair)


def _hand_joints(skeleton: Skeleton, limb: SkeletonLimb) -> set[int]:
    """Returns the joints of the last part of a limb: a hand with its fingers, or a foot with its toes."""
    proper = limb.proper
    remaining_lengths = np.cumsum(skeleton.lengths[list(proper[1:])][::-1])[::-1]
    first = next(
        (
            j
            for j, remaining in zip(proper[1:], remaining_lengths[1:], strict=False)
            if remaining < _HAND_FRACTION * remaining_lengths[0]
        ),
        None,
    )
    return set(skeleton.list_subtree(first)) if first is not None else {limb.chain[-1]}


def _limb_joints(limb: SkeletonLimb) -> tuple[int, ...]:
    """Returns the joints of a limb without the junction that it starts from."""
    return limb.chain[max(limb.start, 1) :]


def _stands_on_one_foot(rest: Float, sides: Float) -> bool:
    """Returns True if an upright mesh has points close to the ground, but not on both sides.

    Args:
        rest: (N, 3) metres, all control points.
        sides: (N,) 1 and -1 for the two sides, 0 for the middle.
    """
    low = sides[_normalize_points(rest, rest)[:, 1] < _BASE_HEIGHT_FRACTION]
    length, height = float(np.ptp(rest[:, [0, 2]], axis=0).max()), float(np.ptp(rest[:, 1]))
    is_on_feet = not len(low) or {1.0, -1.0} <= set(low.tolist())
    return not is_on_feet and height >= _MIN_UPRIGHT_RATIO * length


def _upper_body_candidates(found: list[_Candidate], anatomy: Anatomy, skeleton: Skeleton) -> list[_Candidate]:
    """Returns the candidates without the joints of legs, and sets the cost of the hips to zero."""
    legs = {joint for pair in anatomy.legs for limb in pair for joint in skeleton.list_subtree(limb.chain[1])}
    upper = [candidate for candidate in found if candidate.joint not in legs]
    return [
        candidate._replace(cost=0.0) if candidate.joint == anatomy.trunk[0] else candidate
        for candidate in upper
    ]


def _extend_arms(level: Float, anatomy: Anatomy) -> Float:
    """Returns the joint positions (N, 3) with the arms stretched out to the sides. Otherwise the hand of a
    hanging arm would be below its elbow.
    """
    extended = level.copy()
    for left, right in anatomy.arms:
        for limb, side in ((left, 1.0), (right, -1.0)):
            for joint, parent in zip(limb.proper[1:], limb.proper, strict=False):
                long = float(np.linalg.norm(level[joint] - level[parent]))
                extended[joint] = extended[parent] + [side * long, 0.0, 0.0]
    return extended


def _joint_costs(anatomy: Anatomy, skeleton: Skeleton) -> list[_Candidate]:
    """Returns all joints as candidates, with a cost by their kind: end of a limb, middle of a limb, trunk, or
    other.

    Joints near the end of a limb, such as a wrist, have a high cost, since the end moves in the same way.
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
    """Normalizes points (N, 3): scales the width to -1..1 and the height to 0..1, and expresses the depth as
    a fraction of the height.
    """
    low, high = all_points.min(0), all_points.max(0)
    height = max(float(high[1] - low[1]), 1e-9)
    middle = (low + high) / 2
    half_width = float(high[0] - low[0]) / 2
    # A narrow mesh, such as a post, has no left and right side. Dividing by its width would turn noise into
    # sides.
    width_scale = 1.0 / half_width if half_width > _MAX_POST_HALF_WIDTH * height else 0.0
    return np.asarray((points - [middle[0], low[1], middle[2]]) * [width_scale, 1.0 / height, 1.0 / height])


def _point_sides(points: Float, partners: Sequence[int] | None) -> Float:
    """Returns (N,) 1 on the left, -1 on the right, 0 in the middle. Known mirror images define the middle
    exactly."""
    if partners is None:
        offsets = np.abs(points[:, 0]) > _SIDE_WIDTH_FRACTION
    else:
        offsets = np.asarray(partners) != np.arange(len(points))
    return np.asarray(np.sign(points[:, 0]) * offsets)
