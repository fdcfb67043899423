"""Detection: finds a person's posture in one frame by fitting several hypotheses and keeping the best.

With the network, its estimates for each likely facing are the first hypotheses, and it contributes to the
ranking. Without it, or in addition, standing postures and a bank of others are aligned with the extremities
of the surface.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.body_model import Posture, model
from enliven_edge.tracking.detect.appearance import (
    EstimateAtPoints,
    flip_posture,
)
from enliven_edge.tracking.detect.extremities import extremities
from enliven_edge.tracking.detect.fit_quality import likely_builds, oddness
from enliven_edge.tracking.detect.hypotheses import bank_starts, pose_from_estimate, standing_starts
from enliven_edge.tracking.estimator import FACINGS, Estimate, PoseEstimator
from enliven_edge.tracking.fit import FitReport, Fitter
from enliven_edge.tracking.frame import Observation
from enliven_edge.tracking.work_budget import Steps

_REFINED_HYPOTHESES = 3
"""Hypotheses that are refined. With eight, flipped ones won on real shots, because coarse fits distinguish
front from back better."""
_DUPLICATE_DISTANCE_M = 0.12
"""Maximum distance in metres of all pairs of joints for two hypotheses to count as equal: they would end in
the same fit."""
_FACING_CANDIDATES = 3
"""Number of likeliest facings that the network is conditioned on, in addition to none and the opposite. Each
costs a run."""
_LENGTH_WEIGHTS = np.full(len(model.LENGTHS), 30.0)
"""(12,) weights of the lengths in a refinement. They are low, because the person is not measured yet."""
_COARSE_POINTS = 160
"""Points of the coarse fits of a tracked person: a third of all, because the fits are only compared."""
_FIRST_POINTS = 250
"""The same for a new person: half of all, because there is no present posture to keep if all of these are
bad."""
_COARSE_STEPS = 8
"""Steps of a coarse fit. With four to six the tuning set lost half a percent of its joints."""
_COARSE_WIDTH_M = 0.25
"""Robust width of coarse fits in metres. A limb of a hypothesis may be wrong by as much."""
_FIRST_STEPS = 2
"""Steps after which the worse half of the hypotheses is dropped. It hardly ever wins."""
_MIDDLE_POINTS = 250
"""Points of the first half of a refinement of a tracked person. Half of all show which hypothesis is
hopeless."""
_MAX_ENERGY_RATIO = 1.6
"""Factor on the lowest energy above which a half refined hypothesis is dropped as hopeless."""
_HALF_STEPS = 15
"""Steps of each half of a refinement. The fit has converged by then."""
_HALF_WIDTH = 0.12
"""Robust width of the first half in metres, between that of a coarse fit and that of the ordinary fit."""
_HALF_AFFINITY = 0.4
"""Factor on the affinity in the first half of a refinement: the surface takes over from the network."""
_MAX_REFINED_COST = 1.0
"""Fraction of the present cost below which a hypothesis is refined. One that is no better hardly ever
wins."""
_AFFINITY = 0.15
"""Affinity in coarse fits in metres: the added distance between a point and a capsule of another body
part."""
_BANK_HYPOTHESES = 8
"""Hypotheses from the bank if there is no network, the most similar first. Each costs a coarse fit."""
_EXTRA_BANK_HYPOTHESES = 3
"""Hypotheses from the bank in addition to the network's, which are better."""
_NETWORK_COST = 1
"""Cost of running the network for one likely facing, in coarse fits."""
_POSTURE_COST = 1
"""Cost of turning the network's estimates into postures of one build, in coarse fits."""
_EXTREMITIES_COST = 3
"""Cost of the geodesic extremities, in coarse fits."""
_BANK_COST = 4
"""Cost of comparing the bank with the points, in coarse fits."""
_REFINEMENT_COST = 2
"""Cost of half a refinement of one hypothesis, in coarse fits."""
_FIRST_STEPS_COST = 0.33
"""Cost of the first steps of a coarse fit, as a fraction of a coarse fit to all points."""
_OTHER_STEPS_COST = 0.67
"""The same for the other steps."""
_FIXED_COST_FRACTION = 0.3
"""Fraction of the cost of a step that does not depend on the number of points."""


def detect(
    fitter: Fitter,
    observation: Observation,
    eye: Float,
    height: float,
    seen: EstimateAtPoints | None = None,
    by_facing: list[Estimate] | None = None,
    lengths: Float | None = None,
) -> Steps[tuple[Posture, FitReport]]:
    """Finds the posture that explains an observation best, without another frame.

    It is a generator that yields its costs.

    A short coarse fit of every hypothesis ranks them, and the best three are refined with all points.

    Args:
        fitter: fits the hypotheses.
        observation: the observed person.
        eye: (3,) the sensor's position, world frame.
        height: metres, the person's height until it is measured.
        seen: the network's estimate of this observation; None without the network.
        by_facing: its estimates for each likely facing, see :func:`estimates_by_facing`.
        lengths: (12,) metres, of this person if they are known already.
    """
    coarse = _CoarseFits(fitter, observation, seen, eye, height, _FIRST_POINTS)
    starts = yield from _create_hypotheses(observation, by_facing or [], eye, height, lengths)
    ranked = yield from coarse.ranked(starts)
    kept = _best_distinct(ranked, _REFINED_HYPOTHESES)
    best = yield from _refine(fitter, observation, seen, kept, height)
    # Also try the best posture flipped, because front and back are easily confused.
    other = yield from _refine(fitter, observation, seen, [flip_posture(best[1])], height)
    _, posture, report = min(best, other, key=lambda found: found[0])
    return posture, report


def detect_another(
    fitter: Fitter,
    observation: Observation,
    seen: EstimateAtPoints | None,
    eye: Float,
    height: float,
    now: Posture,
    by_facing: list[Estimate] | None = None,
    lengths: Float | None = None,
) -> Steps[tuple[Posture, FitReport] | None]:
    """Finds a posture that may explain an observation better than ``now``. None if there is none.

    It is a generator that yields its costs. The present posture is fitted as coarsely as all others. A
    hypothesis that is no better at that stage is hardly ever better in the end, so it is not refined.

    Args:
        fitter, observation, seen, eye, height, by_facing, lengths: as in :func:`detect`.
        now: the present posture.
    """
    coarse = _CoarseFits(fitter, observation, seen, eye, height, _COARSE_POINTS)
    mark, _ = coarse.fitted(now)
    yield 1
    starts = yield from _create_hypotheses(observation, by_facing or [], eye, height, lengths)
    ranked = yield from coarse.ranked(starts)
    promising = [pair for pair in ranked if pair[0] < _MAX_REFINED_COST * mark]
    if not promising:
        return None
    kept = _best_distinct(promising, _REFINED_HYPOTHESES)
    _, posture, report = yield from _refine(fitter, observation, seen, kept, height, _MIDDLE_POINTS)
    return posture, report


class _CoarseFits:
    """Fits hypotheses in a few steps, to some of the points, to separate good ones from bad ones."""

    def __init__(
        self,
        fitter: Fitter,
        observation: Observation,
        seen: EstimateAtPoints | None,
        eye: Float,
        height: float,
        points: int,
    ) -> None:
        step = max(1, len(observation.points) // points)
        self._cost = _FIXED_COST_FRACTION + (1.0 - _FIXED_COST_FRACTION) / step
        self._fitter, self._eye, self._height = fitter, eye, height
        self._seen = None if seen is None else seen.thinned(step)
        self._observation = _add_affinities(observation.thinned(step), self._seen, _AFFINITY)

    def ranked(self, starts: list[Posture]) -> Steps[list[tuple[float, Posture]]]:
        """Returns the costs and postures of the better half of some hypotheses.

        It is a generator that yields its costs.

        A hypothesis that is in the worse half after a few steps hardly ever wins.
        """
        glanced, ranked = [], []
        for start in starts:
            glanced.append(self.fitted(start, _FIRST_STEPS))
            yield _FIRST_STEPS_COST * self._cost
        glanced.sort(key=lambda pair: pair[0])
        for _, posture in glanced[: max(_REFINED_HYPOTHESES, len(starts) // 2)]:
            ranked.append(self.fitted(posture, _COARSE_STEPS - _FIRST_STEPS))
            yield _OTHER_STEPS_COST * self._cost
        return ranked

    def fitted(self, start: Posture, steps: int = _COARSE_STEPS) -> tuple[float, Posture]:
        """Returns the cost of a hypothesis after the given number of steps, and its posture."""
        fit = self._fitter.fit
        posture, report = fit(self._observation, start, iterations=steps, width=_COARSE_WIDTH_M)
        return report.energy + oddness(self._seen, posture, self._eye, self._height), posture


def _best_distinct(ranked: list[tuple[float, Posture]], most: int) -> list[Posture]:
    """Returns the cheapest postures without those that are similar to a cheaper one."""
    kept: list[tuple[Float, Posture]] = []
    for _, posture in sorted(ranked, key=lambda pair: pair[0]):
        joints = posture.joints()
        if all(np.linalg.norm(joints - other, axis=1).max() > _DUPLICATE_DISTANCE_M for other, _ in kept):
            kept.append((joints, posture))
        if len(kept) == most:
            break
    return [posture for _, posture in kept]


def estimates_by_facing(
    estimator: PoseEstimator, estimate: Estimate, world_from_camera: Float
) -> Steps[list[Estimate]]:
    """Runs the network on the crop of an estimate, conditioned on each likely facing, one after the other."""
    ways = np.argsort(-estimate.facing)[:_FACING_CANDIDATES]
    turns = [float(way) for way in ways] + [float(ways[0]) + 0.5 * FACINGS]
    estimates: list[Estimate] = []
    for facing in (None, *(turn * 2.0 * np.pi / FACINGS for turn in turns)):
        estimates += estimator.estimates(estimate.crop, world_from_camera, [facing])
        yield _NETWORK_COST
    return estimates


def _create_hypotheses(
    observation: Observation, by_facing: list[Estimate], eye: Float, height: float, lengths: Float | None
) -> Steps[list[Posture]]:
    """Returns the initial hypotheses: from the network, standing, and from the bank.

    It is a generator that yields its costs.

    Args:
        observation: the observed person.
        by_facing: the network's estimates.
        eye: (3,) the sensor's position, world frame.
        height: metres.
        lengths: (12,) metres, of this person; None: of an average person, and of one of the visible height.
    """
    z, mask, _, camera, pose = observation.view
    builds = [lengths] if lengths is not None else likely_builds(observation, height)
    by_estimate = [pose_from_estimate(estimate, build) for build in builds for estimate in by_facing]
    yield _POSTURE_COST * len(builds)
    ends = extremities(z, mask, camera, pose)
    yield _EXTREMITIES_COST
    banked = bank_starts(
        observation, ends, eye, builds[0], _EXTRA_BANK_HYPOTHESES if by_facing else _BANK_HYPOTHESES
    )
    yield _BANK_COST
    return [*by_estimate, *standing_starts(observation, eye, builds[-1]), *banked]


def _refine(
    fitter: Fitter,
    observation: Observation,
    seen: EstimateAtPoints | None,
    starts: list[Posture],
    height: float,
    points: int | None = None,
) -> Steps[tuple[float, Posture, FitReport]]:
    """Fits some hypotheses completely, including lengths. Returns the best with its cost.

    It is a generator that yields its costs.

    Args:
        fitter, observation, seen, height: as in :func:`detect`.
        starts: the hypotheses.
        points: number of points in the first half of the fit, after which a much worse hypothesis is dropped;
            None: all points, and none is dropped.
    """
    few, guide = observation, seen
    if points is not None:
        step = max(1, len(observation.points) // points)
        few, guide = observation.thinned(step), None if seen is None else seen.thinned(step)
    halfway = []
    for start in starts:
        guided = _add_affinities(few, guide, _HALF_AFFINITY * _AFFINITY)
        posture, report = fitter.fit(
            guided, start, iterations=_HALF_STEPS, width=_HALF_WIDTH, proportions=_LENGTH_WEIGHTS
        )
        halfway.append((report.energy, posture))
        yield _REFINEMENT_COST
    most = np.inf if points is None else _MAX_ENERGY_RATIO * min(energy for energy, _ in halfway)
    ready = []
    for energy, posture in halfway:
        if energy <= most:
            posture, report = fitter.fit(
                observation, posture, iterations=_HALF_STEPS, proportions=_LENGTH_WEIGHTS
            )
            odd = oddness(seen, posture, observation.view.world_from_camera[:3, 3], height)
            ready.append((report.energy + odd, posture, report))
            yield _REFINEMENT_COST
    return min(ready, key=lambda found: found[0])


def _add_affinities(observation: Observation, seen: EstimateAtPoints | None, metres: float) -> Observation:
    """Returns the observation with affinities: points prefer the limbs of their body part, left or right."""
    return observation if seen is None else observation.guided(seen.sideless_affinity(metres))
