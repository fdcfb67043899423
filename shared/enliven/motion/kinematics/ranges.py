"""Soft joint limits: limits the swing and twist of a bone.

    joint = fit_joint_range(bone, turns)    # computed from plausible rotations of the bone
    limit_turns(joint, turns)               # (T, 4) the rotations, limited to the range

A rotation is split into a swing, which changes the direction of the bone, and a twist about the bone. A swing
is a vector perpendicular to the bone: its length is the angle, and its direction the axis. The range of the
swing is the convex hull of the known swings and the rest pose. The range of the twist is an interval. Both
ranges are extended by free angles. Swing and twist share the extension: the farther a bone is twisted beyond
the known range, the less it may swing beyond it. Rotations within the range do not change.

A rotation beyond the range is replaced by the nearest known swing and twist plus a reduced distance. This
distance is at most the free angle plus a soft margin. At a swing of 180 degrees, the direction of the swing
is undefined. Close to it, the result approaches a fixed swing. So the limited rotation is a continuous
function of the input.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.rotation import conjugate, from_rotation_vector, multiply, to_rotation_vector, unit

FREE_SWING = np.radians(30.0)
"""Additional swing beyond the known swings, radians. It is needed because clips do not show every possible
pose of a body."""
FREE_TWIST = np.radians(30.0)
"""Additional twist beyond the known twists, radians."""
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
"""Maximum range, radians, that is limited. A wider range would leave too little space for a smooth
transition."""
_SAME_ANGLE = 1e-9
"""Maximum difference, radians, between two equal angles."""


@dataclass(frozen=True, eq=False)
class JointRange:
    """The range of a bone relative to its parent bone.

    Attributes:
        bone: (3,) direction of the bone at rest, unit vector.
        axes: (2, 3) unit vectors perpendicular to the bone and to each other.
        hull: (K, 2) corners of the convex hull of the known swings, in order, radians along the axes.
        twists: the smallest and the largest known twist, radians.
        free_swing, free_twist: extension of the known range, radians.
        soft: maximum excess beyond this extension, radians.
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


def fit_joint_range(bone: Float, turns: Float | None = None, angle_factor: float = 1.0) -> JointRange:
    """Computes the range of a bone from known rotations.

    Args:
        bone: (3,) direction of the bone at rest, of any non-zero length.
        turns: (F, 4) rotations relative to the parent bone that are known to be plausible. None if none are
            known.
        angle_factor: factor, above 0, on the free angles and the soft margin. The bones of a spine share
            these angles.
    """
    bone = unit(bone)
    first_axis = unit(np.cross(bone, np.eye(3)[int(np.abs(bone).argmin())]))
    axes = np.stack([first_axis, np.cross(bone, first_axis)])
    free_angles = (MAX_UNKNOWN_SWING, MAX_UNKNOWN_TWIST) if turns is None else (FREE_SWING, FREE_TWIST)
    widened = (
        float(angle_factor * free_angles[0]),
        float(angle_factor * free_angles[1]),
        float(angle_factor * SOFT_MARGIN),
    )
    if turns is None:
        return JointRange(bone, axes, np.zeros((1, 2)), (0.0, 0.0), *widened)
    swings, twists = _decompose_swing_twist(bone, axes, turns)
    hull = _compute_convex_hull(np.concatenate([np.zeros((1, 2)), swings]))
    twist_interval = float(min(twists.min(), 0.0)), float(max(twists.max(), 0.0))
    return JointRange(bone, axes, hull, twist_interval, *widened)


def limit_turns(joint: JointRange, turns: Float) -> Float:
    """Limits rotations (T, 4) of a bone softly to its range. Rotations within the range do not change.

    Args:
        turns: (T, 4) rotations relative to the parent bone. Rotations with a swing close to 180 degrees
            determine the fixed swing.
    """
    swings, twists = _decompose_swing_twist(joint.bone, joint.axes, turns)
    return limit_turns_towards(joint, turns, _make_fixed_swing(joint, swings), swings, twists)


def limit_turns_towards(
    joint: JointRange, turns: Float, far: Float, swings: Float | None = None, twists: Float | None = None
) -> Float:
    """Limits rotations (T, 4) of a bone softly to its range, with a given fixed swing. Rotations within the
    range do not change.

    Args:
        turns: (T, 4) relative to the parent bone.
        far: (2,) the fixed swing at 180 degrees, radians along the joint's axes.
        swings, twists: the swings and twists of the rotations, if they were already computed.
    """
    if swings is None or twists is None:
        swings, twists = _decompose_swing_twist(joint.bone, joint.axes, turns)
    nearest, differences = _find_nearest_known_swings(joint, swings)
    nearest_twists = np.clip(twists, *joint.twists)
    limited_swings, limited_twists, kept_share, none = (
        swings,
        twists,
        np.ones(len(turns)),
        np.zeros(len(turns)),
    )
    swing_off = np.linalg.norm(differences, axis=1) if joint.swing_reach < _UNLIMITED_ANGLE else none
    if joint.swing_reach < _UNLIMITED_ANGLE:
        twist_differences = (
            _distance_to_interval(twists, *joint.twists) if joint.twist_reach < _UNLIMITED_ANGLE else none
        )
        limited_swings = (
            nearest + _compute_kept_fraction(joint, swing_off, twist_differences)[:, None] * differences
        )
        kept_share = 1.0 - _smooth_rise(
            np.linalg.norm(swings, axis=1), max(float(_FOLD_ANGLE), joint.swing_reach)
        )
        limited_swings = kept_share[:, None] * limited_swings + (1.0 - kept_share)[:, None] * far
    if joint.twist_reach < _UNLIMITED_ANGLE:
        limited_twists = nearest_twists + _compute_kept_fraction(
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


def _make_fixed_swing(joint: JointRange, swings: Float) -> Float:
    """Returns the fixed swing (2,) of a bone for rotations close to 180 degrees, radians.

    It is the range's limit in the mean direction of those ``swings`` (T, 2) that are close to 180 degrees.
    """
    far_swings = swings[np.linalg.norm(swings, axis=1) > _FOLD_ANGLE]
    if not len(far_swings):
        return np.zeros(2)
    nearest, difference = _find_nearest_known_swings(joint, _FOLD_ANGLE * unit(far_swings.mean(0))[None])
    factor = _compute_kept_fraction(joint, np.linalg.norm(difference, axis=1), np.zeros(1))
    return np.asarray(nearest[0] + factor[0] * difference[0])


def _find_nearest_known_swings(joint: JointRange, swings: Float) -> tuple[Float, Float]:
    """Returns the nearest swings (T, 2) within the hull, and the differences (T, 2) of ``swings`` from them,
    radians."""
    nearest = _project_onto_hull(joint.hull, swings)
    return nearest, np.asarray(swings - nearest)


def _compute_kept_fraction(joint: JointRange, swing_off: Float, twist_off: Float) -> Float:
    """Returns the fraction (T,) of the distance to the known rotations that is kept.

    Args:
        swing_off, twist_off: (T,) distances to the known swings and twists, radians. The free angle in their
            combined direction is the radius of an ellipse. So the larger the twist, the smaller the allowed
            swing.
    """
    distance = np.hypot(swing_off, twist_off)
    free_angle = np.hypot(swing_off / joint.free_swing, twist_off / joint.free_twist)
    relative_distance = distance / np.maximum(free_angle, 1e-300)
    return np.where(
        free_angle > 1.0,
        _limit_softly(distance, relative_distance, joint.soft) / np.maximum(distance, 1e-300),
        1.0,
    )


def _distance_to_interval(twists: Float, lower: float, upper: float) -> Float:
    """Returns the distances (T,), radians, from twists to the nearer end of an interval, or 0 within the
    interval.

    Twists of 180 and -180 degrees are the same rotation, so distances are measured in both directions around
    the circle.
    """
    above_interval = np.minimum(twists - upper, 2.0 * np.pi + lower - twists)
    below_interval = np.minimum(lower - twists, 2.0 * np.pi + twists - upper)
    return np.asarray(np.maximum(np.maximum(above_interval, below_interval), 0.0))


def _limit_softly(distances: Float, free: Float, soft: float) -> Float:
    """Limits distances (T,) softly. Distances up to ``free`` do not change, and the excess is compressed to
    less than ``soft``.
    """
    excess = np.maximum(distances - free, 0.0)
    return np.asarray(np.minimum(distances, free) - soft * np.expm1(-excess / soft))


def _smooth_rise(angles: Float, start: float) -> Float:
    """Returns a smooth step (T,) of the angles: 0 up to ``start`` radians, and 1 at 180 degrees."""
    fraction = np.clip((angles - start) / (np.pi - start), 0.0, 1.0)
    return np.asarray(fraction**2 * (3.0 - 2.0 * fraction))


def _decompose_swing_twist(bone: Float, axes: Float, turns: Float) -> tuple[Float, Float]:
    """Decomposes rotations (T, 4). Returns (T, 2) swings along the axes, and (T,) twists, in radians.

    A rotation applies the twist first, and then the swing.
    """
    half_twist = np.arctan2(turns[:, 1:] @ bone, turns[:, 0])
    swings = multiply(turns, conjugate(from_rotation_vector(2.0 * half_twist[:, None] * bone)))
    twists = np.mod(2.0 * half_twist + np.pi, 2.0 * np.pi) - np.pi
    return np.asarray(to_rotation_vector(swings) @ axes.T), np.asarray(twists)


def _compute_convex_hull(points: Float) -> Float:
    """Returns the corners (K, 2) of the convex hull of points (P, 2), counter-clockwise (monotone chain)."""
    sorted_points = np.unique(points, axis=0)
    # Use Python's floats in the loop, because NumPy's scalars would take eight times as long.
    point_list: list[tuple[float, float]] = [(x, y) for x, y in sorted_points.tolist()]
    corners = list[tuple[float, float]]()
    for side_points in (point_list, point_list[::-1]):
        chain = list[tuple[float, float]]()
        for x, y in side_points:
            while len(chain) > 1:
                (start_x, start_y), (end_x, end_y) = chain[-2:]
                is_right_turn = (end_x - start_x) * (y - start_y) - (end_y - start_y) * (x - start_x) <= 0.0
                if not is_right_turn:
                    break
                chain.pop()
            chain.append((x, y))
        corners += chain[:-1]
    return np.array(corners) if corners else sorted_points


def _project_onto_hull(hull: Float, points: Float) -> Float:
    """Returns the points (T, 2) of a convex hull (K, 2) that are nearest to points (T, 2)."""
    edges = np.roll(hull, -1, axis=0) - hull
    offsets = points[:, None] - hull
    squared = np.maximum(np.sum(edges**2, axis=1), 1e-300)
    fraction = np.clip(np.sum(offsets * edges, axis=2) / squared, 0.0, 1.0)
    on_edge = hull + fraction[..., None] * edges
    nearest_edge = np.argmin(np.sum((points[:, None] - on_edge) ** 2, axis=2), axis=1)
    nearest = on_edge[np.arange(len(points)), nearest_edge]
    if len(hull) < 3:
        return np.asarray(nearest)
    side_of_edge = edges[:, 0] * offsets[..., 1] - edges[:, 1] * offsets[..., 0]
    return np.where((side_of_edge >= 0.0).all(axis=1, keepdims=True), points, nearest)
