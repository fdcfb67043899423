"""The limbs of the body model, and for each a bank of the postures that it can take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float, Int
from enliven_edge.tracking import model, ranges
from enliven_edge.tracking.kinematics import deviation, exponential, product

ARMS = ((model.UPPER_ARM_L, model.FOREARM_L), (model.UPPER_ARM_R, model.FOREARM_R))
LEGS = (
    (model.THIGH_L, model.SHIN_L, model.FOOT_L),
    (model.THIGH_R, model.SHIN_R, model.FOOT_R),
)
_TWISTS = np.arange(8) * (np.pi / 4)
_ARM, _LEG = (80, -np.array([0.25, 1.1, 1.9])), (80, np.array([0.1, 0.9, 1.7]))
"""Directions of the first bone, and angles of the hinge after it, radians."""
_BEYOND = 0.1
"""Radians that a posture of the bank may be beyond its range: the fit brings it back."""


@dataclass(frozen=True)
class Limb:
    """An arm or a leg.

    Attributes:
        frames: of its bones, from the trunk outwards.
        capsules: (K,) numbers of its capsules; ``others``: all the body's other ones.
        carriers: (K,) which of its bones carries each.
        bank: (N, len(frames), 3, 3) parent_from_frame of its bones: everywhere in their ranges.
    """

    frames: tuple[int, ...]
    capsules: Int
    others: Int
    carriers: Int
    bank: Float


def _limb(frames: tuple[int, ...]) -> Limb:
    own = np.isin(model.CAPSULES.frame, frames)
    carriers = np.array([frames.index(int(frame)) for frame in model.CAPSULES.frame[own]])
    return Limb(frames, np.flatnonzero(own), np.flatnonzero(~own), carriers, _bank(frames))


def _bank(frames: tuple[int, ...]) -> Float:
    """(N, len(frames), 3, 3): the first bone everywhere, turned about itself; the hinge after it bent."""
    count, bends = _ARM if frames in ARMS else _LEG
    made = []
    for direction in _directions(count):
        swing = _swing(direction)
        for number, bend in enumerate(bends):
            # The twist of a limb that is nearly straight hardly moves it.
            for twist in _TWISTS if number else _TWISTS[::3]:
                first = product(swing, exponential(np.array([0.0, twist, 0.0])))
                if (
                    np.abs(deviation(ranges.MIDDLE[frames[0]], first)) <= ranges.REACH[frames[0]] + _BEYOND
                ).all():
                    hinge = exponential(np.array([bend, 0.0, 0.0]))
                    made.append(np.stack([first, hinge, *(ranges.RELAXED[frame] for frame in frames[2:])]))
    return np.stack(made)


def _directions(count: int) -> Float:
    """(count, 3) unit vectors spread evenly over the sphere (a Fibonacci lattice)."""
    k = np.arange(count) + 0.5
    polar, around = np.arccos(1 - 2 * k / count), np.pi * (1 + 5**0.5) * k
    return np.stack([np.cos(around) * np.sin(polar), np.cos(polar), np.sin(around) * np.sin(polar)], 1)


def _swing(to: Float) -> Float:
    """(3, 3) the smallest turn that brings -Y, along which limbs hang, to a unit vector."""
    axis = np.array([-to[2], 0.0, to[0]])
    sine = float(np.linalg.norm(axis))
    if sine < 1e-9:
        return np.eye(3) if to[1] < 0 else np.diag([1.0, -1.0, -1.0])
    return np.asarray(exponential(axis * (float(np.arctan2(sine, -to[1])) / sine)))


LIMBS = {frames: _limb(frames) for frames in (*ARMS, *LEGS)}
