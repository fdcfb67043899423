"""Furniture that touches people: it lies beside their bodies, before nothing of them, and never moves.

Where people stand from the first frame on, no room is known around them, and a table at a hip is taken for
an arm as soon as the real one is folded. A limb that is fitted badly lies beside the model too, but mostly
before the trunk or a leg.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Bool, Float32, Int16
from enliven_edge.tracking.body_model import Posture, clear_of_rays, model
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.segment.segmentation import lying_on

BESIDE = 0.12
"""Metres from a person's surface beyond which a pixel is something else: clothes stay within."""
_NEARER = -0.3
"""Metres from a pixel along its ray from which a body is looked for: before it, as far as a limb reaches."""
_FARTHER = 0.6
"""Metres behind a pixel along its ray up to which it is looked for: a limb is held as far before a body."""
_CLOSE = 0.06
"""Metres by which a ray may miss a body: an arm beside the hip is as near."""
_BODY = np.flatnonzero(
    ~np.isin(model.CAPSULES.frame, [model.UPPER_ARM_L, model.FOREARM_L, model.UPPER_ARM_R, model.FOREARM_R])
)
"""The capsules of trunk, head and legs: an arm may be the one that is taken for furniture."""


def furniture_beside(
    view: FrameView, still: Bool, owner: Int16, people: Sequence[Posture], floor: float
) -> Bool:
    """Returns the (h, w) pixels that are furniture, of those that never moved.

    Args:
        still: (h, w) the pixels that never moved.
        owner: (h, w) the person of each pixel, or -1.
        people: at least one.
        floor: metres above the floor from which a pixel is none of it.
    """
    made = still & (view.z > 0.0) & (view.points[..., 1] > floor)
    theirs = made & (owner >= 0)
    if theirs.any():
        made &= ~lying_on(view, people, floor, BESIDE, theirs)
    if made.any():
        made[made] = ~_before(np.ascontiguousarray(view.points[made], np.float32), view, people)
    return made


def _before(points: Float32, view: FrameView, people: Sequence[Posture]) -> Bool:
    """Returns which of (N, 3) points lie before or behind a trunk, a head or a leg, seen from the sensor."""
    met = np.zeros(len(points), bool)
    for posture in people:
        ends, radii = (each[_BODY] for each in posture.capsules())
        met |= clear_of_rays(points, view.eye.astype(np.float32), _NEARER, _FARTHER, ends, radii) < _CLOSE
    return met
