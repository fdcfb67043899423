"""Feet that stay where they stand, also those that are not the anchor.

Examples never put two feet quite as far apart as the performer's; so while both stand, only the anchor is
still. Here every foot is taken back to where it stands, and into and out of it smoothly.

    places = planted(places (F, P, 3), yaw (F,), placed, feet, stands (F, K), step, settings)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Bool, Float
from enliven.document import LocomotionSettings
from enliven.examples.spacetime.locomotion import PlacedMotion
from enliven.mapping import turned_about_y
from enliven.motion.contact import hold, runs_of


def planted(
    places: Float,
    yaw: Float,
    placed: PlacedMotion,
    feet: Sequence[int],
    stands: Bool,
    step: float,
    settings: LocomotionSettings,
) -> Float:
    """(F, P, 3) metres in the mesh's frame: feet that stand do not move over the floor.

    Args:
        places: (F, P, 3) metres in the mesh's frame, as they were put into the world.
        yaw: (F,) radians.
        placed: where they are then.
        feet: (K,) numbers of the control points that are feet.
        stands: (F, K) which of them the performer stands on.
        step: seconds between frames.
        settings: ``plant`` says how much of it is done, ``contact.blend`` how long it takes.
    """
    out = np.array(places, np.float64)
    times = np.arange(len(places)) * step
    weights, goals = np.empty(len(places)), np.empty((len(places), 3))
    for k, foot in enumerate(feet):
        way = placed.world[:, foot]
        runs = runs_of(stands[:, k] & (placed.anchors >= 0))
        if not runs:
            continue
        stood = np.array([_stood(way[a : b + 1], placed.anchors[a : b + 1] == foot) for a, b in runs])
        starts, ends = (np.array([run[end] for run in runs]) * step for end in (0, 1))
        hold(times, starts, ends, stood, settings.contact.blend, weights, goals)
        back = settings.plant * weights[:, None] * (goals - way) * [1.0, 0.0, 1.0]
        out[:, foot] += turned_about_y(back, -yaw)
    return out


def _stood(way: Float, anchor: Bool) -> Float:
    """(3,) where a foot stands that went along a way (N, 3): where it is the anchor, else in the middle."""
    return np.asarray(way[anchor.argmax()] if anchor.any() else way.mean(0))
