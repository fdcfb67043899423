"""The tree of a person's limbs: how long the ways along a body are between head, hands and feet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import Float

HEAD = 0
"""The number of the head among the five ends; then come two hands and two feet."""
_BETWEEN = np.array(
    [(1, 1, 0, 0)] * 2 + [(1, 0, 1, 1)] * 2 + [(0, 2, 0, 0)] + [(0, 1, 1, 1)] * 4 + [(0, 0, 0, 2)], float
)
"""(10, 4) how often head, arm, trunk and leg lie on the way between each two of the five ends."""
_SOLVE = np.linalg.pinv(_BETWEEN)
"""(4, 10) the lengths of limbs from the ways, by least squares."""
_USUAL = 0.035
"""Share of arm, trunk and leg by which a way usually differs from the tree's: ways go around a thick body."""
_FAULTY = 12.0
"""Square of the multiples of that at which a way counts half: a hand that touches a thigh shortens many."""
_PROPORTIONS = ((0, 1, 0.5, 0.5), (3, 1, 1.15, 0.4), (2, 1, 0.55, 0.5))
"""Of head, leg and trunk (by number): over the arm, the usual ratio, and the spread of its logarithm; wide
enough for a child, a bear and a man of boxes."""
_SPREAD = 0.06
"""Share of arm, trunk and leg within which ways from a point count as those from the chest or the pelvis."""


class LimbTree(NamedTuple):
    """Metres along the surface: head and arms from end to chest, legs from end to pelvis, and between."""

    head: float
    arm: float
    trunk: float
    leg: float

    @property
    def size(self) -> float:
        """Metres: arm, trunk and leg together."""
        return self.arm + self.trunk + self.leg

    @property
    def from_chest(self) -> tuple[float, ...]:
        """Metres from the five ends to the chest, and the size."""
        below = self.trunk + self.leg
        return (self.head, self.arm, self.arm, below, below, self.size)

    @property
    def from_pelvis(self) -> tuple[float, ...]:
        """Metres from the five ends to the pelvis, and the size."""
        arm = self.arm + self.trunk
        return (self.head + self.trunk, arm, arm, self.leg, self.leg, self.size)


def ways_misfit(apart: Float) -> tuple[Float, Float]:
    """(K,) costs of ways that no person's tree has, and (K, 4) lengths of the nearest trees.

    Args:
        apart: (K, 10) metres between each two of head, two hands and two feet, in this order.
    """
    lengths = apart @ _SOLVE.T
    size = np.maximum(lengths[:, 1:].sum(1), 1e-9)[:, None]
    square = ((apart - lengths @ _BETWEEN.T) / (_USUAL * size)) ** 2
    cost = (square / (1.0 + square / _FAULTY)).sum(1)
    lengths = np.maximum(lengths, 1e-3 * size)
    for part, of, usual, spread in _PROPORTIONS:
        cost += (np.log(lengths[:, part] / lengths[:, of] / usual) / spread) ** 2
    return cost, lengths


def weighted_place(points: Float, ways: Float, wanted: tuple[float, ...]) -> Float:
    """(3,) metres: the middle of the points that are so far along the surface from the five ends.

    Args:
        points: (C, 3) metres.
        ways: (5, C) metres from each end.
        wanted: five ways, and the size that errors are measured by.
    """
    *five, size = wanted
    square = (((ways - np.array(five)[:, None]) / size) ** 2).sum(0)
    weights = np.exp(-(square - square.min()) / (2 * _SPREAD**2))
    return np.asarray(weights @ points / weights.sum())
