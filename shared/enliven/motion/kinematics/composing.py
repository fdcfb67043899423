"""Compiled loops: the rotations of bones from samples of their layers, and the resulting joint positions."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.motion.kinematics.quaternions import between, conj, load, mul, store, turn


@njit(cache=True, nogil=True)
def own_turns(knots, knot, part, fixed, first, terms, inverse, out):
    """Fills ``out`` (T, N, 4) with the product of the terms ``first[j]`` to ``first[j + 1]`` of each bone j.

    Term m >= 0 is the slerp of ``knots`` (T, K, 4) at ``part[m]`` from ``knot[m]`` to the next; term m < 0 is
    the rotation ``fixed[-1 - m]``. Terms with ``inverse`` are inverted.
    """
    taken = np.empty((len(knot), 4))
    for t in range(len(knots)):
        for m in range(len(knot)):
            k = knot[m]
            store(taken, m, between(load(knots[t], k), load(knots[t], k + 1), part[m]))
        for j in range(len(first) - 1):
            total = (1.0, 0.0, 0.0, 0.0)
            for i in range(first[j], first[j + 1]):
                m = terms[i]
                q = load(taken, m) if m >= 0 else load(fixed, -1 - m)
                total = mul(total, conj(q) if inverse[i] else q)
            store(out[t], j, total)


@njit(cache=True, nogil=True)
def compose(parents, vectors, modeling, own, root, turns, joints):
    """Computes D_j = D_parent m_j a_j into ``turns`` (T, N, 4), and the joint positions (T, N, 3).

    ``vectors`` (T or 1, N, 3) lead from each parent to its joint before the bone rotates.
    """
    for t in range(len(own)):
        way = vectors[min(t, len(vectors) - 1)]
        for j in range(len(parents)):
            q = mul(load(modeling, j), load(own[t], j))
            if parents[j] < 0:
                store(turns[t], j, q)
                joints[t, j, 0], joints[t, j, 1], joints[t, j, 2] = root[t, 0], root[t, 1], root[t, 2]
                continue
            q = mul(load(turns[t], parents[j]), q)
            store(turns[t], j, q)
            x, y, z = turn(q, way[j, 0], way[j, 1], way[j, 2])
            joints[t, j, 0] = joints[t, parents[j], 0] + x
            joints[t, j, 1] = joints[t, parents[j], 1] + y
            joints[t, j, 2] = joints[t, parents[j], 2] + z


@njit(cache=True, nogil=True)
def upright(turns):
    """Returns (N, 4) the same rotations with w >= 0."""
    out = np.empty(turns.shape)
    for j in range(len(turns)):
        q = load(turns, j)
        store(out, j, q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3]))
    return out
