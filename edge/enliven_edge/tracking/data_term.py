"""The data term of the fit, compiled: observed points lie on the surface of the body.

A point on capsule c with outward normal n, foot point x on the axis and parameter t along it has the residual
r = distance - radius. Its derivatives by the unknowns are linear in eleven numbers,

    phi = (n, x cross n, t n, 1, t),    row = -B_c phi,

with a matrix B_c that is the same for all points of the capsule. So each point adds only phi phi' to a small
matrix S_c of its capsule, and the normal equations get B_c S_c B_c' once a capsule instead of a row a point.
B_c has rows only for the unknowns that move the capsule. The last five numbers belong to the lengths: while
those are frozen, phi is its first six.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven_edge.tracking.capsules import foot, nearest_capsules
from enliven_edge.tracking.terms import body_girth, robust

_DOFS = 30
_GIRTH = 11
_FEATURES, _RIGID = 11, 6


@njit(cache=True, nogil=True)
def depth_to_model(  # type: ignore[no-untyped-def]
    matrix,
    gradient,
    seen,
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
        seen, affinity: as :func:`capsules.nearest_capsules` takes them.
    """
    count = len(ends)
    many = seen.shape[1]
    which, met = np.empty(many, np.int32), np.zeros(count + 1, np.int64)
    nearest_capsules(which, seen, affinity, ends, radii, np.float32(side))
    found = np.empty((many, 3))
    energy, explained = 0.0, 0.0
    support[:] = 0.0
    per_point = weight / max(1, many)
    for i in range(many):
        c = which[i]
        t, distance = foot(seen[0, i], seen[1, i], seen[2, i], ends[c], radii[c])
        cost, w = robust(distance, width)
        energy += per_point * cost
        if abs(distance) < width:
            explained += 1.0
            support[c] += 1.0
        found[i, 0], found[i, 1], found[i, 2] = t, distance, per_point * w
        if w > 1e-4:
            met[c + 1] += 1
        else:
            which[i] = -1
    order = _by_capsule(which, met)
    if matrix.shape[0] == _DOFS:
        _add_rigid(matrix, gradient, seen, found, order, met, ends, capsule_frame, body)
        return energy, explained / max(1, many)
    for c in range(count):
        if met[c + 1] > met[c]:
            of_capsule = (seen, found, order[met[c] : met[c + 1]], ends[c])
            shape = (capsule_frame[c], capsule_local[c], radii[c], body_girth(radii))
            _add_capsule(matrix, gradient, c, shape, body, of_capsule)
    return energy, explained / max(1, many)


@njit(cache=True, nogil=True)
def _add_rigid(matrix, gradient, seen, found, order, met, ends, capsule_frame, body):  # type: ignore[no-untyped-def]
    """All points into the normal equations of translation and turns.

    phi is in the world's frame, so the sums of all that an unknown moves are those of its frame and of the
    frames beyond it, and two unknowns share the points of the one farther out: B of each is needed once.
    """
    world, pivots, _, moves, dof_frame, dof_axis, _, parents = body
    total, pull = np.zeros((len(world), _RIGID, _RIGID)), np.zeros((len(world), _RIGID))
    for c in range(len(capsule_frame)):
        if met[c + 1] > met[c]:
            f = capsule_frame[c]
            _rigid_sums(total[f], pull[f], seen, found, order[met[c] : met[c + 1]], ends[c])
    for f in range(len(world) - 1, 0, -1):
        total[parents[f]] += total[f]
        pull[parents[f]] += pull[f]
    basis, product = np.zeros((len(dof_frame), _RIGID)), np.empty(_RIGID)
    for a in range(3):
        gradient[a] -= pull[0, a]
        for b in range(a, 3):
            matrix[a, b] += total[0, a, b]
    for k in range(len(dof_frame)):
        f, axis = dof_frame[k], dof_axis[k]
        ax, ay, az = world[f, 0, axis], world[f, 1, axis], world[f, 2, axis]
        x, y, z = pivots[f, 0], pivots[f, 1], pivots[f, 2]
        basis[k, 0], basis[k, 1], basis[k, 2] = az * y - ay * z, ax * z - az * x, ay * x - ax * y
        basis[k, 3], basis[k, 4], basis[k, 5] = ax, ay, az
        for a in range(_RIGID):
            product[a] = 0.0
            for b in range(_RIGID):
                product[a] += total[f, a, b] * basis[k, b]
            gradient[3 + k] -= pull[f, a] * basis[k, a]
        for a in range(3):
            matrix[a, 3 + k] += product[a]
        for i in range(k + 1):
            if moves[f, i]:
                value = 0.0
                for a in range(_RIGID):
                    value += product[a] * basis[i, a]
                matrix[3 + i, 3 + k] += value


@njit(cache=True, nogil=True)
def _by_capsule(which, met):  # type: ignore[no-untyped-def]
    """The points in the order of their capsules: those of c from met[c] to met[c + 1], numbers at first."""
    for c in range(1, len(met)):
        met[c] += met[c - 1]
    order, filled = np.empty(len(which), np.int64), met.copy()
    for i in range(len(which)):
        c = which[i]
        if c >= 0:
            order[filled[c]] = i
            filled[c] += 1
    return order


@njit(cache=True, nogil=True)
def _add_capsule(matrix, gradient, c, shape, body, of_capsule):  # type: ignore[no-untyped-def]
    """The points of one capsule into the normal equations with the lengths."""
    seen, found, order, ends = of_capsule
    frame, local, radii, girth = shape
    total, pull = np.zeros((_FEATURES, _FEATURES)), np.zeros(_FEATURES)
    basis, product, phi = np.empty((matrix.shape[0], _FEATURES)), np.empty(_FEATURES), np.empty(_FEATURES)
    for i in order:
        if _features(phi, seen[0, i], seen[1, i], seen[2, i], ends, found[i, 0]):
            _accumulate(total, pull, phi, found[i, 2], found[i, 1])
    used = _capsule_basis(basis, c, frame, local, radii, girth, body)
    _expand(matrix, gradient, basis, body[6][c, 2 : 2 + used], total, pull, product)


@njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _rigid_sums(total, pull, seen, found, order, ends):  # type: ignore[no-untyped-def]
    """total += sum weight phi phi', pull += sum weight residual phi, of phi = (n, x cross n).

    Written out, so that the sums stay in registers: this is what a frame's fit does most.
    """
    px, py, pz = ends[0, 0], ends[0, 1], ends[0, 2]
    dx, dy, dz = ends[1, 0] - px, ends[1, 1] - py, ends[1, 2] - pz
    aa = ab = ac = bb = bc = cc = 0.0
    ad = ae = af = bd = be = bf = cd = ce = cf = 0.0
    dd = de = df = ee = ef = ff = 0.0
    ra = rb = rc = rd = re = rf = 0.0
    for i in order:
        t, residual, weight = found[i, 0], found[i, 1], found[i, 2]
        x, y, z = px + t * dx, py + t * dy, pz + t * dz
        a, b, c = seen[0, i] - x, seen[1, i] - y, seen[2, i] - z
        length = np.sqrt(a * a + b * b + c * c)
        if length < 1e-6:
            continue
        scale = 1.0 / length
        a, b, c = a * scale, b * scale, c * scale
        d, e, f = y * c - z * b, z * a - x * c, x * b - y * a
        wa, wb, wc, wd, we, wf = weight * a, weight * b, weight * c, weight * d, weight * e, weight * f
        aa, ab, ac, bb, bc, cc = aa + wa * a, ab + wa * b, ac + wa * c, bb + wb * b, bc + wb * c, cc + wc * c
        ad, ae, af = ad + wa * d, ae + wa * e, af + wa * f
        bd, be, bf = bd + wb * d, be + wb * e, bf + wb * f
        cd, ce, cf = cd + wc * d, ce + wc * e, cf + wc * f
        dd, de, df, ee, ef, ff = dd + wd * d, de + wd * e, df + wd * f, ee + we * e, ef + we * f, ff + wf * f
        ra, rb, rc = ra + wa * residual, rb + wb * residual, rc + wc * residual
        rd, re, rf = rd + wd * residual, re + we * residual, rf + wf * residual
    rows = ((aa, ab, ac, ad, ae, af), (ab, bb, bc, bd, be, bf), (ac, bc, cc, cd, ce, cf))
    more = ((ad, bd, cd, dd, de, df), (ae, be, ce, de, ee, ef), (af, bf, cf, df, ef, ff))
    for k in range(3):
        for j in range(_RIGID):
            total[k, j] += rows[k][j]
            total[3 + k, j] += more[k][j]
    of = (ra, rb, rc, rd, re, rf)
    for j in range(_RIGID):
        pull[j] += of[j]


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
    world, pivots, by_length, _, dof_frame, dof_axis, unknowns, _ = body
    turns = unknowns[capsule, 0]
    used = unknowns[capsule, 1]
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
