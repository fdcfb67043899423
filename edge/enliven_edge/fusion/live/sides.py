"""Exchanges left and right: a sensor that sees a back may name the sides the wrong way round."""

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
"""(12, 2) joints with a midpoint that does not depend on the naming of sides."""
_ABOUT_FACE = np.array([0.0, 0.0, 1.0, 0.0])
"""(4,) half a turn about a bone's length."""


def middles(joints: Float) -> Float:
    """Returns (..., 12, 3) the points of a body that an exchange of sides leaves in place."""
    return np.asarray(0.5 * (joints[..., MIDDLES[:, 0], :] + joints[..., MIDDLES[:, 1], :]))


def middle_weights(weights: Float) -> Float:
    """Returns (..., 12) of (..., 20): the smaller of the two joints' weights."""
    return np.minimum(weights[..., MIDDLES[:, 0]], weights[..., MIDDLES[:, 1]])


def exchanged(body: Body) -> Body:
    """Returns the body with left and right exchanged; twice is the body itself.

    Positions change their names only. Every bone is also turned half about its length, so that the front of a
    person who was taken for facing the other way is where it truly is.
    """
    turns = body.orientations
    return dataclasses.replace(
        body,
        joints=body.joints[OTHER_SIDE],
        confidence=body.confidence[OTHER_SIDE],
        orientations=None if turns is None else multiply(turns, _ABOUT_FACE)[OTHER_SIDE],
        contacts=None if body.contacts is None else body.contacts[::-1].copy(),
    )
