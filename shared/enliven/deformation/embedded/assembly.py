"""Assembles the matrix of :mod:`enliven.deformation.embedded.preconditioner`, term by term."""

from __future__ import annotations

import numpy as np

from enliven.deformation.embedded.block_cholesky import SIZE
from enliven.deformation.embedded.node_blocks import (
    add_geometric,
    compute_stretch_coupling,
    eliminate_stretch,
    leave_coupled,
    stretch_block,
)
from enliven.kernels import njit
from enliven.lanes import fma8, load8, store8


@njit(cache=True, nogil=True)
def rotate_by_node(frames, node, v, out):
    """Rotates the vector v (3,) by the rotation of ``node``, into ``out`` (3,)."""
    at = 9 * node
    for a in range(3):
        out[a] = frames[at + a] * v[0] + frames[at + 3 + a] * v[1] + frames[at + 6 + a] * v[2]


@njit(cache=True, nogil=True)
def _add_cross(lower, at, v, w):
    """Adds w [v]x (the cross product matrix of v) to the 3x3 matrix at index ``at`` of ``lower``."""
    lower[at + 1] -= w * v[2]
    lower[at + 2] += w * v[1]
    lower[at + 8] += w * v[2]
    lower[at + 10] -= w * v[0]
    lower[at + 16] -= w * v[1]
    lower[at + 17] += w * v[0]


@njit(cache=True, nogil=True)
def _add_end(lower, at, v, w, sign):
    """Adds the diagonal block of one end of an edge, given its lever arm ``v``.

    The translation is added for both directions of the edge.
    """
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    for r in range(3):
        for c in range(r + 1):
            lower[at + 8 * r + c] -= w * v[r] * v[c]
        lower[at + 9 * r] += w * square
        lower[at + 9 * (r + 3)] += 2 * w
    _add_cross(lower, at + 24, v, sign * w)


@njit(cache=True, nogil=True)
def assemble_matrix(x, t, planes, raw, s, ridge):
    """Computes the matrix at the state x into ``s.lower``, and the inverse stretch blocks into
    ``s.compliance``."""
    lower, start, frames = s.lower, s.start, s.linear
    lower[:] = np.float32(0.0)
    s.held[:] = 0.0
    s.first[:] = 0.0
    for j in range(start.shape[0] - 1):
        for r in range(6):
            lower[SIZE * start[j] + 9 * r] = ridge
    add_geometric(x, raw, t.stretch, start, lower)
    _add_edges(t, s)
    for m in range(t.rigid.shape[0]):
        _add_rigid(lower, start, frames, t, s.edge_block, m)
    _add_points(t.nodes, t.rows, t.pulls, s)
    compute_stretch_coupling(s.linear, s.held, s.first, s.coupling)
    if planes.nodes.shape[0] > 0:
        _add_planes(planes, s)
    _compute_stretch_blocks(s, t.stretch)


@njit(cache=True, nogil=True)
def _compute_stretch_blocks(s, w):
    """Computes each node's inverse stretch block, and its coupling to rotation and translation.

    Terms that would make one of the two blocks indefinite are skipped.
    """
    # Copy the fields into local variables. Otherwise reading a field of the structure takes as long as
    # computing a block.
    start, linear, held, lower = s.start, s.linear, s.held, s.lower
    coupling, coupled, compliance = s.coupling, s.coupled, s.compliance
    room, block, inverse = np.empty((3, 3, 3)), np.zeros(SIZE, np.float32), np.zeros(SIZE, np.float32)
    for j in range(start.shape[0] - 1):
        own, at = SIZE * start[j], SIZE * j
        stretch_block(linear, held, 9 * j, w[j], 1.0, room, block)
        if eliminate_stretch(lower, own, coupling, coupled, compliance, at, block, inverse):
            continue
        stretch_block(linear, held, 9 * j, w[j], 0.0, room, block)
        if not eliminate_stretch(lower, own, coupling, coupled, compliance, at, block, inverse):
            leave_coupled(coupling, coupled, compliance, at, block)


@njit(cache=True, nogil=True)
def _add_edges(t, s):
    """Adds the term E_reg, which couples the translations and rotations of an edge's two ends."""
    lower, start, frames, stiff, first = s.lower, s.start, s.linear, s.held, s.first
    a, b = np.empty(3), np.empty(3)
    for e in range(t.edges.shape[0]):
        i, j, w, d = t.edges[e, 0], t.edges[e, 1], t.smooth[e], t.offsets[e]
        rotate_by_node(frames, i, d, a)
        rotate_by_node(frames, j, d, b)
        _add_end(lower, SIZE * start[i], a, w, -1.0)
        _add_end(lower, SIZE * start[j], b, w, 1.0)
        at = SIZE * s.edge_block[e]
        # Fill the rows of the node that is eliminated later: [[0, -a x], [-b x, -2]] for node i, and the
        # transpose for node j.
        up, down = (a, b) if i > j else (b, a)
        sign = -w if i > j else w
        _add_cross(lower, at + 3, up, sign)
        _add_cross(lower, at + 24, down, sign)
        for r in range(3):
            lower[at + 27 + 9 * r] -= 2 * w
            first[3 * i + r] += w * d[r]
            first[3 * j + r] -= w * d[r]
            for c in range(3):
                stiff[9 * i + 3 * r + c] += w * d[r] * d[c]
                stiff[9 * j + 3 * r + c] += w * d[r] * d[c]


@njit(cache=True, nogil=True)
def _add_rigid(lower, start, frames, t, edge_block, m):
    """Adds the term E_rig of one edge: the rotations of both ends, 2 |w_j - w_k|^2, and their
    translations."""
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
def _point_jacobian(frames, nodes, rows, m, arms, out):
    """Computes the Jacobian (4, 3, 8) of point ``m`` by the rotation and translation of each of its four
    nodes. The rotation's part is the cross product matrix of the arm -u, and the translation's part is the
    node's weight.
    """
    for k in range(4):
        share = rows[m, k, 3]
        if share == 0.0:
            continue
        rotate_by_node(frames, nodes[m, k], rows[m, k], arms)
        x, y, z = np.float32(arms[0]), np.float32(arms[1]), np.float32(arms[2])
        out[k, 0, 1], out[k, 0, 2] = z, -y
        out[k, 1, 0], out[k, 1, 2] = -z, x
        out[k, 2, 0], out[k, 2, 1] = y, -x
        out[k, 0, 3] = out[k, 1, 4] = out[k, 2, 5] = share


@njit(cache=True, nogil=True)
def _add_points(nodes, rows, pulls, s):
    """Adds the term E_con, which couples the nodes of each point."""
    arms, jacobian = np.empty(3), np.zeros((4, 3, 8), np.float32)
    flat = jacobian.reshape(-1)
    for m in range(nodes.shape[0]):
        if not pulls[m] > 0.0:
            continue
        _point_jacobian(s.linear, nodes, rows, m, arms, jacobian)
        pull = np.float32(pulls[m])
        pair = 0
        for a in range(4):
            for b in range(a + 1):
                if rows[m, a, 3] != 0.0 and rows[m, b, 3] != 0.0:
                    _add_outer(s.lower, SIZE * s.pair_block[m, pair], flat, 24 * a, 24 * b, pull)
                pair += 1
        _add_stretch(s.held, nodes, rows, m, pulls[m])
        for k in range(4):
            for r in range(3):
                s.first[3 * nodes[m, k] + r] += pulls[m] * rows[m, k, 3] * rows[m, k, r]


@njit(cache=True, nogil=True)
def _add_stretch(stiff, nodes, rows, m, w):
    for k in range(4):
        for r in range(3):
            for c in range(3):
                stiff[9 * nodes[m, k] + 3 * r + c] += w * rows[m, k, r] * rows[m, k, c]


@njit(cache=True, nogil=True)
def _add_outer(lower, block, j, first, second, w):
    """Adds w Jaᵀ Jb to a block; J (3, 8) = [[0, z, -y, c, 0, 0], [-z, 0, x, 0, c, 0], [y, -x, 0, 0, 0,
    c]].
    """
    a, b, c = load8(j, second), load8(j, second + 8), load8(j, second + 16)
    x, y, z, share = w * j[first + 10], w * j[first + 16], w * j[first + 1], w * j[first + 3]
    store8(lower, block, fma8(-z, b, fma8(y, c, load8(lower, block))))
    store8(lower, block + 8, fma8(z, a, fma8(-x, c, load8(lower, block + 8))))
    store8(lower, block + 16, fma8(-y, a, fma8(x, b, load8(lower, block + 16))))
    store8(lower, block + 24, fma8(share, a, load8(lower, block + 24)))
    store8(lower, block + 32, fma8(share, b, load8(lower, block + 32)))
    store8(lower, block + 40, fma8(share, c, load8(lower, block + 40)))


@njit(cache=True, nogil=True)
def _add_planes(planes, s):
    """Adds the term of the planes. Each plane gives a row of six numbers per node.

    The pattern does not contain the couplings by planes. If it does not couple two nodes, their product is
    replaced by its bound 2 ab <= a^2 + b^2, so the matrix is never smaller than the exact one.
    """
    arms, jacobian = np.empty(3), np.zeros((4, 3, 8), np.float32)
    line = np.zeros((4, 6))
    for m in range(planes.nodes.shape[0]):
        w = planes.weights[m]
        if not w > 0.0:
            continue
        _point_jacobian(s.linear, planes.nodes, planes.rows, m, arms, jacobian)
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
        _add_stretch(s.held, planes.nodes, planes.rows, m, w)


@njit(cache=True, nogil=True)
def _add_lines(s, i, j, u, v, w):
    """Adds w u vᵀ to the block of the nodes i >= j, or its bound if the pattern does not couple them."""
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
