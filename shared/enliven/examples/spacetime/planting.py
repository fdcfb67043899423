"""Foot lock: keeps standing feet in place, including those that are not the anchor.

The distance between two feet of the mesh never equals the distance between the performer's feet exactly. So
while both feet stand, only the anchor stays in place. This module locks every standing foot to one position,
with smooth transitions.

    places = lock_feet(places (F, P, 3), yaw (F,), placed, feet, stands (F, K), step, settings)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Bool, Float
from enliven.document import LocomotionSettings
from enliven.examples.spacetime.locomotion import PlacedMotion
from enliven.motion.contact.contacts import compute_hold_weights, find_runs
from enliven.skeletons.facing import rotate_about_y


def lock_feet(
    places: Float,
    yaw: Float,
    placed: PlacedMotion,
    feet: Sequence[int],
    stands: Bool,
    step: float,
    settings: LocomotionSettings,
) -> Float:
    """Locks standing feet to the floor. Returns the control points, (F, P, 3) in metres of the mesh's frame.

    Args:
        places: (F, P, 3) metres in the mesh's frame, before the lock.
        yaw: (F,) radians.
        placed: the resulting motion in the world.
        feet: (K,) numbers of the control points that are feet.
        stands: (F, K) true for feet that the performer stands on.
        step: seconds between frames.
        settings: ``plant`` is the strength of the lock, ``contact.blend`` its transition time.
    """
    locked = np.array(places, np.float64)
    times = np.arange(len(places)) * step
    weights, goals = np.empty(len(places)), np.empty((len(places), 3))
    for k, foot in enumerate(feet):
        foot_path = placed.world[:, foot]
        runs = find_runs(stands[:, k] & (placed.anchors >= 0))
        if not runs:
            continue
        stood = np.array(
            [_lock_position(foot_path[a : b + 1], placed.anchors[a : b + 1] == foot) for a, b in runs]
        )
        starts, ends = (np.array([run[end] for run in runs]) * step for end in (0, 1))
        compute_hold_weights(times, starts, ends, stood, settings.contact.blend, weights, goals)
        correction = settings.plant * weights[:, None] * (goals - foot_path) * [1.0, 0.0, 1.0]
        locked[:, foot] += rotate_about_y(correction, -yaw)
    return locked


def _lock_position(foot_path: Float, anchor: Bool) -> Float:
    """Returns the position (3,) to which a foot with path (N, 3) is locked. This is the position at which the
    foot becomes the anchor, or the mean of its path if it never does.
    """
    return np.asarray(foot_path[anchor.argmax()] if anchor.any() else foot_path.mean(0))
