"""The track of one person: predicts, fits, checks, and computes the confidence of every joint."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture, predict_next
from enliven_edge.tracking.detect.appearance import EstimateAtPoints, chest_facing
from enliven_edge.tracking.detect.detection import detect, estimates_by_facing
from enliven_edge.tracking.detect.fit_quality import Facing, fit_quality, total_fit_cost
from enliven_edge.tracking.detect.recovery import PoseRecovery
from enliven_edge.tracking.estimator.estimator import load_shipped_estimator
from enliven_edge.tracking.fit.fit import FitReport, Fitter
from enliven_edge.tracking.frame.observation import FrameView, Observation
from enliven_edge.tracking.people.confidence import joint_confidences, limit_when_seated
from enliven_edge.tracking.people.evidence import NAMES, capsule_confidence, joint_evidence
from enliven_edge.tracking.people.redetection import (
    Redetection,
    add_guides,
    create_observation,
    estimate_with_facing,
    flip_with_estimate,
    run_network,
    start_detection,
)
from enliven_edge.tracking.segment.segmentation import pixels_near_bodies
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import NETWORK_COST, Budget, BudgetedTask, Steps, run_to_end

_MIN_DETECTION_QUALITY = 0.68
"""Minimum quality in [0, 1], see :func:`fit_quality.fit_quality`, for a detected body to be accepted as a
person.
"""
_BAD_QUALITY = 0.45
"""Frames up to this quality in [0, 1] are bad. The limit is lower than for a new body, because a tracked
person may be half hidden."""
_SUPPORT, _VISIBLE = NAMES.index("support"), NAMES.index("visible")
_MIN_EXPLAINED = 0.93
"""Minimum explained fraction of the points. Below it the frame is fitted again with a larger robust width,
because a limb may have moved fast."""
_WIDE_WIDTH_M = 0.25
"""Robust width of the second fit in metres: about the movement of a fast hand in a frame."""
_DOUBTFUL_COST = 8.5
"""Maximum cost of a frame in square centimetres per point. Above it the person is detected again from
scratch."""
_DOUBTFUL_EXPLAINED = 0.87
"""Minimum fraction of explained points. Below it a doubtful person is detected again, even if the network
agrees with the posture."""
_LIMB_JOINTS = 3
"""Number of joints of one limb: elbow, wrist and hand, or knee, ankle and foot."""
_MAX_COST_RATIO = 0.8
"""Maximum cost of a new detection relative to the present cost for it to be accepted. A smaller gain may be
chance."""
_FIRST_REDETECTION_FRAMES = 30
"""Initial number of frames between two detections of a doubtful person. A detection takes several frames.
Doubling the number of detections did not improve the results on the tuning, close and held-out films.
"""
_MAX_REDETECTION_INTERVAL = 120
"""Maximum number of frames between two detections. The wait doubles up to this number while no better posture
is found."""
_RESET_COST_RATIO = 1.2
"""The wait is reset if the cost exceeds that of the last failed detection by this factor."""
_KNOWN_LENGTHS_FRAMES = 120
"""Number of well fitted frames, four seconds, after which the bone lengths are reliable enough to use in a
detection."""
_SHAPING_FRAMES = 30
"""Number of well fitted frames, one second, in which every fit includes the bone lengths. They are far from
correct at first."""
_SHAPING_INTERVAL = 2
"""Interval in frames between two fits that include the lengths, after ``_SHAPING_FRAMES``. Without lengths a
fit is a third faster. With this interval the joint errors of the tuning, close and held-out films fell by up
to a millimetre.
"""
_NO_AFFINITY, _NO_LANDMARKS = np.zeros((0, 0), np.float32), np.zeros((0, 5))
_SPEED_WINDOW_S = 0.4
"""Seconds over which the walking speed is averaged: shorter than a step, long enough to suppress the noise of
single frames."""
_MIN_SUPPORT = np.log1p(4)
"""Minimum evidence of support, log(1 + points), for a joint to count as supported in a frame."""
_MIN_VISIBLE_BONE = 0.3
"""Minimum visible fraction of a joint's bone for its support to count. A smaller visible part may be an edge
of another object."""
_MIN_PROBABILITY = 0.02
"""Blobs below this network probability of being a person are skipped without a fit."""
_MIN_FLOORLESS_PROBABILITY = 0.3
"""Minimum network probability while the floor is guessed. Heights, which exclude most objects, are then
unknown."""
_CLOTHES_DISTANCE_M = 0.12
"""Distance in metres from the model's surface beyond which a point belongs to another object. Clothes stay
within this distance.
"""
_MIN_BARE_FRACTION = 0.5
"""Minimum fraction of a blob's pixels on the model. If it is reached, a second search leaves out the other
pixels.
"""
MIN_PERSON_PIXELS = 60
"""Minimum number of pixels of the working image in which a posture is visible."""


class Follower:
    """The track of one person, fitted in every frame.

    :meth:`detect` creates a follower from a new person's pixels. Then call :meth:`follow` once per frame.

    Attributes:
        posture: the posture in the last fitted frame.
        confidence: (20,) confidence of its joints in [0, 1]; all 0 if the last frame did not show the person.
        evidence: (20, 17) the last frame's evidence for and against every joint.
        lost: whether the fit has been bad for longer than the settings allow.
        person_probability: the network's probability in [0, 1] in the last frame that this is a person and
            not an object.
        budget: the budget for redetection in the next frame.
    """

    def __init__(self, settings: TrackerSettings, fitter: Fitter, posture: Posture) -> None:
        self.settings = settings
        self.posture = posture
        self.confidence = np.zeros(20)
        self.evidence = np.zeros((20, len(NAMES)))
        self.lost = False
        self.person_probability = 1.0
        self._fitter = fitter.for_tracked_people
        self._recovery = PoseRecovery(fitter.for_tracked_people)
        self._facing = Facing()
        self._before: Posture | None = None
        self._fitted = 0
        self._bad_frames = 0
        self._unsupported = np.zeros(20)
        self._velocity, self._time_ns = np.zeros(3), 0
        self.budget = Budget(np.inf)
        self._since_detected = 0
        self._redetection: Redetection | None = None
        self._wait, self._failed_cost = _FIRST_REDETECTION_FRAMES, np.inf

    @classmethod
    def detect(
        cls, view: FrameView, pixels: Bool, settings: TrackerSettings, fitter: Fitter
    ) -> tuple[Follower, float] | None:
        """Detects a person in the (h, w) ``pixels``. Returns a follower and its quality, at most 1, or
        None.
        """
        return run_to_end(cls.detect_incrementally(view, pixels, settings, fitter))

    @classmethod
    def detect_incrementally(
        cls, view: FrameView, pixels: Bool, settings: TrackerSettings, fitter: Fitter, *, entire: bool = False
    ) -> Steps[tuple[Follower, float] | None]:
        """Generator version of :meth:`detect` that yields the cost of each step in coarse fits.

        Args:
            view: the frame.
            pixels: (h, w) the blob.
            settings: the settings.
            fitter: fits the body.
            entire: whether the body must explain all pixels; otherwise a second search leaves out touching
                objects.
        """
        if np.count_nonzero(pixels) < MIN_PERSON_PIXELS:
            return None
        observation = create_observation(view, pixels, settings)
        network_output, by_facing = None, None
        if settings.estimator:
            network_output = run_network(view, pixels, observation, None)
            yield NETWORK_COST
            if network_output.estimate.person_probability < (
                _MIN_PROBABILITY if view.has_floor else _MIN_FLOORLESS_PROBABILITY
            ):
                return None
            network, pose = load_shipped_estimator(), view.world_from_camera
            by_facing = yield from estimates_by_facing(network, network_output.estimate, pose)
        height = settings.body_height
        posture, report = yield from detect(fitter, observation, view.eye, height, network_output, by_facing)
        if fit_quality(report) < _MIN_DETECTION_QUALITY:
            bare = pixels & pixels_near_bodies(view, [posture], 0.0, _CLOTHES_DISTANCE_M)
            # Search again without the pixels of objects that touch the person, such as a table.
            if entire or not _MIN_BARE_FRACTION < bare.sum() / pixels.sum() < 1.0:
                return None
            return (yield from cls.detect_incrementally(view, bare, settings, fitter))
        follower = cls(settings, fitter, posture)
        follower.person_probability = (
            1.0 if network_output is None else network_output.estimate.person_probability
        )
        follower._update_evidence(report, observation, network_output)
        return follower, fit_quality(report)

    @property
    def is_redetecting(self) -> bool:
        """Returns True if a redetection of the person is in progress."""
        return self._redetection is not None

    def hide(self) -> None:
        """Handles a frame that does not show the person."""
        self.confidence, self._redetection = np.zeros(20), None

    def predict(self) -> Posture:
        """Returns the posture expected in the next frame, extrapolated from the last two."""
        return self.posture.copy() if self._before is None else predict_next(self._before, self.posture)

    def translate(self, step: Float) -> None:
        """Moves the posture as a whole by (3,) metres, in a frame that is not fitted."""
        self.posture.position = self.posture.position + step
        if self._before is not None:
            self._before.position = self._before.position + step

    def follow(self, view: FrameView, pixels: Bool, predicted: Posture | None = None) -> bool:
        """Fits the posture to the person's (h, w) ``pixels``. Returns False if the fit is bad.

        Args:
            view: the frame.
            pixels: (h, w) the person's pixels.
            predicted: the result of :meth:`predict`, if it is already known.
        """
        self.confidence = np.zeros(20)
        if np.count_nonzero(pixels) < MIN_PERSON_PIXELS:
            return self._count_bad_frame()
        predicted = self.predict() if predicted is None else predicted
        observation = create_observation(view, pixels, self.settings)
        network_output = None
        if self.settings.estimator:
            network_output = run_network(view, pixels, observation, chest_facing(predicted, view.eye))
            self.person_probability = network_output.estimate.person_probability
            observation = add_guides(observation, network_output, self.settings.fit.affinity)
        posture, report = self._fit_frame(observation, predicted, self._length_weights())
        certain = capsule_confidence(report, observation, posture)
        # Do not try arms while a redetection runs, because a frame with both searches would take too long.
        reconsider, arms = self._recovery.reconsider, not self.is_redetecting
        posture, report = reconsider(observation, posture, report, certain, network_output, arms=arms)
        velocity = self._update_velocity(posture.position, view.time_ns)
        flipped = network_output is not None and self._facing.is_wrong(
            network_output, posture, view.eye, velocity
        )
        if flipped and network_output is not None:
            posture, network_output = flip_with_estimate(posture, network_output, view)
            observation = add_guides(observation, network_output, self.settings.fit.affinity)
            posture, report = self._fitter.fit(observation, posture)
        redetected = self._try_redetection(observation, posture, report, network_output, view.eye)
        if redetected is not None:
            posture, report = redetected
            network_output = (
                None if network_output is None else estimate_with_facing(posture, network_output, view)
            )
        is_bad = fit_quality(report) <= _BAD_QUALITY
        if is_bad and not self._count_bad_frame() and self.lost:
            return False
        self._before, self.posture = (None if flipped or redetected else self.posture), posture
        self._update_evidence(report, observation, network_output)
        if is_bad:
            return False
        self._fitted, self._bad_frames = self._fitted + 1, 0
        return True

    def _fit_frame(
        self, observation: Observation, predicted: Posture, proportions: Float | None
    ) -> tuple[Posture, FitReport]:
        """Returns the better of two fits: one from the prediction, and a wider one that starts at the last
        posture.
        """
        fit = self._fitter.fit
        best = fit(observation, predicted, predicted=predicted, proportions=proportions)
        if best[1].explained > _MIN_EXPLAINED:
            return best
        wide, _ = fit(observation, self.posture, predicted=predicted, iterations=5, width=_WIDE_WIDTH_M)
        other = fit(observation, wide, predicted=predicted, proportions=proportions)
        return other if other[1].energy < best[1].energy else best

    def _try_redetection(
        self,
        observation: Observation,
        posture: Posture,
        report: FitReport,
        network_output: EstimateAtPoints | None,
        eye: Float,
    ) -> tuple[Posture, FitReport] | None:
        """Detects a doubtful person from scratch. Returns a fit only if it explains the frame much better.

        A detection takes several frames. So a new one starts at most every second, less often while
        detections fail, and never while the network agrees with the posture. The result belongs to an earlier
        frame. So it is also fitted to this frame, and must explain this frame better, too.
        """
        self._since_detected += 1
        height = self.settings.body_height
        current_cost = total_fit_cost(report, posture, network_output, eye, height)
        plain = observation.with_guides(_NO_AFFINITY, _NO_LANDMARKS)
        # Start a detection if the tracking is doubtful and the waiting time is over.
        if self._redetection is None:
            if current_cost < _DOUBTFUL_COST or current_cost > _RESET_COST_RATIO * self._failed_cost:
                self._wait = _FIRST_REDETECTION_FRAMES
            is_doubtful = current_cost >= _DOUBTFUL_COST and self._since_detected >= self._wait
            if not is_doubtful or _is_confirmed(posture, report, network_output):
                return None
            self._since_detected = 0
            known_lengths = posture.lengths if self._fitted > _KNOWN_LENGTHS_FRAMES else None
            steps = start_detection(self._fitter, plain, network_output, eye, height, posture, known_lengths)
            redetection = (observation, network_output, posture, current_cost, known_lengths is not None)
            self._redetection = Redetection(BudgetedTask(steps), *redetection)
        under_way = self._redetection
        if not under_way.task.advance(self.budget):
            return None
        self._redetection, detection = None, under_way.task.result
        # Compare the detection with the fit, first in the frame in which the detection began, then in the
        # present frame.
        is_better = (
            detection is not None
            and total_fit_cost(detection[1], detection[0], under_way.network_output, eye, height)
            <= _MAX_COST_RATIO * under_way.cost
        )
        if detection is not None and is_better and under_way.observation is not observation:
            detection = self._carry_to_frame(
                detection[0], posture.position - under_way.posture.position, plain
            )
            is_better = (
                total_fit_cost(detection[1], detection[0], network_output, eye, height)
                <= _MAX_COST_RATIO * current_cost
            )
        if not is_better:
            self._wait = min(2 * self._wait, _MAX_REDETECTION_INTERVAL)
            self._failed_cost = current_cost
            return None
        self._wait = _FIRST_REDETECTION_FRAMES
        self._fitted = self._fitted if under_way.known else 0
        self._recovery, self._facing = PoseRecovery(self._fitter), Facing()
        return detection

    def _carry_to_frame(
        self, posture: Posture, step: Float, observation: Observation
    ) -> tuple[Posture, FitReport]:
        """Moves an earlier frame's posture by (3,) metres and fits it to this frame.

        The first fit has a large robust width.
        """
        moved = posture.copy()
        moved.position = moved.position + step
        wide, _ = self._fitter.fit(observation, moved, width=_WIDE_WIDTH_M)
        return self._fitter.fit(observation, wide)

    def _update_velocity(self, position: Float, time_ns: int) -> Float:
        """Returns the (3,) velocity of the hip centre, metres per second, averaged over the last frames."""
        seconds = (time_ns - self._time_ns) * 1e-9
        if 0.0 < seconds < 0.5:
            share = min(1.0, seconds / _SPEED_WINDOW_S)
            self._velocity = self._velocity + share * (
                (position - self.posture.position) / seconds - self._velocity
            )
        self._time_ns = time_ns
        return self._velocity

    def _count_bad_frame(self) -> bool:
        """Counts a bad frame. Always returns False."""
        self._redetection = None
        self._bad_frames += 1
        self.lost = self._bad_frames > self.settings.lost_after
        return False

    def _update_evidence(
        self, report: FitReport, observation: Observation, network_output: EstimateAtPoints | None
    ) -> None:
        """Computes the frame's evidence for and against every joint, and updates the confidence."""
        estimate = None if network_output is None else network_output.estimate
        self.evidence = joint_evidence(self.posture, report, observation, self._unsupported, estimate)
        supported = (self.evidence[:, _VISIBLE] > _MIN_VISIBLE_BONE) & (
            self.evidence[:, _SUPPORT] > _MIN_SUPPORT
        )
        self._unsupported = np.where(supported, 0.0, self._unsupported + 1.0)
        joint_confidence = joint_confidences(self.evidence, alone=network_output is None)
        self.confidence = limit_when_seated(joint_confidence, self.posture)

    def _length_weights(self) -> Float | None:
        """Returns (12,) weights of the prior on the bones' lengths, low at first.

        None if the lengths are frozen.

        Lengths are frozen after they have settled. Before that, they are fitted in every frame of the first
        second and in every other frame later.
        """
        settings = self.settings.fit
        settled = self._fitted > 3 * settings.settle_frames
        if settled or (
            self._fitted > _SHAPING_FRAMES and (self._fitted + self._bad_frames) % _SHAPING_INTERVAL
        ):
            return None
        firmness = settings.proportions * (1.0 + 30.0 * self._fitted / settings.settle_frames)
        return np.full(len(model.LENGTHS), firmness)


def _is_confirmed(posture: Posture, report: FitReport, network_output: EstimateAtPoints | None) -> bool:
    """Returns True if a posture explains most of the frame and the network agrees with it, except for one
    limb.

    A single wrong limb needs no detection, because :class:`PoseRecovery` tries limbs in other places. Of 227
    detections that began in such frames of the tuning and close films, 12 were accepted. Six led to a better
    and six to a worse posture, by a few centimetres at most.
    """
    if network_output is None or report.explained <= _DOUBTFUL_EXPLAINED:
        return False
    return network_output.estimate.count_disagreeing(posture.joints()) <= _LIMB_JOINTS
