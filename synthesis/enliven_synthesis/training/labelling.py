"""The part of the body that each rendered pixel shows, to train the network with."""

from __future__ import annotations

import numpy as np

from enliven.arrays import AnyArray, Float, Int, UInt8
from enliven.person import Limb
from enliven_edge.tracking.estimator import PARTS, BodyPart
from enliven_synthesis.body import PIECES, Figure

_TRUNK_MIDDLE = 0.04
"""Metres above the spine joint, of a person of 1.75 m: where the chest ends and the belly begins."""


def _part_of_limb() -> Int:
    """(16,) the part of every limb that is not the trunk; -1 for the trunk's."""
    parts = np.full(len(Limb), -1)
    parts[Limb.SKULL] = BodyPart.HEAD
    parts[Limb.UPPER_ARM_LEFT :] = np.arange(BodyPart.UPPER_ARM_LEFT, PARTS)
    return parts


_LIMB = np.array([piece.limb for piece in PIECES])


_PART = _part_of_limb()[_LIMB]


def label_pixels(pieces: UInt8, points: Float, figure: Figure, scale: float) -> UInt8:
    """(M,) the part at each surface point.

    Args:
        pieces: (M,) the index of the piece of flesh that was met.
        points: (M, 3) metres, world frame.
        figure: whose flesh it is.
        scale: the person's stature over the reference's.
    """
    labels: AnyArray = _PART[pieces].copy()
    trunk = labels < 0
    spine = figure.frames[Limb.ABDOMEN]
    local = (points[trunk] - spine[:, 3]) @ spine[:, :3]
    belly = local[:, 1] < _TRUNK_MIDDLE * scale
    right = local[:, 0] < 0.0
    labels[trunk] = np.where(belly, BodyPart.BELLY_LEFT, BodyPart.CHEST_LEFT) + right
    return labels.astype(np.uint8)
