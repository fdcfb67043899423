"""Similarity transforms (rotation, scale and displacement), and their fit to corresponding points."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from enliven.arrays import Float

_MIN_SQUARE_M2 = 1e-12
"""Minimum sum of squared distances from the centre, in square metres. Coincident points do not define a
scale.
"""


@dataclass(frozen=True, eq=False)
class Similarity:
    """A similarity transform. A point x is mapped to size turn x + move.

    Attributes:
        size: scale factor, above 0.
        turn: (3, 3) rotation.
        move: (3,) displacement in metres.
    """

    size: float = 1.0
    turn: Float = field(default_factory=lambda: np.eye(3))
    move: Float = field(default_factory=lambda: np.zeros(3))

    def transform(self, points: Float) -> Float:
        """Applies the transform to points (..., 3)."""
        return np.asarray(self.size * points @ self.turn.T + self.move)

    def transform_back(self, points: Float) -> Float:
        """Applies the inverse transform to points (..., 3)."""
        return np.asarray((points - self.move) @ self.turn / self.size)


def fit_similarity(source: Float, target: Float) -> Similarity:
    """Returns the similarity from source points (N, 3) to target points (N, 3).

    It minimises sum |size turn s + move - t|^2 over rotations and displacements (Umeyama 1991). The scale is
    the ratio of the spreads of both sets (Horn 1987). Unlike an affine map, it is unique even for a flat
    mesh.
    """
    source_centre, target_centre = source.mean(0), target.mean(0)
    a, b = source - source_centre, target - target_centre
    size = float(np.sqrt(max((b**2).sum(), _MIN_SQUARE_M2) / max((a**2).sum(), _MIN_SQUARE_M2)))
    u, _, vt = np.linalg.svd(b.T @ a)
    u[:, 2] *= np.sign(np.linalg.det(u @ vt))
    rotation = u @ vt
    return Similarity(size, rotation, target_centre - size * rotation @ source_centre)
