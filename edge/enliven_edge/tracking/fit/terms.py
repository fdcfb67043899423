"""The terms of the fit, compiled: each adds its squared residuals to the Gauss-Newton normal equations.

The order of the unknowns is translation (3), rotations (27), lengths (12). Consider a residual r with the
weight w, and the row J of its derivatives. It adds w J'J to the matrix, w J'r to the gradient and w r^2 to
the energy. Residuals of points that are fixed to a frame are added through the sums of
:mod:`normal_equations`, other residuals directly.

:mod:`structures` defines the arguments: body, surface, sums, prior and weights. :func:`assemble` adds up all
terms. **A new term needs a kernel and a line here, and a weight in** ``FitSettings``. Every term can read the
weights by name. The number of lengths L is 12, or 0 if they are frozen.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.kinematics import (
    capsules_into,
    deviation_into,
    forward_into,
    pivots_by_length,
)
from enliven_edge.tracking.fit.data_term import depth_to_model
from enliven_edge.tracking.fit.normal_equations import (
    add_direction_residual,
    add_point_residual,
    add_sums,
    by_length,
    empty_sums,
    ends_by_length,
    robust,
    stretch_into,
    world_point_into,
)
from enliven_edge.tracking.fit.self_intersection import self_intersection
from enliven_edge.tracking.fit.structures import CapsuleSurface, PlacedFrames
from enliven_edge.tracking.frame.observation import nearest_pixel

SQUARE_CM = 1e4
"""Square centimetres per square metre: energies are in square centimetres, residuals in metres."""
_SIDE_COST_M = 0.04
"""Cost in metres of a capsule's surface that is seen from the side, see :func:`capsules.nearest_capsules`. It
is about the radius of a forearm."""
_FREE_SPACE_WIDTH_M = 0.25
"""Robust width of the free-space term in metres. It covers a whole forearm in a wrong position."""
_CAPSULE_SAMPLES = np.int64(5)
"""Number of points along a capsule that are tested for free space. It is an int64, because Numba would
compile a second version for an int."""
_PAIR_SAMPLES = np.int64(3)
"""Number of points along the first capsule of a pair that are kept outside the second capsule."""
_INTERSECTION_WEIGHT = 0.02
"""Weight of the self-intersection term relative to that of all points together."""
_SIZE_WEIGHT = 0.1
"""Weight of a person's size relative to that of the proportions. People differ more in size."""
_FLOOR_TOLERANCE_M = 0.02
"""Tolerance of the floor's height in metres: limbs may be this far below the estimated floor."""


@njit(cache=True, nogil=True)
def free_space(sums, surface, view, weight, width, samples, violated):  # noqa: PLR0915, a kernel
    """Adds the free-space term, which moves limbs out of the free space in front of the observed depth.

    Points along every capsule's axis are projected into the image. A point outside the person's silhouette is
    moved to the nearest silhouette pixel, unless a nearer object hides it or the depth is unknown. A point
    inside the silhouette is moved back if its capsule is in front of the observed surface.

    Args:
        sums: the sums, modified in place.
        surface: a :class:`~enliven_edge.tracking.fit.structures.CapsuleSurface`.
        view: an :class:`~enliven_edge.tracking.frame.observation.ImageView`.
        weight: the weight of the term.
        width: robust width in metres.
        samples: number of points per capsule.
        violated: (C,) receives the fraction of each capsule's samples in free space.
    """
    ends, radii, by_ends, lengths_of = surface.ends, surface.radii, surface.by_ends, surface.lengths_of
    depth, mask, pose = view.depth, view.mask, view.world_from_camera
    normal, point, stretch = np.empty(3), np.empty(3), np.empty(len(sums.tug))
    first, last = np.empty(3), np.empty(3)
    fx, fy, cx, cy = view.camera
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
            # Project the sample into the image.
            u = int(np.floor(fx * (first[0] + t * (last[0] - first[0])) / z + cx + 0.5))
            v = int(np.floor(fy * (first[1] + t * (last[1] - first[1])) / z + cy + 0.5))
            if u < 0 or v < 0 or u >= depth.shape[1] or v >= depth.shape[0]:
                continue
            seen, inside = depth[v, u], mask[v, u]
            # Inside the silhouette, move the surface behind the observed depth, with a tolerance of 3 cm.
            if inside:
                residual = seen - (z - radius) - 0.03
                if residual <= 0.0:
                    continue
                for a in range(3):
                    normal[a] = -pose[a, 2]
            else:
                # Outside the silhouette, skip occluded and unknown pixels, and move the other samples to the
                # silhouette.
                if seen == 0.0 or seen < z - radius - 0.05:
                    continue
                near_v, near_u = nearest_pixel(v, u, view.nearest)
                if near_v < 0:
                    continue
                violated[c] += 1.0 / samples
                dx, dy = (u - near_u) * z / fx, (v - near_v) * z / fy
                residual = np.sqrt(dx * dx + dy * dy)
                for a in range(3):
                    normal[a] = (dx * pose[a, 0] + dy * pose[a, 1]) / residual
            for a in range(3):
                point[a] = ends[c, 0, a] + t * (ends[c, 1, a] - ends[c, 0, a])
            if len(stretch) > 0:
                stretch_into(stretch, normal, by_ends[c], t, surface.frame[c], lengths_of)
                stretch[model.GIRTH] += radius / surface.girth if inside else 0.0
            cost, w = robust(residual, width)
            energy += per_sample * cost
            add_direction_residual(
                sums, surface.frame[c], normal, point, stretch, lengths_of, residual, per_sample * w
            )
    return energy


@njit(cache=True, nogil=True)
def _in_camera(out, pose, point):
    """Transforms a (3,) world point into the frame of a camera with the (4, 4) pose, and writes it into
    ``out``.
    """
    for a in range(3):
        out[a] = 0.0
        for b in range(3):
            out[a] += pose[b, a] * (point[b] - pose[b, 3])


@njit(cache=True, nogil=True)
def above_floor(sums, surface, weight, slack):
    """Adds the term that keeps the balls at both ends of every capsule above the floor, y = 0.

    ``slack`` is the tolerance in metres.
    """
    ends, radii, lengths_of = surface.ends, surface.radii, surface.lengths_of
    down, stretch = np.array([0.0, -1.0, 0.0]), np.empty(len(sums.tug))
    energy = 0.0
    for c in range(len(ends)):
        for e in range(2):
            residual = radii[c, e] - slack - ends[c, e, 1]
            if residual <= 0.0:
                continue
            stretch_into(stretch, down, surface.by_ends[c], float(e), surface.frame[c], lengths_of)
            if len(stretch) > 0:
                stretch[model.GIRTH] += radii[c, e] / surface.girth
            energy += weight * residual * residual
            add_direction_residual(
                sums, surface.frame[c], down, ends[c, e], stretch, lengths_of, residual, weight
            )
    return energy


@njit(cache=True, nogil=True)
def near_landmarks(sums, landmarks, frames, local, lengths, body, weight):
    """Adds the landmark term w |p - landmark|^2 of joints p, with robust weights.

    Args:
        sums: the sums, modified in place.
        landmarks: (20, 5) x, y, z, the weight w and the robust width of each joint; (0, 5) without landmarks.
        frames, local: (20,) frames and (20, 3, 12) positions in them of the model's joints.
        lengths: (12,) metres.
        body: the frames of a posture.
        weight: the weight of the term.
    """
    point, apart, stretch = np.empty(3), np.empty(3), np.empty((3, len(sums.tug)))
    energy = 0.0
    for j in range(len(landmarks)):
        w = weight * landmarks[j, 3]
        if w <= 0.0:
            continue
        world_point_into(point, frames[j], local[j], lengths, body)
        square = 0.0
        for a in range(3):
            apart[a] = point[a] - landmarks[j, a]
            square += apart[a] * apart[a]
        cost, doubt = robust(np.sqrt(square), landmarks[j, 4])
        energy += w * cost
        if len(sums.tug) > 0:
            by_length(stretch, frames[j], local[j], body)
        add_point_residual(sums, frames[j], point, apart, stretch, body.lengths_of, w * doubt)
    return energy


@njit(cache=True, nogil=True)
def keep_proportions(matrix, gradient, lengths, reference, firmness, scale):
    """Adds the term that keeps the bone lengths near the reference.

    The size has a lower weight, ``scale`` times that of the proportions. For n bones with relative changes c,
    the mean m of c, and the weight f, the energy is f sum (c - m)^2 + scale f n m^2. The girth, the last
    length, has its own term f c^2.

    Args:
        matrix, gradient: the normal equations, modified in place.
        lengths, reference: (12,) metres.
        firmness: (12,) weights; the first one is used for all bones.
        scale: the relative weight of the size.
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
def keep_rotations_near(matrix, gradient, rotations, reference, weights, dof_frame, dof_axis):
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
def joint_ranges(matrix, gradient, rotations, middle, reach, weight, dof_frame, dof_axis):
    """Adds the term that keeps rotations within their ranges: the excess beyond a range is a residual."""
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


@njit(cache=True, nogil=True)
def assemble(matrix, gradient, state, seen, shape, prior, weights, support, violated):
    """Computes the normal equations (upper triangle) and the energy at a posture.

    Returns (energy, explained).

    Each term consists of one line here, one kernel above, and one weight in :class:`FitSettings`.

    Args:
        matrix, gradient: receive the normal equations.
        state, shape, prior, weights: as in :mod:`enliven_edge.tracking.fit.structures`.
        seen: a :class:`~enliven_edge.tracking.frame.observation.ObservationArrays`.
        support: (C,) receives the number of points that each capsule explains.
        violated: (C,) receives the fraction of each capsule in free space.
    """
    rotations, lengths, free = state.rotations, state.lengths, len(prior.firmness)
    frame, axis = shape.dof_frame, shape.dof_axis
    matrix[:], gradient[:] = 0.0, 0.0
    body, surface = place_model(state, shape, free)
    sums = empty_sums(len(rotations), free)
    energy, explained = depth_to_model(
        sums, seen.points, seen.affinity, surface, SQUARE_CM, weights.width, _SIDE_COST_M, support
    )
    through, low = weights.free_space * SQUARE_CM, weights.floor * SQUARE_CM
    energy += free_space(sums, surface, seen.image, through, _FREE_SPACE_WIDTH_M, _CAPSULE_SAMPLES, violated)
    energy += above_floor(sums, surface, low, _FLOOR_TOLERANCE_M)
    joints = (shape.joint_frames, shape.joint_offsets)
    near = weights.landmarks * SQUARE_CM
    energy += near_landmarks(sums, seen.landmarks, joints[0], joints[1], lengths, body, near)
    add_sums(matrix, gradient, sums, body)
    energy += self_intersection(
        matrix, gradient, surface, body, shape.pairs, _INTERSECTION_WEIGHT * SQUARE_CM, _PAIR_SAMPLES
    )
    energy += joint_ranges(
        matrix, gradient, rotations, prior.middle, prior.reach, weights.ranges, frame, axis
    )
    energy += keep_rotations_near(matrix, gradient, rotations, prior.rest, prior.relaxedness, frame, axis)
    energy += keep_rotations_near(matrix, gradient, rotations, prior.predicted, prior.stiffness, frame, axis)
    if free > 0:
        energy += keep_proportions(matrix, gradient, lengths, prior.reference, prior.firmness, _SIZE_WEIGHT)
    return energy, explained


@njit(cache=True, nogil=True)
def place_model(state, shape, free):
    """Returns the frames and the surface of a posture.

    ``free`` is the number of lengths that are not frozen.
    """
    rotations, lengths, frames = state.rotations, state.lengths, shape.capsule_frame
    world, pivots, of_pivots = np.empty((13, 3, 3)), np.empty((13, 3)), np.empty((13, 3, free))
    forward_into(world, pivots, state.position, rotations, lengths, shape.parents, shape.pivots)
    pivots_by_length(of_pivots, world, rotations, shape.parents, shape.pivots)
    turns = (shape.dof_frame, shape.dof_axis)
    body = PlacedFrames(
        world, pivots, of_pivots, shape.moves, turns[0], turns[1], shape.lengths_of, shape.parents
    )
    count = len(frames)
    ends, radii, by_ends = np.empty((count, 2, 3)), np.empty((count, 2)), np.empty((count, 2, 3, free))
    capsules_into(ends, radii, world, pivots, lengths, frames, shape.capsule_ends, shape.capsule_radii)
    if free > 0:
        ends_by_length(by_ends, body, frames, shape.capsule_ends)
    return body, CapsuleSurface(ends, radii, frames, by_ends, shape.lengths_of, lengths[model.GIRTH])
