"""The normal equations of an articulated body, computed from sums per frame.

Consider a residual r of a point x that is fixed to a frame. If the point moves by dx, the residual changes by
n . dx, with a vector n. If the frame moves by the twist (v, w) about the world's origin, this change is phi .
(v, w), with the wrench

    phi = (n, x cross n),

and if a bone's length p moves the point by dx/dp, the change is l_p = n . dx/dp. So the terms of the fit add
only phi phi', r phi and the corresponding products with l to the sums of the frame. As phi is in the world
frame, the sums of an unknown are those of its frame plus those of all descendants. This is the method of
composite rigid bodies (Walker and Orin 1982). Two unknowns share the points of the frame farther from the
root. So the normal equations are gathered from the sums once, independent of the number of residuals.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.fit.structures import FrameSums

_TRANSLATION_DOFS = 3
"""Number of unknowns of the translation. Rotations follow, then lengths."""


@njit(cache=True, nogil=True)
def empty_sums(frames, lengths):
    """Returns zero sums for the given numbers of frames and lengths.

    The number of lengths is 0 if they are frozen.

    Returns (total (F, 6, 6), pull (F, 6), cross (F, 6, L), own (L, L), tug (L,)). The first three are
    weighted sums per frame of phi phi', r phi and phi l'. The last two are weighted sums over all frames of l
    l' and r l.
    """
    total, pull = np.zeros((frames, 6, 6)), np.zeros((frames, 6))
    own, tug = np.zeros((lengths, lengths)), np.zeros(lengths)
    return FrameSums(total, pull, np.zeros((frames, 6, lengths)), own, tug)


@njit(cache=True, nogil=True)
def add_direction_residual(sums, frame, normal, point, stretch, lengths_of, residual, weight):
    """Adds a residual along one direction to the sums.

    Args:
        sums: the sums, modified in place.
        frame: the frame to which the point is fixed.
        normal: (3,) n, world frame.
        point: (3,) metres, world frame.
        stretch: (L,) the residual's derivatives by the lengths; (0,) if they are frozen.
        lengths_of: (F, 1 + 12) as in ``model.FRAME_LENGTHS``.
        residual: metres.
        weight: the weight of the squared residual.
    """
    total, pull, cross, own, tug = sums.total, sums.pull, sums.cross, sums.own, sums.tug
    moved = lengths_of_frame(lengths_of, frame, len(tug))
    (x, y, z), (a, b, c) = (point[0], point[1], point[2]), (normal[0], normal[1], normal[2])
    phi = (a, b, c, y * c - z * b, z * a - x * c, x * b - y * a)
    for i in range(6):
        scaled = weight * phi[i]
        pull[frame, i] += scaled * residual
        for j in range(6):
            total[frame, i, j] += scaled * phi[j]
        for p in moved:
            cross[frame, i, p] += scaled * stretch[p]
    for p in moved:
        scaled = weight * stretch[p]
        tug[p] += scaled * residual
        for q in moved:
            own[p, q] += scaled * stretch[q]


@njit(cache=True, nogil=True)
def add_point_residual(sums, frame, point, apart, stretch, lengths_of, weight):
    """Adds the three residuals of a point with a target to the sums.

    Args:
        sums: the sums, modified in place.
        frame: the frame to which the point is fixed.
        point: (3,) metres, world frame.
        apart: (3,) metres, the point minus its target.
        stretch: (3, L) the point's derivatives by the lengths; (3, 0) if they are frozen.
        lengths_of: (F, 1 + 12) as in ``model.FRAME_LENGTHS``.
        weight: the weight of the squared residuals.
    """
    total, pull, cross, own, tug = sums.total, sums.pull, sums.cross, sums.own, sums.tug
    moved = lengths_of_frame(lengths_of, frame, len(tug))
    (x, y, z), (a, b, c) = (point[0], point[1], point[2]), (apart[0], apart[1], apart[2])
    across = ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0))
    square = x * x + y * y + z * z
    force, moment = (a, b, c), (y * c - z * b, z * a - x * c, x * b - y * a)
    for i in range(3):
        pull[frame, i] += weight * force[i]
        pull[frame, 3 + i] += weight * moment[i]
        total[frame, i, i] += weight
        total[frame, 3 + i, 3 + i] += weight * square
        for j in range(3):
            total[frame, i, 3 + j] += weight * across[i][j]
            total[frame, 3 + j, i] += weight * across[i][j]
            total[frame, 3 + i, 3 + j] -= weight * point[i] * point[j]
    for p in moved:
        a, b, c = weight * stretch[0, p], weight * stretch[1, p], weight * stretch[2, p]
        tug[p] += a * apart[0] + b * apart[1] + c * apart[2]
        wrench = (a, b, c, y * c - z * b, z * a - x * c, x * b - y * a)
        for i in range(6):
            cross[frame, i, p] += wrench[i]
        for q in moved:
            own[p, q] += a * stretch[0, q] + b * stretch[1, q] + c * stretch[2, q]


@njit(cache=True, nogil=True)
def lengths_of_frame(lengths_of, frame, lengths):
    """Returns the indices of the lengths that move the points of a frame. The result is empty if all are
    frozen.
    """
    return lengths_of[frame, 1 : 1 + (lengths_of[frame, 0] if lengths > 0 else 0)]


@njit(cache=True, nogil=True)
def add_sums(matrix, gradient, sums, body):
    """Adds the sums to the normal equations, the upper triangle of the matrix. It modifies the sums.

    Args:
        matrix, gradient: the normal equations, modified in place.
        sums: from the terms.
        body: the frames of a posture.
    """
    world, pivots, dof_frame, parents = body.world, body.pivots, body.dof_frame, body.parents
    total, pull, cross, own, tug = sums.total, sums.pull, sums.cross, sums.own, sums.tug
    # Add the sums of each frame to its parent's, from the leaves to the root.
    for f in range(len(world) - 1, 0, -1):
        parent = parents[f]
        for i in range(6):
            pull[parent, i] += pull[f, i]
            for j in range(6):
                total[parent, i, j] += total[f, i, j]
            for p in range(len(tug)):
                cross[parent, i, p] += cross[f, i, p]
    turns = _twists(world, pivots, dof_frame, body.dof_axis)
    _add_rotation_sums(matrix, gradient, total, pull, turns, body.moves, dof_frame)
    # Compute the blocks of the lengths with themselves, with the translation, and with the rotations.
    first = _TRANSLATION_DOFS + len(turns)
    for p in range(len(tug)):
        gradient[first + p] += tug[p]
        for q in range(p, len(tug)):
            matrix[first + p, first + q] += own[p, q]
        for a in range(_TRANSLATION_DOFS):
            matrix[a, first + p] += cross[0, a, p]
        for k in range(len(turns)):
            f, value = dof_frame[k], 0.0
            for a in range(6):
                value += turns[k, a] * cross[f, a, p]
            matrix[_TRANSLATION_DOFS + k, first + p] += value


@njit(cache=True, nogil=True)
def _twists(world, pivots, dof_frame, dof_axis):
    """Returns (K, 6) the twist of every rotational unknown: about its axis, through its frame's pivot."""
    out = np.empty((len(dof_frame), 6))
    for k in range(len(dof_frame)):
        f, axis = dof_frame[k], dof_axis[k]
        ax, ay, az = world[f, 0, axis], world[f, 1, axis], world[f, 2, axis]
        x, y, z = pivots[f, 0], pivots[f, 1], pivots[f, 2]
        out[k, 0], out[k, 1], out[k, 2] = az * y - ay * z, ax * z - az * x, ay * x - ax * y
        out[k, 3], out[k, 4], out[k, 5] = ax, ay, az
    return out


@njit(cache=True, nogil=True)
def _add_rotation_sums(matrix, gradient, total, pull, turns, moves, dof_frame):
    """Adds the blocks of translation and rotations to the normal equations.

    ``total`` and ``pull`` include all descendants of a frame.
    """
    product = np.empty(6)
    for a in range(_TRANSLATION_DOFS):
        gradient[a] += pull[0, a]
        for b in range(a, _TRANSLATION_DOFS):
            matrix[a, b] += total[0, a, b]
    for k in range(len(turns)):
        f, value = dof_frame[k], 0.0
        for a in range(6):
            value += pull[f, a] * turns[k, a]
            product[a] = 0.0
            for b in range(6):
                product[a] += total[f, a, b] * turns[k, b]
        gradient[_TRANSLATION_DOFS + k] += value
        for a in range(_TRANSLATION_DOFS):
            matrix[a, _TRANSLATION_DOFS + k] += product[a]
        for i in range(k + 1):
            if moves[f, i]:
                value = 0.0
                for a in range(6):
                    value += product[a] * turns[i, a]
                matrix[_TRANSLATION_DOFS + i, _TRANSLATION_DOFS + k] += value


@njit(cache=True, nogil=True)
def point_row(row, scale, frame, point, normal, local, body):
    """Adds scale * normal . d(point)/d(unknowns) to the row, for a point fixed to a frame.

    Args:
        row: (U,) the row, modified in place. It has no entries for frozen lengths.
        scale: the factor.
        frame: the frame to which the point is fixed.
        point: (3,) metres, world frame.
        normal: (3,) world frame.
        local: (3, 12) derivative of the point, in its frame, by the lengths.
        body: the frames of a posture.
    """
    world, pivots, by_length, dof_frame = body.world, body.pivots, body.by_length, body.dof_frame
    for a in range(3):
        row[a] += scale * normal[a]
    for k in range(len(dof_frame)):
        if body.moves[frame, k] == 0:
            continue
        f, axis = dof_frame[k], body.dof_axis[k]
        ax, ay, az = world[f, 0, axis], world[f, 1, axis], world[f, 2, axis]
        x, y, z = point[0] - pivots[f, 0], point[1] - pivots[f, 1], point[2] - pivots[f, 2]
        row[3 + k] += scale * (
            normal[0] * (ay * z - az * y) + normal[1] * (az * x - ax * z) + normal[2] * (ax * y - ay * x)
        )
    if len(row) == model.DOFS:
        return
    nx, ny, nz = normal
    tx = nx * world[frame, 0, 0] + ny * world[frame, 1, 0] + nz * world[frame, 2, 0]
    ty = nx * world[frame, 0, 1] + ny * world[frame, 1, 1] + nz * world[frame, 2, 1]
    tz = nx * world[frame, 0, 2] + ny * world[frame, 1, 2] + nz * world[frame, 2, 2]
    for p in range(local.shape[1]):
        moved = nx * by_length[frame, 0, p] + ny * by_length[frame, 1, p] + nz * by_length[frame, 2, p]
        moved += tx * local[0, p] + ty * local[1, p] + tz * local[2, p]
        row[model.DOFS + p] += scale * moved


@njit(cache=True, nogil=True)
def robust(residual, width):
    """Returns the Geman-McClure energy r^2 / (1 + (r / width)^2), and its weight for least squares."""
    ratio = residual / width
    w = 1.0 / (1.0 + ratio * ratio)
    return residual * residual * w, w * w


@njit(cache=True, nogil=True)
def world_point_into(point, frame, local, lengths, body):
    """Writes the (3,) world position of a point fixed to a frame, linear in the lengths, into ``point``."""
    world, pivots = body.world, body.pivots
    for a in range(3):
        point[a] = pivots[frame, a]
    for b in range(3):
        offset = 0.0
        for p in range(len(lengths)):
            offset += local[b, p] * lengths[p]
        for a in range(3):
            point[a] += world[frame, a, b] * offset


@njit(cache=True, nogil=True)
def ends_by_length(out, body, capsule_frame, capsule_local):
    """Writes (C, 2, 3, L) the derivatives of the capsules' ends by the lengths, world frame, into ``out``."""
    for c in range(len(capsule_frame)):
        for e in range(2):
            by_length(out[c, e], capsule_frame[c], capsule_local[c, e], body)


@njit(cache=True, nogil=True)
def by_length(out, frame, local, body):
    """Writes (3, L) the derivatives of a point with respect to the lengths into ``out``.

    ``local`` (3, 12) contains the point's coefficients in its frame, linear in the lengths.
    """
    world, of_pivot, lengths_of = body.world, body.by_length, body.lengths_of
    out[:] = 0.0
    for p in lengths_of_frame(lengths_of, frame, out.shape[1]):
        x, y, z = local[0, p], local[1, p], local[2, p]
        for a in range(3):
            out[a, p] = of_pivot[frame, a, p] + world[frame, a, 0] * x + world[frame, a, 1] * y
            out[a, p] += world[frame, a, 2] * z


@njit(cache=True, nogil=True)
def stretch_into(out, normal, by_ends, t, frame, lengths_of):
    """Writes (L,) normal . d(point)/d(length) into ``out``, for the point at fraction t along a capsule.

    The girth's entry is not computed.
    """
    out[:] = 0.0
    for p in lengths_of_frame(lengths_of, frame, len(out)):
        for a in range(3):
            out[p] += normal[a] * ((1.0 - t) * by_ends[0, a, p] + t * by_ends[1, a, p])
