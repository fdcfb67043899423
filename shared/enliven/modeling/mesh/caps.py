"""Caps: triangulations that close the loops of a cut; their inner points take their values from the rim."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from enliven.arrays import Float, Int
from enliven.modeling.mesh.cut_loops import area
from enliven.modeling.mesh.planar import refined, triangulated
from enliven.modeling.mesh.poisson_equation import SYMMETRIC_LU

_GROWTH = 1.25
"""How much longer edges get with every ring towards the middle of a cap."""


class HarmonicInterpolation:
    """Harmonic interpolation from the first ``fixed`` points of a triangulation to the others.

    With cotangent weights it is exact for linear functions; Delaunay triangles make the weights positive, so
    it stays within the bounds of what it interpolates. Factored once, for any number of values.
    """

    def __init__(self, points: Float, triangles: Int, fixed: int) -> None:
        self.count = len(points) - fixed
        if self.count:
            web = _cotangent_weights(points, triangles)
            own = np.asarray(web.sum(1)).ravel()
            self._rim = csr_matrix(web[fixed:, :fixed])
            self._factor = splu(csc_matrix(diags(own[fixed:]) - web[fixed:, fixed:]), **SYMMETRIC_LU)

    def __call__(self, values: Float) -> Float:
        """(I, K) at the inner points, from (R, K) at the fixed ones."""
        if not self.count:
            return np.zeros((0, *values.shape[1:]))
        return np.asarray(self._factor.solve(self._rim @ values))


@dataclass(frozen=True)
class Cap:
    """A filling between loops.

    Attributes:
        rim: (R,) the numbers of the rim's points, as the caller counts them.
        faces: (T, 3) into the R points of the rim and then the I points inside; the border runs as the loops.
        inside: what is inside, from what is on the rim: (I, K) of (R, K).
    """

    rim: Int
    faces: Int
    inside: HarmonicInterpolation


def cap_of(loops: list[Int], places: Float, fine: bool = True) -> Cap:
    """A cap between loops, in even triangles.

    Args:
        loops: the points of each loop, in order.
        places: (N, 2) where the points are, in the surface.
        fine: false adds no points inside.
    """
    mirrored = sum(area(places[loop]) for loop in loops) < 0
    rim = np.concatenate(loops)
    points = places[rim] * ([-1.0, 1.0] if mirrored else [1.0, 1.0])
    ends = np.cumsum([len(loop) for loop in loops])
    numbers = [np.arange(end - len(loop), end) for loop, end in zip(loops, ends, strict=True)]
    triangles = triangulated(points, numbers)
    if fine:
        points, triangles = refined(points, triangles, _sizes(points, numbers), growth=_GROWTH)
    return Cap(rim, triangles, HarmonicInterpolation(points, triangles, len(rim)))


def _sizes(points: Float, loops: list[Int]) -> Float:
    """(R,) how long edges at each point of the rim should be: a rim has two points for each edge of the
    mesh that it crosses, so about twice as long as its own."""
    sizes = np.empty(len(points))
    for loop in loops:
        step = np.linalg.norm(points[np.roll(loop, -1)] - points[loop], axis=1)
        around = (step + np.roll(step, 1)) / 2
        sizes[loop] = np.maximum(around, 1.6 * step.mean())
    return sizes


def flattened(points: Float) -> Float:
    """(N, 2) a loop in the plane that it spans best, counter-clockwise."""
    middle = points - points.mean(0)
    normal = np.cross(middle, np.roll(middle, -1, 0)).sum(0)
    normal /= max(float(np.linalg.norm(normal)), 1e-300)
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= max(float(np.linalg.norm(across)), 1e-300)
    return np.asarray(middle @ np.stack([across, np.cross(normal, across)]).T)


def _cotangent_weights(points: Float, triangles: Int) -> csr_matrix:
    """(P, P) the cotangent weights between points, none below zero."""
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
    web = coo_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (count, count)
    )
    web = web.tocsr()
    web.data = np.maximum(web.data, 1e-9)
    return web
