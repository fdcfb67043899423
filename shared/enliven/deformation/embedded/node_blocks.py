"""The per-node blocks of the matrix: the block of each node's stretch, and the geometric stiffness of its
lever arms.
"""

from __future__ import annotations

import numpy as np

from enliven.deformation.embedded.block_cholesky import SIZE, multiply_blocks
from enliven.kernels import njit
from enliven.lane_blocks import invert6, mirror6, transpose6
from enliven.lanes import fma4, fma8, load4, load8, splat4, splat8, store4, store8, total4

_ROW, _COLUMN = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
"""Rows and columns of the six numbers of a symmetric stretch, in the order of node frames. They are arrays,
because Numba compiles an index into a tuple to a slow switch."""
_ZERO_OFF_DIAGONAL_FRACTION = 1e-10
"""Fraction of the squared diagonal below which an off-diagonal entry counts as 0. The error of the positive
part is then 1e-5."""


@njit(cache=True, nogil=True)
def compute_stretch_coupling(linear, held, first, out):
    """Computes into ``out`` how each number of a node's stretch S is coupled to its rotation and translation.

    ``out`` has 6 rows of 8 numbers per node. The coupling is the sum over the node's arms u of w (R S
    u).(turn x R u + shift). ``held`` contains the sum of w u uᵀ, and ``first`` contains the sum of w u.
    """
    out[:] = np.float32(0.0)
    for j in range(first.shape[0] // 3):
        at = 9 * j
        for b in range(3):
            u = v = t = 0.0
            for k in range(3):
                w = held[at + 3 * k + b]
                u += w * linear[at + 3 * k]
                v += w * linear[at + 3 * k + 1]
                t += w * linear[at + 3 * k + 2]
            w = first[3 * j + b]
            for a in range(3):
                # For S = e_a e_bᵀ, the product is R S u = r_a u_b.
                x, y, z = linear[at + 3 * a], linear[at + 3 * a + 1], linear[at + 3 * a + 2]
                q = SIZE * j + 8 * (a if a == b else a + b + 2)
                out[q] += v * z - t * y
                out[q + 1] += t * x - u * z
                out[q + 2] += u * y - v * x
                out[q + 3] += w * x
                out[q + 4] += w * y
                out[q + 5] += w * z


@njit(cache=True, nogil=True)
def eliminate_stretch(lower, own, coupling, coupled, compliance, at, block, inverse):
    """Replaces the node's ``coupling`` B by L = -A⁻¹ B, the response of its rotation and translation to its
    stretch.

    A is the node's own block of the matrix, and C is in ``block``. ``coupled`` receives Lᵀ. ``compliance``
    receives the inverse of the Schur complement C - Bᵀ A⁻¹ B. Returns True if the complement is positive
    definite. Otherwise ``coupling`` is not changed. ``inverse`` (48,) is scratch space.

    A stretch alone moves all points that follow the node. Together with the rotation and translation that
    respond to it, the stretch barely moves these points. So the two parts of the matrix become nearly
    independent.
    """
    mirror6(lower, own, inverse, 0, -1.0)
    if not invert6(inverse, 0, -1.0):
        return False
    multiply_blocks(coupling, at, inverse, 0, coupled, at)
    transpose6(coupled, at, inverse, 0)
    a, b, c = load8(inverse, 0), load8(inverse, 8), load8(inverse, 16)
    d, e, f = load8(inverse, 24), load8(inverse, 32), load8(inverse, 40)
    for i in range(0, SIZE, 8):
        k = at + i
        even = fma8(coupling[k], a, fma8(coupling[k + 2], c, load8(block, i)))
        odd = fma8(coupling[k + 1], b, fma8(coupling[k + 3], d, splat8(coupling[k + 4]) * e))
        store8(compliance, k, fma8(coupling[k + 5], f, even + odd))
    if not invert6(compliance, at, 1.0):
        return False
    for i in range(0, SIZE, 8):
        store8(coupling, at + i, load8(coupled, at + i))
        store8(coupled, at + i, load8(inverse, i))
    return True


@njit(cache=True, nogil=True)
def leave_coupled(coupling, coupled, compliance, at, block):
    """Sets the node's stretch to the inverse of ``block`` alone, without any response of rotation and
    translation.
    """
    for i in range(SIZE):
        coupling[at + i] = coupled[at + i] = 0.0
        compliance[at + i] = block[i]
    invert6(compliance, at, 1.0)


@njit(cache=True, nogil=True)
def add_geometric(x, raw, stretch, start, lower):
    """Adds the geometric stiffness of every node's rotation: an outward force on a lever arm resists
    rotation.

    The second derivative along R(1) = exp(w x) R is sym(sum of r gᵀ) - (sum of r.g) I over the columns r of R
    and g of the gradient. The gradient of E_rot is excluded, because no rotation changes E_rot. Only the
    positive part is added: an inward force makes a rotation easier, but the matrix must stay positive
    definite.

    Args:
        x, raw: (16 N,) the state and dE/dx.
        stretch: (N,) w_rot of each node.
        start, lower: the matrix and its column starts. Its diagonal blocks are changed.
    """
    a, v = np.empty((3, 3)), np.empty((3, 3))
    rows = np.empty(12)
    for j in range(start.shape[0] - 1):
        _sum_of_levers(x, raw, 4.0 * stretch[j], 16 * j, rows)
        trace, at = rows[0] + rows[5] + rows[10], SIZE * start[j]
        # Use half of the term, because all entries of the matrix are halved.
        xx, yy, zz = 0.5 * (rows[0] - trace), 0.5 * (rows[5] - trace), 0.5 * (rows[10] - trace)
        xy, xz, yz = 0.25 * (rows[1] + rows[4]), 0.25 * (rows[2] + rows[8]), 0.25 * (rows[6] + rows[9])
        square = xx * yy - xy * xy
        cube = xz * (xy * yz - xz * yy) + yz * (xy * xz - xx * yz) + zz * square
        # Test definiteness by Sylvester's criterion. A negative definite term is skipped, and a positive
        # definite term is added unchanged. Of any other term, only the positive part is added. Most terms are
        # definite.
        if square > 0.0 and xx < 0.0 and cube < 0.0:
            continue
        if not (square > 0.0 and xx > 0.0 and cube > 0.0):
            a[0, 0], a[1, 1], a[2, 2] = xx, yy, zz
            a[0, 1], a[0, 2], a[1, 2] = xy, xz, yz
            a[1, 0], a[2, 0], a[2, 1] = xy, xz, yz
            _keep_positive(a, v)
            xx, yy, zz, xy, xz, yz = a[0, 0], a[1, 1], a[2, 2], a[0, 1], a[0, 2], a[1, 2]
        lower[at] += xx
        lower[at + 8] += xy
        lower[at + 9] += yy
        lower[at + 16] += xz
        lower[at + 17] += yz
        lower[at + 18] += zz


@njit(cache=True, nogil=True)
def _sum_of_levers(x, raw, w, at, out):
    """Computes the sum of r gᵀ over the columns r of R and g of dE/dR - w R (RᵀR - I) into ``out`` (3 rows
    of 4).
    """
    a, b, c = load4(x, at), load4(x, at + 4), load4(x, at + 8)
    aa, bb, cc = w * (1.0 - total4(a * a)), w * (1.0 - total4(b * b)), w * (1.0 - total4(c * c))
    ab, bc, ca = -w * total4(a * b), -w * total4(b * c), -w * total4(c * a)
    p = fma4(aa, a, fma4(ab, b, fma4(ca, c, load4(raw, at))))
    q = fma4(ab, a, fma4(bb, b, fma4(bc, c, load4(raw, at + 4))))
    r = fma4(ca, a, fma4(bc, b, fma4(cc, c, load4(raw, at + 8))))
    for k in range(3):
        store4(out, 4 * k, fma4(x[at + k], p, fma4(x[at + 4 + k], q, splat4(x[at + 8 + k]) * r)))


@njit(cache=True, nogil=True)
def _keep_positive(a, v):
    """Replaces the symmetric ``a`` (3, 3) by its positive part, by Jacobi rotations that are collected in
    ``v`` (3, 3).
    """
    v[:] = 0.0
    v[0, 0] = v[1, 1] = v[2, 2] = 1.0
    tiny = _ZERO_OFF_DIAGONAL_FRACTION * (a[0, 0] * a[0, 0] + a[1, 1] * a[1, 1] + a[2, 2] * a[2, 2])
    for sweep in range(12):
        p, q = sweep % 3, (sweep + 1) % 3
        off = a[p, q]
        if off * off <= tiny:
            continue
        k = 3 - p - q
        lean = 0.5 * (a[q, q] - a[p, p]) / off
        t = (1.0 if lean >= 0.0 else -1.0) / (abs(lean) + np.sqrt(lean * lean + 1.0))
        c = 1.0 / np.sqrt(t * t + 1.0)
        s = t * c
        a[p, p] -= t * off
        a[q, q] += t * off
        a[p, q] = a[q, p] = 0.0
        first, second = a[k, p], a[k, q]
        a[k, p] = a[p, k] = c * first - s * second
        a[k, q] = a[q, k] = s * first + c * second
        for r in range(3):
            v[r, p], v[r, q] = c * v[r, p] - s * v[r, q], s * v[r, p] + c * v[r, q]
    x, y, z = max(a[0, 0], 0.0), max(a[1, 1], 0.0), max(a[2, 2], 0.0)
    for r in range(3):
        for k in range(3):
            a[r, k] = v[r, 0] * x * v[k, 0] + v[r, 1] * y * v[k, 1] + v[r, 2] * z * v[k, 2]


@njit(cache=True, nogil=True)
def stretch_block(linear, held, at, w, whole, room, out):
    """Computes half the second derivative of the energy by a node's stretch S into ``out`` (6 rows of 8).

    Let G = RᵀR, and U the sum of w u uᵀ over the arms u of E_reg and E_con. Let R(1) = R (I + S). Then E_rot
    gets the terms w |S G + G S|^2 + 2 w (G - I).(S G S), and the other energies get tr(S G S U). For a
    compressed node, the sum may not be positive. If ``whole`` is 0.0, the second term is omitted
    (Gauss-Newton).
    """
    gram, square, z = room[0], room[1], room[2]
    for c in range(3):
        for d in range(3):
            dot = 0.0
            for a in range(3):
                dot += linear[at + 3 * c + a] * linear[at + 3 * d + a]
            gram[c, d] = dot
    for c in range(3):
        for d in range(3):
            dot = gram[c, 0] * gram[0, d] + gram[c, 1] * gram[1, d] + gram[c, 2] * gram[2, d]
            square[c, d] = 2.0 * w * dot
            z[c, d] = held[at + 3 * c + d] + 2.0 * w * (gram[c, d] + whole * (gram[c, d] - (c == d)))
    for p in range(6):
        for q in range(p + 1):
            total = 0.1 * w + 1e-9 if p == q else 0.0
            for first in range(1 if p < 3 else 2):
                a, b = (_ROW[p], _COLUMN[p]) if first == 0 else (_COLUMN[p], _ROW[p])
                for second in range(1 if q < 3 else 2):
                    c, d = (_ROW[q], _COLUMN[q]) if second == 0 else (_COLUMN[q], _ROW[q])
                    # For E = e_a e_bᵀ and E' = e_c e_dᵀ, the trace tr(E X E' Y) equals X_bc Y_da.
                    total += square[b, c] if d == a else 0.0
                    total += 0.5 * (gram[b, c] * z[d, a] + gram[d, a] * z[b, c])
            out[8 * p + q] = out[8 * q + p] = total
