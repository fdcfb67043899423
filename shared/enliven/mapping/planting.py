"""Foot planting (foot lock) for a body in its performer's pose: the root's path is corrected so that feet do
not slide.

    spans = standing_spans(foot, root, step, length)     # when a foot of the performer stands
    turns = remove_spin(Sole(shape, bones).spin(turns, joints, length), spans, step)   # keeps its heading
    rolled, low = Sole(shape, bones).rolling(turns, joints, length)   # how the model's own foot rolls
    plant_body(legs, root, step, floor)                     # the root's path, and the offset of each foot

The feet of a model with other proportions would slide in its performer's pose, because its strides have
another length and its feet roll about other points. So the path of the root is corrected. Horizontally it
moves so that the touching points of the standing foot do not move. Vertically it moves so that the sole of
that foot is on the floor. The root's path stays smooth. The legs bend to close the remaining distance, also
if two standing feet need different paths. In the air the root follows the performer's, and rises if a foot
would be too low.

Feet of captured performers often rotate on the spot while they stand. The model's sole would slide, so each
foot keeps one heading during a contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from enliven.arrays import Float, Int
from enliven.document import Shape
from enliven.motion.contact import find_runs, touching
from enliven.rotation import conjugate, multiply, rotate

Spans = tuple[tuple[int, int], ...]
"""The first and the last frame of every contact of a foot with the floor."""

_MAX_STANDING_HEIGHT = 0.1
"""Largest height of a standing foot above its lowest position, in leg lengths. Floors of captures drift."""
_MAX_STANDING_SPEED = 0.4
"""Largest speed of a standing foot of a body at rest, in leg lengths a second. Captured feet drift slowly."""
_MAX_SPEED_FRACTION = 0.3
"""Largest speed of a standing foot as a fraction of the body's speed: the foot of a runner rolls fast."""
_SPEED_WINDOW_S = 0.4
"""Seconds over which the speed of the body is averaged: a stride."""
_MIN_CONTACT_S = 0.05
"""Shortest contact in seconds. Those of a sprint last 80 ms."""
_RELEASE_FACTOR = 1.3
"""Factor on the limits of height and speed at the end of a contact, relative to its beginning
(hysteresis)."""
_STANDING_PERCENTILE = 5.0
"""Percentile of a joint's height over a take that counts as its height while the foot stands."""
_BLEND_S = 0.1
"""Seconds over which a foot moves from the performer's path to its planted position, and back."""
_SMOOTH_S = 0.05
"""Time in seconds over which the root's speed and height are smoothed. A shorter one makes the root jerk, a
longer one bends the legs more."""
_MIN_AIR_HEIGHT = 0.7
"""Smallest height of a foot in the air as a fraction of the performer's, so that it does not touch the
floor."""
_MIN_SWING_HEIGHT = 0.03
"""Smallest height of a swinging foot in leg lengths, unless the performer's is lower: 25 mm on an adult."""
_CONTACT_DECAY = 0.006
"""Decay length of contact weights above a foot's lowest point, in leg lengths: 5 mm on an adult."""
_FOOT_WEIGHT = 0.5
"""Minimum total skin weight of a vertex on the foot's bones for the vertex to belong to the foot."""
_SEARCH_DIRECTIONS = 128
"""Number of directions, spread evenly, in which the outermost points of a foot are searched."""
_FRAMES_PER_BLOCK = 2048
"""Number of frames that are processed at a time, to bound the memory for all points of a foot."""
_HEIGHT_WEIGHT = 1e-9
"""Weight of the performer's own height, small enough to matter only while no foot stands."""
_MAX_HEADING_DIFFERENCE = np.radians(30.0)
"""Largest angle (radians) between the headings of a standing foot and the performer's foot. Ankle and hip
allow no more."""
_PATH_WEIGHT = 0.01
"""Weight of the performer's path for the root, compared with a standing foot."""


@dataclass(frozen=True, eq=False)
class PosedLeg:
    """A leg in its performer's pose, over time.

    Attributes:
        rolled: (T, 2) metres along x and z that the touching part of the sole has moved relative to the root;
            see :func:`rolling_motion`.
        sole: (T,) metres from the root up to the lowest point of the foot.
        clear: (T,) height in metres of the performer's foot above the floor, scaled to the body's size.
        length: length of the leg in metres.
        spans: the contacts of the foot with the floor.
    """

    rolled: Float
    sole: Float
    clear: Float
    length: float
    spans: Spans


def rolling_motion(points: Float, length: float) -> tuple[Float, Float]:
    """Returns how a foot rolls over a floor.

    A foot that rolls without sliding rotates about the points that touch the floor, first the heel and last
    the toes. So these points must have zero speed, not a joint of the foot.

    Args:
        points: (T, P, 3) metres from the root to points of the sole.
        length: length of the leg in metres.

    Returns:
        (T, 2) metres along x and z that the touching points have moved relative to the root since the first
        moment, and (T,) metres from the root up to the lowest point.
    """
    height = points[..., 1]
    between = 0.5 * (height[1:] + height[:-1])
    above = between - between.min(axis=1, keepdims=True)
    weights = np.exp(-above / (_CONTACT_DECAY * length))
    steps = np.diff(points[..., [0, 2]], axis=0)
    moved = np.einsum("tp,tpc->tc", weights, steps) / weights.sum(1, keepdims=True)
    rolled = np.concatenate([np.zeros((1, 2)), np.cumsum(moved, axis=0)])
    return rolled, np.asarray(height.min(1))


def standing_spans(foot: Float, root: Float, step: float, length: float) -> Spans:
    """Returns the contacts of a foot: the spans in which one of its joints is low and slow.

    The limit of speed rises with the speed of the body.

    Args:
        foot: (T, J, 3) metres, the joints about which the foot rolls, such as ankle, ball and tip.
        root: (T, 3) metres, the position of the body.
        step: seconds between two frames.
        length: length of the leg in metres.
    """
    if len(foot) < 2:
        return ((0, len(foot) - 1),)
    way = np.linalg.norm(np.gradient(root[:, [0, 2]], step, axis=0), axis=1)
    pace = scipy.ndimage.uniform_filter1d(way, max(round(_SPEED_WINDOW_S / step), 1), mode="nearest")
    allowed = np.maximum(_MAX_STANDING_SPEED * length, _MAX_SPEED_FRACTION * pace)
    stands = np.zeros(len(foot), np.bool_)
    for joint in foot.swapaxes(0, 1):
        speed = np.linalg.norm(np.gradient(joint, step, axis=0), axis=1)
        height = joint[:, 1] - np.percentile(joint[:, 1], _STANDING_PERCENTILE)
        down = np.empty(len(foot), np.bool_)
        touching(height, speed / allowed, _MAX_STANDING_HEIGHT * length, 1.0, _RELEASE_FACTOR, down)
        stands |= down
    return tuple((a, b) for a, b in find_runs(stands) if (b - a) * step >= _MIN_CONTACT_S)


class Sole:
    """The outermost points of a foot, with the bones that they follow.

    Args:
        shape: the body, at rest.
        bones: the bones of the foot.
    """

    def __init__(self, shape: Shape, bones: Sequence[int]) -> None:
        self._skeleton = shape.skeleton
        self._points, self._bones = shape.skeleton.positions[list(bones)], np.array(bones)[:, None]
        self._weights = np.ones((len(bones), 1))
        if shape.mesh is None or shape.skin is None:
            return
        foot_weights = np.where(np.isin(shape.skin.indices, bones), shape.skin.weights, 0.0)
        part = np.flatnonzero(foot_weights.sum(1) > _FOOT_WEIGHT)
        if not len(part):
            return
        carrier = shape.skin.indices[part, foot_weights[part].argmax(1)]
        groups = [part[carrier == bone] for bone in np.unique(carrier)]
        chosen = np.concatenate([some[_outermost_points(shape.mesh.vertices[some])] for some in groups])
        self._points = shape.mesh.vertices[chosen]
        self._bones, self._weights = shape.skin.indices[chosen], shape.skin.weights[chosen]

    def points(self, turns: Float, joints: Float) -> Float:
        """Returns the points (T, P, 3) in metres for turns (T, N, 4) and joints (T, N, 3)."""
        positions = np.zeros((len(turns), *self._points.shape))
        for bone in np.unique(self._bones[self._weights > 0.0]):
            weight = np.where(self._bones == bone, self._weights, 0.0).sum(1)
            ways = rotate(turns[:, bone, None], self._points - self._skeleton.positions[bone])
            positions += weight[:, None] * (ways + joints[:, bone, None])
        return positions

    def rolling(self, turns: Float, joints: Float, length: float) -> tuple[Float, Float]:
        """Returns :func:`rolling_motion` of the points, for joints (T, N, 3) in metres relative to the
        root."""
        rolled, low, at = [np.zeros((1, 2))], list[Float](), np.zeros(2)
        for start in range(0, max(len(turns) - 1, 1), _FRAMES_PER_BLOCK):
            part = slice(start, start + _FRAMES_PER_BLOCK + 1)
            way, height = rolling_motion(self.points(turns[part], joints[part]), length)
            rolled.append(at + way[1:])
            at, low = at + way[-1], [*low, height if not start else height[1:]]
        return np.concatenate(rolled), np.concatenate(low)

    def spin(self, turns: Float, joints: Float, length: float) -> Float:
        """Returns the accumulated rotation (T,) of the touching part about +Y, in radians.

        A foot that rolls turns about level axes only. Any other turn drags its sole over the floor.
        """
        leader = np.take_along_axis(self._bones, self._weights.argmax(1)[:, None], axis=1)[:, 0]
        touching, bones = list[Float](), np.unique(leader)
        for start in range(0, len(turns), _FRAMES_PER_BLOCK):
            part = slice(start, start + _FRAMES_PER_BLOCK)
            height = self.points(turns[part], joints[part])[..., 1]
            weights = np.exp(-(height - height.min(axis=1, keepdims=True)) / (_CONTACT_DECAY * length))
            touching.append(np.stack([weights[:, leader == bone].sum(1) for bone in bones], axis=1))
        share = np.concatenate(touching)
        share = share[1:] + share[:-1]
        moved = multiply(turns[1:, bones], conjugate(turns[:-1, bones]))
        about = 2.0 * np.arctan2(moved[..., 2], moved[..., 0])
        about = (about + np.pi) % (2.0 * np.pi) - np.pi
        steps = np.sum(share * about, axis=1) / share.sum(1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    def lowest(self, turns: Float, joints: Float) -> Float:
        """Returns the height (T,) in metres of the lowest point, for turns (T, N, 4) and joints (T, N, 3)."""
        parts = (slice(start, start + _FRAMES_PER_BLOCK) for start in range(0, len(turns), _FRAMES_PER_BLOCK))
        return np.concatenate([self.points(turns[part], joints[part])[..., 1].min(1) for part in parts])

    def lowest_turned(self, turns: Float, joints: Float, turning: Float, about: int) -> Float:
        """Returns the height (T,) in metres of the lowest point relative to a joint, after all points are
        rotated about that joint."""
        low = list[Float]()
        for start in range(0, len(turns), _FRAMES_PER_BLOCK):
            part = slice(start, start + _FRAMES_PER_BLOCK)
            beside = self.points(turns[part], joints[part] - joints[part, about, None])
            low.append(rotate(turning[part, None], beside)[..., 1].min(1))
        return np.concatenate(low)


def _outermost_points(points: Float) -> Int:
    """Returns the indices (P,) of the points (V, 3) that are farthest in some direction."""
    if len(points) <= _SEARCH_DIRECTIONS:
        return np.arange(len(points))
    number = np.arange(_SEARCH_DIRECTIONS) + 0.5
    height, angle = 1.0 - 2.0 * number / _SEARCH_DIRECTIONS, np.pi * (1.0 + np.sqrt(5.0)) * number
    level = np.sqrt(1.0 - height**2)
    ways = np.stack([level * np.cos(angle), height, level * np.sin(angle)])
    return np.unique((points @ ways).argmax(0))


def remove_spin(spin: Float, spans: Spans, step: float) -> Float:
    """Returns the rotations about +Y, (T,) radians, that keep a foot from spinning while it stands.

    The foot keeps the median heading of each contact. If the performer's foot rotates farther than ankle and
    hip allow, as in a pirouette, the foot follows it. The correction fades before and after a contact.

    Args:
        spin: (T,) radians that the touching part has turned about +Y.
        spans: when the foot stands.
        step: seconds between two moments.
    """
    count, blend = len(spin), max(round(_BLEND_S / step), 1)
    spans, turns = _join_spans(spans, blend), np.zeros(count)
    ends = [-blend, *(b for _, b in spans)]
    starts = [*(a for a, _ in spans), count + blend]
    for number, (first, last) in enumerate(spans):
        standing_heading = float(np.median(spin[first : last + 1]))
        for t in range(first, last + 1):
            standing_heading = float(
                np.clip(
                    standing_heading, spin[t] - _MAX_HEADING_DIFFERENCE, spin[t] + _MAX_HEADING_DIFFERENCE
                )
            )
            turns[t] = standing_heading - spin[t]
        before, after = min(blend, first - ends[number]), min(blend, starts[number + 1] - last)
        into, out = _fading_weights(before)[::-1] * turns[first], _fading_weights(after) * turns[last]
        turns[max(first - len(into), 0) : first] += into[len(into) - min(len(into), first) :]
        turns[last + 1 : last + 1 + len(out)] += out[: count - last - 1]
    return turns


def _join_spans(spans: Spans, gap: int) -> Spans:
    """Joins spans that are at most ``gap`` frames apart, and returns all spans."""
    joined = list[tuple[int, int]]()
    for first, last in spans:
        if joined and first - joined[-1][1] <= gap:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return tuple(joined)


def contact_clearance(heights: Float, spans: Spans) -> Float:
    """Returns the height (T,) in metres of a foot above its contacts: the height of the joint that has risen
    least.

    Floors of captures drift, so the reference is interpolated between the contacts before and after.

    Args:
        heights: (T, J) metres of the joints of a foot.
        spans: when the foot stands.
    """
    if spans:
        lows = np.array([heights[first : last + 1].min(0) for first, last in spans for _ in range(2)])
        ends = np.array(spans).ravel()
        times = np.arange(len(heights))
        standing = np.stack([np.interp(times, ends, low) for low in lows.T], axis=1)
    else:
        standing = np.percentile(heights, _STANDING_PERCENTILE, axis=0)
    return np.asarray(np.maximum(heights - standing, 0.0).min(1))


def plant_body(legs: Sequence[PosedLeg], root: Float, step: float, floor: float) -> tuple[Float, list[Float]]:
    """Returns the corrected path of the root, and the remaining offset of each foot.

    Args:
        legs: the legs of the body.
        root: (T, 3) metres, the performer's path scaled to the body's size.
        step: seconds between two moments.
        floor: metres, the height of the floor.

    Returns:
        The root (T, 3) in metres, and for each leg the offset (T, 3) in metres of its foot.
    """
    root = root.copy()
    if not any(leg.spans for leg in legs):
        return root, [np.zeros_like(root) for _ in legs]
    smooth = (_SMOOTH_S / step) ** 2
    stands = [_standing_mask(leg.spans, len(root)) for leg in legs]
    both = [np.minimum(on[1:], on[:-1]) for on in stands]
    for column, axis in enumerate((0, 2)):
        slips = [-np.diff(leg.rolled[:, column] + root[:, axis]) for leg in legs]
        root[1:, axis] += np.cumsum(_smoothest_path(slips, both, smooth, _PATH_WEIGHT))
    flies = _flight_weights(stands, step)
    wanted = [floor - root[:, 1] - leg.sole for leg in legs]
    up = _smoothest_path(wanted, stands, smooth, 0.0)
    # While the body is in the air, raise it until no foot is too low.
    high = np.max(
        [_MIN_AIR_HEIGHT * leg.clear + want for leg, want in zip(legs, wanted, strict=True)], axis=0
    )
    rises = np.where(high > up, flies, 0.0)
    root[:, 1] += _smoothest_path([*wanted, high], [*stands, rises], smooth, 0.0) if rises.any() else up
    return root, [_foot_offsets(leg, root, step, floor, flies) for leg in legs]


def _smoothest_path(wanted: Sequence[Float], weights: Sequence[Float], smooth: float, free: float) -> Float:
    """Returns the x (T,) that minimises the sum of w (x - wanted)^2, smooth (x' - x)^2 and free x^2.

    The first term is summed over all pairs of ``weights`` and ``wanted``. x' is the next value of x.
    """
    total = np.sum(weights, axis=0)
    count = len(total)
    bands = np.zeros((2, count))
    bands[1] = total + free + _HEIGHT_WEIGHT
    bands[1, :-1] += smooth
    bands[1, 1:] += smooth
    bands[0, 1:] = -smooth
    right = np.sum([weight * value for weight, value in zip(weights, wanted, strict=True)], axis=0)
    return np.asarray(scipy.linalg.solveh_banded(bands, right))


def _standing_mask(spans: Spans, count: int) -> Float:
    """Returns (T,) 1 within the spans and 0 elsewhere."""
    on = np.zeros(count)
    for first, last in spans:
        on[first : last + 1] = 1.0
    return on


def _flight_weights(stands: Sequence[Float], step: float) -> Float:
    """Returns (T,) 1 while no foot stands, 0 while one does, with smooth changes."""
    return np.asarray(
        scipy.ndimage.uniform_filter1d(
            1.0 - np.max(stands, axis=0), 2 * max(round(_BLEND_S / 4.0 / step), 1) + 1, mode="nearest"
        )
    )


def _foot_offsets(leg: PosedLeg, root: Float, step: float, floor: float, flies: Float) -> Float:
    """Returns the offset (T, 3) in metres of a foot to its planted position, faded around each contact."""
    above, count, blend = root[:, 1] + leg.sole - floor, len(root), max(round(_BLEND_S / step), 1)
    foot = np.stack([root[:, 0] + leg.rolled[:, 0], above, root[:, 2] + leg.rolled[:, 1]], axis=1)
    offsets = np.zeros_like(foot)
    ends = [-1, *(b for _, b in leg.spans)]
    starts = [*(a for a, _ in leg.spans), count]
    for number, (first, last) in enumerate(leg.spans):
        correction = np.median(foot[first : last + 1], axis=0) - foot[first : last + 1]
        correction[:, 1] = -above[first : last + 1]
        offsets[first : last + 1] = correction
        before = min(blend, first - ends[number])
        after = min(blend, starts[number + 1] - last)
        offsets[first - before + 1 : first] += _fading_weights(before)[::-1, None] * correction[0]
        offsets[last + 1 : last + after] += _fading_weights(after)[:, None] * correction[-1]
    clear = (1.0 - _standing_mask(leg.spans, count)) * _min_clearance(leg, flies)
    offsets[:, 1] = np.maximum(offsets[:, 1], clear - above)
    return offsets


def _min_clearance(leg: PosedLeg, flies: Float) -> Float:
    """Returns the smallest height (T,) in metres of a foot above the floor while it swings.

    While the body is in the air, it is a large fraction of the performer's height. Otherwise the foot just
    clears the floor.
    """
    clear = _MIN_AIR_HEIGHT * leg.clear
    return np.asarray(np.maximum(flies * clear, np.minimum(clear, _MIN_SWING_HEIGHT * leg.length)))


def _fading_weights(count: int) -> Float:
    """Returns (count - 1,) weights that fall smoothly from nearly 1 to nearly 0."""
    remaining = 1.0 - np.arange(1, count) / max(count, 1)
    return np.asarray(remaining * remaining * (3.0 - 2.0 * remaining))
