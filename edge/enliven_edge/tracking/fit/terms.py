"""The terms of the fit, compiled: each adds its squared residuals to the normal equations of Gauss-Newton.

The unknowns are ordered translation (3), rotations (27), lengths (12). A residual r with the row J of its
derivatives and the weight w adds w J'J to the matrix, w J'r to the gradient and w r^2 to the energy.
Residuals of points that a frame carries are added through the sums of :mod:`normal_equations`, the others
directly.

*surface* stands for (ends (C, 2, 3), radii (C, 2), frames (C,), by_ends (C, 2, 3, L), lengths_of, girth): the
capsules, metres, world frame, the frames that carry them, the derivatives of their ends by the lengths,
``model.FRAME_LENGTHS``, and the body's girth, a factor on all radii. L is 12, or 0 where the lengths are
frozen.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven_edge.tracking.body_model import deviation_into, model
from enliven_edge.tracking.fit.normal_equations import add_place, add_ray, of_frame
from enliven_edge.tracking.frame import nearest_pixel

SQUARE_CM = 1e4
"""Square centimetres of a square metre: energies are in them, residuals in metres."""


@njit(cache=True, nogil=True)
def _add_few(matrix, gradient, filled, values, count, residual, weight):  # type: ignore[no-untyped-def]
    """Adds one weighted residual to the upper triangle of the normal equations.

    Its row has only ``count`` entries that are not zero, the ``values`` at ``filled``, in rising order.
    """
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
        body: (world, pivots, by_length, moves, dof_frame, dof_axis, frame_lengths, parents) of a posture;
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
def robust(residual, width):  # type: ignore[no-untyped-def]
    """Geman-McClure: the energy r^2 / (1 + (r / width)^2) and its weight in iterated least squares."""
    ratio = residual / width
    w = 1.0 / (1.0 + ratio * ratio)
    return residual * residual * w, w * w


@njit(cache=True, nogil=True)
def ends_by_length(out, body, capsule_frame, capsule_local):  # type: ignore[no-untyped-def]
    """(C, 2, 3, L) the derivatives of the capsules' ends by the lengths, world frame, into ``out``."""
    for c in range(len(capsule_frame)):
        for e in range(2):
            by_length(out[c, e], capsule_frame[c], capsule_local[c, e], body)


@njit(cache=True, nogil=True)
def by_length(out, frame, local, body):  # type: ignore[no-untyped-def]
    """(3, L) the derivatives by the lengths of a point that is (3, 12) in its frame, into ``out``."""
    world, of_pivot, lengths_of = body[0], body[2], body[6]
    out[:] = 0.0
    for p in of_frame(lengths_of, frame, out.shape[1]):
        x, y, z = local[0, p], local[1, p], local[2, p]
        for a in range(3):
            out[a, p] = of_pivot[frame, a, p] + world[frame, a, 0] * x + world[frame, a, 1] * y
            out[a, p] += world[frame, a, 2] * z


@njit(cache=True, nogil=True)
def _stretch(out, normal, by_ends, t, frame, lengths_of):  # type: ignore[no-untyped-def]
    """(L,) normal . d(point)/d(length), a share t along a capsule, into ``out``; not by the girth."""
    out[:] = 0.0
    for p in of_frame(lengths_of, frame, len(out)):
        for a in range(3):
            out[p] += normal[a] * ((1.0 - t) * by_ends[0, a, p] + t * by_ends[1, a, p])


@njit(cache=True, nogil=True)
def free_space(sums, surface, view, weight, width, samples, violated):  # type: ignore[no-untyped-def]
    """Adds the term against limbs where the camera saw through, or in front of what it saw.

    Points along every capsule's axis are projected. Outside the person's silhouette they are drawn to the
    nearest pixel of it, unless something nearer hides them or nothing is known there; inside it, a surface
    that stands in front of the observed one is pushed back.

    Args:
        view: (depth, mask, nearest, camera, world_from_camera): (h, w) metres (0 unknown), (h, w) the
            person's pixels, (h, w) of :func:`observation.nearest_columns`, (4,) fx, fy, cx, cy, and (4, 4).
        violated: (C,) receives the share of each capsule's samples seen through.
    """
    ends, radii, capsule_frame, by_ends, lengths_of, girth = surface
    depth, mask, nearest, camera, pose = view
    normal, point, stretch = np.empty(3), np.empty(3), np.empty(len(sums[4]))
    first, last = np.empty(3), np.empty(3)
    fx, fy, cx, cy = camera
    energy = 0.0
    violated[:] = 0.0
    per_sample = weight / (len(ends) * samples)
    for c in range(len(ends)):
        _in_camera(first, pose, ends[c, 0])
        _in_camera(last, pose, ends[c, 1])
        for s in range(samples):
            t = (s + 0.5) / samples
            radius = radii[c, 0] + t * (radii[c, 1] - radii[c, 0])
            z = first[2] + t * (last[2] - first[2])
            if z < 0.2:
                continue
            u = int(np.floor(fx * (first[0] + t * (last[0] - first[0])) / z + cx + 0.5))
            v = int(np.floor(fy * (first[1] + t * (last[1] - first[1])) / z + cy + 0.5))
            if u < 0 or v < 0 or u >= depth.shape[1] or v >= depth.shape[0]:
                continue
            seen, inside = depth[v, u], mask[v, u]
            if inside:
                residual = seen - (z - radius) - 0.03
                if residual <= 0.0:
                    continue
                for a in range(3):
                    normal[a] = -pose[a, 2]
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
                    normal[a] = (dx * pose[a, 0] + dy * pose[a, 1]) / residual
            for a in range(3):
                point[a] = ends[c, 0, a] + t * (ends[c, 1, a] - ends[c, 0, a])
            _stretch(stretch, normal, by_ends[c], t, capsule_frame[c], lengths_of)
            if inside and len(stretch) > 0:
                stretch[model.GIRTH] += radius / girth
            cost, w = robust(residual, width)
            energy += per_sample * cost
            add_ray(sums, capsule_frame[c], normal, point, stretch, lengths_of, residual, per_sample * w)
    return energy


@njit(cache=True, nogil=True)
def _in_camera(out, pose, point):  # type: ignore[no-untyped-def]
    """(3,) a point of the world in the frame of a camera at the (4, 4) pose, into ``out``."""
    for a in range(3):
        out[a] = 0.0
        for b in range(3):
            out[a] += pose[b, a] * (point[b] - pose[b, 3])


@njit(cache=True, nogil=True)
def self_intersection(matrix, gradient, surface, body, pairs, weight, samples):  # type: ignore[no-untyped-def]
    """Adds the term that keeps samples on the first capsule of each pair out of the second."""
    ends, radii, capsule_frame, by_ends, _, _ = surface
    filled, values = np.empty(matrix.shape[0], np.int64), np.empty(matrix.shape[0])
    normal, point, centre = np.empty(3), np.empty(3), np.empty(3)
    energy = 0.0
    for k in range(len(pairs)):
        i, j = pairs[k]
        if _clear(ends[i], radii[i], ends[j], radii[j]):
            continue
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
            first = (capsule_frame[i], point, by_ends[i], t)
            second = (capsule_frame[j], centre, by_ends[j], along)
            count = _parting_row(filled, values, first, second, normal, body)
            energy += weight * residual * residual
            _add_few(matrix, gradient, filled, values, count, residual, weight)
    return energy


@njit(cache=True, nogil=True)
def _clear(one, thick, other, broad):  # type: ignore[no-untyped-def]
    """Whether two capsules are too far apart to meet, by the balls about them."""
    apart, first, second = 0.0, 0.0, 0.0
    for a in range(3):
        apart += (0.5 * (one[0, a] + one[1, a] - other[0, a] - other[1, a])) ** 2
        first += (0.5 * (one[1, a] - one[0, a])) ** 2
        second += (0.5 * (other[1, a] - other[0, a])) ** 2
    reach = max(thick[0], thick[1]) + max(broad[0], broad[1]) + np.sqrt(first) + np.sqrt(second)
    return apart > reach * reach


@njit(cache=True, nogil=True)
def _parting_row(filled, values, first, second, normal, body):  # type: ignore[no-untyped-def]
    """normal . d(second - first)/d(unknowns) of two points, ``normal`` along the line between them.

    An unknown that moves both points turns that line without making it longer, so only the unknowns that move
    one of them count: a few for the forearm against the chest. Returns the number of filled entries.

    Args:
        first, second: the frame, the (3,) point, (2, 3, L) the derivatives of its capsule's ends by the
            lengths, and the share along it.
    """
    world, pivots, _, moves, dof_frame, dof_axis, _, _ = body
    one, point, by_one, t = first
    other, centre, by_other, along = second
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
    for p in range(by_one.shape[2]):
        apart = 0.0
        for a in range(3):
            here = (1.0 - t) * by_one[0, a, p] + t * by_one[1, a, p]
            apart += normal[a] * ((1.0 - along) * by_other[0, a, p] + along * by_other[1, a, p] - here)
        filled[count], values[count] = model.DOFS + p, apart
        count += 1
    return count


@njit(cache=True, nogil=True)
def above_floor(sums, surface, weight, slack):  # type: ignore[no-untyped-def]
    """Adds the term that keeps the balls at both ends of every capsule above y = -``slack`` metres."""
    ends, radii, capsule_frame, by_ends, lengths_of, girth = surface
    down, stretch = np.array([0.0, -1.0, 0.0]), np.empty(len(sums[4]))
    energy = 0.0
    for c in range(len(ends)):
        for e in range(2):
            residual = radii[c, e] - slack - ends[c, e, 1]
            if residual <= 0.0:
                continue
            _stretch(stretch, down, by_ends[c], float(e), capsule_frame[c], lengths_of)
            if len(stretch) > 0:
                stretch[model.GIRTH] += radii[c, e] / girth
            energy += weight * residual * residual
            add_ray(sums, capsule_frame[c], down, ends[c, e], stretch, lengths_of, residual, weight)
    return energy


@njit(cache=True, nogil=True)
def near_landmarks(sums, landmarks, frames, local, lengths, body, weight):  # type: ignore[no-untyped-def]
    """Adds the term that draws joints p to their landmarks: weight w |p - landmark|^2, robustly.

    Args:
        landmarks: (20, 5) x, y, z, the weight w and the robust width of each joint; (0, 5) without landmarks.
        frames, local: (20,) and (20, 3, 12) the joints on the model.
    """
    point, apart, stretch = np.empty(3), np.empty(3), np.empty((3, len(sums[4])))
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
        by_length(stretch, frames[j], local[j], body)
        add_place(sums, frames[j], point, apart, stretch, body[6], w * doubt)
    return energy


@njit(cache=True, nogil=True)
def carried(point, frame, local, lengths, body):  # type: ignore[no-untyped-def]
    """Writes the (3,) place of a point that a frame carries, linear in the lengths, into ``point``."""
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
def hold_build(matrix, gradient, lengths, reference, firmness, scale):  # type: ignore[no-untyped-def]
    """Adds the term that keeps proportions near the reference's, and the size ``scale`` times as firmly.

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
        gradient[model.DOFS + p] += f * (change + scale * mean) / reference[p]
        for q in range(p, bones):
            held = (1.0 if p == q else 0.0) - (1.0 - scale) / bones
            matrix[model.DOFS + p, model.DOFS + q] += f * held / (reference[p] * reference[q])
    girth = lengths[bones] / reference[bones] - 1.0
    matrix[model.DOFS + bones, model.DOFS + bones] += firmness[bones] / reference[bones] ** 2
    gradient[model.DOFS + bones] += firmness[bones] * girth / reference[bones]
    return energy + scale * f * bones * mean * mean + firmness[bones] * girth * girth


@njit(cache=True, nogil=True)
def stay_near(matrix, gradient, rotations, reference, weights, dof_frame, dof_axis):  # type: ignore[no-untyped-def]
    """Adds the term that keeps rotations near a reference: weight * |log(reference' rotation)|^2."""
    energy = 0.0
    last, turned = -1, np.zeros(3)
    for k in range(len(dof_frame)):
        f, w = dof_frame[k], weights[dof_frame[k]]
        if w == 0.0:
            continue
        if f != last:
            deviation_into(turned, reference[f], rotations[f])
            last = f
        value = turned[dof_axis[k]]
        matrix[3 + k, 3 + k] += w
        gradient[3 + k] += w * value
        energy += w * value * value
    return energy


@njit(cache=True, nogil=True)
def joint_ranges(matrix, gradient, rotations, middle, reach, weight, dof_frame, dof_axis):  # type: ignore[no-untyped-def]
    """Adds the term that keeps rotations within their ranges: the excess beyond is a residual."""
    energy = 0.0
    last, turned = -1, np.zeros(3)
    for k in range(len(dof_frame)):
        f, axis = dof_frame[k], dof_axis[k]
        if f != last:
            deviation_into(turned, middle[f], rotations[f])
            last = f
        value = turned[axis]
        excess = value - reach[f, axis] if value > 0.0 else value + reach[f, axis]
        if abs(value) <= reach[f, axis]:
            continue
        matrix[3 + k, 3 + k] += weight
        gradient[3 + k] += weight * excess
        energy += weight * excess * excess
    return energy
