"""The energy of KinÊtre's embedded deformation (eq. 3-8): value, gradient, and its course along a line.

The unknowns are x (N, 4, 3): x[j, c] is column c of R_j for c < 3, and x[j, 3] is where node j has moved to,
g_j + t_j. In these, the residuals of E_reg and E_con are linear, and the same for each coordinate; those of
E_rot and E_rig are quadratic. So the energy along any line is a polynomial of degree four, known exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from enliven.arrays import Float, Int32

ROT, REG, CON, RIG = 0, 1, 2, 3


class Terms(NamedTuple):
    """What the energy is made of, beside the unknowns.

    Attributes:
        edges: (E, 2) int32 nodes i, j.
        offsets: (E, 3) g_j - g_i.
        rigid: (K,) int32 the edges of E_rig.
        turning: 1.0 where the translations of E_rig are compared in the middle of the edge, which any rigid
            motion leaves at zero; 0.0 for eq. 7 as printed, |t_k - t_j|^2.
        nodes: (L, 4) int32 the nodes of each constraint.
        rows: (L, 4, 4) the constraint's coefficients: w (p - g) and w for each of its nodes.
        targets: (L, 3) q_l.
        pulls: (L,) the weight of each constraint, 0 where it is lost.
        weights: (4,) w_rot, w_reg, w_con, w_rig.
    """

    edges: Int32
    offsets: Float
    rigid: Int32
    turning: float
    nodes: Int32
    rows: Float
    targets: Float
    pulls: Float
    weights: Float


@njit(cache=True, nogil=True, fastmath=True)
def gradient(x, t, out):  # type: ignore[no-untyped-def]
    """Kernel: ``out`` (N, 4, 3) takes dE/dx; returns (w E_rot, w E_reg, w E_con, w E_rig, E)."""
    out[:] = 0.0
    rot = _rotation_gradient(x, t.weights[ROT], out)
    reg = _smoothness_gradient(x, t.edges, t.offsets, t.weights[REG], out)
    con = _constraint_gradient(x, t.nodes, t.rows, t.targets, t.pulls, t.weights[CON], out)
    rig = _rigidity_gradient(x, t.edges, t.offsets, t.rigid, t.turning, t.weights[RIG], out)
    return rot, reg, con, rig, rot + reg + con + rig


@njit(cache=True, nogil=True, fastmath=True)
def _rotation_gradient(x, w, out):  # type: ignore[no-untyped-def]
    """E_rot, eq. 3: |RᵀR - I|^2; dE/dR = 4 R (RᵀR - I)."""
    energy = 0.0
    for j in range(x.shape[0]):
        for c in range(3):
            for d in range(3):
                s = x[j, c, 0] * x[j, d, 0] + x[j, c, 1] * x[j, d, 1] + x[j, c, 2] * x[j, d, 2]
                if c == d:
                    s -= 1.0
                energy += s * s
                for a in range(3):
                    out[j, c, a] += 4 * w * s * x[j, d, a]
    return w * energy


@njit(cache=True, nogil=True, fastmath=True)
def _smoothness_gradient(x, edges, offsets, w, out):  # type: ignore[no-untyped-def]
    """E_reg, eq. 4, both ways of every edge: |R_i (g_j - g_i) + p_i - p_j|^2."""
    energy = 0.0
    for e in range(edges.shape[0]):
        i, j = edges[e, 0], edges[e, 1]
        d0, d1, d2 = offsets[e, 0], offsets[e, 1], offsets[e, 2]
        for a in range(3):
            apart = x[i, 3, a] - x[j, 3, a]
            forth = d0 * x[i, 0, a] + d1 * x[i, 1, a] + d2 * x[i, 2, a] + apart
            back = -(d0 * x[j, 0, a] + d1 * x[j, 1, a] + d2 * x[j, 2, a]) - apart
            energy += forth * forth + back * back
            f, b = 2 * w * forth, 2 * w * back
            out[i, 0, a] += f * d0
            out[i, 1, a] += f * d1
            out[i, 2, a] += f * d2
            out[j, 0, a] -= b * d0
            out[j, 1, a] -= b * d1
            out[j, 2, a] -= b * d2
            out[i, 3, a] += f - b
            out[j, 3, a] += b - f
    return w * energy


@njit(cache=True, nogil=True, fastmath=True)
def _constraint_gradient(x, nodes, rows, targets, pulls, w, out):  # type: ignore[no-untyped-def]
    """E_con, eq. 5: |phi(p) - q|^2, times the constraint's own weight."""
    energy = 0.0
    for m in range(nodes.shape[0]):
        pull = w * pulls[m]
        if pull == 0.0:
            continue
        for a in range(3):
            r = -targets[m, a]
            for k in range(4):
                n = nodes[m, k]
                for c in range(4):
                    r += rows[m, k, c] * x[n, c, a]
            energy += pull * r * r
            for k in range(4):
                n = nodes[m, k]
                for c in range(4):
                    out[n, c, a] += 2 * pull * r * rows[m, k, c]
    return energy


@njit(cache=True, nogil=True, fastmath=True)
def _rigidity_gradient(x, edges, offsets, rigid, turning, w, out):  # type: ignore[no-untyped-def]
    """E_rig, eq. 7: |R_kᵀR_j - I|^2 and the translations' difference."""
    energy = 0.0
    for m in range(rigid.shape[0]):
        e = rigid[m]
        j, k = edges[e, 0], edges[e, 1]
        for c in range(3):
            for d in range(3):
                s = x[k, c, 0] * x[j, d, 0] + x[k, c, 1] * x[j, d, 1] + x[k, c, 2] * x[j, d, 2]
                if c == d:
                    s -= 1.0
                energy += s * s
                for a in range(3):
                    out[k, c, a] += 2 * w * s * x[j, d, a]
                    out[j, d, a] += 2 * w * s * x[k, c, a]
        for a in range(3):
            r = _slip(x, offsets[e], j, k, a, turning) + (1 - turning) * offsets[e, a]
            energy += r * r
            out[j, 3, a] += 2 * w * r
            out[k, 3, a] -= 2 * w * r
            for c in range(3):
                out[j, c, a] += w * r * turning * offsets[e, c]
                out[k, c, a] += w * r * turning * offsets[e, c]
    return w * energy


@njit(cache=True, nogil=True, inline="always")
def _slip(x, offset, j, k, a, turning):  # type: ignore[no-untyped-def]
    """How far apart j and k move the middle of their edge (turning 1), without the constant part (0)."""
    r = x[j, 3, a] - x[k, 3, a]
    for c in range(3):
        r += 0.5 * turning * offset[c] * (x[j, c, a] + x[k, c, a])
    return r


@njit(cache=True, nogil=True, fastmath=True)
def along_line(x, d, t):  # type: ignore[no-untyped-def]
    """Kernel: the coefficients (c0..c4) of E(x + s d) = c0 + c1 s + c2 s^2 + c3 s^3 + c4 s^4."""
    c = np.zeros(5)
    for j in range(x.shape[0]):
        _frame_line(x[j], d[j], x[j], d[j], t.weights[ROT], c)
    for e in range(t.edges.shape[0]):
        i, j = t.edges[e, 0], t.edges[e, 1]
        for a in range(3):
            apart, dapart = x[i, 3, a] - x[j, 3, a], d[i, 3, a] - d[j, 3, a]
            forth, back, dforth, dback = apart, -apart, dapart, -dapart
            for m in range(3):
                forth += t.offsets[e, m] * x[i, m, a]
                back -= t.offsets[e, m] * x[j, m, a]
                dforth += t.offsets[e, m] * d[i, m, a]
                dback -= t.offsets[e, m] * d[j, m, a]
            w = t.weights[REG]
            c[0] += w * (forth * forth + back * back)
            c[1] += 2 * w * (forth * dforth + back * dback)
            c[2] += w * (dforth * dforth + dback * dback)
    _constraint_line(x, d, t.nodes, t.rows, t.targets, t.pulls, t.weights[CON], c)
    for m in range(t.rigid.shape[0]):
        e = t.rigid[m]
        j, k = t.edges[e, 0], t.edges[e, 1]
        _frame_line(x[k], d[k], x[j], d[j], t.weights[RIG], c)
        for a in range(3):
            r = _slip(x, t.offsets[e], j, k, a, t.turning) + (1 - t.turning) * t.offsets[e, a]
            dr = _slip(d, t.offsets[e], j, k, a, t.turning)
            c[0] += t.weights[RIG] * r * r
            c[1] += 2 * t.weights[RIG] * r * dr
            c[2] += t.weights[RIG] * dr * dr
    return c


@njit(cache=True, nogil=True, fastmath=True, inline="always")
def _frame_line(xk, dk, xj, dj, w, out):  # type: ignore[no-untyped-def]
    """Adds w |(R_k + s D_k)ᵀ(R_j + s D_j) - I|^2 as a polynomial in s."""
    for c in range(3):
        for m in range(3):
            p = xk[c, 0] * xj[m, 0] + xk[c, 1] * xj[m, 1] + xk[c, 2] * xj[m, 2]
            if c == m:
                p -= 1.0
            q = dk[c, 0] * xj[m, 0] + dk[c, 1] * xj[m, 1] + dk[c, 2] * xj[m, 2]
            q += xk[c, 0] * dj[m, 0] + xk[c, 1] * dj[m, 1] + xk[c, 2] * dj[m, 2]
            r = dk[c, 0] * dj[m, 0] + dk[c, 1] * dj[m, 1] + dk[c, 2] * dj[m, 2]
            out[0] += w * p * p
            out[1] += 2 * w * p * q
            out[2] += w * (q * q + 2 * p * r)
            out[3] += 2 * w * q * r
            out[4] += w * r * r


@njit(cache=True, nogil=True, fastmath=True)
def _constraint_line(x, d, nodes, rows, targets, pulls, w, out):  # type: ignore[no-untyped-def]
    """Adds E_con along the line."""
    for m in range(nodes.shape[0]):
        pull = w * pulls[m]
        if pull == 0.0:
            continue
        for a in range(3):
            r, dr = -targets[m, a], 0.0
            for k in range(4):
                n = nodes[m, k]
                for c in range(4):
                    r += rows[m, k, c] * x[n, c, a]
                    dr += rows[m, k, c] * d[n, c, a]
            out[0] += pull * r * r
            out[1] += 2 * pull * r * dr
            out[2] += pull * dr * dr


@njit(cache=True, nogil=True)
def best_step(c):  # type: ignore[no-untyped-def]
    """The s > 0 of a minimum of c0 + ... + c4 s^4 (c1 < 0) that lies below c0; 0 if none is found."""
    high = 1.0
    for _ in range(60):
        if c[1] + high * (2 * c[2] + high * (3 * c[3] + high * 4 * c[4])) >= 0.0:
            break
        high *= 2.0
    for _ in range(40):
        low, top = 0.0, high
        s = min(1.0, 0.5 * high)
        for _ in range(60):
            slope = c[1] + s * (2 * c[2] + s * (3 * c[3] + s * 4 * c[4]))
            if slope < 0.0:
                low = s
            else:
                top = s
            bend = 2 * c[2] + s * (6 * c[3] + s * 12 * c[4])
            after = s - slope / bend if bend > 0.0 else 0.5 * (low + top)
            if not low < after < top:
                after = 0.5 * (low + top)
            if abs(after - s) <= 1e-6 * s:
                s = after
                break
            s = after
        if s * (c[1] + s * (c[2] + s * (c[3] + s * c[4]))) < 0.0:
            return s
        high = 0.5 * s
    return 0.0
