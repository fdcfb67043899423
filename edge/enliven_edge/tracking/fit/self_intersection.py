"""The term of the fit against self-intersection of limbs, compiled."""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven_edge.tracking.body_model import model


@njit(cache=True, nogil=True)
def self_intersection(matrix, gradient, surface, body, pairs, weight, samples):
    """Adds the self-intersection term, which moves samples on the first capsule of each pair out of the
    second one.
    """
    ends, radii, capsule_frame, by_ends = surface.ends, surface.radii, surface.frame, surface.by_ends
    filled, values = np.empty(matrix.shape[0], np.int64), np.empty(matrix.shape[0])
    normal, point, centre = np.empty(3), np.empty(3), np.empty(3)
    energy = 0.0
    for k in range(len(pairs)):
        i, j = pairs[k]
        if _are_bounds_apart(ends[i], radii[i], ends[j], radii[j]):
            continue
        for s in range(samples):
            # Take a sample on the first axis, and find the nearest point on the second axis.
            t = (s + 0.5) / samples
            along, square = 0.0, 1e-12
            for a in range(3):
                point[a] = ends[i, 0, a] + t * (ends[i, 1, a] - ends[i, 0, a])
                axis = ends[j, 1, a] - ends[j, 0, a]
                along += (point[a] - ends[j, 0, a]) * axis
                square += axis * axis
            along = min(1.0, max(0.0, along / square))
            square = 0.0
            for a in range(3):
                centre[a] = ends[j, 0, a] + along * (ends[j, 1, a] - ends[j, 0, a])
                square += (point[a] - centre[a]) ** 2
            # The residual is 85 % of the sum of both radii minus the distance, if that is positive.
            reach = radii[i, 0] + t * (radii[i, 1] - radii[i, 0])
            reach += radii[j, 0] + along * (radii[j, 1] - radii[j, 0])
            distance = np.sqrt(square)
            residual = 0.85 * reach - distance
            if residual <= 0.0 or distance < 1e-6:
                continue
            for a in range(3):
                normal[a] = (point[a] - centre[a]) / distance
            first = (capsule_frame[i], point, by_ends[i], t)
            second = (capsule_frame[j], centre, by_ends[j], along)
            count = _separation_row(filled, values, first, second, normal, body)
            energy += weight * residual * residual
            _add_sparse_row(matrix, gradient, filled, values, count, residual, weight)
    return energy


@njit(cache=True, nogil=True)
def _add_sparse_row(matrix, gradient, filled, values, count, residual, weight):
    """Adds one weighted residual to the upper triangle of the normal equations.

    Its row has only ``count`` non-zero entries: the ``values`` at the ascending indices ``filled``.
    """
    for m in range(count):
        i = filled[m]
        scaled = weight * values[m]
        gradient[i] += scaled * residual
        for n in range(m, count):
            matrix[i, filled[n]] += scaled * values[n]


@njit(cache=True, nogil=True)
def _are_bounds_apart(one, thick, other, broad):
    """Returns True if the bounding balls of two capsules do not overlap."""
    apart, first, second = 0.0, 0.0, 0.0
    for a in range(3):
        apart += (0.5 * (one[0, a] + one[1, a] - other[0, a] - other[1, a])) ** 2
        first += (0.5 * (one[1, a] - one[0, a])) ** 2
        second += (0.5 * (other[1, a] - other[0, a])) ** 2
    reach = max(thick[0], thick[1]) + max(broad[0], broad[1]) + np.sqrt(first) + np.sqrt(second)
    return apart > reach * reach


@njit(cache=True, nogil=True)
def _separation_row(filled, values, first, second, normal, body):
    """Writes normal . d(second - first)/d(unknowns) for two points. Returns the number of filled entries.

    An unknown that moves both points rotates the line between them without changing its length. So only the
    unknowns that move exactly one of the points have an entry: a few for the forearm against the chest.

    The arrays need room for all unknowns.

    Args:
        filled, values: receive the indices and values of the non-zero entries.
        first, second: tuples of the point's frame, the (3,) point, the (2, 3, L) derivatives of its capsule's
            ends with respect to the lengths, and the fraction along the capsule.
        normal: (3,) unit vector from the second point to the first.
        body: the frames of a posture.
    """
    world, pivots, moves = body.world, body.pivots, body.moves
    first_frame, point, by_one, t = first
    second_frame, centre, by_other, along = second
    count = 0
    for k in range(len(body.dof_frame)):
        if moves[first_frame, k] == moves[second_frame, k]:
            continue
        f, axis = body.dof_frame[k], body.dof_axis[k]
        side = -1.0 if moves[first_frame, k] else 1.0
        at = point if moves[first_frame, k] else centre
        ax, ay, az = world[f, 0, axis], world[f, 1, axis], world[f, 2, axis]
        x, y, z = at[0] - pivots[f, 0], at[1] - pivots[f, 1], at[2] - pivots[f, 2]
        filled[count] = 3 + k
        values[count] = side * (
            normal[0] * (ay * z - az * y) + normal[1] * (az * x - ax * z) + normal[2] * (ax * y - ay * x)
        )
        count += 1
    for p in range(by_one.shape[2]):
        derivative = 0.0
        for a in range(3):
            first_motion = (1.0 - t) * by_one[0, a, p] + t * by_one[1, a, p]
            derivative += normal[a] * (
                (1.0 - along) * by_other[0, a, p] + along * by_other[1, a, p] - first_motion
            )
        filled[count], values[count] = model.DOFS + p, derivative
        count += 1
    return count
