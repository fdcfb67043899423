"""The cells of an ARAP surface: their rotations, scales and volume matrices, and the residual of the
positions.

A cell consists of a vertex and the edges to its neighbours. The equation numbers are from U. Celikcan, I. O.
Yaz and T. Capin, "Example-based retargeting of human motion to arbitrary mesh models", 2015, section 4.
Vertices are ordered so that neighbours are near in memory. Only the vector ``z`` is in the factor's
elimination order.

The state of a vertex is 16 numbers (two cache lines) in ``frames`` (16 V,): the three columns of T_i, then
the position, each padded with a fourth number. T_i is s_i R_i in the shape state (rotation and uniform scale)
and V_i R_i in the pose state (squash and stretch). The fourth number of the first column is the stretch s - 1
of the last pose along the main axis. The other fourth numbers are 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Int, Int32
from enliven.deformation.arap.polar import ROWS, TRACE, N, polar
from enliven.kernels import njit
from enliven.lanes import fma4, load4, splat4, store4

_STRETCH_REGULARIZATION = 0.02
"""Regularization of a cell's stretch towards 1, as a fraction of the cell's size. It matters for cells
without extent along their main axis."""
_BLOCK_ROWS = 31
"""Number of rows of a block in the pose state: 18 from :func:`polar`, then the cell's deformed edge
covariance (6), its rest covariance (6) and its size (1)."""


class Cells(NamedTuple):
    """The constants of a surface's cells, for V vertices and D directed edges.

    Attributes:
        start: (V + 1,) the index at which each vertex's edges begin.
        neighbour: (D,) the vertex at the other end of each directed edge.
        spokes: (4 D,) for each directed edge the rest vector w_ij (v_i - v_j), and w_ij.
        middle: (4 V,) the sum of the spokes of each cell.
        rest: (6 V,) for each cell the edge covariance at rest, sum of w e eᵀ: xx, xy, xz, yy, yz, zz.
        size: (V,) the trace of ``rest``, the size of a cell in square metres.
        eliminated: (V,) the position of each vertex in elimination order.
    """

    start: Int32
    neighbour: Int32
    spokes: Float
    middle: Float
    rest: Float
    size: Float
    eliminated: Int32


def build_cells(positions: Float, edges: Int, weights: Float, eliminated: Int32) -> Cells:
    """Returns the cells of a surface, given ``positions`` (V, 3), ``edges`` (E, 2) and their ``weights``
    (E,)."""
    count = len(positions)
    ends = np.concatenate([edges, edges[:, ::-1]])
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    i, j = ends[order].T
    w = np.tile(weights, 2)[order]
    e = positions[i] - positions[j]
    spokes = np.concatenate([w[:, None] * e, w[:, None]], 1)
    start = np.concatenate([[0], np.cumsum(np.bincount(i, minlength=count))]).astype(np.int32)
    middle = np.stack([_compute_weighted_sums(i, spokes[:, k], count) for k in range(4)], 1)
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    rest = np.stack([_compute_weighted_sums(i, w * e[:, a] * e[:, b], count) for a, b in pairs], 1)
    size = rest[:, [0, 3, 5]].sum(1)
    flat = (spokes.ravel().copy(), middle.ravel().copy(), rest.ravel().copy())
    return Cells(start, j.astype(np.int32), *flat, size, eliminated)


def _compute_weighted_sums(i: Int, values: Float, count: int) -> Float:
    return np.asarray(np.bincount(i, values, count), np.float64)


@njit(cache=True, nogil=True)
def _gather_covariances(cells, frames, block, at, count):
    """Fills the rows S of a block for ``count`` cells, starting with cell ``at``: the transposed covariances
    of eq. 5, sum w_ij (v'_i - v'_j)(v_i - v_j)ᵀ."""
    room = np.empty(12)
    for n in range(64):
        if n >= count:
            for k in range(9):
                block[k * 64 + n] = 1.0 if k % 4 == 0 else 0.0
            continue
        i = at + n
        x = load4(frames, 16 * i + 12)
        s0 = s1 = s2 = splat4(0.0)
        for e in range(cells.start[i], cells.start[i + 1]):
            d = x - load4(frames, 16 * cells.neighbour[e] + 12)
            s0 = fma4(cells.spokes[4 * e], d, s0)
            s1 = fma4(cells.spokes[4 * e + 1], d, s1)
            s2 = fma4(cells.spokes[4 * e + 2], d, s2)
        store4(room, 0, s0)
        store4(room, 4, s1)
        store4(room, 8, s2)
        for k in range(9):
            block[k * 64 + n] = room[4 * (k // 3) + k % 3]


@njit(cache=True, nogil=True, error_model="numpy")
def turn_and_scale(cells, frames, hold, low, high, first, last):
    """Computes T_i = s_i R_i (rotation and uniform scale, eq. 6 and 8) of the cells ``first`` to ``last``.

    The rotation R_i is computed from the largest eigenvalue of a matrix
    (:mod:`enliven.deformation.arap.polar`). This eigenvalue is also the sum e'ᵀ(R e) in eq. 8. Clamping the
    best s_i to ``low`` and ``high`` still gives the optimum. If both limits are 1, this is plain ARAP.
    ``hold`` adds to eq. 4 the energy hold c_i (s_i - 1)², with c_i the cell's size.
    """
    block = np.empty(ROWS * N)
    for at in range(first, last, N):
        count = min(N, last - at)
        _gather_covariances(cells, frames, block, at, count)
        polar(block, count, frames, at)
        for n in range(count):
            i = at + n
            size = cells.size[i]
            s = (block[TRACE * N + n] / size + hold) / (1.0 + hold) if size > 0.0 else 1.0
            s = min(max(s, low), high)
            for c in range(3):
                to, row = 16 * i + 4 * c, (9 + 3 * c) * 64 + n
                frames[to] = s * block[row]
                frames[to + 1] = s * block[row + 64]
                frames[to + 2] = s * block[row + 128]


@njit(cache=True, nogil=True, error_model="numpy")
def turn_and_squash(cells, frames, exaggeration, most, first, last):
    """Computes T_i = V_i R_i (squash and stretch, eq. 10 to 12) of the cells ``first`` to ``last``.

    V_i scales by s along the main axis of the deformation that remains after the rotation, and by sqrt(1/s)
    perpendicular to it. The projector on the axis is the matrix of eq. 11, squared five times. If two axes
    are equally good (a cell that only grows), both contribute. So the result does not flicker between them.
    """
    block, spread = np.empty(ROWS * N), np.empty(_BLOCK_ROWS * N)
    for at in range(first, last, N):
        count = min(N, last - at)
        _gather_covariances(cells, frames, block, at, count)
        _gather_spread(cells, frames, spread, at, count)
        polar(block, count, frames, at)
        for k in range(18 * N):
            spread[k] = block[k]
        _squash_and_stretch(spread, exaggeration, most)
        for n in range(count):
            for c in range(3):
                to, row = 16 * (at + n) + 4 * c, 3 * c * 64 + n
                frames[to], frames[to + 1], frames[to + 2] = spread[row], spread[row + 64], spread[row + 128]
            frames[16 * (at + n) + 3] = spread[9 * 64 + n]


@njit(cache=True, nogil=True)
def _gather_spread(cells, frames, spread, at, count):
    """Fills rows 18 to 30 of ``spread`` for ``count`` cells, starting with cell ``at``: the deformed
    covariance, sum of w e' e'ᵀ (xx, xy, xz, yy, yz, zz), the rest covariance, and the size.
    """
    room = np.empty(12)
    for n in range(64):
        if n >= count:
            for k in range(18, 31):
                spread[k * 64 + n] = 1.0
            continue
        i = at + n
        here, a0 = load4(frames, 16 * i + 12), 16 * i + 12
        s0 = s1 = s2 = splat4(0.0)
        for e in range(cells.start[i], cells.start[i + 1]):
            j, w = 16 * cells.neighbour[e] + 12, cells.spokes[4 * e + 3]
            d = here - load4(frames, j)
            s0 = fma4(w * (frames[a0] - frames[j]), d, s0)
            s1 = fma4(w * (frames[a0 + 1] - frames[j + 1]), d, s1)
            s2 = fma4(w * (frames[a0 + 2] - frames[j + 2]), d, s2)
        store4(room, 0, s0)
        store4(room, 4, s1)
        store4(room, 8, s2)
        spread[18 * 64 + n], spread[19 * 64 + n], spread[20 * 64 + n] = room[0], room[1], room[2]
        spread[21 * 64 + n], spread[22 * 64 + n], spread[23 * 64 + n] = room[5], room[6], room[10]
        for k in range(6):
            spread[(24 + k) * 64 + n] = cells.rest[6 * i + k]
        spread[30 * 64 + n] = cells.size[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _squash_and_stretch(block, exaggeration, most):  # noqa: PLR0915, a kernel
    """Computes rows 0 to 8 of ``block`` = V_i R_i, and row 9 = s - 1, from covariances, rotations and sizes.

    The block is one array with constant strides, and the loop has no branch, so the compiler vectorizes it.
    """
    least = 1.0 / most
    for n in range(64):
        s00, s10, s20 = block[n], block[64 + n], block[2 * 64 + n]
        s01, s11, s21 = block[3 * 64 + n], block[4 * 64 + n], block[5 * 64 + n]
        s02, s12, s22 = block[6 * 64 + n], block[7 * 64 + n], block[8 * 64 + n]
        r00, r10, r20 = block[9 * 64 + n], block[10 * 64 + n], block[11 * 64 + n]
        r01, r11, r21 = block[12 * 64 + n], block[13 * 64 + n], block[14 * 64 + n]
        r02, r12, r22 = block[15 * 64 + n], block[16 * 64 + n], block[17 * 64 + n]
        # Compute X = sym(S Rᵀ) = sum of w e'(R e)ᵀ and Y = R rest Rᵀ = sum of w (R e)(R e)ᵀ.
        x00 = s00 * r00 + s01 * r01 + s02 * r02
        x11 = s10 * r10 + s11 * r11 + s12 * r12
        x22 = s20 * r20 + s21 * r21 + s22 * r22
        x01 = 0.5 * (s00 * r10 + s01 * r11 + s02 * r12 + s10 * r00 + s11 * r01 + s12 * r02)
        x02 = 0.5 * (s00 * r20 + s01 * r21 + s02 * r22 + s20 * r00 + s21 * r01 + s22 * r02)
        x12 = 0.5 * (s10 * r20 + s11 * r21 + s12 * r22 + s20 * r10 + s21 * r11 + s22 * r12)
        a, b, c = block[24 * 64 + n], block[25 * 64 + n], block[26 * 64 + n]
        d, e, f = block[27 * 64 + n], block[28 * 64 + n], block[29 * 64 + n]
        q0, q1, q2 = a * r00 + b * r01 + c * r02, b * r00 + d * r01 + e * r02, c * r00 + e * r01 + f * r02
        y00, y01, y02 = (
            q0 * r00 + q1 * r01 + q2 * r02,
            q0 * r10 + q1 * r11 + q2 * r12,
            q0 * r20 + q1 * r21 + q2 * r22,
        )
        q0, q1, q2 = a * r10 + b * r11 + c * r12, b * r10 + d * r11 + e * r12, c * r10 + e * r11 + f * r12
        y11, y12 = q0 * r10 + q1 * r11 + q2 * r12, q0 * r20 + q1 * r21 + q2 * r22
        q0, q1, q2 = a * r20 + b * r21 + c * r22, b * r20 + d * r21 + e * r22, c * r20 + e * r21 + f * r22
        y22 = q0 * r20 + q1 * r21 + q2 * r22
        b00, b11 = block[18 * 64 + n] - 2.0 * x00 + y00, block[21 * 64 + n] - 2.0 * x11 + y11
        b01, b12 = block[19 * 64 + n] - 2.0 * x01 + y01, block[22 * 64 + n] - 2.0 * x12 + y12
        b02, b22 = block[20 * 64 + n] - 2.0 * x02 + y02, block[23 * 64 + n] - 2.0 * x22 + y22
        # If only rounding errors are left, they define no axis. Then the tiny constants make B zero and V the
        # identity.
        t = 1.0 / (abs(b00 + b11 + b22) + 1e-12 * block[30 * 64 + n] + 1e-300)
        b00, b01, b02, b11, b12, b22 = b00 * t, b01 * t, b02 * t, b11 * t, b12 * t, b22 * t
        # Square the matrix five times, so that the main axis dominates.
        for _ in range(5):
            t = 1.0 / (abs(b00 + b11 + b22) + 1e-30)
            b00, b01, b02, b11, b12, b22 = b00 * t, b01 * t, b02 * t, b11 * t, b12 * t, b22 * t
            c00, c01 = b00 * b00 + b01 * b01 + b02 * b02, b00 * b01 + b01 * b11 + b02 * b12
            c02, c11 = b00 * b02 + b01 * b12 + b02 * b22, b01 * b01 + b11 * b11 + b12 * b12
            c12, c22 = b01 * b02 + b11 * b12 + b12 * b22, b02 * b02 + b12 * b12 + b22 * b22
            b00, b01, b02, b11, b12, b22 = c00, c01, c02, c11, c12, c22
        t = 1.0 / (b00 + b11 + b22 + 1e-60)
        b00, b01, b02, b11, b12, b22 = b00 * t, b01 * t, b02 * t, b11 * t, b12 * t, b22 * t
        # Equation 8 along the main axis gives the stretch s.
        above = b00 * x00 + b11 * x11 + b22 * x22 + 2.0 * (b01 * x01 + b02 * x02 + b12 * x12)
        below = b00 * y00 + b11 * y11 + b22 * y22 + 2.0 * (b01 * y01 + b02 * y02 + b12 * y12)
        steady = _STRETCH_REGULARIZATION * block[30 * 64 + n] + 1e-300
        s = (above + steady) / (below + steady)
        block[9 * 64 + n] = s - 1.0
        s = (s - 1.0) * exaggeration + 1.0
        s = s if s > least else least
        s = s if s < most else most
        # V stretches by s along the axis and by sqrt(1/s) across it, which keeps the volume. The result is V
        # R.
        across = math.sqrt(1.0 / s)
        along = s - across
        v00, v11, v22 = across + along * b00, across + along * b11, across + along * b22
        v01, v02, v12 = along * b01, along * b02, along * b12
        block[n] = v00 * r00 + v01 * r10 + v02 * r20
        block[64 + n] = v01 * r00 + v11 * r10 + v12 * r20
        block[2 * 64 + n] = v02 * r00 + v12 * r10 + v22 * r20
        block[3 * 64 + n] = v00 * r01 + v01 * r11 + v02 * r21
        block[4 * 64 + n] = v01 * r01 + v11 * r11 + v12 * r21
        block[5 * 64 + n] = v02 * r01 + v12 * r11 + v22 * r21
        block[6 * 64 + n] = v00 * r02 + v01 * r12 + v02 * r22
        block[7 * 64 + n] = v01 * r02 + v11 * r12 + v12 * r22
        block[8 * 64 + n] = v02 * r02 + v12 * r12 + v22 * r22


@njit(cache=True, nogil=True)
def residual(cells, frames, z, first, last):
    """Computes z (4 V,) in elimination order: the right side minus the left side of eq. 9, for the vertices
    ``first`` to ``last``.
    """
    room = np.empty(4)
    for i in range(first, last):
        m = 4 * i
        here = load4(frames, 16 * i + 12)
        v = fma4(cells.middle[m], load4(frames, 16 * i), splat4(0.0))
        v = fma4(cells.middle[m + 1], load4(frames, 16 * i + 4), v)
        v = fma4(cells.middle[m + 2], load4(frames, 16 * i + 8), v)
        u = splat4(0.0)
        for e in range(cells.start[i], cells.start[i + 1]):
            j = 16 * cells.neighbour[e]
            v = fma4(cells.spokes[4 * e], load4(frames, j), v)
            v = fma4(cells.spokes[4 * e + 1], load4(frames, j + 4), v)
            v = fma4(cells.spokes[4 * e + 2], load4(frames, j + 8), v)
            u = fma4(cells.spokes[4 * e + 3], load4(frames, j + 12) - here, u)
        store4(room, 0, fma4(0.5, v, u))
        to = 4 * cells.eliminated[i]
        z[to], z[to + 1], z[to + 2], z[to + 3] = room[0], room[1], room[2], 0.0
