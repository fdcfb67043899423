"""Detection: finds a person's posture in one frame by fitting several hypotheses and keeping the best.

With the network, its estimates for the likeliest facings are hypotheses, and it contributes to the ranking.
Without it, a bank of postures is aligned with the extremities of the surface. Standing postures are added.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.detect.appearance import (
    EstimateAtPoints,
    flip_posture,
)
from enliven_edge.tracking.detect.extremities import find_extremities
from enliven_edge.tracking.detect.fit_quality import implausibility_cost, likely_builds
from enliven_edge.tracking.detect.hypotheses import bank_starts, make_standing_starts, pose_from_estimate
from enliven_edge.tracking.estimator.estimator import Estimate, PoseEstimator
from enliven_edge.tracking.estimator.labels import FACINGS
from enliven_edge.tracking.fit.fit import FitReport, Fitter
from enliven_edge.tracking.frame.observation import Observation
from enliven_edge.tracking.work_budget import Steps

_REFINED_HYPOTHESES = 3
"""Number of hypotheses that are refined. With eight, flipped bodies won on real shots, because coarse fits
distinguish front from back better than refined ones."""
_DUPLICATE_DISTANCE_M = 0.12
"""Maximum distance in metres between the corresponding joints of two hypotheses that count as equal. Fits of
both would end in the same posture.
"""
_LENGTH_WEIGHTS = np.full(len(model.LENGTHS), 30.0)
"""(12,) weights of the lengths' prior in a refinement. They are low, because the person is not measured
yet."""
_COARSE_POINTS = 250
"""Number of points in coarse fits: half of all points, because the fits are only compared."""
_COARSE_STEPS = 8
"""Steps of a coarse fit. With four to six the tuning set lost half a percent of its joints."""
_COARSE_WIDTH_M = 0.25
"""Robust width of coarse fits in metres. A limb of a hypothesis may be this far from its true position."""
_FIRST_STEPS = 2
"""Number of steps after which the worse half of the hypotheses is dropped. Hypotheses from this half hardly
ever win."""
_HALF_STEPS = 15
"""Steps of each half of a refinement. The fit has converged by then."""
_HALF_WIDTH = 0.12
"""Robust width of the first half in metres, between that of a coarse fit and that of the ordinary fit."""
_HALF_AFFINITY = 0.4
"""Factor on the affinity in the first half of a refinement: the surface takes over from the network."""
_AFFINITY = 0.15
"""Affinity in coarse fits in metres: the added distance between a point and a capsule of another body
part."""
_BANK_HYPOTHESES = 8
"""Number of the most similar bank postures that are tried without a network. Each costs a coarse fit."""
_NETWORK_COST = 1
"""Cost of running the network for one likely facing, in coarse fits."""
_POSTURE_COST = 1
"""Cost of converting the network's estimates into postures with one set of bone lengths, in coarse fits."""
_EXTREMITIES_COST = 3
"""Cost of the geodesic extremities, in coarse fits."""
_BANK_COST = 4
"""Cost of comparing the bank with the points, in coarse fits."""
_REFINEMENT_COST = 2
"""Cost of half a refinement of one hypothesis, in coarse fits."""
_FIRST_STEPS_COST = 0.33
"""Cost of the first steps of a coarse fit, as a fraction of a coarse fit to all points."""
_OTHER_STEPS_COST = 0.67
"""Cost of the remaining steps of a coarse fit, as a fraction of a coarse fit to all points."""
_FIXED_COST_FRACTION = 0.3
"""Fraction of a step's cost that is independent of the number of points."""


def detect(
    fitter: Fitter,
    observation: Observation,
    eye: Float,
    height: float,
    network_output: EstimateAtPoints | None = None,
    by_facing: list[Estimate] | None = None,
) -> Steps[tuple[Posture, FitReport]]:
    """Finds the posture that explains an observation best, using only this frame.

    It is a generator that yields the cost of each step, in coarse fits.

    A short coarse fit of every hypothesis ranks them, and the best three are refined with all points.

    Args:
        fitter: fits the hypotheses.
        observation: the observed person.
        eye: (3,) the sensor's position, world frame.
        height: metres, the person's height until it is measured.
        network_output: the network's estimate of this observation; None without the network.
        by_facing: the network's estimates for each likely facing, see :func:`estimates_by_facing`.
    """
    coarse = _CoarseFits(fitter, observation, network_output, eye, height, _COARSE_POINTS)
    starts = yield from _create_hypotheses(observation, by_facing or [], eye, height)
    ranked = yield from coarse.rank(starts)
    finalists = _choose_best_distinct(ranked, _REFINED_HYPOTHESES)
    best = yield from _refine(fitter, observation, network_output, finalists, height)
    # Also try the best posture flipped, because front and back are easily confused.
    other = yield from _refine(fitter, observation, network_output, [flip_posture(best[1])], height)
    _, posture, report = min(best, other, key=lambda found: found[0])
    return posture, report


class _CoarseFits:
    """Fits hypotheses in a few steps to a subset of the points, to separate good ones from bad ones."""

    def __init__(
        self,
        fitter: Fitter,
        observation: Observation,
        network_output: EstimateAtPoints | None,
        eye: Float,
        height: float,
        points: int,
    ) -> None:
        step = max(1, len(observation.points) // points)
        self._cost = _FIXED_COST_FRACTION + (1.0 - _FIXED_COST_FRACTION) / step
        self._fitter, self._eye, self._height = fitter, eye, height
        self._network_output = None if network_output is None else network_output.thin(step)
        self._observation = _add_affinities(observation.thin(step), self._network_output, _AFFINITY)

    def rank(self, starts: list[Posture]) -> Steps[list[tuple[float, Posture]]]:
        """Fits hypotheses coarsely. Returns the costs and postures of the better half.

        It is a generator that yields its costs.

        A hypothesis that is in the worse half after a few steps hardly ever wins.
        """
        briefly_fitted, ranked = [], []
        for start in starts:
            briefly_fitted.append(self.fit_steps(start, _FIRST_STEPS))
            yield _FIRST_STEPS_COST * self._cost
        briefly_fitted.sort(key=lambda pair: pair[0])
        for _, posture in briefly_fitted[: max(_REFINED_HYPOTHESES, len(starts) // 2)]:
            ranked.append(self.fit_steps(posture, _COARSE_STEPS - _FIRST_STEPS))
            yield _OTHER_STEPS_COST * self._cost
        return ranked

    def fit_steps(self, start: Posture, steps: int = _COARSE_STEPS) -> tuple[float, Posture]:
        """Returns the cost of a hypothesis after the given number of steps, and its posture."""
        fit = self._fitter.fit
        posture, report = fit(self._observation, start, iterations=steps, width=_COARSE_WIDTH_M)
        return report.energy + implausibility_cost(
            self._network_output, posture, self._eye, self._height
        ), posture


def _choose_best_distinct(ranked: list[tuple[float, Posture]], max_count: int) -> list[Posture]:
    """Returns the cheapest postures without those that are similar to a cheaper one."""
    distinct: list[tuple[Float, Posture]] = []
    for _, posture in sorted(ranked, key=lambda pair: pair[0]):
        joints = posture.joints()
        if all(np.linalg.norm(joints - other, axis=1).max() > _DUPLICATE_DISTANCE_M for other, _ in distinct):
            distinct.append((joints, posture))
        if len(distinct) == max_count:
            break
    return [posture for _, posture in distinct]


def estimates_by_facing(
    estimator: PoseEstimator, estimate: Estimate, world_from_camera: Float
) -> Steps[list[Estimate]]:
    """Runs the network on the crop of an estimate without a facing, with the likeliest one, and its opposite.

    It is a generator that yields its costs.
    """
    likeliest = float(np.argmax(estimate.facing))
    turns = (likeliest, likeliest + 0.5 * FACINGS)
    estimates: list[Estimate] = []
    for facing in (None, *(turn * 2.0 * np.pi / FACINGS for turn in turns)):
        estimates += estimator.estimates(estimate.crop, world_from_camera, [facing])
        yield _NETWORK_COST
    return estimates


def _create_hypotheses(
    observation: Observation, by_facing: list[Estimate], eye: Float, height: float
) -> Steps[list[Posture]]:
    """Returns the initial hypotheses: standing, and from the network or from the bank.

    It is a generator that yields its costs.

    Args:
        observation: the observed person.
        by_facing: the network's estimates.
        eye: (3,) the sensor's position, world frame.
        height: metres.
    """
    builds = likely_builds(observation, height)
    # The network needs no standing postures to find people. But without them, two of four pushed chairs were
    # taken for a person.
    standing = make_standing_starts(observation, eye, builds[-1])
    if by_facing:
        yield _POSTURE_COST * len(builds)
        by_estimate = [pose_from_estimate(estimate, build) for build in builds for estimate in by_facing]
        return [*by_estimate, *standing]
    z, mask, _, camera, pose = observation.view
    ends = find_extremities(z, mask, camera, pose)
    yield _EXTREMITIES_COST
    banked = bank_starts(observation, ends, eye, builds[0], _BANK_HYPOTHESES)
    yield _BANK_COST
    return [*standing, *banked]


def _refine(
    fitter: Fitter,
    observation: Observation,
    network_output: EstimateAtPoints | None,
    starts: list[Posture],
    height: float,
) -> Steps[tuple[float, Posture, FitReport]]:
    """Fits some hypotheses completely, including lengths. Returns the best posture with its cost and report.

    It is a generator that yields its costs.

    Args:
        fitter, observation, network_output, height: as in :func:`detect`.
        starts: the hypotheses.
    """
    guided = _add_affinities(observation, network_output, _HALF_AFFINITY * _AFFINITY)
    eye = observation.view.world_from_camera[:3, 3]
    ready = []
    for start in starts:
        halfway, _ = fitter.fit(
            guided, start, iterations=_HALF_STEPS, width=_HALF_WIDTH, proportions=_LENGTH_WEIGHTS
        )
        yield _REFINEMENT_COST
        posture, report = fitter.fit(
            observation, halfway, iterations=_HALF_STEPS, proportions=_LENGTH_WEIGHTS
        )
        implausibility = implausibility_cost(network_output, posture, eye, height)
        ready.append((report.energy + implausibility, posture, report))
        yield _REFINEMENT_COST
    return min(ready, key=lambda found: found[0])


def _add_affinities(
    observation: Observation, network_output: EstimateAtPoints | None, metres: float
) -> Observation:
    """Returns the observation with affinities: points prefer the limbs of their body part, left or right."""
    return (
        observation
        if network_output is None
        else observation.with_guides(network_output.sideless_affinity(metres))
    )
