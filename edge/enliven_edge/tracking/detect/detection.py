"""Finding a person's posture with no memory: several hypotheses are fitted, the best explanation wins.

Where the network is at hand, what it sees for each way that somebody may face gives the first hypotheses, and
it has a say in the ranking; else, or besides, standing postures and a bank of others are brought to the
extremities of the surface.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven_edge.tracking.body_model import Posture, model
from enliven_edge.tracking.detect.appearance import Seen, agreement, facing_score, turned_about
from enliven_edge.tracking.detect.extremities import extremities
from enliven_edge.tracking.detect.facing_side import backward
from enliven_edge.tracking.detect.hypotheses import banked_starts, standing_starts
from enliven_edge.tracking.detect.posing import posed
from enliven_edge.tracking.estimator import FACINGS, Estimate, PoseEstimator
from enliven_edge.tracking.fit import FitReport, Fitter
from enliven_edge.tracking.frame import Observation
from enliven_edge.tracking.work_budget import Steps

_REFINED = 3
"""Hypotheses that are refined. With more of them those win that are turned about: ranking by coarse fits
tells front from back better."""
_SAME = 0.12
"""Metres: hypotheses all of whose joints are this near to each other's are one."""
_LIKELIEST = 3
"""Ways to face that are supposed, besides not saying how, and the opposite of the likeliest."""
_LOOSE = np.full(len(model.LENGTHS), 30.0)
_COARSE_POINTS, _COARSE_STEPS, _WIDE = 160, 8, 0.25
"""Points and steps of the coarse fits of who is followed already, and all coarse fits' width in metres."""
_GLANCE = 2
"""Steps after which the worse half of the hypotheses is left."""
_MIDDLE_POINTS, _LEFT = 250, 1.6
"""Points of the first half of a refinement, and how many times the least energy makes one be left then."""
_PROMISING = 1.0
"""Share of what the present posture costs below which another one is worth being refined."""
_AFFINITY = 0.15
"""Metres: how far, at first, what a point looks like outweighs where it is."""
_DISAGREEMENT = 4.0
"""Square centimetres a point that it costs to be of other parts than the network says, all of them."""
_FACING = 0.6
"""Square centimetres a point that it costs to face another way than the likeliest, by log likelihood."""
_BACKWARD = 12.0
"""Square centimetres a point that it costs to lean backward, a sine."""
_STATURE, _SPREAD = 2.0, 0.15
"""Square centimetres a point that the unlikeliest stature costs, a third of it one spread (metres) away."""
_SHORTEST, _TALLEST, _ALIKE = 0.9, 2.1, 0.08
"""Metres within which a person may just stand there, and the share by which statures are much the same."""
_BANKED, _BANKED_BESIDES = 8, 3
"""Hypotheses of the bank without a network, and besides one."""
_POSED, _ENDS, _BANK, _REFINEMENT, _GLANCED = 1, 3, 4, 2, 1
"""What the parts of a detection cost, in coarse fits: estimates made postures, extremities, the bank, half a
refinement, and a look at a hypothesis."""


def detect(
    fitter: Fitter,
    observation: Observation,
    eye: Float,
    height: float,
    seen: Seen | None = None,
    supposed: list[Estimate] | None = None,
    lengths: Float | None = None,
) -> Steps[tuple[Posture, FitReport]]:
    """The posture that explains the observation best from scratch, in parts.

    A short coarse fit of every hypothesis ranks them, and the best three are refined to all points.

    Args:
        eye: (3,) the sensor's position, world frame.
        height: metres, the person's height until it is measured.
        seen: what the network says of this observation; None without one.
        supposed: what it sees for each way that the person may face, see :func:`supposing`.
        lengths: (12,) metres, the person's own where they are known already.
    """
    coarse = _Coarse(fitter, observation, seen, eye, height)
    starts = yield from _starts(observation, supposed or [], eye, height, lengths)
    ranked = []
    for start in starts:
        ranked.append(coarse.fitted(start))
        yield 1
    kept = _best_distinct(ranked, _REFINED)
    best = yield from _refined(fitter, observation, seen, kept, height)
    # A front is easily taken for a back: the best is tried turned about as well.
    other = yield from _refined(fitter, observation, seen, [turned_about(best[1])], height)
    _, posture, report = min(best, other, key=lambda found: found[0])
    return posture, report


def detect_another(
    fitter: Fitter,
    observation: Observation,
    seen: Seen | None,
    eye: Float,
    height: float,
    now: Posture,
    supposed: list[Estimate] | None = None,
    lengths: Float | None = None,
) -> Steps[tuple[Posture, FitReport] | None]:
    """A posture from scratch that may explain the observation better than ``now``, in parts; None: none may.

    The present posture is fitted as coarsely as all others: what is no better than it then is hardly ever
    better in the end, and is not refined.

    Args:
        seen, supposed, eye, height, lengths: as of :func:`detect`.
    """
    coarse = _Coarse(fitter, observation, seen, eye, height, _COARSE_POINTS)
    mark, _ = coarse.fitted(now)
    yield 1
    starts = yield from _starts(observation, supposed or [], eye, height, lengths)
    ranked = yield from coarse.ranked(starts)
    promising = [pair for pair in ranked if pair[0] < _PROMISING * mark]
    if not promising:
        return None
    kept = _best_distinct(promising, _REFINED)
    _, posture, report = yield from _refined(fitter, observation, seen, kept, height, _MIDDLE_POINTS)
    return posture, report


class _Coarse:
    """Short fits, to so many of the points, which tell good hypotheses from bad ones."""

    def __init__(
        self,
        fitter: Fitter,
        observation: Observation,
        seen: Seen | None,
        eye: Float,
        height: float,
        points: int | None = None,
    ) -> None:
        step = 1 if points is None else max(1, len(observation.points) // points)
        self._fitter, self._eye, self._height = fitter, eye, height
        self._seen = None if seen is None else seen.thinned(step)
        self._observation = _guided(observation.thinned(step), self._seen, _AFFINITY)

    def ranked(self, starts: list[Posture]) -> Steps[list[tuple[float, Posture]]]:
        """What the better half of some hypotheses costs, and their postures, in parts.

        Who is among the worse after a few steps hardly ever wins.
        """
        glanced, ranked = [], []
        for start in starts:
            glanced.append(self.fitted(start, _GLANCE))
            yield _GLANCED
        glanced.sort(key=lambda pair: pair[0])
        for _, posture in glanced[: max(_REFINED, len(starts) // 2)]:
            ranked.append(self.fitted(posture, _COARSE_STEPS - _GLANCE))
            yield _GLANCED
        return ranked

    def fitted(self, start: Posture, steps: int = _COARSE_STEPS) -> tuple[float, Posture]:
        """What a hypothesis costs after so many steps, and its posture."""
        fit = self._fitter.fit
        posture, report = fit(self._observation, start, iterations=steps, width=_WIDE)
        return report.energy + _oddness(self._seen, posture, self._eye, self._height), posture


def _best_distinct(ranked: list[tuple[float, Posture]], most: int) -> list[Posture]:
    """The cheapest postures, leaving out those that are much like a cheaper one."""
    kept: list[tuple[Float, Posture]] = []
    for _, posture in sorted(ranked, key=lambda pair: pair[0]):
        joints = posture.joints()
        if all(np.linalg.norm(joints - other, axis=1).max() > _SAME for other, _ in kept):
            kept.append((joints, posture))
        if len(kept) == most:
            break
    return [posture for _, posture in kept]


def supposing(estimator: PoseEstimator, estimate: Estimate, world_from_camera: Float) -> list[Estimate]:
    """What the network sees in the crop of an estimate, for each way in which the person may well face."""
    ways = np.argsort(-estimate.facing)[:_LIKELIEST]
    turns = [float(way) for way in ways] + [float(ways[0]) + 0.5 * FACINGS]
    facings = [None, *(turn * 2.0 * np.pi / FACINGS for turn in turns)]
    return estimator.estimates(estimate.crop, world_from_camera, facings)


def _starts(
    observation: Observation, supposed: list[Estimate], eye: Float, height: float, lengths: Float | None
) -> Steps[list[Posture]]:
    """Where to begin: as the network sees it, standing, and of the bank; in parts.

    Args:
        lengths: (12,) the person's own; None: the likeliest person's, and those of one who just stands there.
    """
    z, mask, _, camera, pose = observation.view
    builds = [lengths] if lengths is not None else _builds(observation, height)
    by_estimate = [posed(estimate, build) for build in builds for estimate in supposed]
    yield _POSED * len(builds)
    ends = extremities(z, mask, camera, pose)
    yield _ENDS
    banked = banked_starts(observation, ends, eye, builds[0], _BANKED_BESIDES if supposed else _BANKED)
    yield _BANK
    return [*by_estimate, *standing_starts(observation, eye, builds[-1]), *banked]


def _refined(
    fitter: Fitter,
    observation: Observation,
    seen: Seen | None,
    starts: list[Posture],
    height: float,
    points: int | None = None,
) -> Steps[tuple[float, Posture, FitReport]]:
    """The best of some hypotheses fitted to the end, their proportions too, and what it costs; in parts.

    Args:
        points: of the first half of the fit, after which what is much worse than another is left; None: all,
            and nothing is left.
    """
    few, guide = observation, seen
    if points is not None:
        step = max(1, len(observation.points) // points)
        few, guide = observation.thinned(step), None if seen is None else seen.thinned(step)
    halfway = []
    for start in starts:
        guided = _guided(few, guide, 0.4 * _AFFINITY)
        posture, report = fitter.fit(guided, start, iterations=15, width=0.12, proportions=_LOOSE)
        halfway.append((report.energy, posture))
        yield _REFINEMENT
    most = np.inf if points is None else _LEFT * min(energy for energy, _ in halfway)
    ready = []
    for energy, posture in halfway:
        if energy <= most:
            posture, report = fitter.fit(observation, posture, iterations=15, proportions=_LOOSE)
            odd = _oddness(seen, posture, observation.view[4][:3, 3], height)
            ready.append((report.energy + odd, posture, report))
            yield _REFINEMENT
    return min(ready, key=lambda found: found[0])


def _guided(observation: Observation, seen: Seen | None, metres: float) -> Observation:
    """The observation whose points prefer the limbs that they look like, left or right."""
    return observation if seen is None else replace(observation, affinity=seen.sideless_affinity(metres))


def cost(report: FitReport, posture: Posture, seen: Seen | None, eye: Float, height: float) -> float:
    """What a fitted posture costs in all, square centimetres a point; comparable within one frame."""
    return report.energy + _oddness(seen, posture, eye, height)


def _oddness(seen: Seen | None, posture: Posture, eye: Float, height: float) -> float:
    """What a posture costs besides what the depth says.

    For points that the network takes for other parts, for facing another way than it says, for leaning
    backward, and for a stature that is far from the likeliest.
    """
    unlike = ((model.height_of(posture.lengths) - height) / _SPREAD) ** 2
    stature = _STATURE * unlike / (unlike + 2.0) + _BACKWARD * backward(posture)
    if seen is None:
        return stature
    facing = facing_score(seen, posture, eye)
    return stature + _DISAGREEMENT * (1.0 - agreement(seen, posture)) - _FACING * facing


def quality(report: FitReport) -> float:
    """The share of the person that is explained less the share of the model that was seen through."""
    return report.explained - float(report.violated.mean())


def _builds(observation: Observation, height: float) -> list[Float]:
    """(12,) lengths of whom this may be: somebody of the likeliest height, and somebody as tall as is seen.

    What reaches lower may be a child, or somebody who crouches; what reaches higher, somebody tall, or arms.
    """
    seen = float(observation.crown[1]) + 0.01
    if observation.cut or not _SHORTEST < seen < _TALLEST:
        return [model.lengths_for_height(height)]
    if abs(seen / height - 1.0) < _ALIKE:
        return [model.lengths_for_height(seen)]
    return [model.lengths_for_height(height), model.lengths_for_height(seen)]
