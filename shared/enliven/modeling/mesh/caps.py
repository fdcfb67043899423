"""Caps: triangulations that close the loops of a cut. Values at their inner points are interpolated from the
rim."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from enliven.arrays import Float, Int
from enliven.meshes.planar import refine_triangulation, triangulate_loops
from enliven.modeling.mesh.cut_loops import signed_area
from enliven.modeling.mesh.poisson_equation import SYMMETRIC_LU

_EDGE_GROWTH = 1.25
"""Ratio of the edge lengths of successive rings towards the middle of a cap."""


class HarmonicInterpolation:
    """Harmonic interpolation from the first ``fixed`` points of a triangulation to its other points.

    With cotangent weights, the interpolation is exact for linear functions. Delaunay triangles make the
    weights positive, so the results stay within the range of the given values. The matrix is factorized once,
    for any number of values.
    """

    def __init__(self, points: Float, triangles: Int, fixed: int) -> None:
        self.count = len(points) - fixed
        if self.count:
            weights = _cotangent_weights(points, triangles)
            degree = np.asarray(weights.sum(1)).ravel()
            self._rim = csr_matrix(weights[fixed:, :fixed])
            self._factor = splu(csc_matrix(diags(degree[fixed:]) - weights[fixed:, fixed:]), **SYMMETRIC_LU)

    def __call__(self, values: Float) -> Float:
        """Returns (I, K) values at the inner points, from (R, K) values at the fixed points."""
        if not self.count:
            return np.zeros((0, *values.shape[1:]))
        return np.asarray(self._factor.solve(self._rim @ values))


@dataclass(frozen=True)
class Cap:
    """A triangulation of the area between loops.

    Attributes:
        rim: (R,) the numbers of the rim's points, as given by the caller.
        faces: (T, 3) indices into the R points of the rim and the I inner points after them. The border has
            the direction of the loops.
        inner_points: interpolates values at the inner points (I, K) from values on the rim (R, K).
    """

    rim: Int
    faces: Int
    inner_points: HarmonicInterpolation


def triangulate_cap(loops: list[Int], places: Float, fine: bool = True) -> Cap:
    """Returns a cap that fills the area between loops with triangles of similar size.

    Args:
        loops: the points of each loop, in order.
        places: (N, 2) coordinates of the points in the plane of the cap.
        fine: True to add inner points.
    """
    mirrored = sum(signed_area(places[loop]) for loop in loops) < 0
    rim = np.concatenate(loops)
    points = places[rim] * ([-1.0, 1.0] if mirrored else [1.0, 1.0])
    ends = np.cumsum([len(loop) for loop in loops])
    numbers = [np.arange(end - len(loop), end) for loop, end in zip(loops, ends, strict=True)]
    triangles = triangulate_loops(points, numbers)
    if fine:
        points, triangles = refine_triangulation(
            points, triangles, _target_edge_lengths(points, numbers), growth=_EDGE_GROWTH
        )
    return Cap(rim, triangles, HarmonicInterpolation(points, triangles, len(rim)))


def _target_edge_lengths(points: Float, loops: list[Int]) -> Float:
    """Returns the target edge lengths (R,) of triangles at the rim's points.

    A rim has two points for each mesh edge that it crosses, so the target is about twice the length of the
    rim's own edges.
    """
    sizes = np.empty(len(points))
    for loop in loops:
        step = np.linalg.norm(points[np.roll(loop, -1)] - points[loop], axis=1)
        around = (step + np.roll(step, 1)) / 2
        sizes[loop] = np.maximum(around, 1.6 * step.mean())
    return sizes


def flatten_loop(points: Float) -> Float:
    """Projects a loop onto its best-fitting plane. Returns (N, 2) points, counter-clockwise."""
    middle = points - points.mean(0)
    normal = np.cross(middle, np.roll(middle, -1, 0)).sum(0)
    normal /= max(float(np.linalg.norm(normal)), 1e-300)
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= max(float(np.linalg.norm(across)), 1e-300)
    return np.asarray(middle @ np.stack([across, np.cross(normal, across)]).T)


def _cotangent_weights(points: Float, triangles: Int) -> csr_matrix:
    """Returns the cotangent weights (P, P) between points. Negative weights are raised to a small positive
    value.
    """
    count = len(points)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    rows, columns, values = [], [], []
    for tip, left, right, i, j in ((a, b, c, 1, 2), (b, c, a, 2, 0), (c, a, b, 0, 1)):
        u, v = left - tip, right - tip
        turn = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        cotangent = (u * v).sum(1) / np.maximum(turn, 1e-12 * (u * u).sum(1) + 1e-300)
        rows += [triangles[:, i], triangles[:, j]]
        columns += [triangles[:, j], triangles[:, i]]
        values += [cotangent, cotangent]
    weights = coo_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (count, count)
    )
    weights = weights.tocsr()
    weights.data = np.maximum(weights.data, 1e-9)
    return weights
