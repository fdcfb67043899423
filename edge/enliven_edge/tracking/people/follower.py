"""One person, followed from frame to frame: predict, fit, doubt, and say how sure every joint is."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven_edge.tracking.body_model import Posture, continued, model
from enliven_edge.tracking.detect import (
    EstimateAtPoints,
    Facing,
    PoseRecovery,
    cost,
    detect,
    estimates_by_facing,
    facing,
    quality,
)
from enliven_edge.tracking.estimator import shipped_estimator
from enliven_edge.tracking.fit import FitReport, Fitter
from enliven_edge.tracking.frame import FrameView, Observation
from enliven_edge.tracking.people.confidence import bounded_when_seated, confidence
from enliven_edge.tracking.people.evidence import NAMES, capsule_confidence, evidence
from enliven_edge.tracking.people.redetection import (
    Redetection,
    conditioned_on_facing,
    guided_by,
    new_detection,
    observation_of,
    run_network,
    turned_around,
)
from enliven_edge.tracking.segment import lying_on
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import LOOK, Budget, BudgetedTask, Steps, whole

_GOOD = 0.68
"""Quality in [0, 1], see :func:`detection.quality`, from which a detected body is believed to be a person."""
_ACCEPTABLE = 0.45
"""Quality up to which a frame is bad: less than for a new body, as a known one may be half hidden."""
_SUPPORT, _VISIBLE = NAMES.index("support"), NAMES.index("visible")
_EXPLAINED = 0.93
"""Share of the points below which a frame is fitted a second time, more widely: a limb was too fast."""
_WIDE = 0.25
"""Metres: the robust width of the second fit, about what a fast hand moves in a frame."""
_DOUBTED = 8.5
"""Square centimetres a point: cost of a frame from which the person is detected again."""
_MOSTLY_EXPLAINED = 0.87
"""Share of the points below which a doubtful person is detected again whatever the network sees."""
_LIMB = 3
"""Joints of a limb that moves by itself: elbow, wrist and hand, or knee, ankle and foot."""
_CLEARLY = 0.8
"""Share of the present cost that a new detection may have at most: a smaller gain may be chance."""
_AGAIN_AFTER = 30
"""Frames between two detections of a doubtful person at first: each takes several frames, and the
tuning, close and held-out films came out no better with twice as many."""
_LONGEST = 120
"""Frames between two detections at most: the wait doubles up to this while nothing better is found."""
_WORSE = 1.2
"""Times the cost of the last detection in vain from which the wait starts short again."""
_KNOWN_AFTER = 120
"""Well fitted frames, four seconds, after which the lengths are settled enough to detect the person with."""
_SHAPED_AFTER = 30
"""Well fitted frames, a second, up to which all fit the lengths: these are far off at first."""
_SHAPED_EVERY = 2
"""Frames from one fit of the lengths to the next after that: a posture is fitted a third faster without, and
joints of the tuning, close and held-out films came nearer by up to a millimetre."""
_NO_AFFINITY, _NO_LANDMARKS = np.zeros((0, 0), np.float32), np.zeros((0, 5))
_SPEED_MEMORY = 0.4
"""Seconds over which the speed of walking is averaged: less than a step, more than the noise of a frame."""
_SOME_POINTS = np.log1p(4)
"""Evidence of support, log(1 + points), from which a joint counts as supported in a frame."""
_SEEN_SHARE = 0.3
"""Share of a joint's bone that must be visible for its support to count: fewer samples may be an edge."""
_HARDLY = 0.02
"""Probability of being a person below which a group of pixels is not searched: so plain a no needs no fit."""
_MAYBE = 0.3
"""The same probability where the floor is guessed: heights, which rule out most things, say nothing then."""
_BESIDE = 0.12
"""Metres from the model's surface beyond which a point is something else: clothes stay within."""
_MOSTLY = 0.5
"""Share of a group of pixels that must lie on the model for a search without the rest to be worth it."""
FEWEST_PIXELS = 60
"""Pixels of the working image below which a group cannot show a posture."""


class Follower:
    """Fits one person in every frame.

    :meth:`found` makes one where a new person is seen; then call :meth:`follow` once a frame.

    Attributes:
        posture: of the last frame that was fitted.
        confidence: (20,) of its joints, in [0, 1]; all 0 in a frame that did not show the person.
        evidence: (20, 17) what the last frame said for and against every joint.
        lost: whether the fit has been bad for longer than the settings allow.
        person_probability: of the last frame by the network, in [0, 1]: that this is a person and no thing.
        budget: what detecting the person again may cost in the next frame.
    """

    def __init__(self, settings: TrackerSettings, fitter: Fitter, posture: Posture) -> None:
        self.settings = settings
        self.posture = posture
        self.confidence = np.zeros(20)
        self.evidence = np.zeros((20, len(NAMES)))
        self.lost = False
        self.person_probability = 1.0
        self._fitter = fitter.limber
        self._recovery = PoseRecovery(fitter.limber)
        self._facing = Facing()
        self._before: Posture | None = None
        self._fitted = 0
        self._bad = 0
        self._unsupported = np.zeros(20)
        self._velocity, self._time_ns = np.zeros(3), 0
        self.budget = Budget(np.inf)
        self._since_detected = 0
        self._redetection: Redetection | None = None
        self._wait, self._cost_in_vain = _AGAIN_AFTER, np.inf

    @classmethod
    def found(
        cls, view: FrameView, pixels: Bool, settings: TrackerSettings, fitter: Fitter
    ) -> tuple[Follower, float] | None:
        """Returns a person in the (h, w) ``pixels`` and their quality, up to 1; None without a person."""
        return whole(cls.sought(view, pixels, settings, fitter))

    @classmethod
    def sought(
        cls, view: FrameView, pixels: Bool, settings: TrackerSettings, fitter: Fitter, *, entire: bool = False
    ) -> Steps[tuple[Follower, float] | None]:
        """Does what :meth:`found` does, in parts.

        Args:
            entire: whether the body must explain all pixels; else a second search leaves out what touches it.
        """
        if np.count_nonzero(pixels) < FEWEST_PIXELS:
            return None
        observation = observation_of(view, pixels, settings)
        seen, by_facing = None, None
        if settings.estimator:
            seen = run_network(view, pixels, observation, None)
            yield LOOK
            if seen.estimate.person_probability < (_HARDLY if view.has_floor else _MAYBE):
                return None
            network, pose = shipped_estimator(), view.world_from_camera
            by_facing = yield from estimates_by_facing(network, seen.estimate, pose)
        height = settings.body_height
        posture, report = yield from detect(fitter, observation, view.eye, height, seen, by_facing)
        if quality(report) < _GOOD:
            bare = pixels & lying_on(view, [posture], 0.0, _BESIDE)
            # Once more without what touches the person, a table say.
            if entire or not _MOSTLY < bare.sum() / pixels.sum() < 1.0:
                return None
            return (yield from cls.sought(view, bare, settings, fitter))
        follower = cls(settings, fitter, posture)
        follower.person_probability = 1.0 if seen is None else seen.estimate.person_probability
        follower._update_evidence(report, observation, seen)
        return follower, quality(report)

    @property
    def redetecting(self) -> bool:
        """Whether a new detection of the person is under way."""
        return self._redetection is not None

    def hide(self) -> None:
        """Takes in a frame that does not show the person."""
        self.confidence, self._redetection = np.zeros(20), None

    def predicted(self) -> Posture:
        """Returns the posture expected in the next frame, by the motion between the last two."""
        return self.posture.copy() if self._before is None else continued(self._before, self.posture)

    def carry(self, step: Float) -> None:
        """Moves the posture as a whole by (3,) metres, in a frame that is not fitted."""
        self.posture.position = self.posture.position + step
        if self._before is not None:
            self._before.position = self._before.position + step

    def follow(self, view: FrameView, pixels: Bool, predicted: Posture | None = None) -> bool:
        """Fits a frame in which the (h, w) ``pixels`` are this person's; False where they do not fit.

        Args:
            predicted: what :meth:`predicted` returned, where it is known already.
        """
        self.confidence = np.zeros(20)
        if np.count_nonzero(pixels) < FEWEST_PIXELS:
            return self._missed()
        predicted = self.predicted() if predicted is None else predicted
        observation = observation_of(view, pixels, self.settings)
        seen = None
        if self.settings.estimator:
            seen = run_network(view, pixels, observation, facing(predicted, view.eye))
            self.person_probability = seen.estimate.person_probability
            observation = guided_by(observation, seen, self.settings.fit.affinity)
        posture, report = self._fitted_to(observation, predicted, self._proportions())
        certain = capsule_confidence(report, observation, posture)
        # One search at a time: a frame with both would be the longest.
        reconsider, arms = self._recovery.reconsider, not self.redetecting
        posture, report = reconsider(observation, posture, report, certain, seen, arms=arms)
        velocity = self._moving(posture.position, view.time_ns)
        flipped = seen is not None and self._facing.is_wrong(seen, posture, view.eye, velocity)
        if flipped and seen is not None:
            posture, seen = turned_around(posture, seen, view)
            observation = guided_by(observation, seen, self.settings.fit.affinity)
            posture, report = self._fitter.fit(observation, posture)
        redetected = self._redetected(observation, posture, report, seen, view.eye)
        if redetected is not None:
            posture, report = redetected
            seen = None if seen is None else conditioned_on_facing(posture, seen, view)
        bad = quality(report) <= _ACCEPTABLE
        if bad and not self._missed() and self.lost:
            return False
        self._before, self.posture = (None if flipped or redetected else self.posture), posture
        self._update_evidence(report, observation, seen)
        if bad:
            return False
        self._fitted, self._bad = self._fitted + 1, 0
        return True

    def _fitted_to(
        self, observation: Observation, predicted: Posture, proportions: Float | None
    ) -> tuple[Posture, FitReport]:
        """Returns the better of two fits: from the prediction, and after a wider fit from the last one."""
        fit = self._fitter.fit
        best = fit(observation, predicted, predicted=predicted, proportions=proportions)
        if best[1].explained > _EXPLAINED:
            return best
        wide, _ = fit(observation, self.posture, predicted=predicted, iterations=5, width=_WIDE)
        other = fit(observation, wide, predicted=predicted, proportions=proportions)
        return other if other[1].energy < best[1].energy else best

    def _redetected(
        self,
        observation: Observation,
        posture: Posture,
        report: FitReport,
        seen: EstimateAtPoints | None,
        eye: Float,
    ) -> tuple[Posture, FitReport] | None:
        """Detects a doubtful person from scratch; returns a fit only if it explains the frame much better.

        A detection takes several frames, so there is one at most every second, fewer of them while
        they find nothing, and none where the network sees the same posture. A posture found in an earlier
        frame is fitted to this one and has to explain it better too.
        """
        self._since_detected += 1
        height = self.settings.body_height
        now = cost(report, posture, seen, eye, height)
        plain = observation.guided(_NO_AFFINITY, _NO_LANDMARKS)
        if self._redetection is None:
            if now < _DOUBTED or now > _WORSE * self._cost_in_vain:
                self._wait = _AGAIN_AFTER
            doubted = now >= _DOUBTED and self._since_detected >= self._wait
            if not doubted or _is_borne_out(posture, report, seen):
                return None
            self._since_detected = 0
            known = posture.lengths if self._fitted > _KNOWN_AFTER else None
            steps = new_detection(self._fitter, plain, seen, eye, height, posture, known)
            begun = (observation, seen, posture, now, known is not None)
            self._redetection = Redetection(BudgetedTask(steps), *begun)
        under_way = self._redetection
        if not under_way.task.go_on(self.budget):
            return None
        self._redetection, found = None, under_way.task.result
        better = (
            found is not None
            and cost(found[1], found[0], under_way.seen, eye, height) <= _CLEARLY * under_way.cost
        )
        if found is not None and better and under_way.observation is not observation:
            found = self._brought(found[0], posture.position - under_way.posture.position, plain)
            better = cost(found[1], found[0], seen, eye, height) <= _CLEARLY * now
        if not better:
            self._wait = min(2 * self._wait, _LONGEST)
            self._cost_in_vain = now
            return None
        self._wait = _AGAIN_AFTER
        self._fitted = self._fitted if under_way.known else 0
        self._recovery, self._facing = PoseRecovery(self._fitter), Facing()
        return found

    def _brought(self, posture: Posture, step: Float, observation: Observation) -> tuple[Posture, FitReport]:
        """Moves an earlier frame's posture by (3,) metres and fits it to this frame, widely, then closely."""
        moved = posture.copy()
        moved.position = moved.position + step
        wide, _ = self._fitter.fit(observation, moved, width=_WIDE)
        return self._fitter.fit(observation, wide)

    def _moving(self, position: Float, time_ns: int) -> Float:
        """Returns the (3,) velocity of the hip centre, metres a second, averaged over the last frames."""
        seconds = (time_ns - self._time_ns) * 1e-9
        if 0.0 < seconds < 0.5:
            share = min(1.0, seconds / _SPEED_MEMORY)
            self._velocity = self._velocity + share * (
                (position - self.posture.position) / seconds - self._velocity
            )
        self._time_ns = time_ns
        return self._velocity

    def _missed(self) -> bool:
        """Counts a bad frame; always False."""
        self._redetection = None
        self._bad += 1
        self.lost = self._bad > self.settings.lost_after
        return False

    def _update_evidence(
        self, report: FitReport, observation: Observation, seen: EstimateAtPoints | None
    ) -> None:
        """Gathers what the frame says for and against every joint, and updates the confidence."""
        estimate = None if seen is None else seen.estimate
        self.evidence = evidence(self.posture, report, observation, self._unsupported, estimate)
        supported = (self.evidence[:, _VISIBLE] > _SEEN_SHARE) & (self.evidence[:, _SUPPORT] > _SOME_POINTS)
        self._unsupported = np.where(supported, 0.0, self._unsupported + 1.0)
        sure = confidence(self.evidence, alone=seen is None)
        self.confidence = bounded_when_seated(sure, self.posture)

    def _proportions(self) -> Float | None:
        """Returns (12,) weights that hold the bones' lengths: soft at first; None where they are frozen.

        That is once they are settled, and before that in every other frame after the first ones.
        """
        settings = self.settings.fit
        settled = self._fitted > 3 * settings.settle_frames
        if settled or (self._fitted > _SHAPED_AFTER and (self._fitted + self._bad) % _SHAPED_EVERY):
            return None
        firmness = settings.proportions * (1.0 + 30.0 * self._fitted / settings.settle_frames)
        return np.full(len(model.LENGTHS), firmness)


def _is_borne_out(posture: Posture, report: FitReport, seen: EstimateAtPoints | None) -> bool:
    """Whether a posture explains most of the frame and the network sees at most a limb plainly elsewhere.

    A limb is tried elsewhere anyway. Of 227 detections begun in such frames of the tuning and close films 12
    were taken, six to a better and six to a worse posture, by a few centimetres at most.
    """
    if seen is None or report.explained <= _MOSTLY_EXPLAINED:
        return False
    return seen.estimate.count_apart(posture.joints()) <= _LIMB
