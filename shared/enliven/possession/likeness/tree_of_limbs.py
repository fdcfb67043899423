"""The tree of a person's limbs. It gives the geodesic distances along a body between head, hands and feet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import Float

HEAD = 0
"""The index of the head among the five ends. Two hands and two feet follow."""
_LIMBS_ON_PATH = np.array(
    [(1, 1, 0, 0)] * 2 + [(1, 0, 1, 1)] * 2 + [(0, 2, 0, 0)] + [(0, 1, 1, 1)] * 4 + [(0, 0, 0, 2)], float
)
"""(10, 4) the number of heads, arms, trunks and legs on the path between each pair of the five ends."""
_LIMB_SOLVER = np.linalg.pinv(_LIMBS_ON_PATH)
"""(4, 10) matrix that computes the four limb lengths from the ten distances, by least squares."""
_USUAL_DEVIATION = 0.035
"""Usual deviation of a geodesic distance from the distance in the tree, as a fraction of the length of arm,
trunk and leg together. They differ because geodesic paths go around a thick body."""
_HALF_WEIGHT_DEVIATION = 12.0
"""Squared deviation, relative to the square of ``_USUAL_DEVIATION``, at which a distance has half its weight.
The weight falls, because a hand that touches a thigh shortens many distances."""
_PROPORTIONS = ((0, 1, 0.5, 0.5), (3, 1, 1.15, 0.4), (2, 1, 0.55, 0.5))
"""For head, leg and trunk (by index): the reference limb, the usual ratio to it, and the spread of the
ratio's logarithm. The spread covers a child, a bear and a man made of boxes."""
_DISTANCE_TOLERANCE = 0.06
"""Tolerance of the comparison of a point's distances with those of the chest or the pelvis, as a fraction of
the length of arm, trunk and leg together."""


class LimbTree(NamedTuple):
    """Limb lengths in metres along the surface. Head and arms are measured from end to chest, legs from end
    to pelvis, and the trunk from chest to pelvis.
    """

    head: float
    arm: float
    trunk: float
    leg: float

    @property
    def size(self) -> float:
        """The sum of the lengths of arm, trunk and leg, metres."""
        return self.arm + self.trunk + self.leg

    @property
    def from_chest(self) -> tuple[float, ...]:
        """Distances from the five ends to the chest, then :attr:`size`, metres."""
        below = self.trunk + self.leg
        return (self.head, self.arm, self.arm, below, below, self.size)

    @property
    def from_pelvis(self) -> tuple[float, ...]:
        """Distances from the five ends to the pelvis, then :attr:`size`, metres."""
        arm = self.arm + self.trunk
        return (self.head + self.trunk, arm, arm, self.leg, self.leg, self.size)


def tree_misfit(distances: Float) -> tuple[Float, Float]:
    """Fits a limb tree to each of K choices. Returns the cost (K,) of the deviation from a person's tree, and
    the limb lengths (K, 4) of the fitted trees.

    Args:
        distances: (K, 10) metres between each pair of head, two hands and two feet, in this order.
    """
    lengths = distances @ _LIMB_SOLVER.T
    size = np.maximum(lengths[:, 1:].sum(1), 1e-9)[:, None]
    square = ((distances - lengths @ _LIMBS_ON_PATH.T) / (_USUAL_DEVIATION * size)) ** 2
    cost = (square / (1.0 + square / _HALF_WEIGHT_DEVIATION)).sum(1)
    lengths = np.maximum(lengths, 1e-3 * size)
    for part, of, usual, spread in _PROPORTIONS:
        cost += (np.log(lengths[:, part] / lengths[:, of] / usual) / spread) ** 2
    return cost, lengths


def point_at_distances(points: Float, distances: Float, end_distances: tuple[float, ...]) -> Float:
    """Returns the centre (3,) of those points that have the given geodesic distances from the five ends,
    metres.

    Args:
        points: (C, 3) metres.
        distances: (5, C) metres from each end.
        end_distances: the five target distances, followed by the size that normalizes the errors.
    """
    *five, size = end_distances
    square = (((distances - np.array(five)[:, None]) / size) ** 2).sum(0)
    weights = np.exp(-(square - square.min()) / (2 * _DISTANCE_TOLERANCE**2))
    return np.asarray(weights @ points / weights.sum())
