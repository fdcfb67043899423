"""Kernels that compute the rotations of bones from samples of their layers, and the resulting joint
positions."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven.motion.kinematics.quaternions import between, conj, load, mul, store, turn


@njit(cache=True, nogil=True)
def own_turns(knots, knot, part, fixed, first, terms, inverse, out):
    """Computes for each bone j the product of the terms ``first[j]`` to ``first[j + 1]``, and writes
    it to ``out`` (T, N, 4).

    A term m with ``knot[m]`` >= 0 is the slerp of ``knots`` (T, K, 4) from ``knot[m]`` to the next knot, at
    the fraction ``part[m]``. If ``knot[m]`` = k < 0, the term is the rotation ``fixed[-1 - k]``. Terms with
    ``inverse`` are inverted.
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
    """Computes the world rotations D_j = D_parent m_j a_j (``turns``, (T, N, 4)) and the joint
    positions (``joints``, (T, N, 3), metres).

    ``vectors`` (T or 1, N, 3) are the vectors from each parent to its joint before the bone rotates, metres.
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
