"""The terms of the fit, compiled: each adds its squared residuals to the normal equations of Gauss-Newton.

The unknowns are ordered translation (3), rotations (27), lengths (12). A residual r with the row J of its
derivatives and the weight w adds w J'J to the matrix, w J'r to the gradient and w r^2 to the energy.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven_edge.tracking.kinematics import deviation
from enliven_edge.tracking.observation import nearest_pixel

_DOFS = 30
_GIRTH = 11


@njit(cache=True, nogil=True)
def add(matrix, gradient, row, residual, weight):  # type: ignore[no-untyped-def]
    """One weighted residual into the upper triangle of the normal equations; most of a row is zero."""
    filled, values = np.empty(len(row), np.int64), np.empty(len(row))
    count = 0
    for i in range(len(row)):
        if row[i] != 0.0:
            filled[count], values[count] = i, row[i]
            count += 1
    _add_few(matrix, gradient, filled, values, count, residual, weight)


@njit(cache=True, nogil=True)
def _add_few(matrix, gradient, filled, values, count, residual, weight):  # type: ignore[no-untyped-def]
    """The same for a row of which only ``count`` entries, the ``values`` at ``filled``, are not zero."""
    for m in range(count):
        i = filled[m]
        scaled = weight * values[m]
        gradient[i] += scaled * residual
        for n in range(m, count):
            matrix[i, filled[n]] += scaled * values[n]


@njit(cache=True, nogil=True)
def point_row(row, scale, frame, point, normal, local, body):  # type: ignore[no-untyped-def]
    """Adds scale * normal . d(point)/d(unknowns) to the row, for a point carried by a frame.

    Args:
        local: (3, 12) derivative of the point, in its frame, by the lengths.
        body: (world, pivots, by_length, moves, dof_frame, dof_axis, capsule_unknowns, parents) of a posture;
            the row has no places for the lengths where they are frozen.
    """
    world, pivots, by_length, moves, dof_frame, dof_axis, _, _ = body
    for a in range(3):
        row[a] += scale * normal[a]
    for k in range(len(dof_frame)):
        if moves[frame, k] == 0:
            continue
        f, axis = dof_frame[k], dof_axis[k]
        ax, ay, az = world[f, 0, axis], world[f, 1, axis], world[f, 2, axis]
        x, y, z = point[0] - pivots[f, 0], point[1] - pivots[f, 1], point[2] - pivots[f, 2]
        row[3 + k] += scale * (
            normal[0] * (ay * z - az * y) + normal[1] * (az * x - ax * z) + normal[2] * (ax * y - ay * x)
        )
    if len(row) == _DOFS:
        return
    nx, ny, nz = normal
    tx = nx * world[frame, 0, 0] + ny * world[frame, 1, 0] + nz * world[frame, 2, 0]
    ty = nx * world[frame, 0, 1] + ny * world[frame, 1, 1] + nz * world[frame, 2, 1]
    tz = nx * world[frame, 0, 2] + ny * world[frame, 1, 2] + nz * world[frame, 2, 2]
    for p in range(local.shape[1]):
        moved = nx * by_length[frame, 0, p] + ny * by_length[frame, 1, p] + nz * by_length[frame, 2, p]
        moved += tx * local[0, p] + ty * local[1, p] + tz * local[2, p]
        row[_DOFS + p] += scale * moved


@njit(cache=True, nogil=True)
def between(out, ends, t):  # type: ignore[no-untyped-def]
    """(3, 12) the offset a share t along from the first to the second of (2, 3, 12), into ``out``."""
    for a in range(3):
        for p in range(out.shape[1]):
            out[a, p] = (1.0 - t) * ends[0, a, p] + t * ends[1, a, p]


@njit(cache=True, nogil=True)
def robust(residual, width):  # type: ignore[no-untyped-def]
    """Geman-McClure: the energy r^2 / (1 + (r / width)^2) and its weight in iterated least squares."""
    ratio = residual / width
    w = 1.0 / (1.0 + ratio * ratio)
    return residual * residual * w, w * w


@njit(cache=True, nogil=True)
def body_girth(radii):  # type: ignore[no-untyped-def]
    """The girth factor, recovered from the first capsule's radius (its radius at girth 1 is 0.115 m)."""
    return radii[0, 0] / 0.115


@njit(cache=True, nogil=True)
def free_space(  # type: ignore[no-untyped-def]
    matrix, gradient, ends, radii, capsule_frame, capsule_local, body, view, weight, width, samples, violated
):
    """No limb where the camera saw through, and none in front of what it saw.

    Points along every capsule's axis are projected. Outside the person's silhouette they are drawn to the
    nearest pixel of it, unless something nearer hides them or nothing is known there; inside it, a surface
    that stands in front of the observed one is pushed back.

    Args:
        view: (depth, mask, nearest, camera, world_from_camera): (h, w) metres (0 unknown), (h, w) the
            person's pixels, (h, w) of :func:`observation.nearest_columns`, (4,) fx, fy, cx, cy, and (4, 4).
        violated: (C,) receives the share of each capsule's samples seen through.
    """
    depth, mask, nearest, camera, world_from_camera = view
    height, width_px = depth.shape
    row, normal, point = np.empty(matrix.shape[0]), np.empty(3), np.empty(3)
    offset_row = np.empty((3, capsule_local.shape[3]))
    fx, fy, cx, cy = camera
    energy = 0.0
    violated[:] = 0.0
    per_sample = weight / (len(ends) * samples)
    for c in range(len(ends)):
        for s in range(samples):
            t = (s + 0.5) / samples
            radius = radii[c, 0] + t * (radii[c, 1] - radii[c, 0])
            x, y, z = 0.0, 0.0, 0.0
            for b in range(3):
                point[b] = ends[c, 0, b] + t * (ends[c, 1, b] - ends[c, 0, b])
                offset = point[b] - world_from_camera[b, 3]
                x += world_from_camera[b, 0] * offset
                y += world_from_camera[b, 1] * offset
                z += world_from_camera[b, 2] * offset
            if z < 0.2:
                continue
            u, v = int(np.floor(fx * x / z + cx + 0.5)), int(np.floor(fy * y / z + cy + 0.5))
            if u < 0 or v < 0 or u >= width_px or v >= height:
                continue
            seen = depth[v, u]
            girth_row = 0.0
            if mask[v, u]:
                residual = seen - (z - radius) - 0.03
                if residual <= 0.0:
                    continue
                for a in range(3):
                    normal[a] = -world_from_camera[a, 2]
                girth_row = radius / body_girth(radii)
            else:
                if seen == 0.0 or seen < z - radius - 0.05:
                    continue
                near_v, near_u = nearest_pixel(v, u, nearest)
                if near_v < 0:
                    continue
                violated[c] += 1.0 / samples
                dx, dy = (u - near_u) * z / fx, (v - near_v) * z / fy
                residual = np.sqrt(dx * dx + dy * dy)
                for a in range(3):
                    normal[a] = (dx * world_from_camera[a, 0] + dy * world_from_camera[a, 1]) / residual
            row[:] = 0.0
            between(offset_row, capsule_local[c], t)
            point_row(row, 1.0, capsule_frame[c], point, normal, offset_row, body)
            if len(row) > _DOFS:
                row[_DOFS + _GIRTH] += girth_row
            cost, w = robust(residual, width)
            energy += per_sample * cost
            add(matrix, gradient, row, residual, per_sample * w)
    return energy


@njit(cache=True, nogil=True)
def self_intersection(  # type: ignore[no-untyped-def]
    matrix, gradient, ends, radii, capsule_frame, capsule_local, body, pairs, weight, samples
):
    """Limbs do not enter each other: samples on the first capsule of a pair stay outside the second."""
    filled, values = np.empty(matrix.shape[0], np.int64), np.empty(matrix.shape[0])
    normal, point, centre = np.empty(3), np.empty(3), np.empty(3)
    energy = 0.0
    for k in range(len(pairs)):
        i, j = pairs[k]
        for s in range(samples):
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
            reach = radii[i, 0] + t * (radii[i, 1] - radii[i, 0])
            reach += radii[j, 0] + along * (radii[j, 1] - radii[j, 0])
            distance = np.sqrt(square)
            residual = 0.85 * reach - distance
            if residual <= 0.0 or distance < 1e-6:
                continue
            for a in range(3):
                normal[a] = (point[a] - centre[a]) / distance
            first = (capsule_frame[i], point, capsule_local[i], t)
            second = (capsule_frame[j], centre, capsule_local[j], along)
            count = _parting_row(filled, values, first, second, normal, body, matrix.shape[0] > _DOFS)
            energy += weight * residual * residual
            _add_few(matrix, gradient, filled, values, count, residual, weight)
    return energy


@njit(cache=True, nogil=True)
def _parting_row(filled, values, first, second, normal, body, with_lengths):  # type: ignore[no-untyped-def]
    """normal . d(second - first)/d(unknowns) of two points, ``normal`` along the line between them.

    What carries both points turns that line without making it longer, so only the unknowns that move one of
    them count: a few of the forearm against the chest. Returns how many were filled.
    """
    world, pivots, by_length, moves, dof_frame, dof_axis, _, _ = body
    one, point, one_local, t = first
    other, centre, other_local, along = second
    count = 0
    for k in range(len(dof_frame)):
        if moves[one, k] == moves[other, k]:
            continue
        f, axis = dof_frame[k], dof_axis[k]
        side = -1.0 if moves[one, k] else 1.0
        at = point if moves[one, k] else centre
        ax, ay, az = world[f, 0, axis], world[f, 1, axis], world[f, 2, axis]
        x, y, z = at[0] - pivots[f, 0], at[1] - pivots[f, 1], at[2] - pivots[f, 2]
        filled[count] = 3 + k
        values[count] = side * (
            normal[0] * (ay * z - az * y) + normal[1] * (az * x - ax * z) + normal[2] * (ax * y - ay * x)
        )
        count += 1
    if not with_lengths:
        return count
    for p in range(by_length.shape[2]):
        apart = 0.0
        for a in range(3):
            change = by_length[other, a, p] - by_length[one, a, p]
            for b in range(3):
                here = (1.0 - t) * one_local[0, b, p] + t * one_local[1, b, p]
                there = (1.0 - along) * other_local[0, b, p] + along * other_local[1, b, p]
                change += world[other, a, b] * there - world[one, a, b] * here
            apart += normal[a] * change
        filled[count], values[count] = _DOFS + p, apart
        count += 1
    return count


@njit(cache=True, nogil=True)
def above_floor(matrix, gradient, ends, radii, capsule_frame, capsule_local, body, weight, slack):  # type: ignore[no-untyped-def]
    """No limb below the floor at y = 0: the lowest point of both ends of every capsule, ``slack`` allowed."""
    row, up = np.zeros(matrix.shape[0]), np.array([0.0, 1.0, 0.0])
    energy = 0.0
    for c in range(len(ends)):
        for e in range(2):
            residual = radii[c, e] - slack - ends[c, e, 1]
            if residual <= 0.0:
                continue
            row[:] = 0.0
            point_row(row, -1.0, capsule_frame[c], ends[c, e], up, capsule_local[c, e], body)
            if len(row) > _DOFS:
                row[_DOFS + _GIRTH] += radii[c, e] / body_girth(radii)
            energy += weight * residual * residual
            add(matrix, gradient, row, residual, weight)
    return energy


@njit(cache=True, nogil=True)
def near_landmarks(  # type: ignore[no-untyped-def]
    matrix, gradient, landmarks, frames, local, lengths, body, weight
):
    """Joints are near where something else than the surface puts them: weight w |p - landmark|^2, robustly.

    Args:
        landmarks: (20, 5) x, y, z, the weight w and the robust width of each joint; (0, 5): there are none.
        frames, local: (20,) and (20, 3, 12) the joints on the model.
    """
    columns, filled = np.empty((matrix.shape[0], 3)), np.empty(matrix.shape[0], np.int64)
    point, apart = np.empty(3), np.empty(3)
    energy = 0.0
    for j in range(len(landmarks)):
        w = weight * landmarks[j, 3]
        if w <= 0.0:
            continue
        carried(point, frames[j], local[j], lengths, body)
        square = 0.0
        for a in range(3):
            apart[a] = point[a] - landmarks[j, a]
            square += apart[a] * apart[a]
        cost, doubt = robust(np.sqrt(square), landmarks[j, 4])
        energy += w * cost
        count = point_columns(columns, filled, frames[j], point, local[j], body)
        add_point(matrix, gradient, columns, filled, count, apart, w * doubt)
    return energy


@njit(cache=True, nogil=True)
def carried(point, frame, local, lengths, body):  # type: ignore[no-untyped-def]
    """(3,) where a frame carries a point that is linear in the lengths, into ``point``."""
    world, pivots = body[0], body[1]
    for a in range(3):
        point[a] = pivots[frame, a]
    for b in range(3):
        offset = 0.0
        for p in range(len(lengths)):
            offset += local[b, p] * lengths[p]
        for a in range(3):
            point[a] += world[frame, a, b] * offset


@njit(cache=True, nogil=True)
def point_columns(columns, filled, frame, point, local, body):  # type: ignore[no-untyped-def]
    """d(point)/d(unknown), (3,) each, of the unknowns that move a point; how many, in rising order."""
    world, pivots, by_length, moves, dof_frame, dof_axis, _, _ = body
    for a in range(3):
        filled[a] = a
        for b in range(3):
            columns[a, b] = 1.0 if a == b else 0.0
    count = 3
    for k in range(len(dof_frame)):
        if moves[frame, k] == 0:
            continue
        f, axis = dof_frame[k], dof_axis[k]
        ax, ay, az = world[f, 0, axis], world[f, 1, axis], world[f, 2, axis]
        x, y, z = point[0] - pivots[f, 0], point[1] - pivots[f, 1], point[2] - pivots[f, 2]
        columns[count, 0] = ay * z - az * y
        columns[count, 1] = az * x - ax * z
        columns[count, 2] = ax * y - ay * x
        filled[count] = 3 + k
        count += 1
    if len(filled) == _DOFS:
        return count
    for p in range(local.shape[1]):
        for a in range(3):
            columns[count, a] = by_length[frame, a, p]
            for b in range(3):
                columns[count, a] += world[frame, a, b] * local[b, p]
        filled[count] = _DOFS + p
        count += 1
    return count


@njit(cache=True, nogil=True)
def add_point(matrix, gradient, columns, filled, count, apart, weight):  # type: ignore[no-untyped-def]
    """A point's three residuals at once into the upper triangle of the normal equations."""
    for m in range(count):
        x, y, z = weight * columns[m, 0], weight * columns[m, 1], weight * columns[m, 2]
        i = filled[m]
        gradient[i] += x * apart[0] + y * apart[1] + z * apart[2]
        for n in range(m, count):
            matrix[i, filled[n]] += x * columns[n, 0] + y * columns[n, 1] + z * columns[n, 2]


@njit(cache=True, nogil=True)
def hold_build(matrix, gradient, lengths, reference, firmness, scale):  # type: ignore[no-untyped-def]
    """Proportions stay near the reference's, and the size too, but ``scale`` times as firmly.

    With the relative changes c of the bones and their mean m, the energy is f sum (c - m)^2 + scale f n m^2;
    the girth, which comes last, stands alone: f c^2.

    Args:
        firmness: (12,) weights; the first is that of all bones.
    """
    bones = len(lengths) - 1
    mean, energy, f = 0.0, 0.0, firmness[0]
    for p in range(bones):
        mean += (lengths[p] / reference[p] - 1.0) / bones
    for p in range(bones):
        change = lengths[p] / reference[p] - 1.0 - mean
        energy += f * change * change
        gradient[_DOFS + p] += f * (change + scale * mean) / reference[p]
        for q in range(p, bones):
            held = (1.0 if p == q else 0.0) - (1.0 - scale) / bones
            matrix[_DOFS + p, _DOFS + q] += f * held / (reference[p] * reference[q])
    girth = lengths[bones] / reference[bones] - 1.0
    matrix[_DOFS + bones, _DOFS + bones] += firmness[bones] / reference[bones] ** 2
    gradient[_DOFS + bones] += firmness[bones] * girth / reference[bones]
    return energy + scale * f * bones * mean * mean + firmness[bones] * girth * girth


@njit(cache=True, nogil=True)
def stay_near(matrix, gradient, rotations, reference, weights, dof_frame, dof_axis):  # type: ignore[no-untyped-def]
    """Every rotation stays near a reference: weight * |log(reference' rotation)|^2 by component."""
    energy = 0.0
    last, turned = -1, np.zeros(3)
    for k in range(len(dof_frame)):
        f = dof_frame[k]
        if f != last:
            turned, last = deviation(reference[f], rotations[f]), f
        w = weights[f]
        value = turned[dof_axis[k]]
        matrix[3 + k, 3 + k] += w
        gradient[3 + k] += w * value
        energy += w * value * value
    return energy


@njit(cache=True, nogil=True)
def joint_ranges(matrix, gradient, rotations, middle, reach, weight, dof_frame, dof_axis):  # type: ignore[no-untyped-def]
    """Rotations inside their boxes are free; outside, the excess is a residual."""
    energy = 0.0
    last, turned = -1, np.zeros(3)
    for k in range(len(dof_frame)):
        f, axis = dof_frame[k], dof_axis[k]
        if f != last:
            turned, last = deviation(middle[f], rotations[f]), f
        value = turned[axis]
        excess = value - reach[f, axis] if value > 0.0 else value + reach[f, axis]
        if abs(value) <= reach[f, axis]:
            continue
        matrix[3 + k, 3 + k] += weight
        gradient[3 + k] += weight * excess
        energy += weight * excess * excess
    return energy
