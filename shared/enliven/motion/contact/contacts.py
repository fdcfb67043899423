"""Contact detection: computes the times at which a foot stands from its height and speed, and the positions
to which it is locked.

    Pin(joint, start, settings)              # stored on a Shape, by joint name; not baked
    find_contacts(places (F, 3), step, size, settings) -> Contacts

A foot touches the floor while it is low and slow. It is released when it is clearly higher or faster
(hysteresis). During a contact, it is locked to the median of its positions. While locked, it may rise, as a
heel does, but not sink.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import FEET, ContactSettings
from enliven.kernels import njit

AUTO, ALWAYS, _, GROUND = range(len(FEET))
"""The indices of the foot modes."""
_MAX_HELD_DRIFT_LIMBS = 0.25
"""Maximum drift of a foot in the mode "always", as a fraction of its limb's length. A larger drift counts as
a step."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """The contacts of one joint.

    Attributes:
        starts: (C,) start times, seconds since the first sample, ascending. -inf for a contact that includes
            the first sample.
        ends: (C,) end times, seconds. inf for a contact that includes the last sample.
        places: (C, 3) positions to which the joint is locked, metres.
    """

    starts: Float
    ends: Float
    places: Float


def find_contacts(
    places: Float, step: float, size: float, how: ContactSettings, modes: Int | None = None
) -> Contacts:
    """Finds the contacts of a joint from its positions.

    Args:
        places: (F, 3) positions of the joint, metres, +Y up.
        step: seconds between two positions.
        size: length of the limb, metres.
        how: the contact thresholds.
        modes: (F,) indices into :data:`enliven.document.FEET` of the foot mode in each frame. None means
            "auto" in all frames.
    """
    if len(places) == 1 and modes is None:
        return Contacts(np.array([-np.inf]), np.array([np.inf]), places.copy())
    height = places[:, 1] - np.percentile(places[:, 1], 5)
    stillness = np.zeros(len(places))
    speed = np.linalg.norm(np.gradient(places, step, axis=0), axis=1) if len(places) > 1 else stillness
    is_down = np.empty(len(places), np.bool_)
    detect_contact_frames(height, speed, how.height * size, how.speed * size, how.release, is_down)
    spans = find_runs(is_down)
    if modes is not None:
        low = np.empty_like(is_down)
        detect_contact_frames(height, stillness, how.height * size, how.speed * size, how.release, low)
        spans = find_runs(is_down & (modes == AUTO))
        for a, b in find_runs(low & (modes == ALWAYS)):
            spans += _split_steps(places, a, b, _MAX_HELD_DRIFT_LIMBS * size)
    spans = sorted((a, b) for a, b in spans if (b - a) * step >= how.shortest)
    starts = np.array([-np.inf if a == 0 else a * step for a, _ in spans])
    ends = np.array([np.inf if b == len(places) - 1 else b * step for _, b in spans])
    middles = np.array([np.median(places[a : b + 1], axis=0) for a, b in spans]).reshape(-1, 3)
    return Contacts(starts, ends, middles)


def _split_steps(places: Float, first: int, last: int, max_drift: float) -> list[tuple[int, int]]:
    """Splits a run of contact frames at steps. A step is a drift over the ground by more than ``max_drift``
    metres.
    """
    runs, begin = list[tuple[int, int]](), first
    for frame in range(first, last + 1):
        drift = places[frame, [0, 2]] - places[begin, [0, 2]]
        if drift @ drift > max_drift * max_drift:
            runs.append((begin, frame - 1))
            begin = frame
    return [*runs, (begin, last)]


def find_runs(flags: Bool) -> list[tuple[int, int]]:
    """Returns the first and the last frame of every run of True values in ``flags`` (F,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


@njit(cache=True, nogil=True)
def detect_contact_frames(height, speed, low, slow, release, down):
    """Marks the frames in which a foot with the given ``height`` (F,) and ``speed`` (F,) touches the floor.
    Writes True to ``down`` (F,) in these frames."""
    now = False
    for f in range(len(height)):
        more = release if now else 1.0
        now = height[f] <= low * more and speed[f] <= slow * more
        down[f] = now


@njit(cache=True, nogil=True)
def compute_hold_weights(times, starts, ends, places, blend, weights, goals):
    """Computes the weights (T,), in [0, 1], and the target positions ``goals`` (T, 3) of a locked joint at
    ``times`` (T,).

    Within a contact, the weight is 1. Outside a contact, it decreases to 0 by smoothstep over ``blend``
    seconds. Between two contacts, the position is the mean of both, weighted by w / (1 - w). So the position
    never jumps, and a contact with full weight is not affected by the other contact.
    """
    for t in range(len(times)):
        x, y, z, total = 0.0, 0.0, 0.0, 0.0
        weights[t] = 0.0
        for c in range(len(starts)):
            away = max(starts[c] - times[t], times[t] - ends[c], 0.0)
            if away == 0.0:
                x, y, z, total = places[c, 0], places[c, 1], places[c, 2], 1.0
                weights[t] = 1.0
                break
            if away >= blend:
                continue
            u = 1.0 - away / blend
            w = u * u * (3.0 - 2.0 * u)
            draw = w / max(1.0 - w, 1e-12)
            total += draw
            weights[t] = max(weights[t], w)
            x, y, z = x + draw * places[c, 0], y + draw * places[c, 1], z + draw * places[c, 2]
        scale = 1.0 / total if total > 0.0 else 0.0
        goals[t, 0], goals[t, 1], goals[t, 2] = x * scale, y * scale, z * scale
