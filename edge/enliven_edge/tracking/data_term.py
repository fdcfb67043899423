"""The data term of the fit, compiled: observed points lie on the surface of the body.

A point on capsule c with outward normal n, foot point x on the axis and parameter t along it has the residual
r = distance - radius. Its derivatives by the unknowns are linear in eleven numbers,

    phi = (n, x cross n, t n, 1, t),    row = -B_c phi,

with a matrix B_c that is the same for all points of the capsule. So each point adds only phi phi' to a small
matrix S_c of its capsule, and the normal equations get B_c S_c B_c' once a capsule instead of a row a point.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven_edge.tracking.terms import body_girth, robust

_DOFS = 30
_GIRTH = 11
_FEATURES = 11


@njit(cache=True, nogil=True)
def nearest_capsule(point, normal, ends, radii, side):  # type: ignore[no-untyped-def]
    """The capsule whose surface an observed point lies on: index, parameter along it, signed distance.

    A surface that faces away from the observed normal costs up to twice ``side`` metres more, so that a
    point on the front of an arm is not explained by the chest behind it.
    """
    best, best_cost, best_t, best_distance = -1, 1e9, 0.0, 1e9
    x, y, z = point[0], point[1], point[2]
    for c in range(len(ends)):
        ax, ay, az = ends[c, 0, 0], ends[c, 0, 1], ends[c, 0, 2]
        dx, dy, dz = ends[c, 1, 0] - ax, ends[c, 1, 1] - ay, ends[c, 1, 2] - az
        px, py, pz = x - ax, y - ay, z - az
        t = (px * dx + py * dy + pz * dz) / (dx * dx + dy * dy + dz * dz + 1e-12)
        t = min(1.0, max(0.0, t))
        px, py, pz = px - t * dx, py - t * dy, pz - t * dz
        square = px * px + py * py + pz * pz
        radius = radii[c, 0] + t * (radii[c, 1] - radii[c, 0])
        # The distance alone is a lower bound of the cost: most capsules need no root.
        if square > (best_cost + radius) * (best_cost + radius):
            continue
        length = np.sqrt(square)
        distance = length - radius
        facing = (px * normal[0] + py * normal[1] + pz * normal[2]) / (length + 1e-9)
        cost = abs(distance) + side * (1.0 - facing)
        if cost < best_cost:
            best, best_cost, best_t, best_distance = c, cost, t, distance
    return best, best_t, best_distance


@njit(cache=True, nogil=True)
def depth_to_model(  # type: ignore[no-untyped-def]
    matrix,
    gradient,
    points,
    normals,
    ends,
    radii,
    capsule_frame,
    capsule_local,
    body,
    weight,
    width,
    side,
    support,
):
    """Every observed point lies on the surface of its nearest capsule.

    ``support`` (C,) receives the number of points that each capsule explains within ``width``.
    Returns (energy, share of the points that are explained).
    """
    count = len(ends)
    sums, pulls = np.zeros((count, _FEATURES, _FEATURES)), np.zeros((count, _FEATURES))
    phi = np.empty(_FEATURES)
    energy, explained = 0.0, 0.0
    support[:] = 0.0
    per_point = weight / max(1, len(points))
    for i in range(len(points)):
        c, t, distance = nearest_capsule(points[i], normals[i], ends, radii, side)
        cost, w = robust(distance, width)
        energy += per_point * cost
        if abs(distance) < width:
            explained += 1.0
            support[c] += 1.0
        if w > 1e-4 and _features(phi, points[i], ends[c], t):
            _accumulate(sums[c], pulls[c], phi, per_point * w, distance)
    basis = np.empty((matrix.shape[0], _FEATURES))
    for c in range(count):
        if sums[c, 9, 9] > 0.0:
            _capsule_basis(basis, capsule_frame[c], capsule_local[c], radii[c], body_girth(radii), body)
            _expand(matrix, gradient, basis, sums[c], pulls[c])
    return energy, explained / max(1, len(points))


@njit(cache=True, nogil=True)
def _features(phi, point, ends, t):  # type: ignore[no-untyped-def]
    """phi of a point and its place on a capsule's axis; False where the point is on the axis itself."""
    x = ends[0, 0] + t * (ends[1, 0] - ends[0, 0])
    y = ends[0, 1] + t * (ends[1, 1] - ends[0, 1])
    z = ends[0, 2] + t * (ends[1, 2] - ends[0, 2])
    nx, ny, nz = point[0] - x, point[1] - y, point[2] - z
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length < 1e-6:
        return False
    nx, ny, nz = nx / length, ny / length, nz / length
    phi[0], phi[1], phi[2] = nx, ny, nz
    phi[3], phi[4], phi[5] = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
    phi[6], phi[7], phi[8] = t * nx, t * ny, t * nz
    phi[9], phi[10] = 1.0, t
    return True


@njit(cache=True, nogil=True)
def _accumulate(total, pull, phi, weight, residual):  # type: ignore[no-untyped-def]
    """total += weight phi phi' (upper triangle), pull += weight residual phi."""
    for a in range(_FEATURES):
        scaled = weight * phi[a]
        pull[a] += scaled * residual
        for b in range(a, _FEATURES):
            total[a, b] += scaled * phi[b]


@njit(cache=True, nogil=True)
def _capsule_basis(basis, frame, local, radii, girth, body):  # type: ignore[no-untyped-def]
    """B_c: a capsule's derivatives by the unknowns, up to the sign, as combinations of phi."""
    world, pivots, by_length, moves, dof_frame, dof_axis = body
    basis[:] = 0.0
    for a in range(3):
        basis[a, a] = 1.0
    for k in range(len(dof_frame)):
        if moves[frame, k] == 0:
            continue
        f, axis = dof_frame[k], dof_axis[k]
        ax, ay, az = world[f, 0, axis], world[f, 1, axis], world[f, 2, axis]
        x, y, z = pivots[f]
        basis[3 + k, 0] = -(ay * z - az * y)
        basis[3 + k, 1] = -(az * x - ax * z)
        basis[3 + k, 2] = -(ax * y - ay * x)
        basis[3 + k, 3], basis[3 + k, 4], basis[3 + k, 5] = ax, ay, az
    for p in range(local.shape[2]):
        for a in range(3):
            start, change = by_length[frame, a, p], 0.0
            for b in range(3):
                start += world[frame, a, b] * local[0, b, p]
                change += world[frame, a, b] * (local[1, b, p] - local[0, b, p])
            basis[_DOFS + p, a] = start
            basis[_DOFS + p, 6 + a] = change
    basis[_DOFS + _GIRTH, 9] = radii[0] / girth
    basis[_DOFS + _GIRTH, 10] = (radii[1] - radii[0]) / girth


@njit(cache=True, nogil=True)
def _expand(matrix, gradient, basis, total, pull):  # type: ignore[no-untyped-def]
    """matrix += B S B' (upper triangle), gradient -= B s."""
    count = matrix.shape[0]
    product = np.empty(_FEATURES)
    for i in range(count):
        filled = False
        for a in range(_FEATURES):
            filled = filled or basis[i, a] != 0.0
        if not filled:
            continue
        for b in range(_FEATURES):
            value = 0.0
            for a in range(_FEATURES):
                value += basis[i, a] * (total[a, b] if a <= b else total[b, a])
            product[b] = value
        for a in range(_FEATURES):
            gradient[i] -= basis[i, a] * pull[a]
        for j in range(i, count):
            value = 0.0
            for b in range(_FEATURES):
                value += product[b] * basis[j, b]
            matrix[i, j] += value
