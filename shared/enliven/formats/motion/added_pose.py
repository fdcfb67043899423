"""Detects frames at the ends of a capture that are not part of the motion, such as a T-pose or a calibration
pose.

Many conversions of CMU's captures begin with such a pose: frame 0 is a T-pose, and the motion starts at frame
1. During playback, the body jumps from this pose to the motion. The jump is detected by its speed, which is
higher than a person can reach, while the rest of the motion is smooth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.formats.motion.capture import Capture

_MIN_IMPOSSIBLE_SPEED = 8.0
"""Minimum speed of a joint that a person cannot reach, in body sizes per second: 14 m/s for an adult. Kicks
reach 10 m/s."""
_MIN_JUMP_SPEED_RATIO = 4.0
"""Minimum speed of the jump after an added pose, relative to the fastest motion in the rest of the take.
Captures may also contain smaller glitches."""
_MIN_FADE_SPEED_RATIO = 1.5
"""Minimum speed of the frames in which an added pose fades into the motion, relative to the rest of the
take."""
_MAX_FADE_S = 0.3
"""Maximum duration of the fade from an added pose into the motion, in seconds. In resampled files, the jump
is spread over some frames."""
_MIN_JUMP_BODY_SIZES = 0.15
"""Minimum jump of a joint, as a fraction of body size. A smaller jump is hardly visible."""
_MAX_HOLD_S = 2.0
"""Maximum duration of an added pose, in seconds."""
_SAME_POSE_BODY_SIZES = 1e-5
"""Maximum motion of a joint between two frames of a static pose, as a fraction of body size. Real people
always move more."""
_MIN_OTHER_INTERVALS = 5
"""Minimum number of frame intervals in the rest of a take. With fewer intervals, its smoothness cannot be
judged."""
_MAX_REST_POSE_DISTANCE = 0.05
"""Maximum mean distance of the joints from the rest pose in a frame that shows the rest pose, as a fraction
of body size."""


def count_added_frames(
    places: Float, seconds: float, rest: Float | None = None, only_rest: bool = False
) -> tuple[int, int]:
    """Returns the numbers of frames at the start and at the end of a motion that show an added pose.

    Args:
        places: (F, N, 3) positions of the joints over time, in any unit.
        seconds: time from one frame to the next.
        rest: (N, 3) the joints in the file's rest pose. If an added pose is the rest pose, it may fade into
            the motion.
        only_rest: True if only frames that show the rest pose count as added poses. False if any pose counts.
    """
    return (
        _count_added_frames(places, seconds, rest, only_rest),
        _count_added_frames(places[::-1], seconds, rest, only_rest),
    )


def remove_added_poses(capture: Capture) -> Capture:
    """Removes the added poses at the ends of a capture, and adds a note about the removed frames."""
    begin, end = count_added_frames(capture.positions, capture.seconds)
    if not (begin or end):
        return capture
    kept_frames = slice(begin, capture.frames - end)
    notes = (*capture.notes, *make_added_frame_notes(begin, end))
    positions, rotations = capture.positions[kept_frames], capture.rotations[kept_frames]
    return replace(capture, positions=positions, rotations=rotations, notes=notes)


def make_added_frame_notes(begin: int, end: int) -> tuple[str, ...]:
    """Returns notes about the frames that were removed at the start and at the end."""
    return tuple(
        f"the {end_name} {f'{count} frames are' if count > 1 else 'frame is'} left out, because the motion "
        f"{'begins' if end_name == 'first' else 'ends'} with an added pose, such as a T-pose"
        for count, end_name in ((begin, "first"), (end, "last"))
        if count
    )


def _count_added_frames(places: Float, seconds: float, rest: Float | None, only_rest: bool) -> int:
    """Returns the number of frames at the start that show an added pose."""
    size = float(np.ptp(places[len(places) // 2], axis=0).max())
    if len(places) < _MIN_OTHER_INTERVALS + 2 or size <= 0.0:
        return 0
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2).max(1) / size
    moving = np.flatnonzero(steps > _SAME_POSE_BODY_SIZES)
    static_count = int(moving[0]) if len(moving) else 0
    fade = max(round(_MAX_FADE_S / seconds), 1)
    # Leave out the frames at the other end, because it may also have an added pose.
    other_steps = steps[static_count + fade : len(steps) - fade]
    if static_count * seconds > _MAX_HOLD_S or len(other_steps) < _MIN_OTHER_INTERVALS:
        return 0
    fastest, shows_rest = float(other_steps.max()), rest is not None and _is_rest_pose(places[0], rest, size)
    if only_rest and not shows_rest:
        return 0
    first = steps[static_count : static_count + fade]
    fast = first > (_MIN_FADE_SPEED_RATIO if shows_rest else _MIN_JUMP_SPEED_RATIO) * fastest
    count = len(fast) if fast.all() else int(np.argmin(fast))
    if not count or first[:count].max() < _MIN_JUMP_SPEED_RATIO * fastest:
        return 0
    jump = float(np.linalg.norm(places[static_count + count] - places[0], axis=1).max()) / size
    return (
        static_count + count
        if jump > _MIN_JUMP_BODY_SIZES and (shows_rest or first[0] > _MIN_IMPOSSIBLE_SPEED * seconds)
        else 0
    )


def _is_rest_pose(pose: Float, rest: Float, size: float) -> bool:
    """Returns True if a pose (N, 3) equals the rest pose, independent of the root's position."""
    distances = np.linalg.norm((pose - pose[0]) - (rest - rest[0]), axis=1)
    return bool(distances.mean() < _MAX_REST_POSE_DISTANCE * size)
