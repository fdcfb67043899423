"""The range of a joint: how far a bone may swing and twist, and soft limits that keep it there.

    joint = joint_range(bone, turns)        # from the turns of the bone that are known to be plausible
    limit_turns(joint, turns)               # (T, 4) the turns, those beyond the range brought back to it

A turn is split into a swing, which changes the direction of the bone, and a twist about the bone. A swing is
a vector at right angles to the bone: its length is the angle, and its direction the axis. The range of the
swing is the convex hull of the known swings and the rest pose. The range of the twist is an interval. Both
are widened by free angles, which a turn shares: a bone that is twisted far beyond what is known swings less
far beyond it. Turns within the range do not change.

A turn beyond the range moves to the nearest known swing and twist, and then outwards by less than it was off:
at most by the free angle and a soft margin. Close to half a turn, the direction of a swing is undefined.
There the result approaches one fixed swing. So the limited turn is a continuous function of the turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.rotation import conjugate, from_rotation_vector, multiply, to_rotation_vector, unit

FREE_SWING = np.radians(30.0)
"""Radians beyond the known swings that a bone may swing: clips do not show everything that a body can do."""
FREE_TWIST = np.radians(30.0)
"""Radians beyond the known twists that a bone may twist."""
UNKNOWN_SWING = np.radians(75.0)
"""Radians that a bone may swing from its rest pose if no turns are known."""
UNKNOWN_TWIST = np.radians(45.0)
"""Radians that a bone may twist from its rest pose if no turns are known: more folds the skin."""
SOFT = np.radians(20.0)
"""Radians beyond the free range that a limit gives way by at most."""
_FOLD = np.radians(135.0)
"""Angle, radians, above which a swing or a twist approaches its fixed value at half a turn."""
_UNLIMITED = np.radians(165.0)
"""Radians of a range above which it has no limit: too little would be left to return in."""
_SAME = 1e-9
"""Radians below which two angles are equal."""


@dataclass(frozen=True, eq=False)
class JointRange:
    """The range of a bone against the bone above it.

    Attributes:
        bone: (3,) unit vector, its direction at rest.
        axes: (2, 3) unit vectors at right angles to the bone and to each other.
        hull: (K, 2) radians along the axes, corners of the convex hull of the known swings, in order.
        twists: radians, the least and the largest known twist.
        free_swing, free_twist: radians by which the known range is widened.
        soft: radians beyond that by which the limits give way at most.
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
        """Radians of the largest swing within the range."""
        return float(np.linalg.norm(self.hull, axis=1).max()) + self.free_swing

    @property
    def twist_reach(self) -> float:
        """Radians of the largest twist within the range."""
        return max(abs(self.twists[0]), abs(self.twists[1])) + self.free_twist


def joint_range(bone: Float, turns: Float | None = None, share: float = 1.0) -> JointRange:
    """Returns the range of a bone.

    Args:
        bone: (3,) its direction at rest, of any length but zero.
        turns: (F, 4) turns against the bone above that are known to be plausible; None if none are known.
        share: of the free angles and the soft margin, which the bones of a spine share. More than 0.
    """
    bone = unit(bone)
    first = unit(np.cross(bone, np.eye(3)[int(np.abs(bone).argmin())]))
    axes = np.stack([first, np.cross(bone, first)])
    free = (UNKNOWN_SWING, UNKNOWN_TWIST) if turns is None else (FREE_SWING, FREE_TWIST)
    widened = float(share * free[0]), float(share * free[1]), float(share * SOFT)
    if turns is None:
        return JointRange(bone, axes, np.zeros((1, 2)), (0.0, 0.0), *widened)
    swings, twists = _swing_and_twist(bone, axes, turns)
    hull = _convex_hull(np.concatenate([np.zeros((1, 2)), swings]))
    ends = float(min(twists.min(), 0.0)), float(max(twists.max(), 0.0))
    return JointRange(bone, axes, hull, ends, *widened)


def limit_turns(joint: JointRange, turns: Float) -> Float:
    """Returns (T, 4) turns of a bone within its range, softly; turns within it are returned unchanged.

    Args:
        turns: (T, 4) against the bone above. Swings of them close to half a turn decide where all such end.
    """
    swings, twists = _swing_and_twist(joint.bone, joint.axes, turns)
    return limit_turns_towards(joint, turns, _far_swing(joint, swings), swings, twists)


def limit_turns_towards(
    joint: JointRange, turns: Float, far: Float, swings: Float | None = None, twists: Float | None = None
) -> Float:
    """Returns (T, 4) turns of a bone within its range, softly; turns within it are returned unchanged.

    Args:
        turns: (T, 4) against the bone above.
        far: (2,) radians along the joint's axes, the swing that stands for half a turn.
        swings, twists: of the turns, if they are known already.
    """
    if swings is None or twists is None:
        swings, twists = _swing_and_twist(joint.bone, joint.axes, turns)
    nearest, off = _known_swings(joint, swings)
    known = np.clip(twists, *joint.twists)
    made, about, kept, none = swings, twists, np.ones(len(turns)), np.zeros(len(turns))
    swing_off = np.linalg.norm(off, axis=1) if joint.swing_reach < _UNLIMITED else none
    if joint.swing_reach < _UNLIMITED:
        around = _off_around(twists, *joint.twists) if joint.twist_reach < _UNLIMITED else none
        made = nearest + _factor(joint, swing_off, around)[:, None] * off
        kept = 1.0 - _rise(np.linalg.norm(swings, axis=1), max(float(_FOLD), joint.swing_reach))
        made = kept[:, None] * made + (1.0 - kept)[:, None] * far
    if joint.twist_reach < _UNLIMITED:
        about = known + _factor(joint, swing_off, np.abs(twists - known)) * (twists - known)
        # Close to half a turn of swing, the twist is undefined as well.
        about = about * kept * (1.0 - _rise(np.abs(twists), max(float(_FOLD), joint.twist_reach)))
    changed = (np.abs(made - swings).max(1) > _SAME) | (np.abs(about - twists) > _SAME)
    limited = multiply(
        from_rotation_vector(made @ joint.axes), from_rotation_vector(about[:, None] * joint.bone)
    )
    return np.where(changed[:, None], limited, turns)


def _far_swing(joint: JointRange, swings: Float) -> Float:
    """Returns (2,) radians, the swing at which a bone is held while its turn is close to half a turn.

    It is the limit in the mean direction of the swings (T, 2) that are close to that.
    """
    far = swings[np.linalg.norm(swings, axis=1) > _FOLD]
    if not len(far):
        return np.zeros(2)
    nearest, off = _known_swings(joint, _FOLD * unit(far.mean(0))[None])
    factor = _factor(joint, np.linalg.norm(off, axis=1), np.zeros(1))
    return np.asarray(nearest[0] + factor[0] * off[0])


def _known_swings(joint: JointRange, swings: Float) -> tuple[Float, Float]:
    """Returns (T, 2) radians, the nearest known swings, and (T, 2) how far the swings are off them."""
    nearest = _nearest_in_hull(joint.hull, swings)
    return nearest, np.asarray(swings - nearest)


def _factor(joint: JointRange, swing_off: Float, twist_off: Float) -> Float:
    """Returns (T,) the share of a turn's distance to the known ones that is kept.

    Args:
        swing_off, twist_off: (T,) radians from the known swings and twists. The free angle in the direction
            of both is that of an ellipse: a bone that is twisted far swings less far.
    """
    off = np.hypot(swing_off, twist_off)
    share = np.hypot(swing_off / joint.free_swing, twist_off / joint.free_twist)
    free = off / np.maximum(share, 1e-300)
    return np.where(share > 1.0, _soft(off, free, joint.soft) / np.maximum(off, 1e-300), 1.0)


def _off_around(twists: Float, least: float, most: float) -> Float:
    """Returns (T,) radians from twists to the nearer end of an interval, either way around; 0 within it.

    Half a turn to one side is half a turn to the other: what depends on this does not jump there.
    """
    above = np.minimum(twists - most, 2.0 * np.pi + least - twists)
    below = np.minimum(least - twists, 2.0 * np.pi + twists - most)
    return np.asarray(np.maximum(np.maximum(above, below), 0.0))


def _soft(far: Float, free: Float, soft: float) -> Float:
    """Returns (T,) distances: unchanged up to ``free``, then ever less, and never ``soft`` beyond that."""
    beyond = np.maximum(far - free, 0.0)
    return np.asarray(np.minimum(far, free) - soft * np.expm1(-beyond / soft))


def _rise(angles: Float, start: float) -> Float:
    """Returns (T,) 0 up to ``start`` radians, 1 at half a turn, and a smooth rise between."""
    part = np.clip((angles - start) / (np.pi - start), 0.0, 1.0)
    return np.asarray(part**2 * (3.0 - 2.0 * part))


def _swing_and_twist(bone: Float, axes: Float, turns: Float) -> tuple[Float, Float]:
    """Returns (T, 2) the swings of turns (T, 4) along the axes and (T,) their twists, in radians.

    Turns are the twist first, and then the swing.
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
    """Returns True if the way (2,) from a over b to c does not turn left."""
    one, other = b - a, c - a
    return bool(one[0] * other[1] - one[1] * other[0] <= 0.0)


def _nearest_in_hull(hull: Float, points: Float) -> Float:
    """Returns (T, 2) the points of a convex hull (K, 2) that are nearest to points (T, 2)."""
    edges = np.roll(hull, -1, axis=0) - hull
    ways = points[:, None] - hull
    squared = np.maximum(np.sum(edges**2, axis=1), 1e-300)
    along = np.clip(np.sum(ways * edges, axis=2) / squared, 0.0, 1.0)
    on_edge = hull + along[..., None] * edges
    best = np.argmin(np.sum((points[:, None] - on_edge) ** 2, axis=2), axis=1)
    nearest = on_edge[np.arange(len(points)), best]
    if len(hull) < 3:
        return np.asarray(nearest)
    left = edges[:, 0] * ways[..., 1] - edges[:, 1] * ways[..., 0]
    return np.where((left >= 0.0).all(axis=1, keepdims=True), points, nearest)
