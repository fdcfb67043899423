"""The data term of the fit, compiled: observed points lie on the surface of the body.

A point on capsule c with outward normal n, foot point x on the axis and parameter t along it has the residual
r = distance - radius. Its derivatives by the unknowns are linear in eleven numbers,

    phi = (n, x cross n, t n, 1, t),    row = -B_c phi,

with a matrix B_c that is the same for all points of the capsule. So each point adds only phi phi' to a small
matrix S_c of its capsule, and the normal equations get B_c S_c B_c' once a capsule instead of a row a point.
B_c has rows only for the unknowns that move the capsule.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven_edge.tracking.terms import body_girth, robust

_DOFS = 30
_GIRTH = 11
_FEATURES = 11
_ROWS = 13
"""Numbers of a capsule in :func:`aligned_capsules`."""


@njit(cache=True, nogil=True)
def aligned_capsules(ends, radii):  # type: ignore[no-untyped-def]
    """(13, C) float32: start, axis, 1 / axis^2, radius and its growth, and room for the search's results.

    One row a number, so that the search runs over many capsules at once.
    """
    out = np.zeros((_ROWS, len(ends)), np.float32)
    for c in range(len(ends)):
        square = 1e-12
        for a in range(3):
            axis = ends[c, 1, a] - ends[c, 0, a]
            out[a, c], out[3 + a, c] = ends[c, 0, a], axis
            square += axis * axis
        out[6, c] = 1.0 / square
        out[7, c], out[8, c] = radii[c, 0], radii[c, 1] - radii[c, 0]
    return out


@njit(
    cache=True,
    nogil=True,
    fastmath={"nsz", "arcp", "contract", "reassoc", "nnan", "ninf"},
    error_model="numpy",
)
def nearest_capsule(x, y, z, nx, ny, nz, rows, side, affinity):  # type: ignore[no-untyped-def]
    """The capsule whose surface an observed point lies on; its t and signed distance are in rows 9 and 10.

    A surface that faces away from the observed normal costs up to twice ``side`` metres more, so that a
    point on the front of an arm is not explained by the chest behind it.

    Args:
        x, y, z, nx, ny, nz: float32 point and unit normal.
        rows: (13, C) of :func:`aligned_capsules`.
        affinity: (C,) float32 metres added to each capsule's cost, by what the point looks like; or (0,).
    """
    count = rows.shape[1]
    zero, one = np.float32(0.0), np.float32(1.0)
    for c in range(count):
        px, py, pz = x - rows[0, c], y - rows[1, c], z - rows[2, c]
        dx, dy, dz = rows[3, c], rows[4, c], rows[5, c]
        t = min(one, max(zero, (px * dx + py * dy + pz * dz) * rows[6, c]))
        px, py, pz = px - t * dx, py - t * dy, pz - t * dz
        length = np.sqrt(px * px + py * py + pz * pz) + np.float32(1e-9)
        distance = length - (rows[7, c] + t * rows[8, c])
        facing = (px * nx + py * ny + pz * nz) / length
        rows[9, c], rows[10, c] = t, distance
        rows[11, c] = abs(distance) + side * (one - facing)
    if len(affinity) == count:
        for c in range(count):
            rows[11, c] += affinity[c]
    best = 0
    for c in range(1, count):
        if rows[11, c] < rows[11, best]:
            best = c
    return best


@njit(cache=True, nogil=True)
def depth_to_model(  # type: ignore[no-untyped-def]
    matrix,
    gradient,
    points,
    normals,
    affinity,
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

    Args:
        points: (M, 3) float32 metres, world frame.
        normals: (M, 3) float32 unit normals.
        affinity: (M, C) float32 metres, see :func:`nearest_capsule`; or (0, 0).
    """
    count = len(ends)
    rows = aligned_capsules(ends, radii)
    sums, pulls = np.zeros((count, _FEATURES, _FEATURES)), np.zeros((count, _FEATURES))
    phi = np.empty(_FEATURES)
    none = np.empty(0, np.float32)
    energy, explained = 0.0, 0.0
    support[:] = 0.0
    per_point = weight / max(1, len(points))
    narrow = np.float32(side)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        likes = affinity[i] if len(affinity) > 0 else none
        c = nearest_capsule(x, y, z, normals[i, 0], normals[i, 1], normals[i, 2], rows, narrow, likes)
        distance = np.float64(rows[10, c])
        cost, w = robust(distance, width)
        energy += per_point * cost
        if abs(distance) < width:
            explained += 1.0
            support[c] += 1.0
        if w > 1e-4 and _features(phi, x, y, z, ends[c], np.float64(rows[9, c])):
            _accumulate(sums[c], pulls[c], phi, per_point * w, distance)
    basis, product = np.empty((matrix.shape[0], _FEATURES)), np.empty(_FEATURES)
    for c in range(count):
        if sums[c, 9, 9] > 0.0:
            frame, girth = capsule_frame[c], body_girth(radii)
            used = _capsule_basis(basis, c, frame, capsule_local[c], radii[c], girth, body)
            _expand(matrix, gradient, basis, body[6][c, 2 : 2 + used], sums[c], pulls[c], product)
    return energy, explained / max(1, len(points))


@njit(cache=True, nogil=True)
def _features(phi, px, py, pz, ends, t):  # type: ignore[no-untyped-def]
    """phi of a point and its place on a capsule's axis; False where the point is on the axis itself."""
    x = ends[0, 0] + t * (ends[1, 0] - ends[0, 0])
    y = ends[0, 1] + t * (ends[1, 1] - ends[0, 1])
    z = ends[0, 2] + t * (ends[1, 2] - ends[0, 2])
    nx, ny, nz = px - x, py - y, pz - z
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
def _capsule_basis(basis, capsule, frame, local, radii, girth, body):  # type: ignore[no-untyped-def]
    """The rows of B_c, up to the sign, for the unknowns that move the capsule; how many there are."""
    world, pivots, by_length, _, dof_frame, dof_axis, unknowns = body
    turns = unknowns[capsule, 0]
    used = unknowns[capsule, 1] if basis.shape[0] > _DOFS else turns
    basis[:used] = 0.0
    for a in range(3):
        basis[a, a] = 1.0
    for i in range(3, turns):
        k = unknowns[capsule, 2 + i] - 3
        f, axis = dof_frame[k], dof_axis[k]
        ax, ay, az = world[f, 0, axis], world[f, 1, axis], world[f, 2, axis]
        x, y, z = pivots[f, 0], pivots[f, 1], pivots[f, 2]
        basis[i, 0] = -(ay * z - az * y)
        basis[i, 1] = -(az * x - ax * z)
        basis[i, 2] = -(ax * y - ay * x)
        basis[i, 3], basis[i, 4], basis[i, 5] = ax, ay, az
    for i in range(turns, used):
        p = unknowns[capsule, 2 + i] - _DOFS
        for a in range(3):
            start, change = by_length[frame, a, p], 0.0
            for b in range(3):
                start += world[frame, a, b] * local[0, b, p]
                change += world[frame, a, b] * (local[1, b, p] - local[0, b, p])
            basis[i, a] = start
            basis[i, 6 + a] = change
        if p == _GIRTH:
            basis[i, 9] = radii[0] / girth
            basis[i, 10] = (radii[1] - radii[0]) / girth
    return used


@njit(cache=True, nogil=True)
def _expand(matrix, gradient, basis, unknowns, total, pull, product):  # type: ignore[no-untyped-def]
    """matrix += B S B' (upper triangle), gradient -= B s, for the rows of B's unknowns, in rising order."""
    for a in range(_FEATURES):
        for b in range(a):
            total[a, b] = total[b, a]
    for i in range(len(unknowns)):
        into = unknowns[i]
        for b in range(_FEATURES):
            product[b] = 0.0
        for a in range(_FEATURES):
            factor = basis[i, a]
            if factor != 0.0:
                gradient[into] -= factor * pull[a]
                for b in range(_FEATURES):
                    product[b] += factor * total[a, b]
        for j in range(i, len(unknowns)):
            value = 0.0
            for b in range(_FEATURES):
                value += product[b] * basis[j, b]
            matrix[into, unknowns[j]] += value
