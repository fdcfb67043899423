"""Refines the transform between two sensors: Gauss-Newton on joints, sides and clocks together.

It minimises  sum_f sum_j w_fj rho(|R q_fj(t_f - lag) + t - p_fj|) + |tilt|^2 / s_tilt^2 + t_y^2 / s_floor^2
over the rotation R, the translation t and the clocks' lag, with iterative re-weighting (Geman and McClure's
rho). The joints of a frame may be matched with exchanged sides. The two priors express the accuracy of each
sensor's floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float
from enliven_edge.fusion.calibration.matching import BodyMatch
from enliven_edge.fusion.live import OTHER_SIDE
from enliven_edge.fusion.placement import UP, angle_between, cross_matrix, inverse, moved, rigid, turn, turned
from enliven_edge.fusion.settings import CalibrationSettings

_MAX_FRAMES = 900
"""Maximum number of frames. Neighbouring frames contain the same information."""
_CORRELATION_TIME_S = 0.5
"""Correlation time of one sensor's errors in seconds: each such interval counts as one independent
observation."""
_INDEPENDENT_POINTS = 3.0
"""Number of independent points per observation of a body. The errors of its 20 joints are correlated."""
_NOISE_M = 0.02
"""Disagreement in metres below which no joint is down-weighted: a tracker's noise."""


@dataclass(frozen=True)
class Fit:
    """The pose of sensor b relative to sensor a.

    Attributes:
        a_from_b: (4, 4).
        lag: seconds to add to b's times to get a's.
        residuals: (N, 20) metres between the joints at each moment used.
        weights: (N, 20) confidence of both sensors, 0..1, before robust weighting.
        doubt: (N, 20) the robust weight, 0..1.
        times: (N,) seconds of a's stream; feet: (N, 3) the hips, in a's frame.
        swapped: (N,) whether the two sensors named the sides differently.
        precision: (7, 7) inverse covariance of (rotation about the centre, shift, lag) [rad, m, s].
        centre: (3,) the centre of rotation in ``precision``, in a's frame.
    """

    a_from_b: Float
    lag: float
    residuals: Float
    weights: Float
    doubt: Float
    times: Float
    feet: Float
    swapped: Bool
    precision: Float
    centre: Float

    @property
    def cost(self) -> float:
        """Returns the mean truncated disagreement in metres."""
        total = self.weights.sum()
        return float((self.weights * np.minimum(self.residuals, 0.5)).sum() / total) if total else np.inf

    @property
    def rms(self) -> float:
        """Returns the robust root mean square disagreement of the joints in metres."""
        trust = self.weights * self.doubt
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
    held = [match.a.at(match.times, settings.longest_gap) for match in thinned]
    fit = None
    for _ in range(steps):
        look = _looked(thinned, held, a_from_b, lag, settings)
        if look is None:
            return fit
        fit, step = _stepped(look, a_from_b, lag, settings)
        a_from_b, lag = _applied(a_from_b, lag, step, fit.centre)
        if np.abs(step).max() < 1e-7:
            break
    look = _looked(thinned, held, a_from_b, lag, settings)
    return fit if look is None else _stepped(look, a_from_b, lag, settings)[0]


@dataclass(frozen=True)
class _JointPairs:
    """The joints of both sensors at their common moments: p and q (N, 20, 3), q's velocity, weights."""

    times: Float
    p: Float
    q: Float
    velocity: Float
    weights: Float
    swapped: Bool


def _looked(
    matches: list[BodyMatch],
    held: list[tuple[Float, Float, Float]],
    a_from_b: Float,
    lag: float,
    settings: CalibrationSettings,
) -> _JointPairs | None:
    """Returns the joints of both sensors at the matches' moments.

    ``held`` are the first sensor's, by match.
    """
    looks = []
    for match, (p, _, seen_a) in zip(matches, held, strict=True):
        q, velocity, seen_b = match.b.at(match.times - lag, settings.longest_gap)
        swapped = _sides(match.times, p, moved(a_from_b, q), seen_a, seen_b, settings.width)
        if swapped.any():
            order = np.where(swapped[:, None], OTHER_SIDE, np.arange(20))
            q, velocity = (np.take_along_axis(x, order[..., None], 1) for x in (q, velocity))
            seen_b = np.take_along_axis(seen_b, order, 1)
        weights = seen_a * seen_b
        good = weights.sum(1) > 0
        looks.append(
            _JointPairs(match.times[good], p[good], q[good], velocity[good], weights[good], swapped[good])
        )
    if not looks or not sum(len(look.times) for look in looks):
        return None
    columns = zip(*((x.times, x.p, x.q, x.velocity, x.weights, x.swapped) for x in looks), strict=True)
    return _JointPairs(*(np.concatenate(column) for column in columns))


def _sides(times: Float, p: Float, q: Float, seen_a: Float, seen_b: Float, width: float) -> Bool:
    """Returns (N,) whether exchanged sides agree better, over a few neighbouring frames."""
    plain, other = (
        (seen_a * seen * np.minimum(_lengths(p - there), 2 * width)).sum(1)
        for seen, there in ((seen_b, q), (seen_b[:, OTHER_SIDE], q[:, OTHER_SIDE]))
    )
    gain = plain - other
    if len(gain) < 3:
        return np.asarray(gain > 0)
    total = np.concatenate([[0.0], np.cumsum(gain)])
    low = np.searchsorted(times, times - 0.15, side="left")
    high = np.searchsorted(times, times + 0.15, side="right")
    return np.asarray(total[high] - total[low] > 1e-9)


def _stepped(
    look: _JointPairs, a_from_b: Float, lag: float, settings: CalibrationSettings
) -> tuple[Fit, Float]:
    """Returns the state of the fit, and the step (7,) of rotation, shift and lag that improves it."""
    placed = moved(a_from_b, look.q)
    error = placed - look.p
    residuals = _lengths(error)
    width = _width(residuals, look.weights, settings.width)
    doubt = 1.0 / (1.0 + (residuals / width) ** 2) ** 2
    trust = look.weights * doubt
    centre = np.tensordot(trust, placed, 2) / max(trust.sum(), 1e-12)
    variance = float((trust * residuals**2).sum() / max(3 * trust.sum(), 1e-12)) + 1e-10
    # Count only independent observations, because the errors of neighbouring frames and of one body's joints
    # are correlated.
    looks = max(1.0, len(np.unique(np.floor(look.times / _CORRELATION_TIME_S)))) * _INDEPENDENT_POINTS
    scale = looks / max(trust.sum(), 1e-12) / variance
    h, g = normal_equations(placed - centre, turned(a_from_b, look.velocity), error, scale * trust)
    precision = h.copy()
    _add_priors(h, g, a_from_b, centre, settings)
    damped = h + 1e-9 * np.diag(np.maximum(np.diag(h), 1e-9))
    step = np.asarray(-np.linalg.solve(damped, g), np.float64)
    step[6] = np.clip(step[6], -0.05, 0.05)
    feet = look.p[:, 0]
    fit = Fit(
        a_from_b, lag, residuals, look.weights, doubt, look.times, feet, look.swapped, precision, centre
    )
    return fit, step


def _width(residuals: Float, weights: Float, widest: float) -> float:
    """Returns the robust width in metres: three times the median disagreement, within bounds."""
    seen = residuals[weights > 0]
    return float(np.clip(3.0 * np.median(seen), _NOISE_M, widest)) if len(seen) else widest


def normal_equations(arm: Float, velocity: Float, error: Float, weights: Float) -> tuple[Float, Float]:
    """Returns J^T W J (7, 7) and J^T W e (7,) for rotation (about the centre), shift and lag.

    A joint's J is (-[arm]x, 1, -v). A larger lag evaluates an earlier q, so d q(t - lag) / d lag = -v. Only
    sums of products of these numbers are needed, which one matrix product computes.

    Args:
        arm, velocity, error: (N, 20, 3) metres from the centre, m/s, metres of disagreement.
        weights: (N, 20).
    """
    flat = weights.reshape(-1)
    columns = np.empty((len(flat), 10))
    columns[:, :3], columns[:, 3:6], columns[:, 6:9] = (x.reshape(-1, 3) for x in (arm, velocity, error))
    columns[:, 9] = 1.0
    sums = columns.T @ (flat[:, None] * columns)
    aa, av, ae, vv, ve = sums[:3, :3], sums[:3, 3:6], sums[:3, 6:9], sums[3:6, 3:6], sums[3:6, 6:9]
    h, g = np.empty((7, 7)), np.empty(7)
    h[:3, :3] = np.trace(aa) * np.eye(3) - aa
    h[:3, 3:6], h[3:6, 3:6] = cross_matrix(sums[:3, 9]), sums[9, 9] * np.eye(3)
    h[:3, 6], h[3:6, 6], h[6, 6] = -_crossed(av), -sums[3:6, 9], np.trace(vv)
    h[3:6, :3], h[6, :6] = h[:3, 3:6].T, h[:6, 6]
    g[:3], g[3:6], g[6] = _crossed(ae), sums[6:9, 9], -np.trace(ve)
    return h, g


def _crossed(products: Float) -> Float:
    """Returns (3,) the sum of a x b from the sum of a b^T (3, 3)."""
    p = products
    return np.array([p[1, 2] - p[2, 1], p[2, 0] - p[0, 2], p[0, 1] - p[1, 0]])


def _lengths(vectors: Float) -> Float:
    """Returns (N, 20) the lengths of (N, 20, 3)."""
    return np.asarray(np.sqrt(np.einsum("njk,njk->nj", vectors, vectors)))


def _add_priors(h: Float, g: Float, a_from_b: Float, centre: Float, settings: CalibrationSettings) -> None:
    """Adds the priors that both floors are level and at y = 0, with the precision of each sensor's floor."""
    if not settings.floor_known:
        return
    tilt = 1.0 / (2 * np.deg2rad(settings.tilt) ** 2)
    up = a_from_b[:3, :3] @ UP
    lean = np.cross(UP, up)
    for axis in (0, 2):
        h[axis, axis] += tilt
        g[axis] += tilt * lean[axis]
    floor = 1.0 / (2 * settings.floor_height**2)
    # Compute the height of b's floor at the point below the people.
    height = float(a_from_b[1, 3] + (a_from_b[:3, :3] @ _below(a_from_b, centre))[1])
    h[4, 4] += floor
    g[4] += floor * height


def _below(a_from_b: Float, centre: Float) -> Float:
    """Returns (3,) the point of b's floor below a point of a's frame, in b's frame."""
    point = a_from_b[:3, :3].T @ (centre - a_from_b[:3, 3])
    return np.array([point[0], 0.0, point[2]])


def _applied(a_from_b: Float, lag: float, step: Float, centre: Float) -> tuple[Float, float]:
    """Returns the transform rotated about the centre and shifted, and the new lag."""
    rotation = turn(step[:3])
    translation = rotation @ (a_from_b[:3, 3] - centre) + centre + step[3:6]
    return rigid(rotation @ a_from_b[:3, :3], translation), lag + float(step[6])


def differ(a: Fit, b: Fit) -> bool:
    """Returns True if two fits place the people differently, beyond noise."""
    apart = moved(b.a_from_b, moved(inverse(a.a_from_b), a.centre)) - a.centre
    return angle_between(a.a_from_b, b.a_from_b) > np.deg2rad(15.0) or bool(np.linalg.norm(apart) > 0.4)
