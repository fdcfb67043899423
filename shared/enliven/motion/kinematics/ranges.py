"""Joint limits: how far a bone may swing and twist, with soft limits.

    joint = fit_joint_range(bone, turns)    # computed from plausible rotations of the bone
    limit_turns(joint, turns)               # (T, 4) the rotations, limited to the range

A rotation is split into a swing, which changes the direction of the bone, and a twist about the bone. A swing
is a vector perpendicular to the bone: its length is the angle, and its direction the axis. The range of the
swing is the convex hull of the known swings and the rest pose. The range of the twist is an interval. Both
are widened by free angles, which a rotation shares: a bone that is twisted far beyond the known range may
swing less far beyond it. Rotations within the range do not change.

A rotation beyond the range moves to the nearest known swing and twist, and then outwards by less than its
former distance: at most by the free angle and a soft margin. Close to a rotation of 180 degrees, the
direction of a swing is undefined. There the result approaches one fixed swing. So the limited rotation is a
continuous function of the input.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.rotation import conjugate, from_rotation_vector, multiply, to_rotation_vector, unit

FREE_SWING = np.radians(30.0)
"""Swing that is allowed beyond the known swings, radians. Clips do not show every pose that a body can
take."""
FREE_TWIST = np.radians(30.0)
"""Twist that is allowed beyond the known twists, radians."""
MAX_UNKNOWN_SWING = np.radians(75.0)
"""Maximum swing from the rest pose, radians, if no rotations are known."""
MAX_UNKNOWN_TWIST = np.radians(45.0)
"""Maximum twist from the rest pose, radians, if no rotations are known. A larger twist would fold the
skin."""
SOFT_MARGIN = np.radians(20.0)
"""Maximum excess beyond the free range, radians, that the soft limit allows."""
_FOLD_ANGLE = np.radians(135.0)
"""Angle, radians, above which a swing or a twist approaches its fixed value at 180 degrees."""
_UNLIMITED_ANGLE = np.radians(165.0)
"""Range, radians, above which no limit is applied, because too little space would be left for the
transition."""
_SAME_ANGLE = 1e-9
"""Tolerance, radians, within which two angles are equal."""


@dataclass(frozen=True, eq=False)
class JointRange:
    """The range of a bone relative to its parent bone.

    Attributes:
        bone: (3,) unit vector, its direction at rest.
        axes: (2, 3) unit vectors perpendicular to the bone and to each other.
        hull: (K, 2) radians along the axes, corners of the convex hull of the known swings, in order.
        twists: radians, the smallest and the largest known twist.
        free_swing, free_twist: radians, the extension of the known range.
        soft: radians, maximum excess beyond that extension.
    """

    bone: Float
    axes: Float
    hull: Float
    twists: tuple[float, float]
    free_swing: float
    free_twist: float
    soft: float

    @property
    def swing_reach(self) -> float:
        """The largest swing within the range, radians."""
        return float(np.linalg.norm(self.hull, axis=1).max()) + self.free_swing

    @property
    def twist_reach(self) -> float:
        """The largest twist within the range, radians."""
        return max(abs(self.twists[0]), abs(self.twists[1])) + self.free_twist


def fit_joint_range(bone: Float, turns: Float | None = None, share: float = 1.0) -> JointRange:
    """Returns the range of a bone.

    Args:
        bone: (3,) its direction at rest, of any non-zero length.
        turns: (F, 4) rotations relative to the parent bone that are known to be plausible; None if none are
            known.
        share: fraction above 0 that multiplies the free angles and the soft margin. The bones of a spine
            divide these angles among themselves.
    """
    bone = unit(bone)
    first = unit(np.cross(bone, np.eye(3)[int(np.abs(bone).argmin())]))
    axes = np.stack([first, np.cross(bone, first)])
    free = (MAX_UNKNOWN_SWING, MAX_UNKNOWN_TWIST) if turns is None else (FREE_SWING, FREE_TWIST)
    widened = float(share * free[0]), float(share * free[1]), float(share * SOFT_MARGIN)
    if turns is None:
        return JointRange(bone, axes, np.zeros((1, 2)), (0.0, 0.0), *widened)
    swings, twists = _decompose_swing_twist(bone, axes, turns)
    hull = _convex_hull(np.concatenate([np.zeros((1, 2)), swings]))
    ends = float(min(twists.min(), 0.0)), float(max(twists.max(), 0.0))
    return JointRange(bone, axes, hull, ends, *widened)


def limit_turns(joint: JointRange, turns: Float) -> Float:
    """Returns (T, 4) rotations of a bone, softly limited to its range; those within it are returned
    unchanged.

    Args:
        turns: (T, 4) relative to the parent bone. Their swings close to 180 degrees determine the fixed swing
            there.
    """
    swings, twists = _decompose_swing_twist(joint.bone, joint.axes, turns)
    return limit_turns_towards(joint, turns, _fixed_swing(joint, swings), swings, twists)


def limit_turns_towards(
    joint: JointRange, turns: Float, far: Float, swings: Float | None = None, twists: Float | None = None
) -> Float:
    """Returns (T, 4) rotations of a bone, softly limited to its range; those within it are returned
    unchanged.

    Args:
        turns: (T, 4) relative to the parent bone.
        far: (2,) radians along the joint's axes, the fixed swing at 180 degrees.
        swings, twists: of the rotations, if they are known already.
    """
    if swings is None or twists is None:
        swings, twists = _decompose_swing_twist(joint.bone, joint.axes, turns)
    nearest, off = _nearest_known_swings(joint, swings)
    nearest_twists = np.clip(twists, *joint.twists)
    limited_swings, limited_twists, kept_share, none = (
        swings,
        twists,
        np.ones(len(turns)),
        np.zeros(len(turns)),
    )
    swing_off = np.linalg.norm(off, axis=1) if joint.swing_reach < _UNLIMITED_ANGLE else none
    if joint.swing_reach < _UNLIMITED_ANGLE:
        around = (
            _distance_to_interval(twists, *joint.twists) if joint.twist_reach < _UNLIMITED_ANGLE else none
        )
        limited_swings = nearest + _kept_fraction(joint, swing_off, around)[:, None] * off
        kept_share = 1.0 - _smooth_rise(
            np.linalg.norm(swings, axis=1), max(float(_FOLD_ANGLE), joint.swing_reach)
        )
        limited_swings = kept_share[:, None] * limited_swings + (1.0 - kept_share)[:, None] * far
    if joint.twist_reach < _UNLIMITED_ANGLE:
        limited_twists = nearest_twists + _kept_fraction(
            joint, swing_off, np.abs(twists - nearest_twists)
        ) * (twists - nearest_twists)
        # Near a swing of 180 degrees, the twist is undefined too, so fade it out.
        limited_twists = (
            limited_twists
            * kept_share
            * (1.0 - _smooth_rise(np.abs(twists), max(float(_FOLD_ANGLE), joint.twist_reach)))
        )
    changed = (np.abs(limited_swings - swings).max(1) > _SAME_ANGLE) | (
        np.abs(limited_twists - twists) > _SAME_ANGLE
    )
    limited = multiply(
        from_rotation_vector(limited_swings @ joint.axes),
        from_rotation_vector(limited_twists[:, None] * joint.bone),
    )
    return np.where(changed[:, None], limited, turns)


def _fixed_swing(joint: JointRange, swings: Float) -> Float:
    """Returns (2,) radians, the fixed swing of a bone for rotations close to 180 degrees.

    It is the limit in the mean direction of those swings (T, 2) that are close to 180 degrees.
    """
    far = swings[np.linalg.norm(swings, axis=1) > _FOLD_ANGLE]
    if not len(far):
        return np.zeros(2)
    nearest, off = _nearest_known_swings(joint, _FOLD_ANGLE * unit(far.mean(0))[None])
    factor = _kept_fraction(joint, np.linalg.norm(off, axis=1), np.zeros(1))
    return np.asarray(nearest[0] + factor[0] * off[0])


def _nearest_known_swings(joint: JointRange, swings: Float) -> tuple[Float, Float]:
    """Returns (T, 2) radians, the nearest known swings, and (T, 2) the differences from them."""
    nearest = _project_onto_hull(joint.hull, swings)
    return nearest, np.asarray(swings - nearest)


def _kept_fraction(joint: JointRange, swing_off: Float, twist_off: Float) -> Float:
    """Returns (T,) the fraction of a rotation's distance from the known ones that is kept.

    Args:
        swing_off, twist_off: (T,) radians from the known swings and twists. The free angle in their common
            direction is that of an ellipse: a bone that is twisted far swings less far.
    """
    off = np.hypot(swing_off, twist_off)
    free_angle = np.hypot(swing_off / joint.free_swing, twist_off / joint.free_twist)
    free = off / np.maximum(free_angle, 1e-300)
    return np.where(free_angle > 1.0, _soft_limit(off, free, joint.soft) / np.maximum(off, 1e-300), 1.0)


def _distance_to_interval(twists: Float, least: float, most: float) -> Float:
    """Returns (T,) radians from twists to the nearer end of an interval, in either direction; 0 within it.

    180 degrees to one side equals 180 degrees to the other, so functions of the result do not jump there.
    """
    above = np.minimum(twists - most, 2.0 * np.pi + least - twists)
    below = np.minimum(least - twists, 2.0 * np.pi + twists - most)
    return np.asarray(np.maximum(np.maximum(above, below), 0.0))


def _soft_limit(far: Float, free: Float, soft: float) -> Float:
    """Returns (T,) distances, unchanged up to ``free``, then compressed to less than ``soft`` beyond it."""
    beyond = np.maximum(far - free, 0.0)
    return np.asarray(np.minimum(far, free) - soft * np.expm1(-beyond / soft))


def _smooth_rise(angles: Float, start: float) -> Float:
    """Returns (T,) 0 up to ``start`` radians, 1 at 180 degrees, and a smooth transition between."""
    part = np.clip((angles - start) / (np.pi - start), 0.0, 1.0)
    return np.asarray(part**2 * (3.0 - 2.0 * part))


def _decompose_swing_twist(bone: Float, axes: Float, turns: Float) -> tuple[Float, Float]:
    """Returns (T, 2) the swings of rotations (T, 4) along the axes and (T,) their twists, in radians.

    A rotation is the twist first, and then the swing.
    """
    half = np.arctan2(turns[:, 1:] @ bone, turns[:, 0])
    swings = multiply(turns, conjugate(from_rotation_vector(2.0 * half[:, None] * bone)))
    twists = np.mod(2.0 * half + np.pi, 2.0 * np.pi) - np.pi
    return np.asarray(to_rotation_vector(swings) @ axes.T), np.asarray(twists)


def _convex_hull(points: Float) -> Float:
    """Returns (K, 2) the corners of the convex hull of points (P, 2), counter-clockwise (monotone chain)."""
    ordered = np.unique(points, axis=0)
    corners = list[Float]()
    for side in (ordered, ordered[::-1]):
        chain = list[Float]()
        for point in side:
            while len(chain) > 1 and _is_right_turn(chain[-2], chain[-1], point):
                chain.pop()
            chain.append(point)
        corners += chain[:-1]
    return np.array(corners) if corners else ordered


def _is_right_turn(a: Float, b: Float, c: Float) -> bool:
    """Returns True if the path (2,) from a over b to c does not turn left."""
    to_b, to_c = b - a, c - a
    return bool(to_b[0] * to_c[1] - to_b[1] * to_c[0] <= 0.0)


def _project_onto_hull(hull: Float, points: Float) -> Float:
    """Returns (T, 2) the points of a convex hull (K, 2) that are nearest to points (T, 2)."""
    edges = np.roll(hull, -1, axis=0) - hull
    offsets = points[:, None] - hull
    squared = np.maximum(np.sum(edges**2, axis=1), 1e-300)
    fraction = np.clip(np.sum(offsets * edges, axis=2) / squared, 0.0, 1.0)
    on_edge = hull + fraction[..., None] * edges
    best = np.argmin(np.sum((points[:, None] - on_edge) ** 2, axis=2), axis=1)
    nearest = on_edge[np.arange(len(points)), best]
    if len(hull) < 3:
        return np.asarray(nearest)
    left = edges[:, 0] * offsets[..., 1] - edges[:, 1] * offsets[..., 0]
    return np.where((left >= 0.0).all(axis=1, keepdims=True), points, nearest)
