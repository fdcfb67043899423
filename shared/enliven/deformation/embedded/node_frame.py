"""Steps and forces in node frames: how each node turns, stretches and shifts.

A node's R and position have twelve numbers; so has a step: a turn w, a shift, and a symmetric stretch S, with
dR = (w x R) + R S. These numbers are relative to the node: where it has turned, its columns are others and
the numbers the same. L-BFGS' step pairs therefore hold after a step too. In the plain unknowns they do not,
since a turn there is bound to a direction that turns away: steps after the first one were nearly without
effect.

Sixteen numbers a node: w and a 0, the shift and a 0, S00 S11 S22 and a 0, S01 S02 S12 and a 0.
"""

from __future__ import annotations

from enliven.kernels import njit


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
def step_from_node_frame(x, own, way, bend):  # type: ignore[no-untyped-def]
    """Kernel: ``way`` takes the step ``own`` in the plain unknowns, and ``bend`` how it goes on to second
    order, half of w x (w x R).

    Without the latter a turn by ten degrees would stretch a node by 1.5 %, and E_rot would stop the step.
    """
    for j in range(x.shape[0] // 16):
        at = 16 * j
        u, v, w = own[at], own[at + 1], own[at + 2]
        square = u * u + v * v + w * w
        for c in range(3):
            to = at + 4 * c
            r0, r1, r2 = x[to], x[to + 1], x[to + 2]
            along = u * r0 + v * r1 + w * r2
            bend[to] = 0.5 * (u * along - r0 * square)
            bend[to + 1] = 0.5 * (v * along - r1 * square)
            bend[to + 2] = 0.5 * (w * along - r2 * square)
            bend[to + 3] = 0.0
            s0 = own[at + 8] if c == 0 else (own[at + 12] if c == 1 else own[at + 13])
            s1 = own[at + 12] if c == 0 else (own[at + 9] if c == 1 else own[at + 14])
            s2 = own[at + 13] if c == 0 else (own[at + 14] if c == 1 else own[at + 10])
            way[to] = v * r2 - w * r1 + s0 * x[at] + s1 * x[at + 4] + s2 * x[at + 8]
            way[to + 1] = w * r0 - u * r2 + s0 * x[at + 1] + s1 * x[at + 5] + s2 * x[at + 9]
            way[to + 2] = u * r1 - v * r0 + s0 * x[at + 2] + s1 * x[at + 6] + s2 * x[at + 10]
            way[to + 3] = 0.0
        for a in range(4):
            way[at + 12 + a] = own[at + 4 + a]
            bend[at + 12 + a] = 0.0
