"""The track of one person: predicts, fits, checks, and computes the confidence of every joint."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.posture import Posture, predict_next
from enliven_edge.tracking.detect.appearance import EstimateAtPoints, chest_facing
from enliven_edge.tracking.detect.detection import detect, estimates_by_facing
from enliven_edge.tracking.detect.fit_quality import Facing, fit_quality
from enliven_edge.tracking.detect.fitted_frame import FittedFrame
from enliven_edge.tracking.detect.recovery import PoseRecovery
from enliven_edge.tracking.estimator.estimator import load_shipped_estimator
from enliven_edge.tracking.fit.fit import FitReport, Fitter
from enliven_edge.tracking.frame.observation import FrameView, Observation
from enliven_edge.tracking.people.confidence import joint_confidences, limit_when_seated
from enliven_edge.tracking.people.evidence import NAMES, capsule_confidence, joint_evidence
from enliven_edge.tracking.people.person_estimate import (
    add_guides,
    create_observation,
    flip_with_estimate,
    run_network,
)
from enliven_edge.tracking.segment.segmentation import pixels_near_bodies
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.work_budget import NETWORK_COST, Steps, run_to_end

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
_SHAPING_FRAMES = 30
"""Number of well fitted frames, one second, in which every fit includes the bone lengths. They are far from
correct at first."""
_SHAPING_INTERVAL = 2
"""Interval in frames between two fits that include the lengths, after ``_SHAPING_FRAMES``. Without lengths a
fit is a third faster. With this interval the joint errors of the tuning, close and held-out films fell by up
to a millimetre.
"""
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

    def hide(self) -> None:
        """Handles a frame that does not show the person."""
        self.confidence = np.zeros(20)

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
        frame = FittedFrame(observation, posture, report, network_output)
        posture, report = self._recovery.reconsider(frame, certain)
        velocity = self._update_velocity(posture.position, view.time_ns)
        flipped = network_output is not None and self._facing.is_wrong(
            network_output, posture, view.eye, velocity
        )
        if flipped and network_output is not None:
            posture, network_output = flip_with_estimate(posture, network_output, view)
            observation = add_guides(observation, network_output, self.settings.fit.affinity)
            posture, report = self._fitter.fit(observation, posture)
        is_bad = fit_quality(report) <= _BAD_QUALITY
        if is_bad and not self._count_bad_frame() and self.lost:
            return False
        self._before, self.posture = (None if flipped else self.posture), posture
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
