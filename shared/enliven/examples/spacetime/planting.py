"""Foot lock: keeps standing feet in place, including those that are not the anchor.

Examples never put two feet exactly as far apart as the performer's. So while both stand, only the anchor is
still. Here every standing foot is moved back to one position, with smooth transitions.

    places = lock_feet(places (F, P, 3), yaw (F,), placed, feet, stands (F, K), step, settings)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Bool, Float
from enliven.document import LocomotionSettings
from enliven.examples.spacetime.locomotion import PlacedMotion
from enliven.mapping import rotate_about_y
from enliven.motion.contact import find_runs, hold


def lock_feet(
    places: Float,
    yaw: Float,
    placed: PlacedMotion,
    feet: Sequence[int],
    stands: Bool,
    step: float,
    settings: LocomotionSettings,
) -> Float:
    """Locks standing feet to the floor. Returns (F, P, 3) metres in the mesh's frame.

    Args:
        places: (F, P, 3) metres in the mesh's frame, before the lock.
        yaw: (F,) radians.
        placed: the resulting motion in the world.
        feet: (K,) numbers of the control points that are feet.
        stands: (F, K) true for feet that the performer stands on.
        step: seconds between frames.
        settings: ``plant`` is the strength of the lock, ``contact.blend`` its transition time.
    """
    out = np.array(places, np.float64)
    times = np.arange(len(places)) * step
    weights, goals = np.empty(len(places)), np.empty((len(places), 3))
    for k, foot in enumerate(feet):
        way = placed.world[:, foot]
        runs = find_runs(stands[:, k] & (placed.anchors >= 0))
        if not runs:
            continue
        stood = np.array([_lock_position(way[a : b + 1], placed.anchors[a : b + 1] == foot) for a, b in runs])
        starts, ends = (np.array([run[end] for run in runs]) * step for end in (0, 1))
        hold(times, starts, ends, stood, settings.contact.blend, weights, goals)
        back = settings.plant * weights[:, None] * (goals - way) * [1.0, 0.0, 1.0]
        out[:, foot] += rotate_about_y(back, -yaw)
    return out


def _lock_position(way: Float, anchor: Bool) -> Float:
    """Returns (3,) the position to lock a foot with path (N, 3): where it becomes the anchor, else the
    mean."""
    return np.asarray(way[anchor.argmax()] if anchor.any() else way.mean(0))
