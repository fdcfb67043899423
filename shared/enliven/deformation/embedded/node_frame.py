"""Conversion of steps and forces to node frames: the rotation, stretch and translation of each node.

The state of a node, R and its position, has twelve numbers. A step also has twelve numbers: a rotation w, a
translation, and a symmetric stretch S, with dR = (w x R) + R S. These numbers are relative to the node. If
the node rotates, the columns of R change, but these numbers stay the same. So the step pairs of L-BFGS remain
valid after a step. In the unknowns x they would become invalid, because x stores a rotation as changes of the
columns of R, and these columns rotate in later steps. With step pairs in x, only the first step of a frame
has much effect.

A node has sixteen numbers: w and a 0, the translation and a 0, S00 S11 S22 and a 0, S01 S02 S12 and a 0.
"""

from __future__ import annotations

from enliven.kernels import njit
from enliven.lanes import cross4, fma4, load4, narrowed4, splat4, store4, storeq, total4, totals4, widened4


@njit(cache=True, nogil=True)
def force_in_node_frame(x, gradient, out):
    """Converts the gradient dE/dx (16 N,) at ``x`` to node frames, into ``out`` (16 N,)."""
    for at in range(0, x.shape[0], 16):
        a, b, c = load4(x, at), load4(x, at + 4), load4(x, at + 8)
        u, v, w = load4(gradient, at), load4(gradient, at + 4), load4(gradient, at + 8)
        storeq(out, at, narrowed4(cross4(a, u) + cross4(b, v) + cross4(c, w)))
        storeq(out, at + 4, narrowed4(load4(gradient, at + 12)))
        storeq(out, at + 8, narrowed4(totals4(a * u, b * v, c * w)))
        storeq(out, at + 12, narrowed4(totals4(a * v + b * u, a * w + c * u, b * w + c * v)))


@njit(cache=True, nogil=True)
def step_in_node_frame(here, own, length, x):
    """Sets ``x`` to the state ``here``, moved by ``length`` times the step ``own``: R(1) = Q R (I + S + S S /
    2).

    Q is the rotation by w in Cayley's formula: exp(w x) to second order, without any stretch. (A straight
    step by ten degrees would stretch a node by 1.5 %, and E_rot would stop it.) The stretch is exp(S) to
    second order. Its eigenvalues are at least a half, so no step turns a node inside out.
    """
    half, twice = splat4(0.5 * length), splat4(2.0)
    for at in range(0, x.shape[0], 16):
        h = half * widened4(own, at)
        scale = twice * splat4(1.0 / (1.0 + total4(h * h)))
        a, b, c = length * own[at + 8], length * own[at + 9], length * own[at + 10]
        d, e, f = length * own[at + 12], length * own[at + 13], length * own[at + 14]
        s00 = 1.0 + a + 0.5 * (a * a + d * d + e * e)
        s11 = 1.0 + b + 0.5 * (d * d + b * b + f * f)
        s22 = 1.0 + c + 0.5 * (e * e + f * f + c * c)
        s01 = d + 0.5 * (a * d + d * b + e * f)
        s02 = e + 0.5 * (a * e + d * f + e * c)
        s12 = f + 0.5 * (d * e + b * f + f * c)
        p = _rotated_vector(h, scale, load4(here, at))
        q = _rotated_vector(h, scale, load4(here, at + 4))
        r = _rotated_vector(h, scale, load4(here, at + 8))
        store4(x, at, fma4(s00, p, fma4(s01, q, splat4(s02) * r)))
        store4(x, at + 4, fma4(s01, p, fma4(s11, q, splat4(s12) * r)))
        store4(x, at + 8, fma4(s02, p, fma4(s12, q, splat4(s22) * r)))
        store4(x, at + 12, fma4(length, widened4(own, at + 4), load4(here, at + 12)))


@njit(cache=True, nogil=True)
def _rotated_vector(h, scale, v):
    """Returns v, rotated by (I - K)^-1 (I + K) = I + s (K + K K). K is the matrix h x, and s = 2 / (1 +
    |h|^2)."""
    across = cross4(h, v)
    return fma4(scale, across + cross4(h, across), v)


@njit(cache=True, nogil=True)
def state_from_unknowns(x, order, linear, positions):
    """Converts the unknowns (N, 4, 4) to linear parts and positions, in the order of the graph's nodes."""
    for n in range(len(order)):
        node = order[n]
        for a in range(3):
            positions[node, a] = x[n, 3, a]
            for c in range(3):
                linear[node, a, c] = x[n, c, a]
