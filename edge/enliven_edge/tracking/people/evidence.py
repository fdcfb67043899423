"""The evidence of a frame for and against every joint of a fitted posture: the input of its confidence."""

from __future__ import annotations

from functools import cache

import numpy as np

from enliven.arrays import Float
from enliven.kernels import HeldArguments, hold, njit
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture, capsules_of, frames_of, joints_into
from enliven_edge.tracking.estimator.estimator import Estimate
from enliven_edge.tracking.fit.fit import FitReport
from enliven_edge.tracking.fit.gauss_newton import cholesky
from enliven_edge.tracking.fit.normal_equations import point_row
from enliven_edge.tracking.fit.structures import PlacedFrames
from enliven_edge.tracking.frame.observation import Observation

NAMES = (
    "constant",
    "support",
    "visible",
    "hidden",
    "seen through",
    "outside",
    "support beside",
    "visible beside",
    "hidden beside",
    "seen through beside",
    "outside beside",
    "uncertainty",
    "explained",
    "violated",
    "unsupported",
    "spread",
    "apart",
)
"""Names of the columns of :func:`joint_evidence`. A column with "beside" describes
the neighbouring bone. The last two columns come from the network's estimate. They are 0 without an
estimate.
"""
_COUNT = len(NAMES)
_JOINT_TOLERANCE_M = 0.02
"""Metres added to the distance between a joint and the network's joint before the logarithm. Differences
between smaller distances are not informative."""
_FULL_SUPPORT = 0.35
"""Fraction of a capsule's expected points that counts as full support. It is only about a third, because body
parts occlude each other.
"""
_CAPSULE_SAMPLES = 5
"""Samples along a capsule for its visible fraction: about 8 cm apart on a thigh."""
_SURFACE_TOLERANCE_M = 0.07
"""Maximum distance in metres between the model's surface and the observed one to count as the same surface.
It covers clothes and the fit's error."""


def neighbour_averages() -> tuple[Float, Float]:
    """Returns two (20, C) averages over capsules: of a joint's own bone, and of the neighbouring one.

    A joint's own bone ends at the joint.
    """
    first, second = np.zeros((20, 20)), np.zeros((20, 20))
    pelvis, chest, girdle, neck, head = [0, 3], [1, 4], [2, 5], [6], [7]
    for joint, near, next_to in ((0, pelvis, chest), (1, chest, pelvis), (2, girdle, neck), (3, head, neck)):
        first[joint, near], second[joint, next_to] = 1 / len(near), 1 / len(next_to)
    for joint, limb, trunk in ((4, 8, 2), (8, 11, 5), (12, 14, 0), (16, 17, 3)):
        chain = [(limb, trunk), (limb, limb + 1), (limb + 1, limb + 2), (limb + 2, limb + 1)]
        for k, (end, other) in enumerate(chain):
            first[joint + k, end], second[joint + k, other] = 1.0, 1.0
    return first, second


_FIRST, _SECOND = neighbour_averages()
_SKELETON = (model.FRAME_PARENTS, model.PIVOTS)
_TURNS = (model.MOVES, model.DOF_FRAME, model.DOF_AXIS, model.FRAME_LENGTHS)
_JOINTS = (model.JOINT_FRAMES, model.JOINT_OFFSETS)
"""Arguments of :func:`joint_uncertainty` that come from the model."""
_SURFACE = (model.CAPSULES.frame, model.CAPSULES.ends, model.CAPSULES.radii)
"""Arguments of :func:`capsules_of` that come from the model."""
_UNSEEN, _NO_SPREAD = np.zeros((0, 3)), np.zeros(0)
"""Empty arrays that replace the network's joints and spread if it was not run."""


@cache
def _choose_held_model() -> HeldArguments:
    """Returns the constant data of the model as reusable kernel arguments."""
    return hold((_SKELETON, _SURFACE, _TURNS, _JOINTS, _FIRST, _SECOND))


def joint_evidence(
    posture: Posture,
    report: FitReport,
    observation: Observation,
    unsupported: Float,
    estimate: Estimate | None = None,
) -> Float:
    """Returns (20, 17) evidence for and against each joint, ordered by :data:`NAMES`.

    Args:
        posture: the fitted posture.
        report: the report of the fit that found the posture.
        observation: the observed person.
        unsupported: (20,) frames since each joint was last supported.
        estimate: the network's estimate of the frame; None without one.
    """
    network = (_UNSEEN, _NO_SPREAD) if estimate is None else (estimate.joints, estimate.expected_errors)
    fit = (report.support, report.violated, report.explained)
    state = (posture.position, posture.rotations, posture.lengths)
    observed, body = observation.held, _choose_held_model()
    return np.asarray(_evidence(observed, body, *state, report.information, *fit, unsupported, *network))


@njit(cache=True, nogil=True)
def _evidence(
    observed, body, position, rotations, lengths, information, support, violated, explained, unsupported,
    seen, spread,
):  # fmt: skip
    """Computes the (20, 17) result of :func:`joint_evidence`.

    ``observed`` and ``body`` are reusable kernel arguments, ``body`` from :func:`_choose_held_model`.
    """
    skeleton, surface, turns, carried, first, second = body.values
    ends, radii = capsules_of(position, rotations, lengths, skeleton[0], skeleton[1], *surface)
    shares = capsule_visibility(ends, radii, observed.values.image)
    joints, loose = joint_uncertainty(
        information, position, rotations, lengths, skeleton[0], skeleton[1], turns, *carried
    )
    fit = support, violated, explained
    return assemble_evidence(shares, *fit, loose, unsupported, joints, seen, spread, first, second)


@njit(cache=True, nogil=True)
def assemble_evidence(
    shares, support, violated, explained, loose, unsupported, joints, seen, spread, first, second
):
    """Assembles the (20, 17) result of :func:`joint_evidence`.

    Args:
        shares: (C, 4) from :func:`capsule_visibility`.
        support, violated, explained: (C,), (C,) and a number, from :class:`FitReport`.
        loose: (20,) uncertainties from :func:`joint_uncertainty`.
        unsupported: (20,) frames since each joint was last supported.
        joints: (20, 3) metres, the posture's joints.
        seen, spread: (20, 3) and (20,) metres, the network's joints; both empty without a network.
        first, second: (20, C) from :func:`neighbour_averages`.
    """
    out = np.zeros((len(joints), _COUNT))
    through = violated.mean()
    for j in range(len(joints)):
        out[j, 0] = 1.0
        for c in range(len(shares)):
            for column, near in ((1, first[j, c]), (6, second[j, c])):
                if near == 0.0:
                    continue
                out[j, column] += near * np.log1p(support[c])
                for kind in range(4):
                    out[j, column + 1 + kind] += near * shares[c, kind]
        out[j, 11] = np.log(loose[j])
        out[j, 12], out[j, 13] = explained, through
        out[j, 14] = np.log1p(unsupported[j])
        if len(seen) > 0:
            x, y, z = joints[j, 0] - seen[j, 0], joints[j, 1] - seen[j, 1], joints[j, 2] - seen[j, 2]
            out[j, 15] = np.log(spread[j])
            out[j, 16] = np.log(_JOINT_TOLERANCE_M + np.sqrt(x * x + y * y + z * z))
    return out


@njit(cache=True, nogil=True)
def capsule_visibility(ends, radii, view):
    """Returns (C, 4) fractions of each capsule's samples that are visible, occluded, seen through or outside.
    A sample is seen through if the measured depth is behind it. Outside means outside the image.

    Args:
        ends, radii: the capsules.
        view: in the form of :func:`terms.free_space`.
    """
    depth, mask, _, camera, pose = view
    height, width = depth.shape
    out = np.zeros((len(ends), 4))
    for c in range(len(ends)):
        for s in range(_CAPSULE_SAMPLES):
            t = (s + 0.5) / _CAPSULE_SAMPLES
            radius = radii[c, 0] + t * (radii[c, 1] - radii[c, 0])
            x, y, z = 0.0, 0.0, 0.0
            for b in range(3):
                offset = ends[c, 0, b] + t * (ends[c, 1, b] - ends[c, 0, b]) - pose[b, 3]
                x += pose[b, 0] * offset
                y += pose[b, 1] * offset
                z += pose[b, 2] * offset
            # Project the sample, and compare its depth with the measured one. The result is 0 (visible), 1
            # (occluded), 2 (seen through) or 3 (outside the image).
            kind = 3
            if z > 0.2:
                u = int(np.floor(camera[0] * x / z + camera[2] + 0.5))
                v = int(np.floor(camera[1] * y / z + camera[3] + 0.5))
                if 0 <= u < width and 0 <= v < height:
                    seen = depth[v, u]
                    if mask[v, u] and abs(seen - (z - radius)) < _SURFACE_TOLERANCE_M:
                        kind = 0
                    elif seen == 0.0 or seen < z - radius:
                        kind = 1
                    else:
                        kind = 2
            out[c, kind] += 1.0 / _CAPSULE_SAMPLES
    return out


def capsule_confidence(report: FitReport, observation: Observation, posture: Posture) -> Float:
    """Returns the confidence (C,) of each capsule in [0, 1]: its support times its fraction outside free
    space.
    """
    count = len(observation.points)
    return np.asarray(_capsule_support(report.support, report.violated, *posture.capsules(), count))


@njit(cache=True, nogil=True)
def _capsule_support(support, violated, ends, radii, count):
    """Computes :func:`capsule_confidence`.

    A capsule's expected number of points is its share of the ``count`` points, in proportion to its frontal
    area. A third of that number counts as full support.
    """
    area = np.empty(len(ends))
    for c in range(len(ends)):
        x, y, z = ends[c, 1, 0] - ends[c, 0, 0], ends[c, 1, 1] - ends[c, 0, 1], ends[c, 1, 2] - ends[c, 0, 2]
        width = radii[c, 0] + radii[c, 1]
        area[c] = (np.sqrt(x * x + y * y + z * z) + width) * width
    enough, out = _FULL_SUPPORT * count / area.sum(), np.empty(len(ends))
    for c in range(len(ends)):
        out[c] = min(1.0, support[c] / max(1.0, enough * area[c])) * (1.0 - violated[c])
    return out


@njit(cache=True, nogil=True)
def joint_uncertainty(matrix, position, rotations, lengths, parents, offsets, turns, frames, local):
    """Returns (J, 3) joints, world frame, and (J,) the relative uncertainty of each: sqrt(trace(J H^-1 J')).
    This is the square root of the trace of the joint's covariance. H is the Gauss-Newton matrix of the frame
    alone, without the temporal prior. So a joint that the image does not constrain is uncertain, even if the
    prediction is steady. With the Cholesky factor U of H the value is |U'^-1 J'|.

    Args:
        matrix: (30, 30) the upper triangle of H, from :class:`FitReport`.
        position, rotations, lengths: the posture.
        parents, offsets: as in :func:`kinematics.forward_into`.
        turns: (moves, dof_frame, dof_axis, frame_lengths) as in :func:`terms.point_row`.
        frames, local: as in :func:`posture.joints_into`.
    """
    world, pivots = frames_of(position, rotations, lengths, parents, offsets)
    moves, dof_frame, dof_axis, lengths_of = turns
    frozen = np.empty((len(world), 3, 0))
    body = PlacedFrames(world, pivots, frozen, moves, dof_frame, dof_axis, lengths_of, parents)
    joints = np.empty((len(frames), 3))
    joints_into(joints, world, pivots, lengths, frames, local)
    factor = np.zeros(matrix.shape)
    cholesky(factor, matrix, 0.0)
    # Prepare one column for each joint and axis, so that the triangular system is solved for all of them at
    # once.
    columns, row, axis = np.empty((len(matrix), 3 * len(joints))), np.empty(len(matrix)), np.zeros(3)
    for k in range(columns.shape[1]):
        j, a = k // 3, k % 3
        row[:], axis[:] = 0.0, 0.0
        axis[a] = 1.0
        point_row(row, 1.0, frames[j], joints[j], axis, local[j], body)
        for i in range(len(row)):
            columns[i, k] = row[i]
    # Solve by forward substitution with U'. The squared solutions add up to the trace of each joint's
    # covariance.
    loose = np.zeros(len(joints))
    for i in range(len(matrix)):
        for k in range(i):
            held = factor[k, i]
            for c in range(columns.shape[1]):
                columns[i, c] -= held * columns[k, c]
        for c in range(columns.shape[1]):
            columns[i, c] /= factor[i, i]
            loose[c // 3] += columns[i, c] ** 2
    return joints, np.sqrt(loose)
