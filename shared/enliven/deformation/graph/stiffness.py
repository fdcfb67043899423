"""Computes the stiffness of each node from stiff and soft regions of a mesh (KinÊtre, per-node weights).

Spots are given as numbers in the settings, and paint is stored per vertex of the mesh. Both are factors on
the weights of the nodes.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Character
from enliven.errors import InputError

Spot = tuple[float, float, float, float, float]
"""A region: x, y, z and radius in metres of the mesh's rest space, and a factor (above 1 is stiffer, below 1
softer)."""
_MIN_WEIGHT_SUM = 1e-9
"""Sum of weights below which a node counts as having no vertices."""


def stiffness_at(positions: Float, spots: tuple[Spot, ...]) -> Float | None:
    """Returns (N,) the factor of each node. It is a spot's factor at the spot's centre, and falls smoothly to
    1 at its radius.

    The factors of overlapping spots are multiplied. Returns None without spots.

    Args:
        positions: (N, 3) metres, the nodes at rest.

    Raises:
        InputError: if a radius or factor is not above 0, or a number is not finite.
    """
    if not spots:
        return None
    logarithm = np.zeros(len(positions))
    for number, (x, y, z, radius, factor) in enumerate(spots, 1):
        if not (np.isfinite([x, y, z]).all() and 0 < radius < np.inf and 0 < factor < np.inf):
            raise InputError(
                f"spot {number} is ({x:g}, {y:g}, {z:g}), radius {radius:g}, factor {factor:g}",
                where="stiffness",
                mend="Give x, y, z, a radius above 0 and a factor above 0.",
            )
        near = 1.0 - np.minimum(np.linalg.norm(positions - [x, y, z], axis=1) / radius, 1.0)
        logarithm += np.log(factor) * near * near * (3.0 - 2.0 * near)
    return np.asarray(np.exp(logarithm))


def painted_stiffness(character: Character) -> Float | None:
    """Returns (N,) the painted factor around each node: the weighted geometric mean of its vertices' factors.

    A node without vertices has 1. None if nothing is painted.
    """
    if character.stiffness is None:
        return None
    skin, count = character.skin, len(character.pivots)
    weights = skin.weights.astype(np.float64)
    logarithms = np.log(character.stiffness, dtype=np.float64)[:, None] * weights
    total = np.bincount(skin.indices.ravel(), weights.ravel(), count)
    mean = np.bincount(skin.indices.ravel(), logarithms.ravel(), count) / np.maximum(total, _MIN_WEIGHT_SUM)
    return np.asarray(np.exp(mean))
