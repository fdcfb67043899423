"""One tracked person: the fit of the body, the identity, and whether the person is visible."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Bool, Float
from enliven.kernels import njit, quantile
from enliven.person import Joint
from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.people.follower import MIN_PERSON_PIXELS, Follower
from enliven_edge.tracking.people.reidentification import BodyMeasurements

_MEASURE_INTERVAL = 5
"""Frames between two measurements of a known person's proportions. Each measurement takes time."""
_NEW_PERSON_FRAMES = 10
"""Frames for which a new person is measured in every frame, to be distinguished from others soon."""
_MIN_TRAVEL_M = 0.15
"""Minimum movement of the hip centre in metres that shows that a body is not an object. Noise of the fit
causes smaller movements."""
_MIN_JOINT_MOVEMENT_M = 0.1
"""Minimum movement of two confident joints in metres for a doubtful body to be accepted. Noise causes smaller
movements."""
_MAX_HIDDEN_SPEED = 2.0
"""Maximum speed in metres per second at which a hidden person's position is extrapolated: a brisk walk."""
_SPEED_DECAY_S = 0.5
"""Seconds in which the speed of a hidden person falls to 1/e. People stop or turn behind objects."""
_MAX_TIME_STEP_S = 0.2
"""Maximum time step in seconds of a hidden person's motion. After a longer gap the speed is outdated."""
_VELOCITY_WINDOW_S = 0.15
"""Seconds over which a person's velocity is averaged: a few frames, against the fit's noise."""
_MAX_VELOCITY_GAP_S = 0.5
"""Maximum seconds between two good frames for a velocity to be computed from them."""
_MAX_COAST_M = 0.15
"""Maximum movement per frame in metres of a person who is moved with the mean of its pixels instead of a
fit. An arm that appears moves the mean too."""
_HIDDEN_RADIUS_M = 0.35
"""Search radius in metres around a person's last position at the moment of disappearing: about a body's
width.
"""
_HIDDEN_RADIUS_GROWTH = 0.7
"""Growth of ``_HIDDEN_RADIUS_M`` in metres per second. It is slower than walking, because most hidden people
stay near.
"""
_CONFIDENCE_WEIGHT = 0.1
"""Weight of a new frame in the running mean of the confidence: a mean over about ten frames."""
_CONFIDENT_JOINTS = 6
"""The running mean uses this number of most confident joints, of 20. Even a half hidden person has them."""
_OBJECT_CONFIDENCE = 0.4
"""Minimum mean confidence of the most confident joints. With less, hardly any joint is visible, so the body
is probably an object."""
_ACCEPTED_FRAMES = 20
"""Number of frames with the whole body in view. After them, low confidence no longer means an object."""
_PROBABILITY_WEIGHT = 0.2
"""Weight of a new frame in the mean probability of being a person: a mean over about five frames."""
_OBJECT_PROBABILITY = 0.4
"""Minimum mean probability of being a person. New bodies below it are rejected. Of the objects mistaken for
people, 95 % were below 0.43."""
_TRIAL_FRAMES = 15
"""Number of good frames after which a low probability decides, even if outline or motion suggest a person. A
body fitted to a strip of wall next to a person slides along the strip. All of 94 people in films were clearly
recognised after 12 frames.
"""
_HIDDEN_PROBABILITY = 0.8
"""Minimum mean probability of being a person for a briefly seen body to be kept when it becomes hidden."""
_HARDLY_SEEN_FRAMES = 3
"""Bodies with fewer frames in which the whole body was visible count as briefly seen."""
_CERTAIN_PROBABILITY = 0.85
"""Mean probability of being a person who nearly every person exceeds, and hardly any object."""
CERTAIN_FRAMES = 10
"""Number of frames above ``_CERTAIN_PROBABILITY`` after which a body stays confirmed as a person. The network
may doubt some of its later postures.
"""
_HEAD_RADIUS_M = 0.18
"""Horizontal radius in metres around the head's joint that contains the top of the head, even in a nod: a
head's length."""
_MIN_CONFIDENCE = 0.5
"""Minimum confidence of a joint to use its position here. Above it an error below 10 cm is more likely
than a larger one."""
UNDECIDED = 0
"""The id of a person before re-identification is decided. Real ids start at 1."""


class Person:
    """A tracked person.

    Attributes:
        id: the person's id; 0 until re-identification is decided.
        follower: the fitted track of the body.
        measurements: stature and proportions for re-identification.
        seen_ns: time of the last good frame in nanoseconds.
        found_ns: time of the detection in nanoseconds.
        hidden_ns: time in nanoseconds at which the person became hidden; None while visible.
        has_moved: whether the person has moved farther than noise, so that it is not an object.
        is_doubtful: whether the person must still move to be accepted.
        has_person_outline: whether its pixels had a person's outline at the detection: a head above
            shoulders.
    """

    def __init__(self, identity: int, follower: Follower, looks: BodyMeasurements, time_ns: int) -> None:
        self.id, self.follower, self.measurements = identity, follower, looks
        self.seen_ns = self.found_ns = time_ns
        self.hidden_ns: int | None = None
        self.has_moved = self.is_doubtful = self.has_person_outline = False
        self._first_joints: Float | None = None
        self._start = follower.posture.position.copy()
        self._centre: Float | None = None
        self._velocity = np.zeros(3)
        self._time_ns = time_ns
        self._turn = 0
        self._mean_confidence = self._person_probability = 1.0
        self._confident_frames = 0

    @property
    def place(self) -> Float:
        """Returns the hip centre (3,), world frame."""
        return self.follower.posture.position

    @property
    def is_confirmed(self) -> bool:
        """Returns True if the network clearly classifies this as a person, now or in enough earlier
        frames."""
        return self._confident_frames >= CERTAIN_FRAMES or self._person_probability > _CERTAIN_PROBABILITY

    @property
    def is_probably_object(self) -> bool:
        """Returns True if hardly any joint was ever visible, or the network classifies this as an object."""
        is_established = (self.has_person_outline or self.has_moved) and self._turn < _TRIAL_FRAMES
        is_classified_as_object = self._person_probability < _OBJECT_PROBABILITY and not (
            self.is_confirmed or is_established
        )
        return is_classified_as_object or (
            self._mean_confidence < _OBJECT_CONFIDENCE and self.measurements.weight < _ACCEPTED_FRAMES
        )

    @property
    def is_too_weak_to_hide(self) -> bool:
        """Returns True if the body should be dropped when it becomes hidden: briefly seen, possibly an
        object."""
        return (
            self._person_probability < _HIDDEN_PROBABILITY
            and not self.has_moved
            and self.measurements.weight < _HARDLY_SEEN_FRAMES
        )

    def predict_posture(self) -> Posture:
        """Returns the posture expected in the next frame."""
        return self.follower.posture if self.hidden_ns is not None else self.follower.predict()

    @property
    def is_hidden(self) -> bool:
        """Returns True if the person was hidden in the last frame."""
        return self.hidden_ns is not None

    def seconds_hidden(self, time_ns: int) -> float:
        """Returns the seconds since the person became hidden, or 0 while the person is visible."""
        return 0.0 if self.hidden_ns is None else (time_ns - self.hidden_ns) * 1e-9

    def search_radius(self, time_ns: int) -> float:
        """Returns the search radius in metres around the person's last position.

        The radius grows while the person is hidden.
        """
        return _HIDDEN_RADIUS_M + _HIDDEN_RADIUS_GROWTH * max(0.0, (time_ns - self.seen_ns) * 1e-9)

    def follow(
        self, view: FrameView, pixels: Bool, *, is_fully_visible: bool, expected: Posture | None = None
    ) -> bool:
        """Fits the person to a frame. Returns True if the fit is good.

        Args:
            view: the frame.
            pixels: (h, w) the person's pixels.
            is_fully_visible: whether nothing occludes the person and the image border does not cut the person
                off.
            expected: the result of :meth:`predict_posture`, if it is already known.
        """
        previous_place = self.place.copy()
        is_good = self.follower.follow(view, pixels, None if self.is_hidden else expected)
        surest = sum(sorted(self.follower.confidence.tolist())[-_CONFIDENT_JOINTS:]) / _CONFIDENT_JOINTS
        self._mean_confidence += _CONFIDENCE_WEIGHT * (surest - self._mean_confidence)
        self._person_probability += _PROBABILITY_WEIGHT * (
            self.follower.person_probability - self._person_probability
        )
        self._confident_frames += self._person_probability > _CERTAIN_PROBABILITY
        if is_good:
            self._update_measurements(
                view, pixels, self.place - previous_place, is_fully_visible=is_fully_visible
            )
        return is_good

    def move_with_pixels(self, view: FrameView, pixels: Bool) -> None:
        """Moves the posture with the mean of the person's pixels, instead of fitting the frame."""
        centre = _mean_point(view, pixels)
        if centre is not None and self._centre is not None:
            step = centre - self._centre
            step[1] = 0.0
            self.follower.translate(step * min(1.0, _MAX_COAST_M / max(1e-9, math.hypot(*step))))
            self.seen_ns = view.time_ns
        self._centre = centre

    def hide(self, time_ns: int) -> None:
        """Handles a frame without the person: continues its motion with decreasing speed, and sets its
        confidence to 0.
        """
        if self.hidden_ns is None:
            self.hidden_ns = time_ns
        seconds = min(_MAX_TIME_STEP_S, max(0.0, (time_ns - self._time_ns) * 1e-9))
        self._velocity = self._velocity * math.exp(-seconds / _SPEED_DECAY_S)
        self.follower.translate(self._velocity * seconds)
        self.follower.hide()
        self._time_ns, self._centre = time_ns, None

    def raise_by(self, metres: float) -> None:
        """Raises the whole person by ``metres``, because the guess of the floor has changed."""
        step = np.array([0.0, metres, 0.0])
        self.follower.translate(step)
        self._start = self._start + step
        for place in (self._centre, self._first_joints):
            if place is not None:
                place += step

    def replace_fit(self, follower: Follower, time_ns: int) -> None:
        """Continues with a new fit after the person was found again."""
        self.follower, self.hidden_ns = follower, None
        if self.measurements.weight > _NEW_PERSON_FRAMES:
            follower.posture.lengths = self.measurements.lengths.copy()
        self._velocity, self._centre = np.zeros(3), None
        self.seen_ns = self._time_ns = time_ns

    def _update_measurements(
        self, view: FrameView, pixels: Bool, step: Float, *, is_fully_visible: bool
    ) -> None:
        """Updates velocity, proportions and stature after a good frame."""
        seconds = (view.time_ns - self._time_ns) * 1e-9
        if 0.0 < seconds < _MAX_VELOCITY_GAP_S:
            velocity = step / seconds
            velocity[1] = 0.0
            velocity *= min(1.0, _MAX_HIDDEN_SPEED / max(1e-9, math.hypot(*velocity)))
            self._velocity += min(1.0, seconds / _VELOCITY_WINDOW_S) * (velocity - self._velocity)
        self._time_ns = self.seen_ns = view.time_ns
        self.hidden_ns = None
        self.has_moved = self.has_moved or math.dist(self.place, self._start) > _MIN_TRAVEL_M
        self._turn += 1
        self._centre = None
        if self._turn % _MEASURE_INTERVAL != 1 and self.measurements.weight > _NEW_PERSON_FRAMES:
            return
        self._centre = _mean_point(view, pixels)
        if is_fully_visible:
            crown = self._crown_height(view, pixels) if view.has_floor else None
            self.measurements.update(self.follower.posture.lengths, crown)
        if self.is_doubtful:
            self._end_doubt_by_motion()

    def _end_doubt_by_motion(self) -> None:
        """Ends the doubt about a person if two confident joints have moved farther than noise."""
        joints, is_confident = self.follower.posture.joints(), self.follower.confidence > _MIN_CONFIDENCE
        if self._first_joints is None:
            self._first_joints = joints
        distances = np.linalg.norm(joints - self._first_joints, axis=1)
        if self.has_moved or np.count_nonzero(is_confident & (distances > _MIN_JOINT_MOVEMENT_M)) >= 2:
            self.is_doubtful = False

    def _crown_height(self, view: FrameView, pixels: Bool) -> float | None:
        """Returns the crown's height above the floor in metres.

        Returns None unless the person is upright with both hands below the crown.
        """
        joints, confidence = self.follower.posture.joints(), self.follower.confidence
        head = joints[Joint.HEAD]
        risen = head - joints[Joint.HIP_CENTER]
        upright = risen[1] > 0.9 * math.hypot(*risen)
        hands = max(float(joints[j, 1]) for j in (Joint.HAND_LEFT, Joint.HAND_RIGHT))
        if confidence[Joint.HEAD] < _MIN_CONFIDENCE or not upright or hands > head[1] - 0.1:
            return None
        heights = heights_around(view.points, pixels, head, _HEAD_RADIUS_M)
        return float(quantile(np.sort(heights), 0.99)) if len(heights) > 20 else None


def _mean_point(view: FrameView, pixels: Bool) -> Float | None:
    """Returns the (3,) mean of a person's points. Returns None if there are too few points."""
    if np.count_nonzero(pixels) < MIN_PERSON_PIXELS:
        return None
    return np.asarray(mean_point(view.points, pixels))


@njit(cache=True, nogil=True)
def mean_point(points, pixels):
    """Returns the (3,) mean of (h, w, 3) points on the (h, w) pixels, at least one."""
    x, y, z, count = 0.0, 0.0, 0.0, 0
    for v in range(pixels.shape[0]):
        for u in range(pixels.shape[1]):
            if pixels[v, u]:
                x, y, z = x + points[v, u, 0], y + points[v, u, 1], z + points[v, u, 2]
                count += 1
    return np.array([x, y, z]) / count


@njit(cache=True, nogil=True)
def heights_around(points, pixels, place, radius):
    """Returns (N,) heights of (h, w, 3) points on (h, w) pixels within a horizontal radius of a place."""
    heights, count = np.empty(np.count_nonzero(pixels)), 0
    for v in range(pixels.shape[0]):
        for u in range(pixels.shape[1]):
            if not pixels[v, u]:
                continue
            x, z = points[v, u, 0] - place[0], points[v, u, 2] - place[2]
            if x * x + z * z < radius * radius:
                heights[count] = points[v, u, 1]
                count += 1
    return heights[:count]
