"""Compiled forward kinematics of the body model, and the mathematics of small rotations."""

from __future__ import annotations

import numpy as np

from enliven.kernels import copy_row, copy_rows, njit
from enliven_edge.tracking.body_model.model import SHOULDER, UPPER_ARM_L, UPPER_ARM_R

MAX_SHOULDER_ELEVATION = 0.3
"""Maximum rotation of a shoulder about the base of the neck in radians, when its arm points straight up."""
_LEVEL = 0.0
"""The shoulder begins to rise if the y component of the upper arm's unit vector in the chest's frame exceeds
this value.
"""
_SMALL = 1e-4
"""Below this value the sine of an angle is replaced by the angle, or by half a turn minus the angle."""


@njit(cache=True, nogil=True)
def forward_into(world, pivots, position, rotations, lengths, parents, offsets):
    """Computes forward kinematics, parents first, and writes it into ``world`` and ``pivots``.

    Args:
        world: (13, 3, 3) receives world_from_frame.
        pivots: (13, 3) receives the frames' origins.
        position: (3,) metres, the origin of the first frame.
        rotations: (13, 3, 3) parent_from_frame.
        lengths: (12,) metres.
        parents: (13,) the parent of each frame.
        offsets: (13, 3, 12) each frame's origin in its parent's frame, linear in the lengths.
    """
    copy_row(pivots[0], position)
    copy_rows(world[0], rotations[0])
    for f in range(1, len(parents)):
        p = parents[f]
        x, y, z = (
            _dot(offsets[f, 0], lengths),
            _dot(offsets[f, 1], lengths),
            _dot(offsets[f, 2], lengths),
        )
        if f in (UPPER_ARM_L, UPPER_ARM_R):
            dx, dy = _shoulder_shift(offsets[f], rotations[f], f)
            x, y = x + dx * lengths[SHOULDER], y + dy * lengths[SHOULDER]
        for a in range(3):
            pivots[f, a] = pivots[p, a] + world[p, a, 0] * x + world[p, a, 1] * y + world[p, a, 2] * z
            for c in range(3):
                world[f, a, c] = (
                    world[p, a, 0] * rotations[f, 0, c]
                    + world[p, a, 1] * rotations[f, 1, c]
                    + world[p, a, 2] * rotations[f, 2, c]
                )


@njit(cache=True, nogil=True)
def pivots_by_length(out, world, rotations, parents, offsets):
    """Writes (13, 3, L) derivatives of the frames' origins with respect to the lengths into ``out``. L is 0
    or 12.
    """
    out[:] = 0.0
    for f in range(1, len(parents) if out.shape[2] > 0 else 0):
        p = parents[f]
        for a in range(3):
            for term in range(out.shape[2]):
                x, y, z = offsets[f, 0, term], offsets[f, 1, term], offsets[f, 2, term]
                along = world[p, a, 0] * x + world[p, a, 1] * y + world[p, a, 2] * z
                out[f, a, term] = out[p, a, term] + along
        if f in (UPPER_ARM_L, UPPER_ARM_R):
            dx, dy = _shoulder_shift(offsets[f], rotations[f], f)
            for a in range(3):
                out[f, a, SHOULDER] += world[p, a, 0] * dx + world[p, a, 1] * dy


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _dot(row, lengths):
    """Returns the dot product of (L,) and (L,).

    The compiler may reorder the sum and can therefore vectorise it.
    """
    total = 0.0
    for term in range(len(lengths)):
        total += row[term] * lengths[term]
    return total


@njit(cache=True, nogil=True)
def _shoulder_shift(offset, rotation, frame):
    """Returns the shift of a raised arm's shoulder, sideways and up, per metre of shoulder width."""
    sine, cosine = shoulder_elevation(rotation)
    side = 1.0 if frame == UPPER_ARM_L else -1.0
    x, y = offset[0, SHOULDER], offset[1, SHOULDER]
    return cosine * x - side * sine * y - x, side * sine * x + cosine * y - y


@njit(cache=True, nogil=True)
def shoulder_elevation(rotation):
    """Returns the sine and cosine of the elevation angle of a shoulder, which rises with its arm.

    The collar bone has no degree of freedom of its own. It moves with the arm, as it does in people (the
    scapulohumeral rhythm). The fit treats the shoulder as fixed within a step, because it moves only a tenth
    as far as the elbow.
    """
    share = max(0.0, (-rotation[1, 1] - _LEVEL) / (1.0 - _LEVEL))
    angle = MAX_SHOULDER_ELEVATION * share * share * (3.0 - 2.0 * share)
    return np.sin(angle), np.cos(angle)


@njit(cache=True, nogil=True)
def capsules_into(ends, radii, world, pivots, lengths, frames, local, thickness):
    """Computes the (C, 2, 3) ends and (C, 2) radii of a posture's capsules, world frame.

    Args:
        ends, radii: receive the result, metres.
        world, pivots: (13, 3, 3) and (13, 3), the output of :func:`forward_into`.
        lengths: (12,) metres.
        frames: (C,) the frame of each capsule.
        local: (C, 2, 3, 12) coefficients of each capsule's ends in its frame, linear in the lengths.
        thickness: (C, 2) radii at girth 1; the girth is the last length.
    """
    girth = lengths[len(lengths) - 1]
    for c in range(len(frames)):
        f = frames[c]
        for e in range(2):
            radii[c, e] = thickness[c, e] * girth
            of = local[c, e]
            x, y, z = _dot(of[0], lengths), _dot(of[1], lengths), _dot(of[2], lengths)
            for a in range(3):
                ends[c, e, a] = pivots[f, a] + world[f, a, 0] * x + world[f, a, 1] * y + world[f, a, 2] * z


@njit(cache=True, nogil=True)
def turn(rotations, step, dof_frame, dof_axis):
    """Multiplies every frame's rotation from the right by the exponential of its angles in ``step``."""
    k = 0
    while k < len(dof_frame):
        frame = dof_frame[k]
        vector = np.zeros(3)
        while k < len(dof_frame) and dof_frame[k] == frame:
            vector[dof_axis[k]] = step[k]
            k += 1
        copy_rows(rotations[frame], product(rotations[frame], exponential(vector)))


@njit(cache=True, nogil=True)
def extrapolate(rotations, before, share, fastest):
    """Extrapolates each frame's rotation by a fraction of its rotation since ``before``, in place.

    The extrapolation is at most ``fastest`` radians.
    """
    for f in range(len(rotations)):
        vector = share * deviation(before[f], rotations[f])
        angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
        vector *= min(1.0, fastest / max(1e-9, angle))
        copy_rows(rotations[f], product(rotations[f], exponential(vector)))


@njit(cache=True, nogil=True)
def product(a, b):
    """Returns the (3, 3) matrix product a b, without a BLAS call."""
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]
    return out


@njit(cache=True, nogil=True)
def deviation(reference, rotation):
    """Returns (3,) log(reference' rotation): the rotation vector between two rotations.

    Its axes are those of ``reference``.
    """
    out = np.empty(3)
    deviation_into(out, reference, rotation)
    return out


@njit(cache=True, nogil=True)
def deviation_into(out, reference, rotation):
    """Writes :func:`deviation` into (3,) ``out``, without an allocation, because a fit calls it 40 times per
    step."""
    trace = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = 0.0
        for a in range(3):
            trace += reference[a, i] * rotation[a, i]
            out[i] += reference[a, k] * rotation[a, j] - reference[a, j] * rotation[a, k]
    sine = 0.5 * np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    if sine < _SMALL and trace < 1.0:
        # The angle is near half a turn, where this formula loses its precision.
        copy_row(out, logarithm(product(reference.T, rotation)))
        return
    scale = 0.5 if sine < _SMALL else 0.5 * np.arctan2(sine, 0.5 * (trace - 1.0)) / sine
    for i in range(3):
        out[i] *= scale


@njit(cache=True, nogil=True)
def exponential(v):
    """Returns the (3, 3) rotation matrix of the rotation vector v (Rodrigues' formula)."""
    angle = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    a = 1.0 - angle * angle / 6.0 if angle < 1e-4 else np.sin(angle) / angle
    b = 0.5 - angle * angle / 24.0 if angle < 1e-4 else (1.0 - np.cos(angle)) / (angle * angle)
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = b * v[i] * v[j]
        out[i, i] += 1.0 - b * angle * angle
    out[0, 1] -= a * v[2]
    out[1, 0] += a * v[2]
    out[0, 2] += a * v[1]
    out[2, 0] -= a * v[1]
    out[1, 2] -= a * v[0]
    out[2, 1] += a * v[0]
    return out


@njit(cache=True, nogil=True)
def logarithm(r):
    """Returns (3,) the rotation vector of a (3, 3) rotation, of length at most pi."""
    v = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    sine = 0.5 * np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    cosine = 0.5 * (r[0, 0] + r[1, 1] + r[2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    if sine > _SMALL:
        return v * (0.5 * angle / sine)
    if cosine > 0.0:
        return v * 0.5
    # Near half a turn, r is nearly 2 a a' - 1. The largest column of r gives the axis a except for its sign,
    # and the vector v gives the sign.
    axis = 0
    for i in range(1, 3):
        if r[i, i] > r[axis, axis]:
            axis = i
    column = 0.5 * (r[:, axis] + r[axis])
    column[axis] -= cosine
    norm = np.sqrt(column[0] ** 2 + column[1] ** 2 + column[2] ** 2)
    along = column[0] * v[0] + column[1] * v[1] + column[2] * v[2]
    return column * (angle / norm if along >= 0.0 else -angle / norm)
