"""Left and right: a sensor that sees a back may name the sides the wrong way round."""

from __future__ import annotations

import dataclasses

import numpy as np

from enliven.arrays import Float
from enliven.person import MIRROR, Body, J
from enliven.rotation import multiply

OTHER_SIDE = np.array(MIRROR)
"""(20,) the joint of the other side; the trunk's joints are their own."""
LATERAL = np.arange(J) != OTHER_SIDE
"""(20,) whether a joint has a side."""
MIDDLES = np.array([(j, MIRROR[j]) for j in range(J) if j <= MIRROR[j]])
"""(12, 2) joints whose midpoint does not depend on which side is called left."""
_ABOUT_FACE = np.array([0.0, 0.0, 1.0, 0.0])
"""(4,) half a turn about a bone's length."""


def middles(joints: Float) -> Float:
    """(..., 12, 3) points of a body that an exchange of sides leaves where they are."""
    return np.asarray(0.5 * (joints[..., MIDDLES[:, 0], :] + joints[..., MIDDLES[:, 1], :]))


def middle_weights(weights: Float) -> Float:
    """(..., 12) of (..., 20): as good as the worse of the two joints."""
    return np.minimum(weights[..., MIDDLES[:, 0]], weights[..., MIDDLES[:, 1]])


def exchanged(body: Body) -> Body:
    """The body with left and right named the other way round; twice is the body itself.

    Positions change their names only. Who is taken for facing the other way has every bone turned half about
    its length, so that its front is where it truly is.
    """
    turns = body.orientations
    return dataclasses.replace(
        body,
        joints=body.joints[OTHER_SIDE],
        confidence=body.confidence[OTHER_SIDE],
        orientations=None if turns is None else multiply(turns, _ABOUT_FACE)[OTHER_SIDE],
        contacts=None if body.contacts is None else body.contacts[::-1].copy(),
    )
