"""Foot planting (foot lock) for a body in its performer's pose: corrects the path of the root so that feet do
not slide.

    spans = find_standing_spans(foot, root, step, length)     # the contacts of the performer's foot
    turns = remove_spin(Sole(shape, bones).spin(turns, joints), spans, step)   # keeps its heading
    rolled, low = Sole(shape, bones).compute_rolling(turns, joints)   # how the model's own foot rolls
    hip_shift(leg, other_leg, rise, step)                   # lets both feet stand without bent legs
    plant_body(legs, root, step, floor)                     # the path of the root, and offsets of feet

In the performer's pose, the feet of a model with other proportions would slide. The lengths of its strides
differ, and its feet roll about other points. So the path of the root is corrected. The horizontal correction
keeps the touching points of the standing foot in place. The vertical correction puts the sole of that foot on
the floor. The path of the root stays smooth. The legs bend to close the remaining distance, for example if
two standing feet need different paths. In the air the root follows the performer's path, and is raised if a
foot would be too low.

The feet of captured performers often rotate on the spot while they stand. The model's sole would slide, so
each foot gets a constant heading during a contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.motion.contact.contacts import detect_contact_frames, find_runs

Spans = tuple[tuple[int, int], ...]
"""The contacts of a foot with the floor: the first and the last frame of each."""
_MAX_STANDING_HEIGHT = 0.1
"""Largest height of a standing foot above its lowest position, in leg lengths. It is large because the floor
drifts in captured motion."""
_MAX_STANDING_SPEED = 0.4
"""Largest speed of a standing foot if the body is at rest, in leg lengths per second. It is large because
captured feet drift."""
_MAX_SPEED_FRACTION = 0.3
"""Largest speed of a standing foot, as a fraction of the body's speed. The foot of a runner rolls fast."""
_SPEED_WINDOW_S = 0.4
"""Seconds over which the speed of the body is averaged: a stride."""
_MIN_CONTACT_S = 0.05
"""Shortest contact in seconds. In a sprint, contacts last 80 ms."""
_RELEASE_FACTOR = 1.3
"""Hysteresis: at the end of a contact, the limits of height and speed are higher than at its beginning by
this factor."""
_STANDING_PERCENTILE = 5.0
"""This percentile of a joint's height over a take is its height while the foot stands."""
_BLEND_S = 0.1
"""Time in seconds in which a foot moves from the performer's path to its planted position, or back."""
_SMOOTH_S = 0.05
"""Time in seconds over which the root's speed and height are smoothed. A shorter time makes the root jerk, a
longer time bends the legs more."""
_MIN_AIR_HEIGHT = 0.7
"""Smallest height of a foot above the floor while the body is in the air, as a fraction of the height of the
performer's foot."""
_MIN_SWING_HEIGHT = 0.03
"""Smallest height of a swinging foot in leg lengths, unless the performer's foot is lower: 25 mm on an
adult."""
_MIN_SWING_S = 0.2
"""Shortest swing in seconds in which a stepping foot takes the body's new heading. In captures a standing
foot may tremble."""
_FLIGHT_WEIGHT = 6.0
"""Weight of a given height in the air, relative to the weight of a standing foot. With a smaller weight, a
jump begins too early and ends too late, with all feet above the floor."""
_HEIGHT_WEIGHT = 1e-9
"""Weight of the term that pulls the root's height to the performer's. It is so small that it matters only
while no foot stands."""
_MAX_HEADING_DIFFERENCE = np.radians(30.0)
"""Largest angle (radians) between the heading of the model's standing foot and that of the performer's foot.
Ankle and hip cannot rotate farther."""
_PATH_WEIGHT = 0.01
"""Weight of the performer's path in the correction of the root's path, relative to the weight of a standing
foot."""


@dataclass(frozen=True, eq=False)
class PosedLeg:
    """A model's leg in the performer's pose, over time.

    Attributes:
        rolled: (T, 2) metres along x and z, the accumulated motion of the touching part of the sole relative
            to the root; see :func:`compute_rolling_motion`.
        sole: (T,) metres from the root up to the lowest point of the foot.
        clearance: (T,) height in metres of the performer's foot above the floor, scaled to the model's size.
        length: length of the leg in metres.
        spans: the contacts of the foot with the floor.
        hold_frames: number of frames before and after each contact in which the foot keeps its horizontal
            place, so that it moves straight down and up.
    """

    rolled: Float
    sole: Float
    clearance: Float
    length: float
    spans: Spans
    hold_frames: int = 0


def find_standing_spans(foot: Float, root: Float, step: float, length: float) -> Spans:
    """Returns the contacts of a foot: the spans in which one of its joints is low and slow.

    The speed limit rises with the speed of the body.

    Args:
        foot: (T, J, 3) metres, the joints about which the foot rolls, such as ankle, ball and toe tip.
        root: (T, 3) metres, the position of the body.
        step: seconds from one frame to the next.
        length: length of the leg in metres.
    """
    if len(foot) < 2:
        return ((0, len(foot) - 1),)
    root_speed = np.linalg.norm(np.gradient(root[:, [0, 2]], step, axis=0), axis=1)
    body_speed = scipy.ndimage.uniform_filter1d(
        root_speed, max(round(_SPEED_WINDOW_S / step), 1), mode="nearest"
    )
    speed_limit = np.maximum(_MAX_STANDING_SPEED * length, _MAX_SPEED_FRACTION * body_speed)
    is_standing = np.zeros(len(foot), np.bool_)
    for joint in foot.swapaxes(0, 1):
        speed = np.linalg.norm(np.gradient(joint, step, axis=0), axis=1)
        height = joint[:, 1] - np.percentile(joint[:, 1], _STANDING_PERCENTILE)
        joint_stands = np.empty(len(foot), np.bool_)
        detect_contact_frames(
            height, speed / speed_limit, _MAX_STANDING_HEIGHT * length, 1.0, _RELEASE_FACTOR, joint_stands
        )
        is_standing |= joint_stands
    return tuple((a, b) for a, b in find_runs(is_standing) if (b - a) * step >= _MIN_CONTACT_S)


def remove_spin(spin: Float, spans: Spans, step: float) -> Float:
    """Returns the rotations about +Y, (T,) radians, that stop a foot from spinning while it stands.

    The foot gets the median heading of each contact. If the performer's foot rotates farther than ankle and
    hip allow, as in a pirouette, the foot rotates with it. The correction fades in and out around a contact.

    Args:
        spin: (T,) radians, the accumulated rotation of the touching part about +Y.
        spans: the contacts of the foot.
        step: seconds from one frame to the next.
    """
    count, blend = len(spin), max(round(_BLEND_S / step), 1)
    spans, turns = _join_spans(spans, blend), np.zeros(count)
    ends = [-blend, *(b for _, b in spans)]
    starts = [*(a for a, _ in spans), count + blend]
    for number, (first, last) in enumerate(spans):
        turns[first : last + 1] = _compute_standing_turns(spin[first : last + 1])
        frames_before, frames_after = min(blend, first - ends[number]), min(blend, starts[number + 1] - last)
        fade_in, fade_out = (
            _compute_fading_weights(frames_before)[::-1] * turns[first],
            _compute_fading_weights(frames_after) * turns[last],
        )
        turns[max(first - len(fade_in), 0) : first] += fade_in[len(fade_in) - min(len(fade_in), first) :]
        turns[last + 1 : last + 1 + len(fade_out)] += fade_out[: count - last - 1]
    return turns


def hold_heading(heading: Float, spans: Spans, step: float) -> Float:
    """Returns the heading (T,) in radians of a foot that steps: constant while it stands, if possible.

    The heading changes while the foot swings. If the body turns farther than a leg allows during a contact,
    the foot turns with it.

    Args:
        heading: (T,) radians, the heading of the body.
        spans: the contacts of the foot.
        step: seconds from one frame to the next.
    """
    spans = _join_spans(spans, max(round(_MIN_SWING_S / step), 1))
    if not spans:
        return heading
    turns = np.concatenate([_compute_standing_turns(heading[first : last + 1]) for first, last in spans])
    frames = np.concatenate([np.arange(first, last + 1) for first, last in spans])
    # Before the first contact and after the last the correction is constant. Between two contacts it eases
    # from one to the next.
    position = np.interp(np.arange(len(heading)), frames, np.arange(len(frames)))
    previous = np.floor(position).astype(int)
    share = position - previous
    share = share * share * (3.0 - 2.0 * share)
    after = np.minimum(previous + 1, len(frames) - 1)
    return np.asarray(heading + (1.0 - share) * turns[previous] + share * turns[after])


def _compute_standing_turns(spin: Float) -> Float:
    """Returns the rotations (F,) in radians that keep the median heading of a contact, as far as a leg
    allows."""
    heading, turns = float(np.median(spin)), np.empty(len(spin))
    for t, angle in enumerate(spin):
        heading = float(np.clip(heading, angle - _MAX_HEADING_DIFFERENCE, angle + _MAX_HEADING_DIFFERENCE))
        turns[t] = heading - angle
    return turns


def _join_spans(spans: Spans, gap: int) -> Spans:
    """Returns the spans after joining spans that are at most ``gap`` frames apart."""
    joined = list[tuple[int, int]]()
    for first, last in spans:
        if joined and first - joined[-1][1] <= gap:
            joined[-1] = (joined[-1][0], last)
        else:
            joined.append((first, last))
    return tuple(joined)


def contact_clearance(heights: Float, spans: Spans) -> Float:
    """Returns the height (T,) in metres of a foot above the floor: the smallest rise of its joints.

    The rise of a joint is its height above its lowest position during contacts. The floor drifts in captured
    motion, so this lowest position is interpolated between successive contacts.

    Args:
        heights: (T, J) metres, the heights of the joints of a foot.
        spans: the contacts of the foot.
    """
    if spans:
        lows = np.array([heights[first : last + 1].min(0) for first, last in spans for _ in range(2)])
        ends = np.array(spans).ravel()
        times = np.arange(len(heights))
        standing = np.stack([np.interp(times, ends, low) for low in lows.T], axis=1)
    else:
        standing = np.percentile(heights, _STANDING_PERCENTILE, axis=0)
    return np.asarray(np.maximum(heights - standing, 0.0).min(1))


def plant_body(
    legs: Sequence[PosedLeg], root: Float, step: float, floor: float, air_height: Float | None = None
) -> tuple[Float, list[Float]]:
    """Returns the corrected path of the root, and the remaining offset of each foot.

    Args:
        legs: the legs of the body.
        root: (T, 3) metres, the performer's path scaled to the body's size.
        step: seconds from one frame to the next.
        floor: the height of the floor in metres.
        air_height: (T,) metres, the height of the lowest foot above the floor while the body is in the air.
            If None, the body has the performer's height, and is only raised if a foot is too low.

    Returns:
        The root (T, 3) in metres, and for each leg the remaining offset (T, 3) of its foot in metres.
    """
    root = root.copy()
    if not any(leg.spans for leg in legs):
        return root, [np.zeros_like(root) for _ in legs]
    smooth = (_SMOOTH_S / step) ** 2
    standing = [_make_standing_mask(leg.spans, len(root)) for leg in legs]
    standing_steps = [np.minimum(mask[1:], mask[:-1]) for mask in standing]
    for column, axis in enumerate((0, 2)):
        slips = [-np.diff(leg.rolled[:, column] + root[:, axis]) for leg in legs]
        root[1:, axis] += np.cumsum(_find_smoothest_path(slips, standing_steps, smooth, _PATH_WEIGHT))
    flight_weights = _flight_weights(standing, step)
    target_heights = [floor - root[:, 1] - leg.sole for leg in legs]
    rise = _find_smoothest_path(target_heights, standing, smooth, 0.0)
    # While the body is in the air, raise it until no foot is too low.
    min_rise = np.max(
        [
            _MIN_AIR_HEIGHT * leg.clearance + target_height
            for leg, target_height in zip(legs, target_heights, strict=True)
        ],
        axis=0,
    )
    rise_weights = np.where(min_rise > rise, flight_weights, 0.0)
    if air_height is not None:
        min_rise, rise_weights = np.max(target_heights, axis=0) + air_height, _FLIGHT_WEIGHT * flight_weights
    root[:, 1] += (
        _find_smoothest_path([*target_heights, min_rise], [*standing, rise_weights], smooth, 0.0)
        if rise_weights.any()
        else rise
    )
    return root, [_foot_offsets(leg, root, step, floor, flight_weights) for leg in legs]


def hip_shift(first: PosedLeg, second: PosedLeg, rise: Float, step: float) -> Float:
    """Returns the shift (T, 3) in metres of one hip relative to the other that lets both feet stand.

    If the model's hips are wider than the performer's, the same rotation of the pelvis moves them farther.
    Then the legs would have to bend while both feet stand. With the shift, both soles are at the same height,
    and the distance between them stays constant. While fewer than two feet stand, the horizontal shift eases
    from one value to the next.

    Args:
        first: the leg of the hip that is shifted.
        second: the leg of the other side.
        rise: (T,) metres, the vertical shift that gives the hips the performer's difference in height. It is
            used while fewer than two feet stand.
        step: seconds from one frame to the next.
    """
    both = np.minimum(*(_make_standing_mask(leg.spans, len(leg.sole)) for leg in (first, second)))
    apart = first.rolled - second.rolled
    for start, end in find_runs(both > 0.0):
        apart[start : end + 1] -= np.median(apart[start : end + 1], axis=0)
    smooth = (_SMOOTH_S / step) ** 2
    x, z = (_find_smoothest_path([-column], [both], smooth, 0.0) for column in apart.T)
    y = _find_smoothest_path([second.sole - first.sole, rise], [both, 1.0 - both], smooth, 0.0)
    return np.stack([x, y, z], axis=1)


def compute_remaining_offsets(
    legs: Sequence[PosedLeg], root: Float, step: float, floor: float
) -> list[Float]:
    """Returns the remaining offset (T, 3) in metres of each foot for a given path ``root`` (T, 3), which is
    not corrected.

    The other arguments are those of :func:`plant_body`.
    """
    flight_weights = _flight_weights([_make_standing_mask(leg.spans, len(root)) for leg in legs], step)
    return [_foot_offsets(leg, root, step, floor, flight_weights) for leg in legs]


def _find_smoothest_path(
    targets: Sequence[Float], weights: Sequence[Float], smooth: float, free: float
) -> Float:
    """Computes the path x (T,) that minimises sum w (x - target)^2 + smooth sum (x' - x)^2 + free sum x^2.

    The first sum is over all pairs of ``weights`` and ``targets``, (T,) each. x' is the next value of x.
    """
    total = np.sum(weights, axis=0)
    count = len(total)
    bands = np.zeros((2, count))
    bands[1] = total + free + _HEIGHT_WEIGHT
    bands[1, :-1] += smooth
    bands[1, 1:] += smooth
    bands[0, 1:] = -smooth
    right_side = np.sum([weight * value for weight, value in zip(weights, targets, strict=True)], axis=0)
    return np.asarray(scipy.linalg.solveh_banded(bands, right_side))


def _make_standing_mask(spans: Spans, count: int) -> Float:
    """Returns (T,) 1 within the spans and 0 elsewhere."""
    mask = np.zeros(count)
    for first, last in spans:
        mask[first : last + 1] = 1.0
    return mask


def _flight_weights(standing: Sequence[Float], step: float) -> Float:
    """Returns (T,) 1 while no foot stands, 0 while any foot stands, with smooth transitions."""
    return np.asarray(
        scipy.ndimage.uniform_filter1d(
            1.0 - np.max(standing, axis=0), 2 * max(round(_BLEND_S / 4.0 / step), 1) + 1, mode="nearest"
        )
    )


def _foot_offsets(leg: PosedLeg, root: Float, step: float, floor: float, flight_weights: Float) -> Float:
    """Returns the offset (T, 3) in metres of a foot to its planted position, faded around each contact."""
    height, count, blend = root[:, 1] + leg.sole - floor, len(root), max(round(_BLEND_S / step), 1)
    path = root[:, [0, 2]] + leg.rolled
    places = [np.median(path[first : last + 1], axis=0) for first, last in leg.spans]
    held = _extend_spans(leg.spans, leg.hold_frames, count)
    offsets = np.zeros_like(root)
    offsets[:, [0, 2]] = _fade_offsets(
        [place - path[first : last + 1] for place, (first, last) in zip(places, held, strict=True)],
        held,
        count,
        blend,
    )
    on_floor = [-height[first : last + 1, None] for first, last in leg.spans]
    offsets[:, 1] = _fade_offsets(on_floor, leg.spans, count, blend)[:, 0]
    min_height = (1.0 - _make_standing_mask(leg.spans, count)) * _min_clearance(leg, flight_weights)
    offsets[:, 1] = np.maximum(offsets[:, 1], min_height - height)
    return offsets


def _extend_spans(spans: Spans, frames: int, count: int) -> Spans:
    """Returns the spans, longer by ``frames`` at both ends, but at most by a third of the gap between two
    spans."""
    ends = [-1 - 3 * frames, *(last for _, last in spans)]
    starts = [*(first for first, _ in spans), count + 3 * frames]
    extensions = [min(frames, (start - end - 1) // 3) for end, start in zip(ends, starts, strict=True)]
    return tuple(
        (max(first - before, 0), min(last + after, count - 1))
        for (first, last), before, after in zip(spans, extensions, extensions[1:], strict=False)
    )


def _fade_offsets(offsets: Sequence[Float], spans: Spans, count: int, blend: int) -> Float:
    """Returns offsets (T, C) of ``count`` frames: those of each span (F, C), faded over ``blend`` frames
    outside the spans."""
    faded = np.zeros((count, offsets[0].shape[1] if offsets else 1))
    ends = [-1, *(b for _, b in spans)]
    starts = [*(a for a, _ in spans), count]
    for number, (first, last) in enumerate(spans):
        faded[first : last + 1] = offsets[number]
        frames_before = min(blend, first - ends[number])
        frames_after = min(blend, starts[number + 1] - last)
        before = _compute_fading_weights(frames_before)[::-1, None]
        faded[first - frames_before + 1 : first] += before * offsets[number][0]
        after = _compute_fading_weights(frames_after)[:, None]
        faded[last + 1 : last + frames_after] += after * offsets[number][-1]
    return faded


def _min_clearance(leg: PosedLeg, flight_weights: Float) -> Float:
    """Returns the smallest allowed height (T,) in metres of a foot above the floor while it swings.

    While the body is in the air, this height is a large fraction of the performer's foot height. Otherwise it
    is just enough to clear the floor.
    """
    air_height = _MIN_AIR_HEIGHT * leg.clearance
    return np.asarray(
        np.maximum(flight_weights * air_height, np.minimum(air_height, _MIN_SWING_HEIGHT * leg.length))
    )


def _compute_fading_weights(count: int) -> Float:
    """Returns (count - 1,) weights that fall smoothly from nearly 1 to nearly 0."""
    remaining = 1.0 - np.arange(1, count) / max(count, 1)
    return np.asarray(remaining * remaining * (3.0 - 2.0 * remaining))
