"""Labels each rendered pixel with the visible body part, for training."""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float, Int, UInt8
from enliven.person import Limb
from enliven_edge.tracking.estimator.labels import PARTS, BodyPart
from enliven_synthesis.body.body_sdf import PIECES
from enliven_synthesis.body.performer import Figure

_TRUNK_MIDDLE = 0.04
"""Height in metres of the border between belly and chest above the spine joint, for a person of 1.75 m."""


def _parts_by_limb() -> Int:
    """Returns the body part (16,) of every limb; -1 for the limbs of the trunk."""
    parts = np.full(len(Limb), -1)
    parts[Limb.SKULL] = BodyPart.HEAD
    parts[Limb.UPPER_ARM_LEFT :] = np.arange(BodyPart.UPPER_ARM_LEFT, PARTS)
    return parts


_LIMB_OF_PIECE = np.array([piece.limb for piece in PIECES])
"""(P,) the limb of every piece of the body."""
_PART_OF_PIECE = _parts_by_limb()[_LIMB_OF_PIECE]
"""(P,) the body part of every piece; -1 for pieces of the trunk."""


def label_pixels(pieces: UInt8, points: Float, figure: Figure, scale: float) -> UInt8:
    """Returns the body part (M,) at each surface point.

    Args:
        pieces: (M,) index of the body piece at each point.
        points: (M, 3) metres, world frame.
        figure: the person's figure.
        scale: the person's stature relative to the reference.
    """
    labels: AnyArray = _PART_OF_PIECE[pieces].copy()
    trunk = labels < 0
    spine = figure.frames[Limb.ABDOMEN]
    local = (points[trunk] - spine[:, 3]) @ spine[:, :3]
    belly = local[:, 1] < _TRUNK_MIDDLE * scale
    right = local[:, 0] < 0.0
    labels[trunk] = np.where(belly, BodyPart.BELLY_LEFT, BodyPart.CHEST_LEFT) + right
    return labels.astype(np.uint8)
