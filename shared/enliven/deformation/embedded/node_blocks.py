"""The part of the matrix that is each node's own: how it stretches, and forces on its arms."""

from __future__ import annotations

import numpy as np

from enliven.deformation.embedded.block_cholesky import SIZE, invert_factor
from enliven.kernels import njit

_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Rows and columns of a symmetric stretch's six numbers, as in node frames."""


@njit(cache=True, nogil=True)
def couple(linear, held, first, j, out, to):  # type: ignore[no-untyped-def]
    """``out`` (6 rows of 8) takes how each number of the node's stretch S pulls at its turn and its shift.

    The sum over its arms u of w (R S u).(turn x R u + shift), with the sum of w u uᵀ in ``held`` and that of
    w u in ``first``.
    """
    at = 9 * j
    for q in range(6):
        for r in range(8):
            out[to + 8 * q + r] = 0.0
        for turn in range(1 if q < 3 else 2):
            a, b = _ENTRIES[q][turn], _ENTRIES[q][1 - turn]
            # S = e_a e_bᵀ: R S u = r_a u_b.
            x, y, z = linear[at + 3 * a], linear[at + 3 * a + 1], linear[at + 3 * a + 2]
            for k in range(3):
                w = held[at + 3 * k + b]
                u, v, t = linear[at + 3 * k], linear[at + 3 * k + 1], linear[at + 3 * k + 2]
                out[to + 8 * q] += w * (v * z - t * y)
                out[to + 8 * q + 1] += w * (t * x - u * z)
                out[to + 8 * q + 2] += w * (u * y - v * x)
            w = first[3 * j + b]
            out[to + 8 * q + 3] += w * x
            out[to + 8 * q + 4] += w * y
            out[to + 8 * q + 5] += w * z


@njit(cache=True, nogil=True)
def decouple(lower, own, coupling, compliance, at, block, product):  # type: ignore[no-untyped-def]
    """Replace the node's ``coupling`` B by L = -A⁻¹ B, how its turn and shift give way to its own stretch.

    A is its own block of the matrix; ``compliance`` takes the inverse of what then holds it, C - Bᵀ A⁻¹ B.
    A stretch alone pulls at all points that the node holds; with the turn and shift that give way it hardly
    does, and the two parts of the matrix become nearly independent. ``block`` holds C.
    """
    inverse = block[SIZE:]
    for i in range(SIZE):
        inverse[i] = lower[own + i]
    if invert6(inverse, 0):
        for q in range(6):
            for r in range(6):
                total = np.float32(0.0)
                for k in range(6):
                    total -= inverse[8 * r + k] * coupling[at + 8 * q + k]
                product[8 * q + r] = total
        for p in range(6):
            for q in range(p + 1):
                total = block[8 * p + q]
                for k in range(6):
                    total += coupling[at + 8 * p + k] * product[8 * q + k]
                compliance[at + 8 * p + q] = total
        if invert6(compliance, at):
            for q in range(6):
                for r in range(6):
                    coupling[at + 8 * q + r] = product[8 * q + r]
            return
    for q in range(6):
        for r in range(6):
            coupling[at + 8 * q + r] = 0.0
            compliance[at + 8 * q + r] = block[8 * q + r]
    invert6(compliance, at)


@njit(cache=True, nogil=True)
def add_geometric(x, raw, w, j, lower, at):  # type: ignore[no-untyped-def]
    """The geometric stiffness of a turn: a force on a lever arm holds it where it draws outward.

    The second derivative along R(1) = exp(w x) R is sym(sum of r gᵀ) - (sum of r.g) I over the columns r of
    R and g of the gradient, that of E_rot left out, since no turn changes it. Of it the positive part is
    taken: a force inward makes a turn easier, but the matrix has to stay definite.
    """
    g = 16 * j
    a = np.zeros((3, 3))
    for c in range(3):
        for d in range(3):
            dot = -1.0 if c == d else 0.0
            for k in range(3):
                dot += x[g + 4 * c + k] * x[g + 4 * d + k]
            # The part of E_rot's gradient, 4 w R (RᵀR - I), column c.
            for r in range(3):
                for k in range(3):
                    a[r, k] -= 4.0 * w * x[g + 4 * c + r] * x[g + 4 * d + k] * dot
        for r in range(3):
            for k in range(3):
                a[r, k] += x[g + 4 * c + r] * raw[g + 4 * c + k]
    trace = a[0, 0] + a[1, 1] + a[2, 2]
    # Half of it, as of everything in the matrix.
    for r in range(3):
        for k in range(r):
            a[r, k] = a[k, r] = 0.25 * (a[r, k] + a[k, r])
        a[r, r] = 0.5 * (a[r, r] - trace)
    _keep_positive(a)
    for r in range(3):
        for k in range(r + 1):
            lower[at + 8 * r + k] += a[r, k]


@njit(cache=True, nogil=True)
def _keep_positive(a):  # type: ignore[no-untyped-def]
    """Replace the symmetric ``a`` (3, 3) by its positive part (Jacobi's rotations)."""
    v = np.eye(3)
    for sweep in range(12):
        p, q = sweep % 3, (sweep + 1) % 3
        if abs(a[p, q]) < 1e-12:
            continue
        lean = (a[q, q] - a[p, p]) / (2.0 * a[p, q])
        t = (1.0 if lean >= 0.0 else -1.0) / (abs(lean) + np.sqrt(lean * lean + 1.0))
        c = 1.0 / np.sqrt(t * t + 1.0)
        s = t * c
        for k in range(3):
            a[k, p], a[k, q] = c * a[k, p] - s * a[k, q], s * a[k, p] + c * a[k, q]
        for k in range(3):
            a[p, k], a[q, k] = c * a[p, k] - s * a[q, k], s * a[p, k] + c * a[q, k]
        for k in range(3):
            v[k, p], v[k, q] = c * v[k, p] - s * v[k, q], s * v[k, p] + c * v[k, q]
    x, y, z = max(a[0, 0], 0.0), max(a[1, 1], 0.0), max(a[2, 2], 0.0)
    for r in range(3):
        for k in range(3):
            a[r, k] = v[r, 0] * x * v[k, 0] + v[r, 1] * y * v[k, 1] + v[r, 2] * z * v[k, 2]


@njit(cache=True, nogil=True)
def stretch_block(linear, held, at, w, room, out):  # type: ignore[no-untyped-def]
    """``out`` (6 rows of 8, the lower half) takes half the second derivative by a node's stretch S.

    With G = RᵀR and U the sum of w u uᵀ over the arms u that E_reg and E_con hold, R(1) = R (I + S) adds
    w |S G + G S|^2 + 2 w (G - I).(S G S) to E_rot, and tr(S G S U) to the others. Where a node is pressed so
    that this is not positive, the Gauss-Newton part stands in.
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
            square[c, d] = (
                2.0 * w * (gram[c, 0] * gram[0, d] + gram[c, 1] * gram[1, d] + gram[c, 2] * gram[2, d])
            )
    for attempt in range(2):
        for c in range(3):
            for d in range(3):
                z[c, d] = held[at + 3 * c + d] + 2.0 * w * gram[c, d]
                if attempt == 0:
                    z[c, d] += 2.0 * w * (gram[c, d] - (1.0 if c == d else 0.0))
        for p in range(6):
            for q in range(p + 1):
                total = 0.1 * w + 1e-9 if p == q else 0.0
                for first in range(1 if p < 3 else 2):
                    a, b = _ENTRIES[p][first], _ENTRIES[p][1 - first]
                    for second in range(1 if q < 3 else 2):
                        c, d = _ENTRIES[q][second], _ENTRIES[q][1 - second]
                        # tr(E X E' Y) of E = e_a e_bᵀ and E' = e_c e_dᵀ is X_bc Y_da.
                        if d == a:
                            total += square[b, c]
                        total += 0.5 * (gram[b, c] * z[d, a] + gram[d, a] * z[b, c])
                out[8 * p + q] = total
        for i in range(SIZE):
            out[SIZE + i] = out[i]
        if invert6(out, SIZE):
            return


@njit(cache=True, nogil=True)
def invert6(m, at):  # type: ignore[no-untyped-def]
    """Replace the symmetric 6x6 matrix at ``at``, of which the lower half is read, by its inverse."""
    block = m[at : at + SIZE]
    if not invert_factor(block):
        return False
    for r in range(6):
        for c in range(r, 6):
            total = np.float32(0.0)
            for k in range(c, 6):
                total += block[8 * k + r] * block[8 * k + c]
            block[8 * r + c] = total
        for c in range(r):
            block[8 * r + c] = block[8 * c + r]
    return True
