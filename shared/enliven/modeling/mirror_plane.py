"""The plane in which a mesh is its own mirror image, if there is one."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from enliven.arrays import Float
from enliven.deformation.sampling import scatter
from enliven.mesh import Mesh
from enliven.puppet import Plane

_SAMPLES = 3000
_TOLERANCE = 0.01
"""Part of the mesh's size that the mirror image may be off, in the mean."""


def plane_of_symmetry(mesh: Mesh) -> Plane | None:
    """The plane of symmetry, or None where the mesh has none."""
    points = scatter(mesh, _SAMPLES, np.random.default_rng(0)).positions
    tree, middle = cKDTree(points), points.mean(0)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    axes = np.concatenate([np.eye(3), np.linalg.svd(points - middle, full_matrices=False)[2]])
    found = min((_refined(points, tree, middle, axis) for axis in axes), key=lambda plane: plane[0])
    gap, point, normal = found
    if gap > _TOLERANCE * size:
        return None
    normal = normal * np.sign(normal[np.abs(normal).argmax()])
    return Plane(tuple(point.tolist()), tuple(normal.tolist()))


def _refined(points: Float, tree: cKDTree, middle: Float, normal: Float) -> tuple[float, Float, Float]:
    """How far the image is off in metres, a point and the normal, after some steps of closest points."""
    point = middle
    for _ in range(20):
        image = points - 2 * ((points - point) @ normal)[:, None] * normal
        pairs = points[tree.query(image)[1]]
        halves, ways = (points + pairs) / 2, pairs - points
        point = halves.mean(0)
        # The plane through the halves whose normal the ways are along.
        spread = (halves - point).T @ (halves - point) - ways.T @ ways / 4
        normal = np.linalg.eigh(spread)[1][:, 0]
    image = points - 2 * ((points - point) @ normal)[:, None] * normal
    return float(tree.query(image)[0].mean()), point, normal
