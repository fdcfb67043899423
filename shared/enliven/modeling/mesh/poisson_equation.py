"""Solution of Poisson's equation on a flat mesh: a height with Laplacian -2 inside and value 0 on the rim."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from enliven.arrays import Bool, Float, Int32
from enliven.modeling.skinning.heat_diffusion import cotangent_laplacian

SYMMETRIC_LU = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}, "diag_pivot_thresh": 0.0}
"""Options of SciPy's ``splu`` for symmetric positive definite matrices: a symmetric ordering, and no pivoting
(a threshold of 0 selects the diagonal). With these options the factor has fewer non-zeros."""


def solve_poisson(points: Float, faces: Int32, inner: Bool) -> Float:
    """Solves laplace(u) = -2 at the vertices with ``inner`` (V,) True, with u = 0 elsewhere. Returns u (V,)
    in square metres."""
    out = np.zeros(len(points))
    rows = np.flatnonzero(inner)
    if len(rows):
        laplacian, mass = cotangent_laplacian(points, faces)
        matrix = csc_matrix(csc_matrix(laplacian)[rows][:, rows])
        out[rows] = splu(matrix, **SYMMETRIC_LU).solve(2.0 * mass[rows])
    return out
