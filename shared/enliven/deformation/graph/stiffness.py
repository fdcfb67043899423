"""Computes the stiffness of each graph node from stiff and soft regions of a mesh (KinÊtre, per-node
weights).

Regions are given as spots in the settings, or as paint that is stored per vertex of the mesh. Both are
factors on the weights of the nodes.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Character
from enliven.errors import InputError

Spot = tuple[float, float, float, float, float]
"""A spot: x, y, z and radius in metres of the mesh's rest space, and a factor. A factor above 1 makes the
mesh stiffer, below 1 softer."""
_MIN_WEIGHT_SUM = 1e-9
"""A node with a smaller sum of skin weights counts as a node without vertices."""


def stiffness_at(positions: Float, spots: tuple[Spot, ...]) -> Float | None:
    """Returns the stiffness factor (N,) of each node. It is a spot's factor at the spot's centre, and changes
    smoothly to 1 at its radius.

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
                f"stiffness spot {number} at ({x:g}, {y:g}, {z:g}) has an invalid value: radius "
                f"{radius:g}, factor {factor:g}",
                where="stiffness",
                remedy="Pass finite x, y and z, a radius above 0 and a factor above 0.",
            )
        inside = 1.0 - np.minimum(np.linalg.norm(positions - [x, y, z], axis=1) / radius, 1.0)
        logarithm += np.log(factor) * inside * inside * (3.0 - 2.0 * inside)
    return np.asarray(np.exp(logarithm))


def compute_painted_stiffness(character: Character) -> Float | None:
    """Returns the painted factor (N,) around each node: the weighted geometric mean of its vertices' factors.

    A node without vertices has the factor 1. Returns None if nothing is painted.
    """
    if character.stiffness is None:
        return None
    skin, count = character.skin, len(character.pivots)
    weights = skin.weights.astype(np.float64)
    logarithms = np.log(character.stiffness, dtype=np.float64)[:, None] * weights
    weight_sums = np.bincount(skin.indices.ravel(), weights.ravel(), count)
    mean = np.bincount(skin.indices.ravel(), logarithms.ravel(), count) / np.maximum(
        weight_sums, _MIN_WEIGHT_SUM
    )
    return np.asarray(np.exp(mean))
