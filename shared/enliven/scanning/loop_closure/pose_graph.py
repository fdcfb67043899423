"""Pose graph optimization: finds the poses that agree best with measured relative poses (links)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from enliven import rotation
from enliven.arrays import Float
from enliven.scanning.rigid import cross_matrix, move_pose

_MAX_STEPS = 30
"""Maximum number of Levenberg-Marquardt steps in each round."""
_MIN_COST_DECREASE = 1e-9
"""Minimum relative decrease of the cost for another step to follow."""
_INITIAL_DAMPING = 1e-6
"""Initial damping of each round, relative to the mean of the matrix's diagonal."""
_TRUST_ROUNDS = 6
"""Number of rounds in which the trust in inconsistent loops is gradually reduced. In the first round, all
loops are trusted."""
_TOLERANCE_SHRINK = 5.0
"""Divisor of the tolerated error of a loop in each round (graduated non-convexity)."""


@dataclass(frozen=True)
class PoseLink:
    """An edge of the pose graph: the relative pose of two poses.

    Attributes:
        first, second: numbers of the poses.
        first_from_second: (4, 4) the second pose in the first one's frame.
        information: (6, 6) inverse covariance of the translation (m) and rotation (rad), in the axes of the
            first pose.
        sure: True if the link is certain. A loop is not certain, because the detection may be wrong.
    """

    first: int
    second: int
    first_from_second: Float
    information: Float
    sure: bool = True


def optimize_poses(
    poses: Sequence[Float],
    links: Sequence[PoseLink],
    ups: Sequence[Float | None] | None = None,
    level: float = 0.01,
    doubt: float = 50.0,
) -> tuple[list[Float], Float]:
    """Returns the poses at which the links agree best, and the trust in each link, 0 to 1.

    The first pose is fixed. Links that are not ``sure`` are weighted by the Geman-McClure function. Its width
    is reduced in each round.

    Args:
        poses: initial estimates, (4, 4) each, world_from_pose.
        ups: for each pose, a (3,) unit vector in its frame that points up according to an accelerometer, or
            None.
        level: standard deviation of these directions, radians.
        doubt: squared Mahalanobis distance at which a link that is not sure has a quarter of its weight.
    """
    current, measured_ups = [pose.copy() for pose in poses], list(ups or [None] * len(poses))
    trusts = np.ones(len(links))
    if not links or len(poses) < 2:
        return current, trusts
    is_loop = np.array([not link.sure for link in links])
    for trust_round in range(_TRUST_ROUNDS if is_loop.any() else 1):
        current = _solve_poses(current, links, trusts, measured_ups, level)
        squares = _compute_squared_errors(current, links)
        scale = doubt * _TOLERANCE_SHRINK ** (_TRUST_ROUNDS - 1 - trust_round)
        trusts = np.where(is_loop, (scale / (scale + squares)) ** 2, 1.0)
    return _solve_poses(current, links, trusts, measured_ups, level), trusts


def pose_graph_cost(
    poses: Sequence[Float],
    links: Sequence[PoseLink],
    trusts: Float,
    ups: Sequence[Float | None],
    level: float,
) -> float:
    """Returns half the weighted sum of squares that :func:`optimize_poses` minimizes, for given trust in the
    links.
    """
    total = float(trusts @ _compute_squared_errors(poses, links))
    world_up = _up_direction(poses, ups)
    for pose, up in zip(poses, ups, strict=True):
        if up is not None and world_up is not None:
            total += float(np.square(pose[:3, :3] @ up - world_up).sum()) / level**2
    return total / 2


def link_residual(link: PoseLink, first: Float, second: Float) -> Float:
    """Returns the error (6,) of a link, metres and radians: the difference between the actual second pose and
    the pose that the link predicts.
    """
    rotation_matrix, relative = first[:3, :3].T, link.first_from_second
    position_error = rotation_matrix @ (second[:3, 3] - first[:3, 3]) - relative[:3, 3]
    rotation_error = rotation_matrix @ second[:3, :3] @ relative[:3, :3].T
    return np.concatenate([position_error, rotation.to_rotation_vector(rotation.from_matrix(rotation_error))])


def _compute_squared_errors(poses: Sequence[Float], links: Sequence[PoseLink]) -> Float:
    """Returns (L,) squared Mahalanobis distances of the links."""
    errors = [link_residual(link, poses[link.first], poses[link.second]) for link in links]
    return np.array([e @ link.information @ e for e, link in zip(errors, links, strict=True)])


def _up_direction(poses: Sequence[Float], ups: Sequence[Float | None]) -> Float | None:
    """Returns the up direction (3,) in the world, from the first pose with an accelerometer reading, or None
    if no pose has one."""
    return next((pose[:3, :3] @ up for pose, up in zip(poses, ups, strict=True) if up is not None), None)


def _solve_poses(
    poses: list[Float], links: Sequence[PoseLink], trusts: Float, ups: list[Float | None], level: float
) -> list[Float]:
    """Returns the poses (4, 4) after Levenberg-Marquardt steps, for given trust in the links (0 to 1
    each)."""
    damping, cost = _INITIAL_DAMPING, pose_graph_cost(poses, links, trusts, ups, level)
    for _ in range(_MAX_STEPS):
        matrix, gradient = _normal_equations(poses, links, trusts, ups, level)
        diagonal = damping * matrix.diagonal().mean()
        step = -splu(matrix + csc_matrix(diagonal * np.eye(len(gradient)))).solve(gradient)
        trial_poses = [
            poses[0],
            *(move_pose(pose, step[6 * n : 6 * n + 6]) for n, pose in enumerate(poses[1:])),
        ]
        trial_cost = pose_graph_cost(trial_poses, links, trusts, ups, level)
        if trial_cost > cost:
            damping *= 10.0
            continue
        decrease = cost - trial_cost
        poses, cost, damping = trial_poses, trial_cost, damping / 10.0
        if decrease <= _MIN_COST_DECREASE * cost + 1e-12:
            break
    return poses


def _normal_equations(
    poses: list[Float], links: Sequence[PoseLink], trusts: Float, ups: list[Float | None], level: float
) -> tuple[csc_matrix, Float]:
    """Returns the (6 N - 6) square normal matrix of all poses except the first, and the gradient."""
    count = len(poses) - 1
    blocks: dict[tuple[int, int], Float] = {(n, n): np.zeros((6, 6)) for n in range(count)}
    gradient = np.zeros((count, 6))
    for link, trust in zip(links, trusts, strict=True):
        error, of_first, of_second = link_jacobians(link, poses[link.first], poses[link.second])
        weight = trust * link.information
        for a, slope_a in ((link.first - 1, of_first), (link.second - 1, of_second)):
            if a < 0:
                continue
            gradient[a] += slope_a.T @ weight @ error
            for b, slope_b in ((link.first - 1, of_first), (link.second - 1, of_second)):
                if b >= 0:
                    blocks[a, b] = blocks.get((a, b), 0.0) + slope_a.T @ weight @ slope_b
    world_up = _up_direction(poses, ups)
    for n, up in enumerate(ups[1:]):
        if up is not None and world_up is not None:
            measured_up = poses[n + 1][:3, :3] @ up
            slope = -cross_matrix(measured_up)
            blocks[n, n][3:, 3:] += slope.T @ slope / level**2
            gradient[n, 3:] += slope.T @ (measured_up - world_up) / level**2
    rows, columns, values = [], [], []
    block_rows, block_columns = np.mgrid[0:6, 0:6]
    for (a, b), block in blocks.items():
        rows.append((6 * a + block_rows).ravel())
        columns.append((6 * b + block_columns).ravel())
        values.append(np.ravel(block))
    row_and_column = np.concatenate(rows), np.concatenate(columns)
    return csc_matrix(
        (np.concatenate(values), row_and_column), shape=(6 * count, 6 * count)
    ), gradient.ravel()


def link_jacobians(link: PoseLink, first: Float, second: Float) -> tuple[Float, Float, Float]:
    """Returns the residual and its (6, 6) Jacobians for a translation and rotation of either pose, world
    axes.
    """
    error = link_residual(link, first, second)
    rotation_matrix, offset = first[:3, :3].T, second[:3, 3] - first[:3, 3]
    error_derivative = _inverse_left_jacobian(error[3:]) @ rotation_matrix
    of_first, of_second = np.zeros((6, 6)), np.zeros((6, 6))
    of_first[:3, :3], of_second[:3, :3] = -rotation_matrix, rotation_matrix
    of_first[:3, 3:] = rotation_matrix @ cross_matrix(offset)
    of_first[3:, 3:], of_second[3:, 3:] = -error_derivative, error_derivative
    return error, of_first, of_second


def _inverse_left_jacobian(rotation_vector: Float) -> Float:
    """Returns the derivative (3, 3) of a rotation vector for a small rotation after it (the inverse left
    Jacobian).
    """
    angle, cross = float(np.linalg.norm(rotation_vector)), cross_matrix(rotation_vector)
    coefficient = 1 / 12 if angle < 1e-4 else (1 - angle / 2 / np.tan(angle / 2)) / angle**2
    return np.asarray(np.eye(3) - cross / 2 + coefficient * cross @ cross)
