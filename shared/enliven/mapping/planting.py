"""Planted feet of a body that is posed as its performer: the body moves so that its feet stand still.

    spans = standing_spans(ball, root, step, length)     # when a foot of the performer stands
    planted(legs, root, step, floor)                     # where the root goes, and how far each foot is off

A model of other proportions that keeps its performer's pose would slide: its strides are of another length.
So it is the root that gives way. Over the floor it goes as the standing foot asks for, and up and down so
that the sole of that foot is on the floor. It stays smooth; what is left, and what two standing feet do not
agree on, is for the legs to bend by. In the air the root follows the performer's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from enliven.arrays import Float
from enliven.motion.contact import runs_of, touching

Spans = tuple[tuple[int, int], ...]
"""The first and the last moment of every contact."""

_HEIGHT = 0.1
"""Leg lengths above its lowest in which a foot stands: floors of captures drift, so speed says more."""
_SPEED = 0.4
"""Leg lengths a second at which a foot stands while the body stays: captured feet creep."""
_PACE = 0.3
"""Share of the body's own speed at which a foot stands: the foot of a runner rolls over the floor at this."""
_PACE_S = 0.4
"""Seconds over which the speed of the body is averaged: that of a stride."""
_SHORTEST_S = 0.05
"""Seconds of a contact at least: those of a sprint last 80 ms."""
_RELEASE = 1.3
"""Times as high or fast that a foot is off the floor again: at more, its toe has left."""
_LOWEST = 5.0
"""Per cent of a take in which a foot is as low as when it stands."""
_BLEND_S = 0.1
"""Seconds over which a foot goes from its performer's way to where it stands, and back."""
_SMOOTH_S = 0.05
"""Seconds over which the root's speed and height give way: less jerks, more lets the legs bend."""
_CLEAR = 0.7
"""Share of the performer's height over the floor that a foot has at least in the air: it does not scuff."""
_TINY = 1e-9
"""Weight of the performer's own height, where no foot stands at all."""
_FREE = 0.01
"""How much the root keeps to the performer's way, compared with a standing foot."""


@dataclass(frozen=True, eq=False)
class PosedLeg:
    """A leg in its performer's pose, over time.

    Attributes:
        foot: (T, 3) metres from the root to the joint on which the foot stands.
        ball: (T, 3) metres, that joint of the performer's on its way, in the size of the body.
        sole: (T,) metres from the root up to the lowest point of the foot.
        clear: (T,) metres that the performer's foot is above the floor, in the size of the body.
        spans: when it stands.
    """

    foot: Float
    ball: Float
    sole: Float
    clear: Float
    spans: Spans


def standing_spans(ball: Float, root: Float, step: float, length: float) -> Spans:
    """When a foot stands: it is low and, compared with the body, slow.

    Args:
        ball: (T, 3) metres, where the foot rolls off.
        root: (T, 3) metres, the body.
        step: seconds between two moments.
        length: metres of the leg.
    """
    if len(ball) < 2:
        return ((0, len(ball) - 1),)
    way = np.linalg.norm(np.gradient(root[:, [0, 2]], step, axis=0), axis=1)
    pace = scipy.ndimage.uniform_filter1d(way, max(round(_PACE_S / step), 1), mode="nearest")
    allowed = np.maximum(_SPEED * length, _PACE * pace)
    speed = np.linalg.norm(np.gradient(ball, step, axis=0), axis=1)
    height = ball[:, 1] - np.percentile(ball[:, 1], _LOWEST)
    down = np.empty(len(ball), np.bool_)
    touching(height, speed / allowed, _HEIGHT * length, 1.0, _RELEASE, down)
    return tuple((a, b) for a, b in runs_of(down) if (b - a) * step >= _SHORTEST_S)


def planted(legs: Sequence[PosedLeg], root: Float, step: float, floor: float) -> tuple[Float, list[Float]]:
    """Where the root goes, and how far each foot is off its performer's pose then.

    Args:
        root: (T, 3) metres, the performer's way in the size of the body.
        step: seconds between two moments.
        floor: metres, the height of the floor.

    Returns:
        The root (T, 3) in metres, and for each leg (T, 3) metres that its foot is to be moved by.
    """
    root = root.copy()
    if not any(leg.spans for leg in legs):
        return root, [np.zeros_like(root) for _ in legs]
    smooth = (_SMOOTH_S / step) ** 2
    stands = [_while_standing(leg.spans, len(root)) for leg in legs]
    for axis in (0, 2):
        # The foot goes as the performer's does: a ball that rolls off is still on its way.
        slips = [np.diff(leg.ball[:, axis] - leg.foot[:, axis] - root[:, axis]) for leg in legs]
        both = [np.minimum(on[1:], on[:-1]) for on in stands]
        root[1:, axis] += np.cumsum(_smoothest(slips, both, smooth, _FREE))
    root[:, 1] += _smoothest([floor - root[:, 1] - leg.sole for leg in legs], stands, smooth, 0.0)
    flies = _flying(stands, step)
    return root, [_offsets(leg, root, step, floor, flies) for leg in legs]


def _smoothest(wanted: Sequence[Float], weights: Sequence[Float], smooth: float, free: float) -> Float:
    """(T,) the x with the least sum of w (x - wanted)^2 over all, smooth (x' - x)^2, and free x^2."""
    total = np.sum(weights, axis=0)
    count = len(total)
    bands = np.zeros((2, count))
    bands[1] = total + free + _TINY
    bands[1, :-1] += smooth
    bands[1, 1:] += smooth
    bands[0, 1:] = -smooth
    right = np.sum([weight * value for weight, value in zip(weights, wanted, strict=True)], axis=0)
    return np.asarray(scipy.linalg.solveh_banded(bands, right))


def _while_standing(spans: Spans, count: int) -> Float:
    """(T,) 1 within the spans and 0 elsewhere."""
    on = np.zeros(count)
    for first, last in spans:
        on[first : last + 1] = 1.0
    return on


def _flying(stands: Sequence[Float], step: float) -> Float:
    """(T,) 1 while no foot stands, 0 while one does, with a smooth change between."""
    return np.asarray(
        scipy.ndimage.uniform_filter1d(
            1.0 - np.max(stands, axis=0), 2 * max(round(_BLEND_S / 4.0 / step), 1) + 1, mode="nearest"
        )
    )


def _offsets(leg: PosedLeg, root: Float, step: float, floor: float, flies: Float) -> Float:
    """(T, 3) metres that a foot is to be moved by: to its place while it stands, fading before and after."""
    foot, above = root + leg.foot, root[:, 1] + leg.sole - floor
    offsets, count, blend = np.zeros_like(foot), len(foot), max(round(_BLEND_S / step), 1)
    ends = [-1, *(b for _, b in leg.spans)]
    starts = [*(a for a, _ in leg.spans), count]
    for number, (first, last) in enumerate(leg.spans):
        held = np.median(foot[first : last + 1], axis=0) - foot[first : last + 1]
        held[:, 1] = -above[first : last + 1]
        offsets[first : last + 1] = held
        before = min(blend, first - ends[number])
        after = min(blend, starts[number + 1] - last)
        offsets[first - before + 1 : first] += _fading(before)[::-1, None] * held[0]
        offsets[last + 1 : last + after] += _fading(after)[:, None] * held[-1]
    # A foot that swings is not below the floor, and in the air above it as its performer's.
    clear = _CLEAR * flies * (1.0 - _while_standing(leg.spans, count)) * leg.clear
    offsets[:, 1] = np.maximum(offsets[:, 1], clear - above)
    return offsets


def _fading(count: int) -> Float:
    """(count - 1,) from nearly 1 to nearly 0, without corners."""
    left = 1.0 - np.arange(1, count) / max(count, 1)
    return np.asarray(left * left * (3.0 - 2.0 * left))
