"""One person, followed from frame to frame: predict, fit, doubt, and say how sure every joint is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Bool, Float
from enliven_edge.tracking.body_model import Posture, continued, model
from enliven_edge.tracking.detect import (
    Facing,
    SecondThoughts,
    Seen,
    cost,
    detect,
    detect_another,
    drawn,
    facing,
    looked_at,
    quality,
    supposing,
    turned_about,
)
from enliven_edge.tracking.estimator import shipped_estimator
from enliven_edge.tracking.fit import FitReport, Fitter
from enliven_edge.tracking.frame import FrameView, Observation, observe
from enliven_edge.tracking.people.confidence import confidence
from enliven_edge.tracking.people.evidence import NAMES, capsule_confidence, evidence
from enliven_edge.tracking.segment import lying_on
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import LOOK, Budget, BudgetedTask, Steps, whole

_GOOD, _ACCEPTABLE = 0.68, 0.45
_SUPPORT, _VISIBLE = NAMES.index("support"), NAMES.index("visible")
_EXPLAINED = 0.93
"""Share of the points; a frame that is explained less is looked at twice."""
_WIDE = 0.25
"""Metres: the robust width of the second look, about what a fast hand moves in a frame."""
_DOUBTED, _CLEARLY = 8.5, 0.8
"""Cost of a frame, square centimetres a point, from which the person is looked for anew, and the share of it
that must be left to believe what is found."""
_EARLY, _AGAIN_AFTER, _LONGEST, _WORSE = (4, 14), 15, 60, 1.2
"""Frames after which somebody new is looked at once more; between two looks at somebody doubtful, at first
and, when nothing better was found again and again, at most; and the cost, of that of the last look in vain,
from which the next one is as soon as the first."""
_KNOWN_AFTER = 120
"""Well fitted frames after which a person's build is known."""
_NO_AFFINITY, _NO_LANDMARKS = np.zeros((0, 0), np.float32), np.zeros((0, 5))
_SPEED_MEMORY = 0.4
"""Seconds over which the speed of walking is averaged."""
_SOME_POINTS = np.log1p(4)
_HARDLY = 0.02
"""Probability of being a person below which nobody is looked for in something."""
_BESIDE, _MOSTLY = 0.12, 0.5
"""Metres from a surface beyond which something else is, and the share of a group that must be the person."""
FEWEST_PIXELS = 60
"""Of the working image; fewer show nobody."""
_SUPPOSING = 5
"""What a look of the network for each way to face costs, in coarse fits."""


class Follower:
    """The fit of one person over time.

    Made by :meth:`found` where somebody new is seen; then :meth:`follow` once a frame.

    Attributes:
        posture: of the last frame that was fitted.
        confidence: (20,) of its joints, in [0, 1]; all 0 in a frame that did not show the person.
        evidence: (20, 17) what the last frame said for and against every joint.
        lost: whether the fit has been bad for longer than the settings allow.
        somebody: how likely the network finds it by the last frame that this is a person, in [0, 1].
        budget: what looking for the person anew may cost in the next frame.
    """

    def __init__(self, settings: TrackerSettings, fitter: Fitter, posture: Posture) -> None:
        self.settings = settings
        self.posture = posture
        self.confidence = np.zeros(20)
        self.evidence = np.zeros((20, len(NAMES)))
        self.lost = False
        self.somebody = 1.0
        self._fitter = fitter
        self._second_thoughts = SecondThoughts(fitter)
        self._facing = Facing()
        self._before: Posture | None = None
        self._fitted = 0
        self._bad = 0
        self._unsupported = np.zeros(20)
        self._velocity, self._time_ns = np.zeros(3), 0
        self.budget = Budget(np.inf)
        self._since_detected, self._since_found = 0, 0
        self._anew: _Anew | None = None
        self._patience, self._in_vain = _AGAIN_AFTER, np.inf

    @classmethod
    def found(
        cls, view: FrameView, pixels: Bool, settings: TrackerSettings, fitter: Fitter
    ) -> tuple[Follower, float] | None:
        """A person in the (h, w) ``pixels``, and how well they are explained (up to 1); None: nobody."""
        return whole(cls.sought(view, pixels, settings, fitter))

    @classmethod
    def sought(
        cls, view: FrameView, pixels: Bool, settings: TrackerSettings, fitter: Fitter
    ) -> Steps[tuple[Follower, float] | None]:
        """What :meth:`found` finds, in parts."""
        if np.count_nonzero(pixels) < FEWEST_PIXELS:
            return None
        observation = _observed(view, pixels, settings)
        seen, supposed = None, None
        if settings.estimator:
            seen = _look(view, pixels, observation, None)
            yield LOOK
            if seen.estimate.somebody < _HARDLY:
                return None
            supposed = supposing(shipped_estimator(), seen.estimate, view.world_from_camera)
            yield _SUPPOSING
        height = settings.body_height
        posture, report = yield from detect(fitter, observation, view.eye, height, seen, supposed)
        if quality(report) < _GOOD:
            bare = pixels & lying_on(view, [posture], 0.0, _BESIDE)
            # Once more without what stands against them, a table say.
            if not _MOSTLY < bare.sum() / pixels.sum() < 1.0:
                return None
            return (yield from cls.sought(view, bare, settings, fitter))
        follower = cls(settings, fitter, posture)
        follower.somebody = 1.0 if seen is None else seen.estimate.somebody
        follower._vouch(report, observation, seen)
        return follower, quality(report)

    @property
    def looking(self) -> bool:
        """Whether the person is being looked for anew."""
        return self._anew is not None

    def hide(self) -> None:
        """Is not seen in a frame."""
        self.confidence, self._anew = np.zeros(20), None

    def predicted(self) -> Posture:
        """Where the posture is expected in the next frame, by the motion between the last two."""
        return self.posture.copy() if self._before is None else continued(self._before, self.posture)

    def carry(self, step: Float) -> None:
        """Moves as a whole by (3,) metres, in a frame that is not fitted."""
        self.posture.position = self.posture.position + step
        if self._before is not None:
            self._before.position = self._before.position + step

    def follow(self, view: FrameView, pixels: Bool) -> bool:
        """Takes in a frame in which the (h, w) ``pixels`` are this person's; False where they do not fit."""
        self.confidence = np.zeros(20)
        if np.count_nonzero(pixels) < FEWEST_PIXELS:
            return self._missed()
        predicted = self.predicted()
        observation = _observed(view, pixels, self.settings)
        seen = None
        if self.settings.estimator:
            seen = _look(view, pixels, observation, facing(predicted, view.eye))
            self.somebody = seen.estimate.somebody
            observation = _guided(observation, seen, self.settings.fit.affinity)
        posture, report = self._fitted_to(observation, predicted, self._proportions())
        certain = capsule_confidence(report, observation, posture)
        posture, report = self._second_thoughts.reconsider(observation, posture, report, certain, seen)
        velocity = self._moving(posture.position, view.time_ns)
        flipped = seen is not None and self._facing.is_wrong(seen, posture, view.eye, velocity)
        if flipped and seen is not None:
            posture, seen = _about(posture, seen, view)
            observation = _guided(observation, seen, self.settings.fit.affinity)
            posture, report = self._fitter.fit(observation, posture)
        anew = self._looked_anew(observation, posture, report, seen, view.eye)
        if anew is not None:
            posture, report = anew
            seen = None if seen is None else _told(posture, seen, view)
        bad = quality(report) <= _ACCEPTABLE
        if bad and not self._missed() and self.lost:
            return False
        self._before, self.posture = (None if flipped or anew else self.posture), posture
        self._vouch(report, observation, seen)
        if bad:
            return False
        self._fitted, self._bad = self._fitted + 1, 0
        return True

    def _fitted_to(
        self, observation: Observation, predicted: Posture, proportions: Float | None
    ) -> tuple[Posture, FitReport]:
        """The better of two fits: from where time puts the person, and from a wider look around the last."""
        fit = self._fitter.fit
        best = fit(observation, predicted, predicted=predicted, proportions=proportions)
        if best[1].explained > _EXPLAINED:
            return best
        wide, _ = fit(observation, self.posture, predicted=predicted, iterations=5, width=_WIDE)
        other = fit(observation, wide, predicted=predicted, proportions=proportions)
        return other if other[1].energy < best[1].energy else best

    def _looked_anew(
        self, observation: Observation, posture: Posture, report: FitReport, seen: Seen | None, eye: Float
    ) -> tuple[Posture, FitReport] | None:
        """The person detected from scratch, where that explains a doubtful frame much better.

        A detection takes several frames, so there is one at most every half second, and fewer of them while
        they find nothing; and two soon after a person was found, because one frame may show a stranger badly.
        What was found in an earlier frame is brought to this one and has to explain it better too.
        """
        self._since_detected += 1
        early = self._since_found in _EARLY
        self._since_found += 1
        height = self.settings.body_height
        now = cost(report, posture, seen, eye, height)
        plain = replace(observation, affinity=_NO_AFFINITY, landmarks=_NO_LANDMARKS)
        if self._anew is None:
            if now < _DOUBTED or now > _WORSE * self._in_vain:
                self._patience = _AGAIN_AFTER
            if not early and (now < _DOUBTED or self._since_detected < self._patience):
                return None
            self._since_detected = 0
            known = posture.lengths if self._fitted > _KNOWN_AFTER else None
            steps = _another(self._fitter, plain, seen, eye, height, posture, known)
            self._anew = _Anew(BudgetedTask(steps), observation, seen, posture, now, early, known is not None)
        anew = self._anew
        if not anew.task.go_on(self.budget):
            return None
        self._anew, found = None, anew.task.result
        better = (
            found is not None and cost(found[1], found[0], anew.seen, eye, height) <= _CLEARLY * anew.cost
        )
        if found is not None and better and anew.observation is not observation:
            found = self._brought(found[0], posture.position - anew.posture.position, plain)
            better = cost(found[1], found[0], seen, eye, height) <= _CLEARLY * now
        if not better:
            self._patience = self._patience if anew.early else min(2 * self._patience, _LONGEST)
            self._in_vain = now
            return None
        self._patience = _AGAIN_AFTER
        self._fitted = self._fitted if anew.known else 0
        self._second_thoughts, self._facing = SecondThoughts(self._fitter), Facing()
        return found

    def _brought(self, posture: Posture, step: Float, observation: Observation) -> tuple[Posture, FitReport]:
        """A posture of an earlier frame, moved by (3,) metres, fitted widely to this one, then closely."""
        moved = posture.copy()
        moved.position = moved.position + step
        wide, _ = self._fitter.fit(observation, moved, width=_WIDE)
        return self._fitter.fit(observation, wide)

    def _moving(self, position: Float, time_ns: int) -> Float:
        """(3,) metres a second at which the hip centre has been going of late."""
        seconds = (time_ns - self._time_ns) * 1e-9
        if 0.0 < seconds < 0.5:
            share = min(1.0, seconds / _SPEED_MEMORY)
            self._velocity = self._velocity + share * (
                (position - self.posture.position) / seconds - self._velocity
            )
        self._time_ns = time_ns
        return self._velocity

    def _missed(self) -> bool:
        """Counts a bad frame."""
        self._anew = None
        self._bad += 1
        self.lost = self._bad > self.settings.lost_after
        return False

    def _vouch(self, report: FitReport, observation: Observation, seen: Seen | None) -> None:
        """Weighs what the frame says for and against every joint."""
        estimate = None if seen is None else seen.estimate
        self.evidence = evidence(self._fitter, self.posture, report, observation, self._unsupported, estimate)
        supported = (self.evidence[:, _VISIBLE] > 0.3) & (self.evidence[:, _SUPPORT] > _SOME_POINTS)
        self._unsupported = np.where(supported, 0.0, self._unsupported + 1.0)
        self.confidence = confidence(self.evidence, alone=seen is None)

    def _proportions(self) -> Float | None:
        """How firmly the bones' lengths are held: softer at first, frozen once settled."""
        settings = self.settings.fit
        if self._fitted > 3 * settings.settle_frames:
            return None
        firmness = settings.proportions * (1.0 + 30.0 * self._fitted / settings.settle_frames)
        return np.full(len(model.LENGTHS), firmness)


@dataclass(frozen=True)
class _Anew:
    """A detection from scratch of a person who is followed, under way.

    Attributes:
        observation, seen: of the frame that is looked at, and what the network says of it.
        posture, cost: the present ones in that frame.
        early: whether it is one of those soon after the person was found.
        known: whether the person's build was known.
    """

    task: BudgetedTask[tuple[Posture, FitReport] | None]
    observation: Observation
    seen: Seen | None
    posture: Posture
    cost: float
    early: bool
    known: bool


def _another(
    fitter: Fitter,
    observation: Observation,
    seen: Seen | None,
    eye: Float,
    height: float,
    posture: Posture,
    lengths: Float | None,
) -> Steps[tuple[Posture, FitReport] | None]:
    """What :func:`detect_another` finds, in parts; arguments as there."""
    supposed = None
    if seen is not None:
        supposed = supposing(shipped_estimator(), seen.estimate, observation.view[4])
        yield _SUPPOSING
    steps = detect_another(fitter, observation, seen, eye, height, posture, supposed, lengths)
    return (yield from steps)


def _observed(view: FrameView, pixels: Bool, settings: TrackerSettings) -> Observation:
    return observe(view.z, view.points, pixels, view.camera, view.world_from_camera, settings.fit.points)


def _look(view: FrameView, pixels: Bool, observation: Observation, facing: float | None) -> Seen:
    """What the network sees, told which way the person has been facing where that is known."""
    camera, pose = view.camera.camera, view.world_from_camera
    estimate = shipped_estimator().estimate(view.z, pixels, camera, pose, facing)
    return looked_at(observation, estimate)


def _guided(observation: Observation, seen: Seen, affinity: float) -> Observation:
    """The observation with what the network says of it: what points look like, where joints are."""
    return replace(observation, affinity=seen.affinity(affinity), landmarks=seen.estimate.guides)


def _about(posture: Posture, seen: Seen, view: FrameView) -> tuple[Posture, Seen]:
    """A posture turned about, and what the network sees when it is told so."""
    turned = turned_about(posture)
    now = _told(turned, seen, view)
    return drawn(turned, now.estimate), now


def _told(posture: Posture, seen: Seen, view: FrameView) -> Seen:
    """What the network sees in the same frame when it is told the facing of a posture."""
    told: list[float | None] = [facing(posture, view.eye)]
    return seen.of(shipped_estimator().estimates(seen.estimate.crop, view.world_from_camera, told)[0])
