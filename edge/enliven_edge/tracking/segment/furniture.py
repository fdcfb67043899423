"""Detects furniture that touches people: it is next to their bodies, not in front of them, and never moves.

If people are present from the first frame on, the background around them is unknown. Then the fit mistakes a
table next to the hip for an arm as soon as the real arm is folded. A badly fitted limb is also outside the
model, but mostly in front of the trunk or a leg. So it is not taken for furniture.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Bool, Float32, Int16
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.capsules import ray_clearances
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.segment.segmentation import pixels_near_bodies

MAX_CLOTHES_DISTANCE_M = 0.12
"""Distance in metres from a person's surface beyond which a pixel belongs to another object. Clothes stay
within this distance.
"""
_SEARCH_START_M = -0.3
"""Start in metres, relative to a pixel, of the interval on the pixel's ray in which a body is searched: a
limb's reach in front of the pixel.
"""
_SEARCH_END_M = 0.6
"""End in metres behind a pixel of the interval on its ray. A limb can be held this far in front of the
body.
"""
_MAX_RAY_DISTANCE_M = 0.06
"""Maximum distance in metres between a ray and a body for the ray to hit the body. An arm hangs this close to
the hip.
"""
_BODY_MODEL = np.flatnonzero(
    ~np.isin(model.CAPSULES.frame, [model.UPPER_ARM_L, model.FOREARM_L, model.UPPER_ARM_R, model.FOREARM_R])
)
"""The capsules of trunk, head and legs. Arms are excluded, because they may be wrongly fitted to the
furniture."""


def find_furniture(
    view: FrameView, still: Bool, owner: Int16, people: Sequence[Posture], floor: float
) -> Bool:
    """Returns the (h, w) pixels of furniture among those that never moved.

    Args:
        view: the frame.
        still: (h, w) the pixels that never moved.
        owner: (h, w) the person of each pixel, or -1.
        people: the postures of the people; at least one.
        floor: metres above the floor up to which a pixel belongs to the floor.
    """
    furniture = still & (view.z > 0.0) & (view.points[..., 1] > floor)
    person_furniture = furniture & (owner >= 0)
    if person_furniture.any():
        furniture &= ~pixels_near_bodies(view, people, floor, MAX_CLOTHES_DISTANCE_M, person_furniture)
    if furniture.any():
        furniture[furniture] = ~_overlaps_bodies(
            np.ascontiguousarray(view.points[furniture], np.float32), view, people
        )
    return furniture


def _overlaps_bodies(points: Float32, view: FrameView, people: Sequence[Posture]) -> Bool:
    """Returns (N,) whether each of (N, 3) points is in front of or behind a trunk, head or leg, seen from the
    sensor.
    """
    overlaps = np.zeros(len(points), bool)
    for posture in people:
        ends, radii = (values[_BODY_MODEL] for values in posture.capsules())
        overlaps |= (
            ray_clearances(points, view.eye.astype(np.float32), _SEARCH_START_M, _SEARCH_END_M, ends, radii)
            < _MAX_RAY_DISTANCE_M
        )
    return overlaps
