"""One tracked person: the fit of the body, the identity, and whether the person is visible."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Bool, Float
from enliven.kernels import njit, quantile
from enliven.person import Joint
from enliven_edge.tracking.body_model import Posture
from enliven_edge.tracking.frame import FrameView
from enliven_edge.tracking.people.follower import MIN_PERSON_PIXELS, Follower
from enliven_edge.tracking.people.reidentification import BodyMeasurements

_MEASURE_INTERVAL = 5
"""Frames between two measurements of a known person's proportions. Each costs time."""
_NEW_PERSON_FRAMES = 10
"""Frames for which a new person is measured in every frame, to be distinguished from others soon."""
_MIN_TRAVEL_M = 0.15
"""Minimum movement of the hip centre in metres that proves that a body is not an object. The fit's noise
causes less."""
_MIN_JOINT_MOVEMENT_M = 0.1
"""Minimum movement of two confident joints in metres for a doubtful body to be accepted. Their noise causes
less."""
_MAX_HIDDEN_SPEED = 2.0
"""Maximum speed in metres per second of the extrapolation of a hidden person: a brisk walk."""
_SPEED_DECAY_S = 0.5
"""Seconds in which the speed of a hidden person falls to 1/e. People stop or turn behind objects."""
_MAX_TIME_STEP_S = 0.2
"""Maximum time step in seconds of a hidden person's motion. After a longer gap the speed is outdated."""
_VELOCITY_WINDOW_S = 0.15
"""Seconds over which a person's velocity is averaged: a few frames, against the fit's noise."""
_MAX_VELOCITY_GAP_S = 0.5
"""Maximum seconds between two good frames for a velocity to be computed from them."""
_MAX_COAST_M = 0.15
"""Maximum movement per frame, in metres, of an unfitted person with the mean of its pixels. An arm that
appears moves the mean too."""
_HIDDEN_RADIUS_M = 0.35
"""Radius in metres in which a person must be directly after disappearing: about a body's width."""
_HIDDEN_RADIUS_GROWTH = 0.7
"""Growth of that radius in metres per second: slower than a walk, because most hidden people stay near."""
_CONFIDENCE_WEIGHT = 0.1
"""Weight of a frame in the mean confidence of the most confident joints: a mean over ten frames."""
_CONFIDENT_JOINTS = 6
"""Number of most confident joints, of 20, in this mean. A half hidden person shows as many."""
_OBJECT_CONFIDENCE = 0.4
"""Mean confidence of these joints below which hardly any joint is visible: an object, most likely."""
_ACCEPTED_FRAMES = 20
"""Frames with the whole body in view after which a person is no longer dropped as an object."""
_PROBABILITY_WEIGHT = 0.2
"""Weight of a frame in the mean probability of being a person: a mean over five frames."""
_OBJECT_PROBABILITY = 0.4
"""Mean probability of being a person below which a new body is rejected. 95 % of the objects found are below
0.43."""
_TRIAL_FRAMES = 15
"""Good frames after which neither outline nor motion outweighs that. A fit to a strip of wall next to a
person slides along it. All of 94 people in films were clearly a person after 12."""
_HIDDEN_PROBABILITY = 0.8
"""Mean probability of being a person below which a hardly seen body is dropped when it becomes hidden."""
_HARDLY_SEEN_FRAMES = 3
"""Frames with the whole body in view below which a body counts as hardly seen."""
_CERTAIN_PROBABILITY = 0.85
"""Mean probability of being a person that nearly every person exceeds, and hardly any object."""
_CERTAIN_FRAMES = 10
"""Frames above that probability after which a body is a person for good. The network doubts some later
postures."""
_HEAD_RADIUS_M = 0.18
"""Horizontal radius in metres around the head's joint that contains the top of the head: a head's length, for
a nod."""
_MIN_CONFIDENCE = 0.5
"""Minimum confidence of a joint to use its position here: more likely within 10 cm than not."""
UNDECIDED = 0
"""The id of a person before re-identification is decided. Real ids start at 1."""


class Person:
    """A tracked person.

    Attributes:
        id: the person's number; 0 until re-identification is decided.
        follower: the fit.
        looks: the proportions for re-identification.
        seen_ns: when the person was last seen well.
        found_ns: when the person was found.
        hidden_ns: when the person became hidden by another object, or None.
        travelled: whether the person has moved like no object does.
        doubted: whether the person must move to be accepted.
        shapely: whether the pixels had a person's outline when found, a head above shoulders.
    """

    def __init__(self, identity: int, follower: Follower, looks: BodyMeasurements, time_ns: int) -> None:
        self.id, self.follower, self.looks = identity, follower, looks
        self.seen_ns = self.found_ns = time_ns
        self.hidden_ns: int | None = None
        self.travelled = self.doubted = self.shapely = False
        self._first_joints: Float | None = None
        self._start = follower.posture.position.copy()
        self._centre: Float | None = None
        self._velocity = np.zeros(3)
        self._time_ns = time_ns
        self._turn = 0
        self._clear = self._person_probability = 1.0
        self._plain = 0

    @property
    def place(self) -> Float:
        """Returns (3,) the hip centre, world frame."""
        return self.follower.posture.position

    @property
    def plain(self) -> bool:
        """Returns True if the network clearly classifies this as a person, or has done so for long enough."""
        return self._plain >= _CERTAIN_FRAMES or self._person_probability > _CERTAIN_PROBABILITY

    @property
    def vague(self) -> bool:
        """Returns True if hardly any joint was ever visible, or the network classifies this as an object."""
        is_established = (self.shapely or self.travelled) and self._turn < _TRIAL_FRAMES
        odd = self._person_probability < _OBJECT_PROBABILITY and not (self.plain or is_established)
        return odd or (self._clear < _OBJECT_CONFIDENCE and self.looks.weight < _ACCEPTED_FRAMES)

    @property
    def fleeting(self) -> bool:
        """Returns True if a hidden person should be dropped at once: hardly seen, and possibly an object."""
        return (
            self._person_probability < _HIDDEN_PROBABILITY
            and not self.travelled
            and self.looks.weight < _HARDLY_SEEN_FRAMES
        )

    def expected(self) -> Posture:
        """Returns the posture expected in the next frame."""
        return self.follower.posture if self.hidden_ns is not None else self.follower.predicted()

    @property
    def hidden(self) -> bool:
        """Returns True if the person was not visible in the last frame."""
        return self.hidden_ns is not None

    def hidden_for(self, time_ns: int) -> float:
        """Returns the seconds since the person became hidden. 0 while visible."""
        return 0.0 if self.hidden_ns is None else (time_ns - self.hidden_ns) * 1e-9

    def uncertainty(self, time_ns: int) -> float:
        """Returns the radius in metres around the last place in which the person must be.

        It grows while hidden.
        """
        return _HIDDEN_RADIUS_M + _HIDDEN_RADIUS_GROWTH * max(0.0, (time_ns - self.seen_ns) * 1e-9)

    def follow(self, view: FrameView, pixels: Bool, *, whole: bool, expected: Posture | None = None) -> bool:
        """Fits the frame. Returns whether it shows the person well.

        Args:
            view: the frame.
            pixels: (h, w) the person's pixels.
            whole: whether nothing occludes the person and the image border does not cut the person off.
            expected: the result of :meth:`expected`, if it is already known.
        """
        before = self.place.copy()
        good = self.follower.follow(view, pixels, None if self.hidden else expected)
        surest = sum(sorted(self.follower.confidence.tolist())[-_CONFIDENT_JOINTS:]) / _CONFIDENT_JOINTS
        self._clear += _CONFIDENCE_WEIGHT * (surest - self._clear)
        self._person_probability += _PROBABILITY_WEIGHT * (
            self.follower.person_probability - self._person_probability
        )
        self._plain += self._person_probability > _CERTAIN_PROBABILITY
        if good:
            self._update_measurements(view, pixels, self.place - before, whole=whole)
        return good

    def coast(self, view: FrameView, pixels: Bool) -> None:
        """Moves the posture with the mean of the person's pixels, in a frame that is not fitted."""
        centre = _centre(view, pixels)
        if centre is not None and self._centre is not None:
            step = centre - self._centre
            step[1] = 0.0
            self.follower.carry(step * min(1.0, _MAX_COAST_M / max(1e-9, math.hypot(*step))))
            self.seen_ns = view.time_ns
        self._centre = centre

    def hide(self, time_ns: int) -> None:
        """Handles a frame without the person: continues its motion with falling speed and confidence 0."""
        if self.hidden_ns is None:
            self.hidden_ns = time_ns
        seconds = min(_MAX_TIME_STEP_S, max(0.0, (time_ns - self._time_ns) * 1e-9))
        self._velocity = self._velocity * math.exp(-seconds / _SPEED_DECAY_S)
        self.follower.carry(self._velocity * seconds)
        self.follower.hide()
        self._time_ns, self._centre = time_ns, None

    def lift(self, metres: float) -> None:
        """Raises the person as a whole, because the guessed floor has changed, not the person."""
        step = np.array([0.0, metres, 0.0])
        self.follower.carry(step)
        self._start = self._start + step
        for place in (self._centre, self._first_joints):
            if place is not None:
                place += step

    def replaced(self, follower: Follower, time_ns: int) -> None:
        """Continues with a new fit after the person was found again."""
        self.follower, self.hidden_ns = follower, None
        if self.looks.weight > _NEW_PERSON_FRAMES:
            follower.posture.lengths = self.looks.lengths.copy()
        self._velocity, self._centre = np.zeros(3), None
        self.seen_ns = self._time_ns = time_ns

    def _update_measurements(self, view: FrameView, pixels: Bool, step: Float, *, whole: bool) -> None:
        """Updates velocity, proportions and stature after a good frame."""
        seconds = (view.time_ns - self._time_ns) * 1e-9
        if 0.0 < seconds < _MAX_VELOCITY_GAP_S:
            velocity = step / seconds
            velocity[1] = 0.0
            velocity *= min(1.0, _MAX_HIDDEN_SPEED / max(1e-9, math.hypot(*velocity)))
            self._velocity += min(1.0, seconds / _VELOCITY_WINDOW_S) * (velocity - self._velocity)
        self._time_ns = self.seen_ns = view.time_ns
        self.hidden_ns = None
        self.travelled = self.travelled or math.dist(self.place, self._start) > _MIN_TRAVEL_M
        self._turn += 1
        self._centre = None
        if self._turn % _MEASURE_INTERVAL != 1 and self.looks.weight > _NEW_PERSON_FRAMES:
            return
        self._centre = _centre(view, pixels)
        if whole:
            crown = self._crown(view, pixels) if view.has_floor else None
            self.looks.see(self.follower.posture.lengths, crown)
        if self.doubted:
            self._end_doubt_by_motion()

    def _end_doubt_by_motion(self) -> None:
        """Ends the doubt about a person that moves: a visible limb moves farther than noise."""
        joints, sure = self.follower.posture.joints(), self.follower.confidence > _MIN_CONFIDENCE
        if self._first_joints is None:
            self._first_joints = joints
        away = np.linalg.norm(joints - self._first_joints, axis=1)
        if self.travelled or np.count_nonzero(sure & (away > _MIN_JOINT_MOVEMENT_M)) >= 2:
            self.doubted = False

    def _crown(self, view: FrameView, pixels: Bool) -> float | None:
        """Returns the crown's height above the floor in metres.

        None unless the person is upright with the hands below the crown.
        """
        joints, sure = self.follower.posture.joints(), self.follower.confidence
        head = joints[Joint.HEAD]
        risen = head - joints[Joint.HIP_CENTER]
        upright = risen[1] > 0.9 * math.hypot(*risen)
        hands = max(float(joints[j, 1]) for j in (Joint.HAND_LEFT, Joint.HAND_RIGHT))
        if sure[Joint.HEAD] < _MIN_CONFIDENCE or not upright or hands > head[1] - 0.1:
            return None
        heights = heights_beside(view.points, pixels, head, _HEAD_RADIUS_M)
        return float(quantile(np.sort(heights), 0.99)) if len(heights) > 20 else None


def _centre(view: FrameView, pixels: Bool) -> Float | None:
    """Returns the (3,) mean of a person's points. None if there are too few."""
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
def heights_beside(points, pixels, place, radius):
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
