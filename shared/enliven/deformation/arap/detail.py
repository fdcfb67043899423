"""Transfers the motion of a coarse surface's cells to a fine surface with all of its detail.

Each cell of the coarse surface defines an affine map. The map moves the cell's vertex to its solved position,
and its linear part fits the cell's edges best. In directions in which a cell has no extent (the normal of a
flat cell), the linear part is the cell's rotation and squash, V_i R_i.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.lanes import fma4, load4, splat4, store4

_ROTATION_FIT_WEIGHT = 0.01
"""Weight of V_i R_i in the fit of a cell's linear map, relative to the cell's edges."""


@njit(cache=True, nogil=True, error_model="numpy")
def compute_vertex_maps(cells, frames, pose, place_of, rest, out):
    """Computes each vertex's affine map into ``out`` (16 M,): the three columns of A and the offset x' - A x,
    each padded with a 0.

    A minimizes sum w |e' - A e|² + own c |A - V R|², with c the cell's size.

    Args:
        cells, frames: the solver's cells and their state after a frame.
        pose: (M, 3) metres, the solved positions.
        place_of: (M,) the position of each vertex in the solver's order.
        rest: (M, 3) metres, the positions at rest.
    """
    count = len(place_of)
    vertex_of = np.empty(len(cells.size), np.int64)
    for v in range(count):
        vertex_of[place_of[v]] = v
    s = np.empty((3, 3))
    for v in range(count):
        i = place_of[v]
        own = _ROTATION_FIT_WEIGHT * cells.size[i] + 1e-300
        for r in range(3):
            for c in range(3):
                s[r, c] = own * frames[16 * i + 4 * c + r]
        for e in range(cells.start[i], cells.start[i + 1]):
            j = vertex_of[cells.neighbour[e]]
            for r in range(3):
                d = pose[v, r] - pose[j, r]
                for c in range(3):
                    s[r, c] += d * cells.spokes[4 * e + c]
        a, b, c_, d_, e_, f = (
            cells.rest[6 * i] + own,
            cells.rest[6 * i + 1],
            cells.rest[6 * i + 2],
            cells.rest[6 * i + 3] + own,
            cells.rest[6 * i + 4],
            cells.rest[6 * i + 5] + own,
        )
        # Invert the symmetric matrix by its cofactors.
        k00, k01, k02 = d_ * f - e_ * e_, c_ * e_ - b * f, b * e_ - c_ * d_
        k11, k12, k22 = a * f - c_ * c_, b * c_ - a * e_, a * d_ - b * b
        t = 1.0 / (a * k00 + b * k01 + c_ * k02)
        for r in range(3):
            m0 = (s[r, 0] * k00 + s[r, 1] * k01 + s[r, 2] * k02) * t
            m1 = (s[r, 0] * k01 + s[r, 1] * k11 + s[r, 2] * k12) * t
            m2 = (s[r, 0] * k02 + s[r, 1] * k12 + s[r, 2] * k22) * t
            out[16 * v + r], out[16 * v + 4 + r], out[16 * v + 8 + r] = m0, m1, m2
            out[16 * v + 12 + r] = pose[v, r] - m0 * rest[v, 0] - m1 * rest[v, 1] - m2 * rest[v, 2]
        out[16 * v + 3] = out[16 * v + 7] = out[16 * v + 11] = out[16 * v + 15] = 0.0


@njit(cache=True, nogil=True)
def apply_vertex_maps(maps, start, near, weights, rest, out, first, last):
    """Computes ``out`` (V, 3): applies to each rest position from ``first`` to ``last`` the blended maps that
    the vertex follows.

    Args:
        maps: (16 M,) the affine maps from :func:`compute_vertex_maps`.
        start, near, weights: the maps that each vertex follows (CSR), and their weights.
    """
    room = np.empty(4)
    for v in range(first, last):
        c0 = c1 = c2 = t = splat4(0.0)
        # Compute the last weight as one minus the others. Float32 weights do not add up to exactly 1, so the
        # vertices of a character far from the origin would jitter.
        left, last_one = 1.0, start[v + 1] - 1
        for k in range(start[v], last_one + 1):
            w, at = left if k == last_one else np.float64(weights[k]), 16 * near[k]
            left -= w
            c0 = fma4(w, load4(maps, at), c0)
            c1 = fma4(w, load4(maps, at + 4), c1)
            c2 = fma4(w, load4(maps, at + 8), c2)
            t = fma4(w, load4(maps, at + 12), t)
        t = fma4(rest[v, 0], c0, t)
        t = fma4(rest[v, 1], c1, t)
        store4(room, 0, fma4(rest[v, 2], c2, t))
        out[v, 0], out[v, 1], out[v, 2] = room[0], room[1], room[2]
