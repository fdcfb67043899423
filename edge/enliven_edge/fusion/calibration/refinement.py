"""Refines the transform between two sensors: Gauss-Newton on joints, sides and clocks together.

It minimises  sum_f sum_j w_fj rho(|R q_fj(t_f - lag) + t - p_fj|) + |tilt|^2 / s_tilt^2 + t_y^2 / s_floor^2
over the rotation R, the translation t and the clocks' lag, with iterative re-weighting (Geman and McClure's
rho). The joints of a frame may be matched with left and right exchanged. The two priors represent the
accuracy of each sensor's floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float
from enliven.space.rigid_transform import (
    UP,
    angle_between,
    compose_transform,
    cross_matrix,
    invert,
    rotate_vectors,
    rotation_from_vector,
    transform_points,
)
from enliven_edge.fusion.calibration.matching import BodyMatch
from enliven_edge.fusion.live.side_assignment import OTHER_SIDE
from enliven_edge.fusion.settings import MAX_TRACK_GAP_S, CalibrationSettings

_ROBUST_WIDTH_M = 0.15
"""Robust width in metres. Joints that differ by more than this between sensors have little influence."""
_FLOOR_TILT_SIGMA_DEG = 1.5
"""Standard deviation of the tilt of a sensor's floor in degrees."""
_FLOOR_HEIGHT_SIGMA_M = 0.04
"""Standard deviation of the height of a sensor's floor in metres."""

_MAX_FRAMES = 900
"""Maximum number of frames. More frames add little, because neighbouring frames contain the same
information."""
_CORRELATION_TIME_S = 0.5
"""Correlation time of one sensor's errors in seconds: each such interval counts as one independent
observation."""
_INDEPENDENT_POINTS = 3.0
"""Number of independent points per observation of a body. The errors of its 20 joints are correlated."""
_NOISE_M = 0.02
"""Disagreement in metres below which a joint's weight is not reduced: a tracker's noise."""


@dataclass(frozen=True)
class Fit:
    """The pose of sensor b relative to sensor a.

    Attributes:
        a_from_b: (4, 4).
        lag: seconds to add to b's times to get a's times.
        residuals: (N, 20) metres between the joints at each moment used.
        weights: (N, 20) combined confidence of both sensors in [0, 1], before robust weighting.
        robust_weights: (N, 20) the robust weights in [0, 1].
        times, hips: (N,) seconds of a's stream, and (N, 3) hip centres in metres, a's frame.
        swapped: (N,) whether the two sensors exchanged left and right.
        precision: (7, 7) inverse covariance of (rotation about the centre, shift, lag) [rad, m, s].
        centre: (3,) the centre of rotation in ``precision``, in a's frame.
    """

    a_from_b: Float
    lag: float
    residuals: Float
    weights: Float
    robust_weights: Float
    times: Float
    hips: Float
    swapped: Bool
    precision: Float
    centre: Float

    @property
    def cost(self) -> float:
        """Returns the mean truncated distance between the joints of both sensors in metres."""
        total = self.weights.sum()
        return float((self.weights * np.minimum(self.residuals, 0.5)).sum() / total) if total else np.inf

    @property
    def rms(self) -> float:
        """Returns the robust root mean square disagreement of the joints in metres."""
        trust = self.weights * self.robust_weights
        return float(np.sqrt((trust * self.residuals**2).sum() / max(trust.sum(), 1e-12)))


def refine(
    matches: tuple[BodyMatch, ...],
    a_from_b: Float,
    lag: float,
    settings: CalibrationSettings,
    *,
    steps: int = 15,
    frames: int = _MAX_FRAMES,
) -> Fit | None:
    """Refines a first guess. Returns None if both never see the same body simultaneously."""
    stride = max(1, sum(len(m.times) for m in matches) // frames)
    thinned = [BodyMatch(m.a, m.b, m.times[::stride]) for m in matches]
    joints_of_a = [match.a.interpolate(match.times, MAX_TRACK_GAP_S) for match in thinned]
    fit = None
    for _ in range(steps):
        samples = _sample_joints(thinned, joints_of_a, a_from_b, lag)
        if samples is None:
            return fit
        fit, step = _compute_step(samples, a_from_b, lag, settings)
        a_from_b, lag = _apply_step(a_from_b, lag, step, fit.centre)
        if np.abs(step).max() < 1e-7:
            break
    samples = _sample_joints(thinned, joints_of_a, a_from_b, lag)
    return fit if samples is None else _compute_step(samples, a_from_b, lag, settings)[0]


@dataclass(frozen=True)
class _JointPairs:
    """The joints of both sensors at their common moments: p and q (N, 20, 3), the velocity of q, and
    weights.
    """

    times: Float
    p: Float
    q: Float
    velocity: Float
    weights: Float
    swapped: Bool


def _sample_joints(
    matches: list[BodyMatch],
    joints_of_a: list[tuple[Float, Float, Float]],
    a_from_b: Float,
    lag: float,
) -> _JointPairs | None:
    """Returns the joints of both sensors at the matches' moments.

    ``joints_of_a`` contains the first sensor's joints, one entry per match.
    """
    samples = []
    for match, (p, _, seen_a) in zip(matches, joints_of_a, strict=True):
        q, velocity, seen_b = match.b.interpolate(match.times - lag, MAX_TRACK_GAP_S)
        swapped = _find_swapped(
            match.times, p, transform_points(a_from_b, q), seen_a, seen_b, _ROBUST_WIDTH_M
        )
        if swapped.any():
            order = np.where(swapped[:, None], OTHER_SIDE, np.arange(20))
            q, velocity = (np.take_along_axis(x, order[..., None], 1) for x in (q, velocity))
            seen_b = np.take_along_axis(seen_b, order, 1)
        weights = seen_a * seen_b
        is_used = weights.sum(1) > 0
        samples.append(
            _JointPairs(
                match.times[is_used],
                p[is_used],
                q[is_used],
                velocity[is_used],
                weights[is_used],
                swapped[is_used],
            )
        )
    if not samples or not sum(len(sample.times) for sample in samples):
        return None
    columns = zip(*((x.times, x.p, x.q, x.velocity, x.weights, x.swapped) for x in samples), strict=True)
    return _JointPairs(*(np.concatenate(column) for column in columns))


def _find_swapped(times: Float, p: Float, q: Float, seen_a: Float, seen_b: Float, width: float) -> Bool:
    """Returns (N,) flags: True if the joints agree better with left and right exchanged, over a few
    neighbouring frames.
    """
    same_cost, swapped_cost = (
        (seen_a * seen * np.minimum(_vector_lengths(p - joints_b), 2 * width)).sum(1)
        for seen, joints_b in ((seen_b, q), (seen_b[:, OTHER_SIDE], q[:, OTHER_SIDE]))
    )
    gain = same_cost - swapped_cost
    if len(gain) < 3:
        return np.asarray(gain > 0)
    total = np.concatenate([[0.0], np.cumsum(gain)])
    low = np.searchsorted(times, times - 0.15, side="left")
    high = np.searchsorted(times, times + 0.15, side="right")
    return np.asarray(total[high] - total[low] > 1e-9)


def _compute_step(
    samples: _JointPairs, a_from_b: Float, lag: float, settings: CalibrationSettings
) -> tuple[Fit, Float]:
    """Returns the state of the fit, and the step (7,) of rotation, shift and lag that improves it."""
    placed_b = transform_points(a_from_b, samples.q)
    error = placed_b - samples.p
    residuals = _vector_lengths(error)
    width = _robust_width(residuals, samples.weights, _ROBUST_WIDTH_M)
    robust_weights = 1.0 / (1.0 + (residuals / width) ** 2) ** 2
    trust = samples.weights * robust_weights
    centre = np.tensordot(trust, placed_b, 2) / max(trust.sum(), 1e-12)
    variance = float((trust * residuals**2).sum() / max(3 * trust.sum(), 1e-12)) + 1e-10
    # Count only independent observations, because the errors of neighbouring frames and of one body's joints
    # are correlated.
    observations = (
        max(1.0, len(np.unique(np.floor(samples.times / _CORRELATION_TIME_S)))) * _INDEPENDENT_POINTS
    )
    scale = observations / max(trust.sum(), 1e-12) / variance
    h, g = normal_equations(
        placed_b - centre, rotate_vectors(a_from_b, samples.velocity), error, scale * trust
    )
    precision = h.copy()
    _add_priors(h, g, a_from_b, centre, settings)
    damped_h = h + 1e-9 * np.diag(np.maximum(np.diag(h), 1e-9))
    step = np.asarray(-np.linalg.solve(damped_h, g), np.float64)
    step[6] = np.clip(step[6], -0.05, 0.05)
    hips = samples.p[:, 0]
    fit = Fit(
        a_from_b,
        lag,
        residuals,
        samples.weights,
        robust_weights,
        samples.times,
        hips,
        samples.swapped,
        precision,
        centre,
    )
    return fit, step


def _robust_width(residuals: Float, weights: Float, widest: float) -> float:
    """Returns the robust width in metres: three times the median disagreement, within bounds."""
    seen_residuals = residuals[weights > 0]
    return (
        float(np.clip(3.0 * np.median(seen_residuals), _NOISE_M, widest)) if len(seen_residuals) else widest
    )


def normal_equations(arm: Float, velocity: Float, error: Float, weights: Float) -> tuple[Float, Float]:
    """Returns J^T W J (7, 7) and J^T W e (7,) for rotation (about the centre), shift and lag.

    A joint's Jacobian J is (-[arm]x, 1, -v). A larger lag evaluates q at an earlier time, so d q(t - lag) / d
    lag = -v. The result needs only sums of products of these numbers, which one matrix product computes.

    Args:
        arm, velocity, error: (N, 20, 3) the joint relative to the centre in metres, its velocity in m/s, and
            the disagreement in metres.
        weights: (N, 20).
    """
    flat_weights = weights.reshape(-1)
    columns = np.empty((len(flat_weights), 10))
    columns[:, :3], columns[:, 3:6], columns[:, 6:9] = (x.reshape(-1, 3) for x in (arm, velocity, error))
    columns[:, 9] = 1.0
    sums = columns.T @ (flat_weights[:, None] * columns)
    aa, av, ae, vv, ve = sums[:3, :3], sums[:3, 3:6], sums[:3, 6:9], sums[3:6, 3:6], sums[3:6, 6:9]
    h, g = np.empty((7, 7)), np.empty(7)
    h[:3, :3] = np.trace(aa) * np.eye(3) - aa
    h[:3, 3:6], h[3:6, 3:6] = cross_matrix(sums[:3, 9]), sums[9, 9] * np.eye(3)
    h[:3, 6], h[3:6, 6], h[6, 6] = -_cross_sum(av), -sums[3:6, 9], np.trace(vv)
    h[3:6, :3], h[6, :6] = h[:3, 3:6].T, h[:6, 6]
    g[:3], g[3:6], g[6] = _cross_sum(ae), sums[6:9, 9], -np.trace(ve)
    return h, g


def _cross_sum(products: Float) -> Float:
    """Returns the sum (3,) of a x b from the sum of a b^T (3, 3)."""
    p = products
    return np.array([p[1, 2] - p[2, 1], p[2, 0] - p[0, 2], p[0, 1] - p[1, 0]])


def _vector_lengths(vectors: Float) -> Float:
    """Returns the lengths (N, 20) of vectors (N, 20, 3)."""
    return np.asarray(np.sqrt(np.einsum("njk,njk->nj", vectors, vectors)))


def _add_priors(h: Float, g: Float, a_from_b: Float, centre: Float, settings: CalibrationSettings) -> None:
    """Adds the priors that both floors are level and at y = 0.

    Their weights follow from the precision of each sensor's floor.
    """
    if not settings.floor_known:
        return
    tilt = 1.0 / (2 * np.deg2rad(_FLOOR_TILT_SIGMA_DEG) ** 2)
    up = a_from_b[:3, :3] @ UP
    lean = np.cross(UP, up)
    for axis in (0, 2):
        h[axis, axis] += tilt
        g[axis] += tilt * lean[axis]
    floor = 1.0 / (2 * _FLOOR_HEIGHT_SIGMA_M**2)
    # Compute the height of b's floor at the point below the people.
    height = float(a_from_b[1, 3] + (a_from_b[:3, :3] @ _floor_point_below(a_from_b, centre))[1])
    h[4, 4] += floor
    g[4] += floor * height


def _floor_point_below(a_from_b: Float, centre: Float) -> Float:
    """Returns the point (3,) of b's floor below ``centre``, a point of a's frame, in b's frame."""
    point = a_from_b[:3, :3].T @ (centre - a_from_b[:3, 3])
    return np.array([point[0], 0.0, point[2]])


def _apply_step(a_from_b: Float, lag: float, step: Float, centre: Float) -> tuple[Float, float]:
    """Returns the transform rotated about the centre and shifted, and the new lag."""
    rotation = rotation_from_vector(step[:3])
    translation = rotation @ (a_from_b[:3, 3] - centre) + centre + step[3:6]
    return compose_transform(rotation @ a_from_b[:3, :3], translation), lag + float(step[6])


def are_different(a: Fit, b: Fit) -> bool:
    """Returns True if two fits place the people differently, beyond noise."""
    displacement = transform_points(b.a_from_b, transform_points(invert(a.a_from_b), a.centre)) - a.centre
    return angle_between(a.a_from_b, b.a_from_b) > np.deg2rad(15.0) or bool(
        np.linalg.norm(displacement) > 0.4
    )
