"""The direction a chest faces and its lean, compiled: of a posture, and of the same posture turned about."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven_edge.tracking.body_model.kinematics import product
from enliven_edge.tracking.body_model.model import CHEST, PELVIS

_LEANS = 0.15
"""Sine of a trunk's usual lean backward: only more counts."""
_LIES = 0.4
"""Sine of a trunk's rise below which it lies rather than leans."""


@njit(cache=True, nogil=True)
def chest_axes(rotations):  # type: ignore[no-untyped-def]
    """Two unit vectors, world frame: towards the chest's left, and up along it.

    Args:
        rotations: (13, 3, 3) parent_from_frame, of a posture.
    """
    turn = product(rotations[PELVIS], rotations[CHEST])
    return (turn[0, 0], turn[1, 0], turn[2, 0]), (turn[0, 1], turn[1, 1], turn[2, 1])


@njit(cache=True, nogil=True)
def chest_axes_about(rotations):  # type: ignore[no-untyped-def]
    """The same of the posture turned about (:func:`appearance.turned_about`), without making it.

    Mirrored left for right and turned half about the pelvis' upright axis, the chest is mirrored front for
    back in the pelvis' frame.
    """
    mirrored = rotations[CHEST].copy()
    for a in range(3):
        mirrored[2, a] = -mirrored[2, a]
    turn = product(rotations[PELVIS], mirrored)
    return (-turn[0, 0], -turn[1, 0], -turn[2, 0]), (turn[0, 1], turn[1, 1], turn[2, 1])


@njit(cache=True, nogil=True)
def ahead_in_plan(left):  # type: ignore[no-untyped-def]
    """The unit (x, z) direction that a chest faces, by the line of its shoulders: bent over or not."""
    length = np.sqrt(left[0] * left[0] + left[2] * left[2]) + 1e-9
    return -left[2] / length, left[0] / length


@njit(cache=True, nogil=True)
def leaning_back(left, up):  # type: ignore[no-untyped-def]
    """How far a chest leans backward, as the sine beyond what is usual: people bend forward."""
    if up[1] < _LIES:
        return 0.0
    x, z = ahead_in_plan(left)
    return max(0.0, -(up[0] * x + up[2] * z) - _LEANS)
