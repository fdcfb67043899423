"""What a frame says for and against every joint of a fitted posture; the ground of its confidence."""

from __future__ import annotations

import numpy as np
from numba import njit

from enliven.arrays import Float
from enliven_edge.estimator.estimator import Estimate
from enliven_edge.tracking import model
from enliven_edge.tracking.fit import FitReport, Fitter
from enliven_edge.tracking.gauss_newton import cholesky
from enliven_edge.tracking.observation import Observation
from enliven_edge.tracking.posture import Posture, forward
from enliven_edge.tracking.terms import point_row

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
"""What each column of :func:`evidence` is; "beside" is the neighbouring part of the body. The last two are of
the network's estimate, 0 without one."""
_CLOSE = 0.02
"""Metres below which it says little how near a joint is to where it is seen."""
_SAMPLES = 5
_SAME = 0.07
"""Metres between the model's surface and the observed one that still are the same."""


def _beside() -> tuple[Float, Float]:
    """(20, C) whose mean speaks for each joint: of the bone that ends there, and of the part beside it."""
    first, second = np.zeros((20, 20)), np.zeros((20, 20))
    pelvis, chest, girdle, neck, head = [0, 3], [1, 4], [2, 5], [6], [7]
    for joint, near, next_to in ((0, pelvis, chest), (1, chest, pelvis), (2, girdle, neck), (3, head, neck)):
        first[joint, near], second[joint, next_to] = 1 / len(near), 1 / len(next_to)
    for joint, limb, trunk in ((4, 8, 2), (8, 11, 5), (12, 14, 0), (16, 17, 3)):
        chain = [(limb, trunk), (limb, limb + 1), (limb + 1, limb + 2), (limb + 2, limb + 1)]
        for k, (end, other) in enumerate(chain):
            first[joint + k, end], second[joint + k, other] = 1.0, 1.0
    return first, second


_FIRST, _SECOND = _beside()


def evidence(
    fitter: Fitter,
    posture: Posture,
    report: FitReport,
    observation: Observation,
    unsupported: Float,
    estimate: Estimate | None = None,
) -> Float:
    """(20, 17) what speaks for and against each joint, ordered by :data:`NAMES`.

    Args:
        unsupported: (20,) frames since each joint was last supported.
        estimate: what the network sees in the frame; None without one.
    """
    shares = capsule_shares(*posture.capsules(), observation.view)
    support = np.log1p(report.support)
    first, second = _FIRST @ shares, _SECOND @ shares
    out = np.zeros((20, len(NAMES)))
    out[:, 0] = 1.0
    out[:, 1], out[:, 2:6] = _FIRST @ support, first
    out[:, 6], out[:, 7:11] = _SECOND @ support, second
    out[:, 11] = np.log(uncertainty(fitter, posture, observation))
    out[:, 12], out[:, 13] = report.explained, report.violated.mean()
    out[:, 14] = np.log1p(unsupported)
    if estimate is not None:
        apart = np.linalg.norm(posture.joints() - estimate.joints, axis=1)
        out[:, 15], out[:, 16] = np.log(estimate.spread), np.log(_CLOSE + apart)
    return out


@njit(cache=True, nogil=True)
def capsule_shares(ends, radii, view):  # type: ignore[no-untyped-def]
    """(C, 4) of the samples along each capsule: visible, hidden by something, seen through, not in the image.

    Args:
        view: as :func:`terms.free_space` takes it.
    """
    depth, mask, _, camera, pose = view
    height, width = depth.shape
    out = np.zeros((len(ends), 4))
    for c in range(len(ends)):
        for s in range(_SAMPLES):
            t = (s + 0.5) / _SAMPLES
            radius = radii[c, 0] + t * (radii[c, 1] - radii[c, 0])
            x, y, z = 0.0, 0.0, 0.0
            for b in range(3):
                offset = ends[c, 0, b] + t * (ends[c, 1, b] - ends[c, 0, b]) - pose[b, 3]
                x += pose[b, 0] * offset
                y += pose[b, 1] * offset
                z += pose[b, 2] * offset
            kind = 3
            if z > 0.2:
                u = int(np.floor(camera[0] * x / z + camera[2] + 0.5))
                v = int(np.floor(camera[1] * y / z + camera[3] + 0.5))
                if 0 <= u < width and 0 <= v < height:
                    seen = depth[v, u]
                    if mask[v, u] and abs(seen - (z - radius)) < _SAME:
                        kind = 0
                    elif seen == 0.0 or seen < z - radius:
                        kind = 1
                    else:
                        kind = 2
            out[c, kind] += 1.0 / _SAMPLES
    return out


def uncertainty(fitter: Fitter, posture: Posture, observation: Observation) -> Float:
    """(20,) how loosely each joint is held: the root of the trace of its covariance, relative.

    The covariance is J H^-1 J' with the Gauss-Newton matrix H of the frame alone, without what time predicts:
    a joint that nothing in the picture holds is loose, however steadily it has been predicted.
    """
    matrix = fitter.information(posture, observation)
    world, pivots, by_length = forward(posture.position, posture.rotations, posture.lengths)
    turns = (model.MOVES, model.DOF_FRAME, model.DOF_AXIS)
    body = (world, pivots, by_length, *turns, model.FRAME_LENGTHS, model.FRAME_PARENTS)
    return np.asarray(_joint_spread(matrix, posture.joints(), model.JOINT_FRAMES, model.JOINT_OFFSETS, body))


@njit(cache=True, nogil=True)
def _joint_spread(matrix, joints, frames, offsets, body):  # type: ignore[no-untyped-def]
    """(20,) sqrt(trace(J H^-1 J')) of every joint, by the Cholesky factor L of H: |L^-1 J'|."""
    count = len(matrix)
    factor, row, axis = np.zeros((count, count)), np.empty(count), np.empty(3)
    cholesky(factor, matrix, 0.0)
    out = np.zeros(len(joints))
    for j in range(len(joints)):
        for a in range(3):
            axis[:], row[:] = 0.0, 0.0
            axis[a] = 1.0
            point_row(row, 1.0, frames[j], joints[j], axis, offsets[j], body)
            for i in range(count):
                value = row[i]
                for k in range(i):
                    value -= factor[i, k] * row[k]
                row[i] = value / factor[i, i]
                out[j] += row[i] * row[i]
        out[j] = np.sqrt(out[j])
    return out
