"""Poisson's equation on a flat mesh: the height whose negative Laplacian is 2 and whose rim is 0."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from enliven.arrays import Bool, Float, Int32
from enliven.modeling.skinning import cotangents

SYMMETRIC_LU = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}, "diag_pivot_thresh": 0.0}


def poisson(points: Float, faces: Int32, inner: Bool) -> Float:
    """(V,) square metres: laplace(u) = -2 where ``inner`` (V,) is true, u = 0 elsewhere."""
    out = np.zeros(len(points))
    rows = np.flatnonzero(inner)
    if len(rows):
        laplacian, mass = cotangents(points, faces)
        matrix = csc_matrix(csc_matrix(laplacian)[rows][:, rows])
        out[rows] = splu(matrix, **SYMMETRIC_LU).solve(2.0 * mass[rows])
    return out
