"""Builds clips from motion captures and tracked people, and resamples and trims clips.

    clip_of_capture(capture, id, *, rest="auto", unit=None) -> Clip
    clip_of_bodies(bodies, seconds, id, *, rest=0, step=1/30, names=None) -> Clip  # enliven.person.body.Body
    trim_clip(clip, start, stop) -> Clip

Clips are in metres, +Y up. Their quaternions have consistent signs from frame to frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from enliven.arrays import AnyArray, Float, Int
from enliven.document import Clip, Skeleton
from enliven.errors import InputError
from enliven.formats.motion.capture import Capture
from enliven.person import BODY_NAMES, PARENTS, Body
from enliven.rotation import conjugate, from_matrix, multiply, remove_sign_jumps, rotate, slerp
from enliven.takes.capture_rest import (
    find_moving_root,
    is_zero_pose_standing,
    link_translations,
    median_links,
    metres_per_unit,
    rigid_pose,
    zero_pose,
)
from enliven.takes.capture_upright import metres_per_unit_from_legs, turn_upright
from enliven.takes.positions import fill_unseen, rest_from_positions, rotations_from_positions


def clip_of_capture(
    capture: Capture, id: str, *, rest: str | int = "auto", unit: str | float | None = None
) -> Clip:
    """Returns the motion of a file as a clip in metres.

    A capture in which +Y does not point up is rotated upright. Visible translations of joints relative to
    their parents become the clip's offsets. A static joint above the moving root (for example a point on the
    floor) is removed.

    Args:
        rest: the rest pose: "zero" (all rotations are zero), "first" (the first frame), a frame number, or
            "auto". "auto" means "zero" if the zero pose is as tall as the body in the frames, and otherwise
            "first".
        unit: a name in ``UNITS``, or metres per unit. None guesses the unit from the leg length or, if no
            legs are found, from the height of the root above the lowest joint.

    Raises:
        InputError: if the tree has two roots, or a frame or unit does not exist.
    """
    capture = turn_upright(capture)
    names, parents, positions, rotations = find_moving_root(capture, id)
    offsets = median_links(parents, positions, rotations)
    turns = from_matrix(rotations)
    if rest == "auto":
        rest = "zero" if is_zero_pose_standing(parents, offsets, positions) else "first"
    if rest == "zero":
        at_rest, frame_turns = (
            zero_pose(parents, offsets, positions),
            np.tile([1.0, 0, 0, 0], (len(names), 1)),
        )
    else:
        frame = 0 if rest == "first" else rest
        if not isinstance(frame, int) or not 0 <= frame < len(positions):
            advice = f'Give "auto", "zero", "first" or 0..{len(positions) - 1}.'
            raise InputError(f"the rest pose {rest!r} does not exist", where=f"clip {id!r}", remedy=advice)
        at_rest = rigid_pose(parents, offsets, positions[frame], rotations[frame])
        frame_turns = turns[frame]
    if unit is None:
        unit = metres_per_unit_from_legs(capture)
    scale = metres_per_unit(unit, at_rest, f"clip {id!r}")
    # Bone j has the rotation of its parent joint. The bones that begin at the root rotate with the root.
    holds = np.array([0, *parents[1:]])
    world = multiply(turns[:, holds], conjugate(frame_turns[holds]))
    skeleton = Skeleton(names, np.array(parents, np.int32), at_rest * scale)
    translations = (
        rotate(frame_turns[holds], link_translations(parents, offsets, positions, rotations)) * scale
    )
    root = positions[:, 0] * scale
    shifts = translations if translations.any() else None
    return Clip(id, skeleton, remove_sign_jumps(world), root, capture.seconds, offsets=shifts)


def clip_of_bodies(
    bodies: Sequence[Body],
    seconds: AnyArray,
    id: str,
    *,
    rest: int | Body = 0,
    step: float = 1.0 / 30.0,
    names: Sequence[str] | None = None,
) -> Clip:
    """Converts a tracked person's motion to a clip of 20 joints.

    If a body has measured orientations, they define the rotations of the bones since rest. Otherwise, the
    rotation of a bone is the swing with the least twist relative to the parent bone. In both cases, every
    bone points from its parent joint to its joint. A joint of confidence 0 is interpolated from the frames
    before and after.

    Args:
        bodies: (F,) the tracked bodies of the person over time.
        seconds: (F,) times of the bodies, ascending. Intervals may be irregular.
        rest: index of the rest pose among the bodies, or a body in the rest pose.
        step: seconds between the frames of the clip.
        names: (20,) names of the joints. None means :data:`BODY_NAMES`.

    Raises:
        InputError: if the list of bodies is empty, or the times do not match or do not ascend.
    """
    times: Float = np.asarray(seconds, np.float64)
    where = f"clip {id!r}"
    if not bodies or times.shape != (len(bodies),) or (np.diff(times) <= 0).any():
        advice = "Give one time for each body, each after the one before."
        raise InputError(f"{len(bodies)} bodies at {times.shape} times", where=where, remedy=advice)
    joints = np.stack([body.joints for body in bodies])
    is_seen = np.stack([body.confidence > 0 for body in bodies])
    joints = fill_unseen(np.array(PARENTS), joints, is_seen)
    rest_body = bodies[rest] if isinstance(rest, int) else rest
    rest_joints = joints[rest] if isinstance(rest, int) else rest.joints
    positions = rest_from_positions(np.array(PARENTS), rest_joints, joints)
    skeleton = Skeleton(tuple(names or BODY_NAMES), np.array(PARENTS, np.int32), positions)
    turns = rotations_from_positions(skeleton, joints, _measure_rotations(bodies, rest_body))
    return _sample_clip_evenly(id, skeleton, times - times[0], turns, joints[:, 0], step)


def resample_clip(clip: Clip, step: float) -> Clip:
    """Resamples a clip to frames ``step`` seconds apart. The last frame is at or before the clip's end."""
    times: Float = np.arange(len(clip.turns), dtype=np.float64) * clip.step
    tracks: dict[str, Any] = {name: _interpolate_track(track, times, step) for name, track in clip.tracks}
    if clip.mirrors is not None:
        tracks["mirrors"] = np.where(_interpolate_track(clip.mirrors, times, step) < 0.0, -1.0, 1.0)
    return replace(_sample_clip_evenly(clip.id, clip.skeleton, times, clip.turns, clip.root, step), **tracks)


def trim_clip(clip: Clip, start: float, stop: float) -> Clip:
    """Trims a clip to the frames from ``start`` to ``stop`` seconds. At least one frame is kept."""
    first = min(max(round(start / clip.step), 0), len(clip.turns) - 1)
    last = max(round(stop / clip.step) + 1, first + 1)
    trimmed = clip.map_values(lambda track: track[first:last])
    if clip.fine is None:
        return trimmed
    return replace(
        trimmed, fine=clip.fine.cut(first * clip.step, (len(trimmed.turns) + first - 1) * clip.step)
    )


def _sample_clip_evenly(
    id: str, skeleton: Skeleton, times: Float, turns: Float, root: Float, step: float
) -> Clip:
    """Builds a clip with frames ``step`` seconds apart by interpolating rotations and root at ``times`` (F,),
    which begin at 0.
    """
    previous, following, fraction = _frame_fractions(times, step)
    even_turns = slerp(turns[previous], turns[following], fraction[:, None])
    return Clip(id, skeleton, remove_sign_jumps(even_turns), _interpolate_track(root, times, step), step)


def _interpolate_track(track: Float, times: Float, step: float) -> Float:
    """Resamples a track (F, ...) with ``times`` (F,) to G frames ``step`` seconds apart. Returns (G, ...)."""
    previous, following, fraction = _frame_fractions(times, step)
    fraction = fraction.reshape(-1, *(1,) * (track.ndim - 1))
    return np.asarray(track[previous] + fraction * (track[following] - track[previous]))


def _frame_fractions(times: Float, step: float) -> tuple[Int, Int, Float]:
    """Returns, for G times that are ``step`` seconds apart, the frames before and after them (G,), and the
    interpolation factors (G,).
    """
    count = int(np.floor(times[-1] / step + 1e-6)) + 1
    sample_times = np.minimum(np.arange(count) * step, times[-1])
    previous = np.clip(np.searchsorted(times, sample_times, side="right") - 1, 0, max(len(times) - 2, 0))
    after = np.minimum(previous + 1, len(times) - 1)
    width = np.where(after > previous, times[after] - times[previous], 1.0)
    return previous, after, (sample_times - times[previous]) / width


def _measure_rotations(bodies: Sequence[Body], still: Body) -> Float | None:
    """Computes rotations since rest (F, 20, 4) from the bodies' measured orientations. Returns None if a body
    has none.
    """
    if still.orientations is None or any(body.orientations is None for body in bodies):
        return None
    world = np.stack([np.asarray(body.orientations) for body in bodies])
    return multiply(world, conjugate(still.orientations))
