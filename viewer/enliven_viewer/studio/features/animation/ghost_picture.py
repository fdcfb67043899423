"""The drawing of ghosts and trails: translucent bodies, and smooth lines with a dot at each frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Float32
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.render.overlay.tubes import make_tube_rows
from enliven_viewer.studio.features.animation.motion_samples import GhostSurface, MotionSamples
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.theme import FUTURE_POSE, INK, PAST_POSE, SELECTED_JOINT, Paint

_TRAIL_RADIUS_PX = 1.5
"""Radius in pixels of a trail at the playhead."""
_TRAIL_END_FRACTION = 0.4
"""Radius at the ends of a trail, as a fraction of ``_TRAIL_RADIUS_PX``."""
_FRAME_RADIUS_PX = 2.5
"""Radius in pixels of a frame's dot."""
_KEY_RADIUS_PX = 5.0
"""Radius in pixels of the dots of key poses and of the playhead."""
_SEGMENTS_PER_FRAME = 3
"""Number of line segments between two frames, so that the trail of a fast hand is still a smooth curve."""
_TRAIL_END_BRIGHTNESS = 0.22
"""Brightness of a trail at its ends; at the playhead it is 1."""


@dataclass(frozen=True, eq=False)
class GhostBody:
    """A ghost: a body, its sRGB colour, and its opacity from 0 to 1."""

    body: GhostSurface
    tint: Paint
    opacity: float


@dataclass(frozen=True, eq=False)
class GhostPicture:
    """The ghosts to draw, farthest in time from the playhead first, and the (N, 12) rows of the trails'
    tubes.
    """

    bodies: tuple[GhostBody, ...]
    tubes: Float32


def make_ghost_bodies(sampled: MotionSamples, time: float) -> list[GhostBody]:
    """Returns the ghosts of a character. Ghosts before ``time`` and after ``time`` have different colours."""
    bodies = []
    for side, tint in (
        ([moment for moment in sampled.bodies if moment < time][::-1], PAST_POSE),
        ([moment for moment in sampled.bodies if moment > time], FUTURE_POSE),
    ):
        for number, moment in enumerate(side):
            bodies.append(GhostBody(sampled.bodies[moment], tint, 1.0 - number / (len(side) + 1.0)))
    return sorted(bodies, key=lambda body: body.opacity)


def make_trail_rows(
    sampled: MotionSamples, points: tuple[int, ...], keys: tuple[float, ...], time: float, lens: Lens
) -> Float32:
    """Returns (N, 12) rows of tubes: trails of the points, with dots at frames, keys and ``time``."""
    request, frames = sampled.request, sorted(sampled.points)
    frames = [frame for frame in frames if request.first <= frame <= request.last]
    if len(frames) < 2 or not points:
        return np.zeros((0, 12), np.float32)
    places = np.stack([sampled.points[frame][list(points)] for frame in frames], 1)
    seconds = np.array(frames) * request.step
    reach = max(time - seconds[0], seconds[-1] - time, request.step)
    fine = np.linspace(seconds[0], seconds[-1], _SEGMENTS_PER_FRAME * (len(seconds) - 1) + 1)
    rows = []
    for line in places:
        curve = smooth_trail(line)
        near = 1.0 - np.abs(fine - time) / reach
        width = (_TRAIL_END_FRACTION + (1.0 - _TRAIL_END_FRACTION) * near) * lens.pixel_sizes(curve)
        line_rows = make_tube_rows(
            curve[:-1], curve[1:], _TRAIL_RADIUS_PX * width[:-1], _make_tints(fine[:-1], time, near[:-1])
        )
        line_rows[:, 7] = _TRAIL_RADIUS_PX * width[1:]
        near = 1.0 - np.abs(seconds - time) / reach
        dots = (
            _FRAME_RADIUS_PX
            * (_TRAIL_END_FRACTION + (1.0 - _TRAIL_END_FRACTION) * near)
            * lens.pixel_sizes(line)
        )
        rows += [line_rows, make_tube_rows(line, line, dots, _make_tints(seconds, time, near))]
    current_places = sampled.place(time)[list(points)]
    rows.append(_make_balls(current_places, SELECTED_JOINT, lens))
    white = tuple(round(255 * value) for value in INK[:3])
    for key in keys:
        if seconds[0] <= key <= seconds[-1]:
            rows.append(_make_balls(sampled.place(key)[list(points)], white, lens))
    return np.concatenate(rows)


def smooth_trail(line: Float) -> Float:
    """Returns (B (F - 1) + 1, 3) positions on the Catmull-Rom spline through (F, 3) points.

    There are B segments between two points.
    """
    padded = np.concatenate([2 * line[:1] - line[1:2], line, 2 * line[-1:] - line[-2:-1]])
    p, q, r, s = (padded[k : len(padded) - 3 + k, None] for k in range(4))
    u = (np.arange(_SEGMENTS_PER_FRAME) / _SEGMENTS_PER_FRAME)[None, :, None]
    pieces = 0.5 * (2 * q + (r - p) * u + (2 * p - 5 * q + 4 * r - s) * u**2 + (3 * q - p - 3 * r + s) * u**3)
    return np.concatenate([pieces.reshape(-1, 3), line[-1:]])


def _make_balls(places: Float, tint: Paint, lens: Lens) -> Float32:
    tints = np.tile(linear_from_srgb(np.array([tint], float)), (len(places), 1))
    return make_tube_rows(places, places, _KEY_RADIUS_PX * lens.pixel_sizes(places), tints)


def _make_tints(seconds: Float, time: float, near: Float) -> Float32:
    """Returns (N, 3) linear RGB of the segments of a trail, dimmer with distance from the playhead."""
    colours = linear_from_srgb(np.array([PAST_POSE, FUTURE_POSE], float))[(seconds > time).astype(int)]
    return np.asarray(
        colours * (_TRAIL_END_BRIGHTNESS + (1.0 - _TRAIL_END_BRIGHTNESS) * near[:, None]), np.float32
    )
