"""The part of the matrix that is each node's own: how it stretches, and forces on its arms."""

from __future__ import annotations

import numpy as np

from enliven.deformation.embedded.block_cholesky import SIZE, times
from enliven.kernels import njit
from enliven.lanes import fma8, load8, splat8, store8, transpose6

_ROW, _COLUMN = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
"""Rows and columns of a symmetric stretch's six numbers, as in node frames; arrays, since Numba makes a
switch of each look into a tuple."""
_UNITS = np.eye(6, 8, dtype=np.float32).ravel()
"""The rows of the identity, as vector registers."""
_DIAGONAL = 1e-10
"""Share of the diagonal's square below which an entry beside it counts as 0: the positive part stays
positive, and is 1e-5 of it off."""


@njit(cache=True, nogil=True)
def couple(linear, held, first, j, out, to):  # type: ignore[no-untyped-def]
    """``out`` (6 rows of 8) takes how each number of the node's stretch S pulls at its turn and its shift.

    The sum over its arms u of w (R S u).(turn x R u + shift), with the sum of w u uᵀ in ``held`` and that of
    w u in ``first``.
    """
    at = 9 * j
    for i in range(SIZE):
        out[to + i] = 0.0
    for b in range(3):
        u = v = t = 0.0
        for k in range(3):
            w = held[at + 3 * k + b]
            u += w * linear[at + 3 * k]
            v += w * linear[at + 3 * k + 1]
            t += w * linear[at + 3 * k + 2]
        w = first[3 * j + b]
        for a in range(3):
            # S = e_a e_bᵀ: R S u = r_a u_b.
            x, y, z = linear[at + 3 * a], linear[at + 3 * a + 1], linear[at + 3 * a + 2]
            q = to + 8 * (a if a == b else a + b + 2)
            out[q] += v * z - t * y
            out[q + 1] += t * x - u * z
            out[q + 2] += u * y - v * x
            out[q + 3] += w * x
            out[q + 4] += w * y
            out[q + 5] += w * z


@njit(cache=True, nogil=True)
def decouple(lower, own, coupling, compliance, at, block, inverse, product):  # type: ignore[no-untyped-def]
    """Replace the node's ``coupling`` B by L = -A⁻¹ B, how its turn and shift give way to its own stretch.

    A is its own block of the matrix, C is in ``block``; ``compliance`` takes the inverse of what then holds
    the stretch, C - Bᵀ A⁻¹ B. Returns whether that is positive definite; where not, ``coupling`` stays.
    A stretch alone pulls at all points that the node holds; with the turn and shift that give way it hardly
    does, and the two parts of the matrix become nearly independent.
    """
    for r in range(6):
        for c in range(r + 1):
            inverse[8 * r + c] = inverse[8 * c + r] = -lower[own + 8 * r + c]
    if not invert6(inverse, 0, -1.0):
        return False
    for i in range(0, SIZE, 8):
        store8(product, i, load8(coupling, at + i))
    times(product, 0, inverse, 0)
    transpose6(product, 0, inverse, 0)
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
        store8(coupling, at + i, load8(product, i))
    return True


@njit(cache=True, nogil=True)
def leave_coupled(coupling, compliance, at, block):  # type: ignore[no-untyped-def]
    """Give the node's stretch the inverse of ``block`` alone: nothing gives way to it."""
    for i in range(SIZE):
        coupling[at + i] = 0.0
        compliance[at + i] = block[i]
    invert6(compliance, at, 1.0)


@njit(cache=True, nogil=True)
def add_geometric(x, raw, w, j, lower, at, a, v):  # type: ignore[no-untyped-def]
    """The geometric stiffness of a turn: a force on a lever arm holds it where it draws outward.

    The second derivative along R(1) = exp(w x) R is sym(sum of r gᵀ) - (sum of r.g) I over the columns r of
    R and g of the gradient, that of E_rot left out, since no turn changes it. Of it the positive part is
    taken: a force inward makes a turn easier, but the matrix has to stay definite. ``a`` and ``v`` (3, 3) are
    room.
    """
    g = 16 * j
    for r in range(3):
        for k in range(3):
            a[r, k] = 0.0
    for c in range(3):
        p, q, r = raw[g + 4 * c], raw[g + 4 * c + 1], raw[g + 4 * c + 2]
        for d in range(3):
            dot = -1.0 if c == d else 0.0
            for k in range(3):
                dot += x[g + 4 * c + k] * x[g + 4 * d + k]
            # The part of E_rot's gradient, 4 w R (RᵀR - I), column c.
            dot *= 4.0 * w
            p -= dot * x[g + 4 * d]
            q -= dot * x[g + 4 * d + 1]
            r -= dot * x[g + 4 * d + 2]
        for k in range(3):
            a[k, 0] += x[g + 4 * c + k] * p
            a[k, 1] += x[g + 4 * c + k] * q
            a[k, 2] += x[g + 4 * c + k] * r
    trace = a[0, 0] + a[1, 1] + a[2, 2]
    # Half of it, as of everything in the matrix.
    for r in range(3):
        for k in range(r):
            a[r, k] = a[k, r] = 0.25 * (a[r, k] + a[k, r])
        a[r, r] = 0.5 * (a[r, r] - trace)
    _keep_positive(a, v)
    for r in range(3):
        for k in range(r + 1):
            lower[at + 8 * r + k] += a[r, k]


@njit(cache=True, nogil=True)
def _keep_positive(a, v):  # type: ignore[no-untyped-def]
    """Replace the symmetric ``a`` (3, 3) by its positive part (Jacobi's rotations, in ``v`` (3, 3))."""
    v[:] = 0.0
    v[0, 0] = v[1, 1] = v[2, 2] = 1.0
    tiny = _DIAGONAL * (a[0, 0] * a[0, 0] + a[1, 1] * a[1, 1] + a[2, 2] * a[2, 2])
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
def stretch_block(linear, held, at, w, whole, room, out):  # type: ignore[no-untyped-def]
    """``out`` (6 rows of 8) takes half the second derivative by a node's stretch S.

    With G = RᵀR and U the sum of w u uᵀ over the arms u that E_reg and E_con hold, R(1) = R (I + S) adds
    w |S G + G S|^2 + 2 w (G - I).(S G S) to E_rot, and tr(S G S U) to the others. Where a node is pressed
    this need not be positive: ``whole`` 0.0 leaves the second of them out (Gauss and Newton).
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
                    # tr(E X E' Y) of E = e_a e_bᵀ and E' = e_c e_dᵀ is X_bc Y_da.
                    total += square[b, c] if d == a else 0.0
                    total += 0.5 * (gram[b, c] * z[d, a] + gram[d, a] * z[b, c])
            out[8 * p + q] = out[8 * q + p] = total


@njit(cache=True, nogil=True)
def invert6(m, at, sign):  # type: ignore[no-untyped-def]
    """Replace the symmetric 6x6 matrix at ``at`` (6 rows of 8) by its inverse, by Gauss and Jordan; False
    where ``sign`` times it is not positive definite.

    The row of a pivot p in column k, divided by p, has 1 + 1/p there: a row with f in that column then keeps
    f - f (1 + 1/p) = -f/p of it, as it has to, and no single number is written between whole registers.
    """
    for k in range(6):
        pivot = m[at + 9 * k]
        if not sign * pivot > 0.0:
            return False
        unit = load8(_UNITS, 8 * k)
        pivot = np.float32(1.0) / pivot
        row = fma8(pivot, unit, splat8(pivot) * load8(m, at + 8 * k))
        for i in range(0, SIZE, 8):
            if i != 8 * k:
                store8(m, at + i, fma8(-m[at + i + k], row, load8(m, at + i)))
        store8(m, at + 8 * k, row - unit)
    return True
