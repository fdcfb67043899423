"""Retargets a motion capture to a performer of other proportions, preserving the direction of every limb.

Bone directions determine the swing of the limbs. The twist comes from the plane in which an elbow or a knee
bends. For a straight limb it comes from the trunk. The soles are put on the floor when the captured soles
were on it.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven.formats.motion.capture import Capture
from enliven.motion_clips.capture_limbs import find_limb_rotations, smoothstep
from enliven.motion_clips.capture_roles import JointRoles, find_roles
from enliven.motion_clips.capture_upright import turn_upright
from enliven.person import Limb
from enliven.rotation import from_matrix, slerp, swing, to_matrix, unit
from enliven_synthesis.body.performer import Figure, Performer

_FORWARD = np.array([0.0, 0.0, 1.0])
"""Unit direction that a motion faces when it begins."""
_HEIGHT_SMOOTHING_S = 0.06
"""Standard deviation in seconds of the Gaussian that smooths height corrections. It is a fraction of a step's
duration."""


class CapturedMotion:
    """A motion capture retargeted to a performer. It begins at the world's origin, facing +Z.

    Args:
        performer: the performer.
        capture: the motion capture.
        start, stop: start and end in the capture in seconds. If ``stop`` is None, it is the capture's end.

    Attributes:
        duration: duration in seconds.

    Raises:
        InputError: if the capture lacks hips, knees, elbows or head.
    """

    def __init__(
        self, performer: Performer, capture: Capture, start: float = 0.0, stop: float | None = None
    ) -> None:
        capture = turn_upright(capture)
        roles = find_roles(capture)
        rotations, standing = find_limb_rotations(capture, roles)
        pelvis = _pelvis_path(performer, capture, roles, rotations, standing)
        first = round(start / capture.seconds)
        last = capture.frames if stop is None else min(round(stop / capture.seconds) + 1, capture.frames)
        rotations, pelvis = rotations[first:last], pelvis[first:last]
        facing = rotations[: max(1, round(0.3 / capture.seconds)), Limb.PELVIS, :, 2].mean(0)
        level = to_matrix(swing(unit(facing * [1.0, 0.0, 1.0]), _FORWARD))
        self._rotations = from_matrix(level @ rotations)
        self._pelvis = (pelvis - pelvis[0] * [1.0, 0.0, 1.0]) @ level.T
        self._performer, self._seconds = performer, capture.seconds
        self.duration = (len(pelvis) - 1) * capture.seconds

    def figure(self, time: float) -> Figure:
        """Returns the figure at a time in seconds. Before the start and after the end it stands still."""
        position = min(max(time / self._seconds, 0.0), len(self._pelvis) - 1.0)
        previous = min(int(position), max(len(self._pelvis) - 2, 0))
        after, part = min(previous + 1, len(self._pelvis) - 1), position - previous
        pelvis = (1.0 - part) * self._pelvis[previous] + part * self._pelvis[after]
        turned = slerp(self._rotations[previous], self._rotations[after], np.full(16, part))
        return self._performer.figure(to_matrix(turned), pelvis)


def _pelvis_path(
    performer: Performer, capture: Capture, roles: JointRoles, rotations: Float, standing: Bool
) -> Float:
    """Returns the (F, 3) hip centre in metres, scaled by leg length, with the soles at the captured
    height.
    """
    p = capture.positions
    hips, knees, ankles = (p[:, list(r)] for r in (roles.hips, roles.knees, roles.ankles))
    leg = np.linalg.norm(hips - knees, axis=-1) + np.linalg.norm(knees - ankles, axis=-1)
    scale = (performer.thigh + performer.shank) / float(np.median(leg))
    hip_height = performer.hip * [0.0, 1.0, 1.0]
    pelvis = scale * hips.mean(1) - rotations[:, Limb.PELVIS] @ hip_height
    captured_height = _compute_lower_foot_height(scale * p[:, list(roles.toes)], scale * ankles, standing)
    lowest = np.array(
        [
            performer.soles(performer.figure(r, pelvis_position)).min()
            for r, pelvis_position in zip(rotations, pelvis, strict=True)
        ]
    )
    pelvis[:, 1] += _smooth(captured_height - lowest, _HEIGHT_SMOOTHING_S / capture.seconds)
    return pelvis


def _compute_lower_foot_height(toes: Float, ankles: Float, standing: Bool) -> Float:
    """Returns the (F,) height in metres of the lower foot above the floor.

    Heights below a few centimetres become 0.

    Args:
        toes, ankles: (F, 2, 3) metres.
        standing: (F, 2) True if that foot stands on the floor.
    """
    heights = []
    for side in (0, 1):
        for part in (toes, ankles):
            floor = np.median(part[standing[:, side], side, 1])
            heights.append(part[:, side, 1] - floor)
    low = np.maximum(np.min(heights, axis=0), 0.0)
    return np.asarray(low * smoothstep(low, 0.03, 0.07))


def _smooth(values: Float, width: float) -> Float:
    """Returns the (F,) values smoothed by a Gaussian with a standard deviation of ``width`` frames."""
    reach = max(1, round(3 * width))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(width, 1e-6)) ** 2)
    return np.convolve(np.pad(values, reach, mode="edge"), kernel / kernel.sum(), mode="valid")
