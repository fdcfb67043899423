"""Detection: finds a person's posture in one frame by fitting several hypotheses and keeping the best.

With the network, its estimates for each likely facing are the first hypotheses, and it takes part in the
ranking. Without it, or in addition, standing postures and a bank of others are brought to the extremities of
the surface.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.body_model import Posture, model
from enliven_edge.tracking.detect.appearance import (
    EstimateAtPoints,
    turned_about,
)
from enliven_edge.tracking.detect.extremities import extremities
from enliven_edge.tracking.detect.fit_quality import likely_builds, oddness
from enliven_edge.tracking.detect.hypotheses import banked_starts, posed, standing_starts
from enliven_edge.tracking.estimator import FACINGS, Estimate, PoseEstimator
from enliven_edge.tracking.fit import FitReport, Fitter
from enliven_edge.tracking.frame import Observation
from enliven_edge.tracking.work_budget import Steps

_REFINED = 3
"""Hypotheses that are refined. Of eight, wrongly turned ones won on real shots: coarse fits tell front from
back better."""
_SAME = 0.12
"""Metres: hypotheses with every pair of joints nearer than this would end in the same fit."""
_LIKELIEST = 3
"""Likeliest facings to condition the network on, besides none and the opposite: each costs a run."""
_LOOSE = np.full(len(model.LENGTHS), 30.0)
"""(12,) weights that hold the lengths in a refinement: loosely, as the person is not measured yet."""
_COARSE_POINTS = 160
"""Points of the coarse fits of a followed person: a third of all, as the fits are only compared."""
_FIRST_POINTS = 250
"""The same of a new person: half of all, as no posture is known that would do where all of these are bad."""
_COARSE_STEPS = 8
"""Steps of a coarse fit: with four to six the tuning set lost half a percent of its joints."""
_WIDE = 0.25
"""Metres: the robust width of coarse fits, as a limb of a hypothesis may be off by as much."""
_GLANCE = 2
"""Steps after which the worse half of the hypotheses is dropped: it hardly ever wins."""
_MIDDLE_POINTS = 250
"""Points of the first half of a refinement of a followed person: half of all tell which one is hopeless."""
_LEFT = 1.6
"""Times the least energy from which a half refined hypothesis is dropped as hopeless."""
_HALF_STEPS = 15
"""Steps of either half of a refinement: the fit has settled by then."""
_HALF_WIDTH = 0.12
"""Metres: the robust width of the first half, between that of a coarse fit and that of the ordinary one."""
_HALF_AFFINITY = 0.4
"""Share of the affinity in the first half of a refinement: the surface takes over from the network."""
_PROMISING = 1.0
"""Share of the present cost below which a hypothesis is refined: one no better hardly ever wins."""
_AFFINITY = 0.15
"""Metres: how far the part that a point looks like outweighs its place in coarse fits."""
_BANKED = 8
"""Hypotheses taken from the bank where there is no network, the most alike first: each costs a coarse fit."""
_BANKED_BESIDES = 3
"""Hypotheses taken from the bank beside the network's, which are better."""
_SUPPOSED = 1
"""Coarse fits: the cost of running the network for one likely facing."""
_POSED = 1
"""Coarse fits: the cost of turning the network's estimates into postures of one build."""
_ENDS = 3
"""Coarse fits: the cost of the geodesic extremities."""
_BANK = 4
"""Coarse fits: the cost of comparing the bank with the points."""
_REFINEMENT = 2
"""Coarse fits: the cost of half a refinement of one hypothesis."""
_GLANCED = 0.33
"""Coarse fits to all points: the cost of the first steps of one."""
_RANKED = 0.67
"""The same: the cost of the other steps."""
_PER_FIT = 0.3
"""Share of the cost of a step that does not depend on the number of points."""


def detect(
    fitter: Fitter,
    observation: Observation,
    eye: Float,
    height: float,
    seen: EstimateAtPoints | None = None,
    by_facing: list[Estimate] | None = None,
    lengths: Float | None = None,
) -> Steps[tuple[Posture, FitReport]]:
    """Finds the posture that explains an observation best, from no other frame; in parts.

    A short coarse fit of every hypothesis ranks them, and the best three are refined to all points.

    Args:
        eye: (3,) the sensor's position, world frame.
        height: metres, the person's height until it is measured.
        seen: the network's estimate of this observation; None without the network.
        by_facing: its estimates for each likely facing, see :func:`estimates_by_facing`.
        lengths: (12,) metres, of this person where they are known already.
    """
    coarse = _Coarse(fitter, observation, seen, eye, height, _FIRST_POINTS)
    starts = yield from _starts(observation, by_facing or [], eye, height, lengths)
    ranked = yield from coarse.ranked(starts)
    kept = _best_distinct(ranked, _REFINED)
    best = yield from _refined(fitter, observation, seen, kept, height)
    # A front is easily taken for a back: the best is tried turned about as well.
    other = yield from _refined(fitter, observation, seen, [turned_about(best[1])], height)
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
    """Finds a posture that may explain an observation better than ``now``, in parts; None: there is none.

    The present posture is fitted as coarsely as all others. A hypothesis that is no better then is hardly
    ever better in the end, so it is not refined.

    Args:
        seen, by_facing, eye, height, lengths: as of :func:`detect`.
    """
    coarse = _Coarse(fitter, observation, seen, eye, height, _COARSE_POINTS)
    mark, _ = coarse.fitted(now)
    yield 1
    starts = yield from _starts(observation, by_facing or [], eye, height, lengths)
    ranked = yield from coarse.ranked(starts)
    promising = [pair for pair in ranked if pair[0] < _PROMISING * mark]
    if not promising:
        return None
    kept = _best_distinct(promising, _REFINED)
    _, posture, report = yield from _refined(fitter, observation, seen, kept, height, _MIDDLE_POINTS)
    return posture, report


class _Coarse:
    """Fits hypotheses in a few steps, to some of the points, to tell good ones from bad ones."""

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
        self._cost = _PER_FIT + (1.0 - _PER_FIT) / step
        self._fitter, self._eye, self._height = fitter, eye, height
        self._seen = None if seen is None else seen.thinned(step)
        self._observation = _guided(observation.thinned(step), self._seen, _AFFINITY)

    def ranked(self, starts: list[Posture]) -> Steps[list[tuple[float, Posture]]]:
        """Returns the costs and postures of the better half of some hypotheses, in parts.

        A hypothesis among the worse half after a few steps hardly ever wins.
        """
        glanced, ranked = [], []
        for start in starts:
            glanced.append(self.fitted(start, _GLANCE))
            yield _GLANCED * self._cost
        glanced.sort(key=lambda pair: pair[0])
        for _, posture in glanced[: max(_REFINED, len(starts) // 2)]:
            ranked.append(self.fitted(posture, _COARSE_STEPS - _GLANCE))
            yield _RANKED * self._cost
        return ranked

    def fitted(self, start: Posture, steps: int = _COARSE_STEPS) -> tuple[float, Posture]:
        """What a hypothesis costs after so many steps, and its posture."""
        fit = self._fitter.fit
        posture, report = fit(self._observation, start, iterations=steps, width=_WIDE)
        return report.energy + oddness(self._seen, posture, self._eye, self._height), posture


def _best_distinct(ranked: list[tuple[float, Posture]], most: int) -> list[Posture]:
    """Returns the cheapest postures, leaving out each that is much like a cheaper one."""
    kept: list[tuple[Float, Posture]] = []
    for _, posture in sorted(ranked, key=lambda pair: pair[0]):
        joints = posture.joints()
        if all(np.linalg.norm(joints - other, axis=1).max() > _SAME for other, _ in kept):
            kept.append((joints, posture))
        if len(kept) == most:
            break
    return [posture for _, posture in kept]


def estimates_by_facing(
    estimator: PoseEstimator, estimate: Estimate, world_from_camera: Float
) -> Steps[list[Estimate]]:
    """Runs the network on the crop of an estimate, conditioned on each likely facing, one after the other."""
    ways = np.argsort(-estimate.facing)[:_LIKELIEST]
    turns = [float(way) for way in ways] + [float(ways[0]) + 0.5 * FACINGS]
    made: list[Estimate] = []
    for facing in (None, *(turn * 2.0 * np.pi / FACINGS for turn in turns)):
        made += estimator.estimates(estimate.crop, world_from_camera, [facing])
        yield _SUPPOSED
    return made


def _starts(
    observation: Observation, by_facing: list[Estimate], eye: Float, height: float, lengths: Float | None
) -> Steps[list[Posture]]:
    """Returns the hypotheses to begin from: by the network, standing, and of the bank; in parts.

    Args:
        lengths: (12,) metres, of this person; None: of an average person, and of one as tall as what is seen.
    """
    z, mask, _, camera, pose = observation.view
    builds = [lengths] if lengths is not None else likely_builds(observation, height)
    by_estimate = [posed(estimate, build) for build in builds for estimate in by_facing]
    yield _POSED * len(builds)
    ends = extremities(z, mask, camera, pose)
    yield _ENDS
    banked = banked_starts(observation, ends, eye, builds[0], _BANKED_BESIDES if by_facing else _BANKED)
    yield _BANK
    return [*by_estimate, *standing_starts(observation, eye, builds[-1]), *banked]


def _refined(
    fitter: Fitter,
    observation: Observation,
    seen: EstimateAtPoints | None,
    starts: list[Posture],
    height: float,
    points: int | None = None,
) -> Steps[tuple[float, Posture, FitReport]]:
    """Fits some hypotheses to the end, lengths too; returns the best with its cost; in parts.

    Args:
        points: how many the first half of the fit uses, after which a much worse one is dropped; None: all,
            and none is dropped.
    """
    few, guide = observation, seen
    if points is not None:
        step = max(1, len(observation.points) // points)
        few, guide = observation.thinned(step), None if seen is None else seen.thinned(step)
    halfway = []
    for start in starts:
        guided = _guided(few, guide, _HALF_AFFINITY * _AFFINITY)
        posture, report = fitter.fit(
            guided, start, iterations=_HALF_STEPS, width=_HALF_WIDTH, proportions=_LOOSE
        )
        halfway.append((report.energy, posture))
        yield _REFINEMENT
    most = np.inf if points is None else _LEFT * min(energy for energy, _ in halfway)
    ready = []
    for energy, posture in halfway:
        if energy <= most:
            posture, report = fitter.fit(observation, posture, iterations=_HALF_STEPS, proportions=_LOOSE)
            odd = oddness(seen, posture, observation.view.world_from_camera[:3, 3], height)
            ready.append((report.energy + odd, posture, report))
            yield _REFINEMENT
    return min(ready, key=lambda found: found[0])


def _guided(observation: Observation, seen: EstimateAtPoints | None, metres: float) -> Observation:
    """Returns the observation with affinities: points prefer the limbs that they look like, left or right."""
    return observation if seen is None else observation.guided(seen.sideless_affinity(metres))
