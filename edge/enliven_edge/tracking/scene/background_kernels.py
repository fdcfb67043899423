"""Compiled kernels that classify pixels against the background model and update it.

Nearly every pixel shows the same depth as before. So each row is processed in two steps. First, vector
instructions update all unchanged pixels. Then the few other pixels are updated one by one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Float32, Int32
from enliven.kernels import njit

BACKGROUND = 0
"""Class of a pixel that shows the background, or has no depth."""
FOREGROUND = 1
"""Class of a pixel that shows an object in front of the known background."""
UNSEEN = 2
"""Class of a pixel without known background, nearer than the background around it."""
UNLIKELY = 3
"""Class of a pixel without known background, about as deep as the background around it. It is unlikely to be
a person."""
_MAX_FLIPS = 6.0
"""Maximum number of times that a pixel changes to the same nearer depth and back. A pixel that changes more
often is a flickering edge of the background, so the nearer depth becomes its background."""
_FOLLOW_RATE = 0.3
"""Rate per second at which the background model follows small differences within the noise, such as slow
drift."""
_FLIP_DECAY_RATE = 0.1
"""Rate per second at which a pixel's count of flips decays."""
_RETURN_FRACTION = 0.7
"""If farther depth replaces the background, the old depth keeps this fraction of the waiting time
``absorb_after``. So an object that is removed and returns is absorbed sooner than a new object.
"""
_WORD_PIXELS = 8
"""Pixels that are tested as one 64-bit number, with one byte per pixel."""


class BackgroundState(NamedTuple):
    """The state of every pixel, (h, w) each.

    Attributes:
        z: metres, the background's depth; 0 where it was never seen.
        nearer: metres, the last depth observed in front of the background, or at a pixel without background.
        waited: seconds for which the depth ``nearer`` was observed.
        away: seconds for which the measured depth was farther than the background, or missing.
        guarded: the id of the person who was last seen there, or -1.
        guard_z: metres, the depth of that person at the pixel.
        flips: number of changes to the nearer depth and back. The sign stores the last state.
        still, still_z: for pixels without known background, the duration of constant depth in seconds, and
            this depth in metres.
    """

    z: Float
    nearer: Float32
    waited: Float32
    away: Float32
    guarded: Int32
    guard_z: Float32
    flips: Float32
    still: Float32
    still_z: Float32


class LearningRate(NamedTuple):
    """The time constants of learning, in seconds. See
    :class:`~enliven_edge.tracking.settings.BackgroundSettings`.

    Attributes:
        step: time since the previous frame.
        absorb_after, clear_after: from the settings.
        seen_for: time for which a depth must be constant before it is learnt at pixels without known
            background. If 0, it is learnt at once.
        dark: time without a measurement after which the background is forgotten. If infinite, it is never
            forgotten.
    """

    step: float
    absorb_after: float
    clear_after: float
    seen_for: float
    dark: float


def empty_background(shape: tuple[int, int]) -> BackgroundState:
    """Returns the state of a background model before its first frame."""
    nearer, waited, away, guard_z, flips, still, still_z = np.zeros((7, *shape), np.float32)
    guarded = np.full(shape, -1, np.int32)
    return BackgroundState(np.zeros(shape), nearer, waited, away, guarded, guard_z, flips, still, still_z)


@njit(cache=True, nogil=True, error_model="numpy")
def classify_pixels(z, points, room, fill, near, far, floor_band):
    """Computes :meth:`BackgroundModel.classify`, without a branch, so that the compiler can vectorise the
    loop."""
    height, width = z.shape
    out = np.empty((height, width), np.uint8)
    for v in range(height):
        for u in range(width):
            d, background, likely = z[v, u], room[v, u], fill[v, u]
            margin = 0.05 + 0.012 * d * d
            where_seen = FOREGROUND if d < background - margin else BACKGROUND
            never_seen = UNSEEN if (likely == 0.0) | (d < likely - margin) else UNLIKELY
            counts = (d > near) & (d < far) & (points[v, u, 1] > floor_band)
            out[v, u] = (where_seen if background > 0.0 else never_seen) if counts else BACKGROUND
    return out


@njit(cache=True, nogil=True)
def learn_frame(z, person, hold, state, rate):
    """Learns one frame. Returns three numbers of pixels: compared, clearly nearer and clearly farther.

    Args:
        z: (h, w) metres.
        person: (h, w) pixels that are not learnt.
        hold: (h, w) pixels of possible people.
        state: a :class:`BackgroundState`, modified in place.
        rate: a :class:`LearningRate`.
    """
    height, width = z.shape
    compared, count_nearer, count_farther = 0, 0, 0
    # Unpack the state once, because Numba would otherwise update the array's reference count at every access
    # through the tuple.
    room, nearer, waited, away = state.z, state.nearer, state.waited, state.away
    guarded, guard_z, flips = state.guarded, state.guard_z, state.flips
    still, still_z = state.still, state.still_z
    step, absorb_after, clear_after, seen_for, dark = rate
    usual, other = (
        np.empty(width, np.bool_),
        np.zeros((width + _WORD_PIXELS - 1) // _WORD_PIXELS * _WORD_PIXELS, np.uint8),
    )
    words, chosen = other.view(np.uint64), np.empty(len(other), np.int64)
    for v in range(height):
        # Update all pixels that show the known background, and mark the others.
        compared += _mark_row(usual, other, room[v], z[v], person[v])
        _update_still_time(room[v], z[v], still[v], still_z[v], np.float32(step))
        _update_unchanged(usual, z[v], room[v], flips[v], waited[v], away[v], guarded[v], step)
        # Learn the marked pixels one by one.
        for u in _marked_pixels(chosen, other, words):
            d, has_background = z[v, u], room[v, u] > 0.0
            if d <= 0.0:
                _update_unmeasured(room, waited, away, v, u, step, dark)
                continue
            # The background is unknown here. Learn the depth after it was constant for long enough.
            if not has_background:
                same = abs(d - nearer[v, u]) <= _margin(d)
                if not hold[v, u] and (seen_for == 0.0 or (same and waited[v, u] + step > seen_for)):
                    room[v, u], waited[v, u] = d, 0.0
                    continue
            # The depth is farther than the background, so an object was removed.
            elif d > room[v, u]:
                compared, count_farther = compared + 1, count_farther + 1
                guarded[v, u] = -1
                _learn_farther(room, nearer, waited, away, v, u, d, step, absorb_after, clear_after)
                continue
            # The depth is nearer, or the background is not learnt yet. Learn it only after waiting, and not
            # while a person is guarded at this depth.
            compared, count_nearer = compared + has_background, count_nearer + has_background
            away[v, u] = 0.0
            if guarded[v, u] < 0 or abs(d - guard_z[v, u]) > 2.0 * _margin(d):
                _learn_nearer(room, nearer, waited, flips, v, u, d, step, absorb_after, hold[v, u])
    return compared, count_nearer, count_farther


@njit(cache=True, nogil=True)
def _mark_row(usual, other, room, z, person):
    """Marks the pixels of a row that show the known background, and the pixels to be learnt one by one.

    A person's pixels are marked as neither. Returns the number of background pixels.
    """
    count = 0
    for u in range(len(z)):
        d, has_background = z[u], room[u] > 0.0
        same = has_background & (d > 0.0) & (abs(d - room[u]) <= _margin(d)) & (not person[u])
        usual[u] = same
        other[u] = not (same | person[u])
        count += same
    return count


@njit(cache=True, nogil=True)
def _marked_pixels(chosen, marks, words):
    """Writes the indices of the set marks into ``chosen`` and returns them. A 64-bit word contains eight
    marks.
    """
    count = 0
    for word in range(len(words)):
        if words[word] == 0:
            continue
        for n in range(word * _WORD_PIXELS, (word + 1) * _WORD_PIXELS):
            chosen[count] = n
            count += marks[n]
    return chosen[:count]


@njit(cache=True, nogil=True, inline="always")
def _margin(d):
    """Returns the sensor's noise at ``d`` metres: the tolerance in metres within which depths count as
    equal.
    """
    return 0.04 + 0.010 * d * d


@njit(cache=True, nogil=True)
def _update_unchanged(usual, z, room, flips, waited, away, guarded, step):
    """Updates the pixels of a row that show the known background, in one loop per quantity."""
    follow, keep = min(1.0, _FOLLOW_RATE * step), np.float32(1.0 - _FLIP_DECAY_RATE * step)
    passed, none = np.float32(step), np.float32(0.0)
    for u in range(len(z)):
        room[u] += follow * (z[u] - room[u]) if usual[u] else 0.0
    for u in range(len(z)):
        # The sign of ``flips`` stores the pixel's last state.
        flips[u] = -abs(flips[u]) * keep if usual[u] else flips[u]
    for u in range(len(z)):
        waited[u] = max(none, waited[u] - passed) if usual[u] else waited[u]
    for u in range(len(z)):
        away[u] = none if usual[u] else away[u]
    for u in range(len(z)):
        guarded[u] = np.int32(-1) if usual[u] else guarded[u]


@njit(cache=True, nogil=True)
def _learn_farther(room, nearer, waited, away, v, u, d, step, absorb_after, clear_after):
    """Learns a pixel that is clearly farther than the known background."""
    waited[v, u] = max(0.0, waited[v, u] - step)
    away[v, u] += step
    if away[v, u] > clear_after:
        # An edge may flicker slowly. So the old depth is stored, and absorbed sooner than a new object if it
        # returns.
        nearer[v, u], waited[v, u] = room[v, u], _RETURN_FRACTION * absorb_after
        room[v, u], away[v, u] = d, 0.0


@njit(cache=True, nogil=True)
def _learn_nearer(room, nearer, waited, flips, v, u, d, step, absorb_after, hold):
    """Learns a pixel that is clearly nearer than the known background, or has no known background."""
    margin = _margin(d)
    if flips[v, u] <= 0.0 and not hold and abs(d - nearer[v, u]) <= 2.0 * margin:
        flips[v, u] = 1.0 - flips[v, u]
        if flips[v, u] > _MAX_FLIPS and room[v, u] > 0.0:
            room[v, u], flips[v, u] = nearer[v, u], 0.0
            return
    if abs(d - nearer[v, u]) <= margin:
        waited[v, u] += step
        nearer[v, u] += 0.2 * (d - nearer[v, u])
        if waited[v, u] > absorb_after:
            room[v, u], waited[v, u] = nearer[v, u], 0.0
        return
    waited[v, u] -= 2.0 * step
    if waited[v, u] <= 0.0:
        nearer[v, u], waited[v, u] = d, 0.0


@njit(cache=True, nogil=True)
def _update_still_time(room, z, still, still_z, step):
    """Updates the time of constant depth of the pixels of a row that have no known background.

    Pixels of people are included.
    """
    none, twice = np.float32(0.0), np.float32(2.0) * step
    for u in range(len(z)):
        d, has_background = np.float32(z[u]), room[u] > 0.0
        difference = d - still_z[u]
        same = abs(difference) <= np.float32(0.01) + np.float32(0.004) * d * d
        passed = still[u] + (step if same else -twice)
        anew = (not same) & (passed <= none)
        follows = still_z[u] + (np.float32(0.1) * difference if same else none)
        still_z[u] = still_z[u] if has_background else (d if anew else follows)
        still[u] = still[u] if has_background else (none if anew else passed)


@njit(cache=True, nogil=True)
def _update_unmeasured(room, waited, away, v, u, step, dark):
    """Updates a pixel without a measurement. Its background is forgotten after ``dark`` seconds."""
    if room[v, u] == 0.0:
        waited[v, u] = max(0.0, waited[v, u] - 2.0 * step)
    elif dark < np.inf:
        away[v, u] += step
        if away[v, u] > dark:
            room[v, u], away[v, u], waited[v, u] = 0.0, 0.0, 0.0


@njit(cache=True, nogil=True)
def guard_people(owner, ids, z, guarded, guard_z):
    """Computes :meth:`BackgroundModel.guard`. A tracked person guards only its pixels in this frame."""
    height, width = owner.shape
    for v in range(height):
        row = guarded[v]
        for i in ids:
            for u in range(width):
                row[u] = np.int32(-1) if row[u] == i else row[u]
        for u in range(width):
            if owner[v, u] >= 0:
                row[u], guard_z[v, u] = ids[owner[v, u]], z[v, u]


@njit(cache=True, nogil=True)
def dilate(mask, pixels):
    """Returns the (h, w) mask dilated by a square of ``pixels`` to every side.

    It first unites each row with the rows around it, and then shifts the result by up to ``pixels`` columns.
    """
    height, width = mask.shape
    out, row = np.zeros((height, width), np.bool_), np.empty(width + 2 * pixels, np.bool_)
    middle = row[pixels : pixels + width]
    for v in range(height):
        row[:] = False
        for near in range(max(0, v - pixels), min(height, v + pixels + 1)):
            beside = mask[near]
            for u in range(width):
                middle[u] |= beside[u]
        out_row = out[v]
        for first in range(2 * pixels + 1):
            moved = row[first : first + width]
            for u in range(width):
                out_row[u] |= moved[u]
    return out
