"""Steps and forces in node frames: how each node turns, stretches and shifts.

A node's R and position have twelve numbers; so has a step: a turn w, a shift, and a symmetric stretch S, with
dR = (w x R) + R S. These numbers are relative to the node: where it has turned, its columns are others and
the numbers the same. L-BFGS' step pairs therefore hold after a step too. In the plain unknowns they do not,
since a turn there is bound to a direction that turns away: steps after the first one were nearly without
effect.

Sixteen numbers a node: w and a 0, the shift and a 0, S00 S11 S22 and a 0, S01 S02 S12 and a 0.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.lanes import fma4, load4, splat4, store4, widened4


@njit(cache=True, nogil=True)
def force_in_node_frame(x, gradient, out):  # type: ignore[no-untyped-def]
    """Kernel: ``out`` (16 N,) takes dE/dx (16 N,) as the derivative in the node frames at ``x``."""
    for j in range(x.shape[0] // 16):
        at = 16 * j
        u = v = w = 0.0
        for c in range(0, 12, 4):
            r0, r1, r2 = x[at + c], x[at + c + 1], x[at + c + 2]
            g0, g1, g2 = gradient[at + c], gradient[at + c + 1], gradient[at + c + 2]
            u += r1 * g2 - r2 * g1
            v += r2 * g0 - r0 * g2
            w += r0 * g1 - r1 * g0
        out[at], out[at + 1], out[at + 2], out[at + 3] = u, v, w, 0.0
        for a in range(4):
            out[at + 4 + a] = gradient[at + 12 + a]
        for c in range(3):
            d = (c + 1) % 3
            same = both = 0.0
            for a in range(3):
                same += x[at + 4 * c + a] * gradient[at + 4 * c + a]
                both += x[at + 4 * c + a] * gradient[at + 4 * d + a]
                both += x[at + 4 * d + a] * gradient[at + 4 * c + a]
            out[at + 8 + c] = same
            # S01, S12 and S02, in this order of c.
            out[at + (12 if c == 0 else (14 if c == 1 else 13))] = both
        out[at + 11] = out[at + 15] = 0.0


@njit(cache=True, nogil=True)
def step_in_node_frame(here, own, length, x):  # type: ignore[no-untyped-def]
    """Kernel: ``x`` takes ``here`` gone along ``length`` of the step: R(1) = Q R (I + S + S S / 2).

    Q is the rotation of Cayley's formula by the turn w: exp(w x) to second order, and without any stretch.
    A turn by ten degrees along a straight line would stretch a node by 1.5 %, and E_rot would stop the step.
    The stretch is exp(S) to second order, with eigenvalues from a half: no step turns a node inside out.
    """
    half, turn = 0.5 * length, np.zeros(12)
    for j in range(x.shape[0] // 16):
        at = 16 * j
        _cayley(half * own[at], half * own[at + 1], half * own[at + 2], turn)
        a, b, c = length * own[at + 8], length * own[at + 9], length * own[at + 10]
        d, e, f = length * own[at + 12], length * own[at + 13], length * own[at + 14]
        s00 = 1.0 + a + 0.5 * (a * a + d * d + e * e)
        s11 = 1.0 + b + 0.5 * (d * d + b * b + f * f)
        s22 = 1.0 + c + 0.5 * (e * e + f * f + c * c)
        s01 = d + 0.5 * (a * d + d * b + e * f)
        s02 = e + 0.5 * (a * e + d * f + e * c)
        s12 = f + 0.5 * (d * e + b * f + f * c)
        p, q, r = _turned(turn, here, at), _turned(turn, here, at + 4), _turned(turn, here, at + 8)
        store4(x, at, fma4(s00, p, fma4(s01, q, splat4(s02) * r)))
        store4(x, at + 4, fma4(s01, p, fma4(s11, q, splat4(s12) * r)))
        store4(x, at + 8, fma4(s02, p, fma4(s12, q, splat4(s22) * r)))
        store4(x, at + 12, fma4(length, widened4(own, at + 4), load4(here, at + 12)))


@njit(cache=True, nogil=True)
def _cayley(u, v, w, out):  # type: ignore[no-untyped-def]
    """``out`` takes the rotation (I - K)^-1 (I + K), K = (u, v, w) x: its columns, each in a row of four."""
    uu, vv, ww, uv, uw, vw = u * u, v * v, w * w, u * v, u * w, v * w
    scale = 2.0 / (1.0 + uu + vv + ww)
    out[0], out[1], out[2] = 1.0 - scale * (vv + ww), scale * (uv + w), scale * (uw - v)
    out[4], out[5], out[6] = scale * (uv - w), 1.0 - scale * (uu + ww), scale * (vw + u)
    out[8], out[9], out[10] = scale * (uw + v), scale * (vw - u), 1.0 - scale * (uu + vv)


@njit(cache=True, nogil=True)
def _turned(turn, x, at):  # type: ignore[no-untyped-def]
    """The three numbers of ``x`` at ``at`` times the matrix of the columns in ``turn``."""
    ahead = splat4(x[at + 2]) * load4(turn, 8)
    return fma4(x[at], load4(turn, 0), fma4(x[at + 1], load4(turn, 4), ahead))


@njit(cache=True, nogil=True)
def plain_state(x, order, linear, positions):  # type: ignore[no-untyped-def]
    """Kernel: the unknowns (N, 4, 4) as linear parts and positions, in the graph's own order."""
    for n in range(len(order)):
        node = order[n]
        for a in range(3):
            positions[node, a] = x[n, 3, a]
            for c in range(3):
                linear[node, a, c] = x[n, c, a]
