"""The matrix that preconditions the descent: six unknowns a node, its turn and its shift.

A step is written in node frames (``node_frame``): dR = (w x R) + R S, with w
a turn and S a symmetric stretch, and a shift of its position. In these the second derivative of the energy
falls into two nearly independent parts: E_rot alone holds the stretches, and E_reg, E_con and E_rig alone
hold turns and shifts. So a turn and a shift a node make a sparse system of 6x6 blocks, an eighth of the work
of one with all twelve unknowns, and the stretch of each node is a 3x3 matrix of its own. Against this matrix
the true one has its eigenvalues between 0.35 and 2.6 (a man of 128 and of 256 nodes, walking); that is why
the number of iterations does not grow with the nodes.

Where nodes turn, their lever arms turn with them, so the matrix is made anew whenever it no longer ends a
frame in a few steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from enliven.arrays import Float, Float32, Int32
from enliven.deformation.embedded.block_cholesky import SIZE, factorise, substitute
from enliven.kernels import copy_row, njit
from enliven.lanes import fma8, load8, store8

_TIKHONOV = 1e-4
"""Keeps the matrix definite where nothing holds a node; the energy itself has no such term."""
_PRESSED = 0.45
"""The least eigenvalue of RᵀR (a bound of it) above which E_rot's full second derivative is taken."""


class RigidSystem(NamedTuple):
    """The factor, its pattern, and the state and weights that it was made at.

    Attributes:
        start, row, product: of :class:`enliven.deformation.embedded.block_cholesky.BlockPattern`.
        edge_block: (E,) int32 the block that couples the ends of an edge.
        pair_block: (L, 10) int32 the blocks that couple a constraint's nodes: (0, 0), (1, 0), (1, 1), ...
        lower, upper: (48 B,) float32 the blocks of the factor, and transposed.
        linear: (9 N,) the columns of each node's R.
        compliance: (9 N,) the inverse of what holds each node's stretch.
        pulls: (L,) the constraints' weights that are in it.
        side: (8 N,) float32 room for the right-hand side.
    """

    start: Int32
    row: Int32
    product: Int32
    edge_block: Int32
    pair_block: Int32
    lower: Float32
    upper: Float32
    linear: Float
    compliance: Float
    pulls: Float
    side: Float32


@njit(cache=True, nogil=True)
def outdated(t, planes, s, repulled):  # type: ignore[no-untyped-def]
    """Kernel: whether the matrix was made for other constraints: a weight has changed by the part
    ``repulled`` of the strongest, or there are planes, which are others in every frame.
    """
    strongest, change = 0.0, 0.0
    for m in range(t.pulls.shape[0]):
        strongest = max(strongest, t.pulls[m])
        change = max(change, abs(t.pulls[m] - s.pulls[m]))
    # The first number of a factor is the inverse of a root; 0 where there is no factor yet.
    return s.lower[0] == 0.0 or planes.nodes.shape[0] > 0 or change > repulled * strongest


@njit(cache=True, nogil=True)
def refactor(x, t, planes, s):  # type: ignore[no-untyped-def]
    """Kernel: make and factorise the matrix at ``x``."""
    for j in range(s.start.shape[0] - 1):
        for c in range(3):
            for a in range(3):
                s.linear[9 * j + 3 * c + a] = x[16 * j + 4 * c + a]
    copy_row(s.pulls, t.pulls)
    ridge = _TIKHONOV
    while True:
        _assemble(t, planes, s, ridge)
        if factorise(s.start, s.row, s.product, s.lower, s.upper) or ridge > 1e6:
            return
        ridge *= 100.0


@njit(cache=True, nogil=True)
def _turned(frames, node, v, out):  # type: ignore[no-untyped-def]
    """``out`` (3,) takes v (3,) turned as the node is."""
    at = 9 * node
    for a in range(3):
        out[a] = frames[at + a] * v[0] + frames[at + 3 + a] * v[1] + frames[at + 6 + a] * v[2]


@njit(cache=True, nogil=True)
def _add_cross(lower, at, v, w):  # type: ignore[no-untyped-def]
    """Add w [v]x to the 3x3 matrix at ``at``."""
    lower[at + 1] -= w * v[2]
    lower[at + 2] += w * v[1]
    lower[at + 8] += w * v[2]
    lower[at + 10] -= w * v[0]
    lower[at + 16] -= w * v[1]
    lower[at + 17] += w * v[0]


@njit(cache=True, nogil=True)
def _add_end(lower, at, v, w, sign):  # type: ignore[no-untyped-def]
    """The diagonal block's share of one end of an edge: arm ``v``, and the shift for both ways."""
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    for r in range(3):
        for c in range(r + 1):
            lower[at + 8 * r + c] -= w * v[r] * v[c]
        lower[at + 9 * r] += w * square
        lower[at + 9 * (r + 3)] += 2 * w
    _add_cross(lower, at + 24, v, sign * w)


@njit(cache=True, nogil=True)
def _assemble(t, planes, s, ridge):  # type: ignore[no-untyped-def]
    """The matrix into ``s.lower``, and what holds the stretches, inverted, into ``s.compliance``."""
    lower, start, frames = s.lower, s.start, s.linear
    lower[:] = np.float32(0.0)
    stiff = s.compliance
    stiff[:] = 0.0
    for j in range(start.shape[0] - 1):
        for r in range(6):
            lower[SIZE * start[j] + 9 * r] = ridge
        _hold_stretch(stiff, s.linear, 9 * j, t.stretch[j])
    _add_edges(t, s)
    for m in range(t.rigid.shape[0]):
        _add_rigid(lower, start, frames, t, s.edge_block, m)
    _add_points(t.nodes, t.rows, t.pulls, s)
    if planes.nodes.shape[0] > 0:
        _add_planes(planes, s)
    for j in range(start.shape[0] - 1):
        _invert3(stiff, 9 * j)


@njit(cache=True, nogil=True)
def _hold_stretch(stiff, linear, at, w):  # type: ignore[no-untyped-def]
    """What E_rot has against a stretch S: w (6 G^2 - 2 G), G = RᵀR, as where S and G commute.

    That is the full second derivative; a node that is pressed flat has nearly none, and where it would be
    negative the Gauss-Newton part, 4 G^2, stands in.
    """
    gram = np.empty((3, 3))
    for c in range(3):
        for d in range(3):
            dot = 0.0
            for a in range(3):
                dot += linear[at + 3 * c + a] * linear[at + 3 * d + a]
            gram[c, d] = dot
    least = np.inf
    for c in range(3):
        least = min(least, gram[c, c] - abs(gram[c, (c + 1) % 3]) - abs(gram[c, (c + 2) % 3]))
    full = least > _PRESSED
    for c in range(3):
        for d in range(3):
            square = gram[c, 0] * gram[0, d] + gram[c, 1] * gram[1, d] + gram[c, 2] * gram[2, d]
            stiff[at + 3 * c + d] = w * (6.0 * square - 2.0 * gram[c, d] if full else 4.0 * square)
        stiff[at + 4 * c] += 0.1 * w + 1e-9


@njit(cache=True, nogil=True)
def _add_edges(t, s):  # type: ignore[no-untyped-def]
    """E_reg: the shifts and turns of an edge's two ends."""
    lower, start, frames, stiff = s.lower, s.start, s.linear, s.compliance
    a, b = np.empty(3), np.empty(3)
    for e in range(t.edges.shape[0]):
        i, j, w, d = t.edges[e, 0], t.edges[e, 1], t.smooth[e], t.offsets[e]
        _turned(frames, i, d, a)
        _turned(frames, j, d, b)
        _add_end(lower, SIZE * start[i], a, w, -1.0)
        _add_end(lower, SIZE * start[j], b, w, 1.0)
        at = SIZE * s.edge_block[e]
        # Rows of the node that is eliminated later: of i, [[0, -a x], [-b x, -2]]; of j, its transpose.
        up, down = (a, b) if i > j else (b, a)
        sign = -w if i > j else w
        _add_cross(lower, at + 3, up, sign)
        _add_cross(lower, at + 24, down, sign)
        for r in range(3):
            lower[at + 27 + 9 * r] -= 2 * w
            for c in range(3):
                stiff[9 * i + 3 * r + c] += w * d[r] * d[c]
                stiff[9 * j + 3 * r + c] += w * d[r] * d[c]


@njit(cache=True, nogil=True)
def _add_rigid(lower, start, frames, t, edge_block, m):  # type: ignore[no-untyped-def]
    """E_rig: the turns of both ends, 2 |w_j - w_k|^2, and their shifts."""
    e, w = t.rigid[m], t.hanging[m]
    j, k = t.edges[e, 0], t.edges[e, 1]
    at = SIZE * edge_block[e]
    for r in range(3):
        lower[SIZE * start[j] + 9 * r] += 2 * w
        lower[SIZE * start[k] + 9 * r] += 2 * w
        lower[at + 9 * r] -= 2 * w
        lower[SIZE * start[j] + 9 * (r + 3)] += w
        lower[SIZE * start[k] + 9 * (r + 3)] += w
        lower[at + 9 * (r + 3)] -= w


@njit(cache=True, nogil=True)
def _jacobian(frames, nodes, rows, m, arms, out):  # type: ignore[no-untyped-def]
    """(4, 3, 8) how point ``m`` moves with the turn and shift of each of its nodes: [-u]x and its weight."""
    for k in range(4):
        share = rows[m, k, 3]
        if share == 0.0:
            continue
        _turned(frames, nodes[m, k], rows[m, k], arms)
        x, y, z = np.float32(arms[0]), np.float32(arms[1]), np.float32(arms[2])
        out[k, 0, 1], out[k, 0, 2] = z, -y
        out[k, 1, 0], out[k, 1, 2] = -z, x
        out[k, 2, 0], out[k, 2, 1] = y, -x
        out[k, 0, 3] = out[k, 1, 4] = out[k, 2, 5] = share


@njit(cache=True, nogil=True)
def _add_points(nodes, rows, pulls, s):  # type: ignore[no-untyped-def]
    """E_con: the nodes of each point, among each other."""
    arms, jacobian = np.empty(3), np.zeros((4, 3, 8), np.float32)
    flat = jacobian.reshape(-1)
    for m in range(nodes.shape[0]):
        if not pulls[m] > 0.0:
            continue
        _jacobian(s.linear, nodes, rows, m, arms, jacobian)
        pull = np.float32(pulls[m])
        pair = 0
        for a in range(4):
            for b in range(a + 1):
                if rows[m, a, 3] != 0.0 and rows[m, b, 3] != 0.0:
                    _add_outer(s.lower, SIZE * s.pair_block[m, pair], flat, 24 * a, 24 * b, pull)
                pair += 1
        _add_stretch(s.compliance, nodes, rows, m, pulls[m])


@njit(cache=True, nogil=True)
def _add_stretch(stiff, nodes, rows, m, w):  # type: ignore[no-untyped-def]
    for k in range(4):
        for r in range(3):
            for c in range(3):
                stiff[9 * nodes[m, k] + 3 * r + c] += w * rows[m, k, r] * rows[m, k, c]


@njit(cache=True, nogil=True)
def _add_outer(lower, block, j, first, second, w):  # type: ignore[no-untyped-def]
    """Add w Jaᵀ Jb to a block; J (3, 8) = [[0, z, -y, c, 0, 0], [-z, 0, x, 0, c, 0], [y, -x, 0, 0, 0, c]]."""
    a, b, c = load8(j, second), load8(j, second + 8), load8(j, second + 16)
    x, y, z, share = w * j[first + 10], w * j[first + 16], w * j[first + 1], w * j[first + 3]
    store8(lower, block, fma8(-z, b, fma8(y, c, load8(lower, block))))
    store8(lower, block + 8, fma8(z, a, fma8(-x, c, load8(lower, block + 8))))
    store8(lower, block + 16, fma8(-y, a, fma8(x, b, load8(lower, block + 16))))
    store8(lower, block + 24, fma8(share, a, load8(lower, block + 24)))
    store8(lower, block + 32, fma8(share, b, load8(lower, block + 32)))
    store8(lower, block + 40, fma8(share, c, load8(lower, block + 40)))


@njit(cache=True, nogil=True)
def _add_planes(planes, s):  # type: ignore[no-untyped-def]
    """Planes: a row of six numbers a node.

    The pattern does not contain the couplings of planes. The product of two nodes that it does not couple is
    bounded, 2 ab <= a^2 + b^2, so the matrix stays above the true one.
    """
    arms, jacobian = np.empty(3), np.zeros((4, 3, 8), np.float32)
    line = np.zeros((4, 6))
    for m in range(planes.nodes.shape[0]):
        w = planes.weights[m]
        if not w > 0.0:
            continue
        _jacobian(s.linear, planes.nodes, planes.rows, m, arms, jacobian)
        for k in range(4):
            for c in range(6):
                line[k, c] = 0.0
                for a in range(3):
                    if planes.rows[m, k, 3] != 0.0:
                        line[k, c] += planes.normals[m, a] * jacobian[k, a, c]
        for a in range(4):
            for b in range(a + 1):
                if planes.rows[m, a, 3] != 0.0 and planes.rows[m, b, 3] != 0.0:
                    _add_lines(s, planes.nodes[m, a], planes.nodes[m, b], line[a], line[b], w)
        _add_stretch(s.compliance, planes.nodes, planes.rows, m, w)


@njit(cache=True, nogil=True)
def _add_lines(s, i, j, u, v, w):  # type: ignore[no-untyped-def]
    """Add w u vᵀ at the nodes i >= j, or what bounds it where the pattern does not couple them."""
    low, high = s.start[j], s.start[j + 1] - 1
    while low < high:
        middle = (low + high) // 2
        if s.row[middle] < i:
            low = middle + 1
        else:
            high = middle
    if s.row[low] == i:
        for r in range(6):
            for c in range(6):
                s.lower[SIZE * low + 8 * r + c] += w * u[r] * v[c]
        return
    for r in range(6):
        for c in range(r + 1):
            s.lower[SIZE * s.start[i] + 8 * r + c] += w * u[r] * u[c]
            s.lower[SIZE * s.start[j] + 8 * r + c] += w * v[r] * v[c]


@njit(cache=True, nogil=True)
def _invert3(m, at):  # type: ignore[no-untyped-def]
    """Replace the symmetric 3x3 matrix at ``at`` by its inverse."""
    a, b, c, d, e, f = m[at], m[at + 1], m[at + 2], m[at + 4], m[at + 5], m[at + 8]
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    scale = 1.0 / (a * p + b * q + c * r)
    m[at], m[at + 1], m[at + 2] = p * scale, q * scale, r * scale
    m[at + 3], m[at + 4], m[at + 5] = q * scale, (a * f - c * c) * scale, (b * c - a * e) * scale
    m[at + 6], m[at + 7], m[at + 8] = r * scale, (b * c - a * e) * scale, (a * d - b * b) * scale


@njit(cache=True, nogil=True)
def precondition(s, way):  # type: ignore[no-untyped-def]
    """Kernel: replace ``way`` (16 N,), a force in node frames, by the step that the matrix makes
    of it.

    The second derivative is twice the matrix, so everything is halved.
    """
    side = s.side
    count = s.start.shape[0] - 1
    for j in range(count):
        g, y = 16 * j, 8 * j
        for a in range(3):
            side[y + a], side[y + 3 + a] = way[g + a], way[g + 4 + a]
    substitute(s.start, s.row, s.lower, s.upper, side)
    for j in range(count):
        g, y = 16 * j, 8 * j
        for a in range(3):
            way[g + a], way[g + 4 + a] = 0.5 * side[y + a], 0.5 * side[y + 3 + a]
        _stretch_of(s.compliance, 9 * j, way, g + 8)


@njit(cache=True, nogil=True)
def _stretch_of(c, at, way, g):  # type: ignore[no-untyped-def]
    """The stretch that a force F makes: S of (S C + C S) / 2 = F / 2, by S = (F C⁻¹ + C⁻¹ F) / 4, which is
    exact where C is a multiple of I. Of the force's off-diagonal numbers each stands for two entries.
    """
    f00, f11, f22 = way[g], way[g + 1], way[g + 2]
    f01, f02, f12 = 0.5 * way[g + 4], 0.5 * way[g + 5], 0.5 * way[g + 6]
    c00, c01, c02, c11, c12, c22 = c[at], c[at + 1], c[at + 2], c[at + 4], c[at + 5], c[at + 8]
    way[g] = 0.5 * (f00 * c00 + f01 * c01 + f02 * c02)
    way[g + 1] = 0.5 * (f01 * c01 + f11 * c11 + f12 * c12)
    way[g + 2] = 0.5 * (f02 * c02 + f12 * c12 + f22 * c22)
    way[g + 4] = 0.25 * (f00 * c01 + f01 * c11 + f02 * c12 + f01 * c00 + f11 * c01 + f12 * c02)
    way[g + 5] = 0.25 * (f00 * c02 + f01 * c12 + f02 * c22 + f02 * c00 + f12 * c01 + f22 * c02)
    way[g + 6] = 0.25 * (f01 * c02 + f11 * c12 + f12 * c22 + f02 * c01 + f12 * c11 + f22 * c12)
