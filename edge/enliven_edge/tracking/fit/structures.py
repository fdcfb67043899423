"""The named structures of the compiled fit: body model, posture, sums, prior and weights.

Sizes: F frames, C capsules, K rotational unknowns, and L lengths. L is 12, or 0 if the lengths are frozen.
"""

from __future__ import annotations

from collections import namedtuple
from dataclasses import fields
from typing import Any, NamedTuple

from enliven.arrays import Float, Int
from enliven_edge.tracking.settings import FitSettings


class FitModel(NamedTuple):
    """The body model, the same in every fit. See :mod:`enliven_edge.tracking.body_model.model`."""

    parents: Int
    pivots: Float
    moves: Int
    dof_frame: Int
    dof_axis: Int
    capsule_frame: Int
    capsule_ends: Float
    capsule_radii: Float
    lengths_of: Int
    pairs: Int
    joint_frames: Int
    joint_offsets: Float


class BodyState(NamedTuple):
    """A posture: (3,) metres, (F, 3, 3) rotations and (12,) lengths."""

    position: Float
    rotations: Float
    lengths: Float


class PlacedFrames(NamedTuple):
    """The frames of a posture: (F, 3, 3) rotations and (F, 3) pivots in metres.

    ``by_length`` (F, 3, L) contains the derivatives of the pivots with respect to the lengths.
    """

    world: Float
    pivots: Float
    by_length: Float
    moves: Int
    dof_frame: Int
    dof_axis: Int
    lengths_of: Int
    parents: Int


class CapsuleSurface(NamedTuple):
    """The capsules of a posture: (C, 2, 3) ends and (C, 2) radii in metres, world frame.

    ``by_ends`` (C, 2, 3, L) contains the derivatives of the ends with respect to the lengths. ``girth``
    scales all radii.
    """

    ends: Float
    radii: Float
    frame: Int
    by_ends: Float
    lengths_of: Int
    girth: float


class FrameSums(NamedTuple):
    """The weighted sums of residuals per frame, see :mod:`enliven_edge.tracking.fit.normal_equations`."""

    total: Float
    pull: Float
    cross: Float
    own: Float
    tug: Float


class FitPrior(NamedTuple):
    """The prior of the fit: the predicted posture, the relaxed posture, joint ranges and proportions.

    ``stiffness`` and ``relaxedness`` (F,) are weights of rotations.

    ``firmness`` (12,) are the weights of the ``reference`` lengths, or (0,) if the lengths are frozen.
    """

    predicted: Float
    stiffness: Float
    rest: Float
    relaxedness: Float
    middle: Float
    reach: Float
    reference: Float
    firmness: Float


class FitConstants(NamedTuple):
    """The common data of all fits with one width: body, weights, and the constant part of the prior."""

    shape: FitModel
    weights: Any
    rest: Float
    relaxedness: Float
    middle: Float
    reach: Float


_NAMES = tuple(field.name for field in fields(FitSettings))
FitWeights: Any = namedtuple("FitWeights", _NAMES)  # type: ignore[misc]
"""A named tuple with the fields of :class:`FitSettings`. A new setting is automatically a weight that every
term can use."""


def create_weights(settings: FitSettings, width: float) -> Any:
    """Returns the settings as weights for the compiled fit: all as floats, with ``width`` as robust width."""
    return FitWeights(*(float(getattr(settings, name)) for name in _NAMES))._replace(width=width)
