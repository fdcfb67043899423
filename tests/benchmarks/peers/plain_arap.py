"""A generated mesh for the deformation benchmarks: a ball, or a bean if it is elongated."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from enliven.meshes.mesh import Mesh


def bean(count: int, tall: float = 1.7) -> Mesh:
    """Returns an ellipsoid of ``count`` evenly spread vertices, 1 m wide, ``tall`` metres tall."""
    k = np.arange(count) + 0.5
    height, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    ring = np.sqrt(1 - height * height)
    points = np.stack([ring * np.cos(turn), height, ring * np.sin(turn)], 1)
    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    a, b, c = (points[faces[:, m]] for m in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(points * [0.5, tall / 2, 0.5], faces.astype(np.int32), "bean")
