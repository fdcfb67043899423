"""One person, fused from all sensors."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.person import Body, Joint
from enliven.rotation import normalized
from enliven_edge.fusion.live.blending import blend, doubt_outliers, fuse_confidence
from enliven_edge.fusion.live.grouping import Group
from enliven_edge.fusion.live.sensor_view import SensorState, SensorView
from enliven_edge.fusion.live.side_assignment import OTHER_SIDE, SideAssignment, walking_direction_sign
from enliven_edge.fusion.settings import MAX_BODY_AGE_S, FusionSettings

_BLEND_TIME_CONSTANT_S = 0.25
"""Time constant in seconds for blending from one sensor to another: no visible jump, little lag."""
_SIDE_SWAP_S = 1.0
"""Seconds for which a majority must disagree before left and right are exchanged."""
_NUMBER_TRUST_S = 30.0
"""Seconds after an absence for which a sensor's own id still identifies a person."""
_NEAR_SIGMA_M = 0.015
"""Standard deviation in metres of a joint close to its sensor."""
_SIGMA_GROWTH_PER_M = 0.004
"""Increase of ``_NEAR_SIGMA_M`` with the squared distance to the sensor, in 1/m."""

_MAX_GLIDE_S = 0.5
"""If a person was unseen for at most this many seconds, joints blend smoothly from their last to their new
position. After a longer time they jump."""
_MOVED_SENSOR_WEIGHT = 0.02
"""Relative weight of a sensor that was moved."""
_CONFIDENCE_RISE_RATE = 3.0
"""Maximum increase of a joint's confidence per second. It limits the weight of a joint that has just become
certain."""
_SURPRISE_TIME_CONSTANT_S = 0.7
"""Time constant in seconds of the low-pass of a sensor's prediction error. It determines how long an erratic
sensor has a low weight."""
_USUAL_ERROR_M2 = 0.05**2
"""Usual squared prediction error in square metres. It corresponds to a tracker's noise of 5 cm."""
_UNSEEN_WEIGHT = 1e-3
"""Weight of a joint that no sensor sees. It is above 0, so that the joint keeps a position."""


class FusedPerson:
    """The state of one fused person."""

    def __init__(self, number: int, sensors: int, settings: FusionSettings) -> None:
        self.id, self.settings = number, settings
        self.joints, self.velocity = np.zeros((20, 3)), np.zeros((20, 3))
        self.confidence = np.zeros(20)
        self.last_ns, self.hits = 0, 0
        self.seen_by: frozenset[int] = frozenset()
        self._turns = np.zeros((20, 4))
        self._has_orientation = False
        self._sides = SideAssignment(sensors, _SIDE_SWAP_S)
        self._had_value = np.zeros((sensors, 20), bool)
        self._sure = np.zeros((sensors, 20))
        self._surprise = np.zeros(sensors)
        self._had_orientation = np.zeros((sensors, 20), bool)
        self._offsets, self._turn_habit = np.zeros((sensors, 20, 3)), np.zeros((sensors, 20, 4))

    def seconds_unseen(self, time_ns: int) -> float:
        """Returns seconds since any sensor saw this person. The result is infinite if no sensor has seen the
        person.
        """
        return (time_ns - self.last_ns) * 1e-9 if self.hits else np.inf

    def predict_joints(self, time_ns: int) -> Float:
        """Returns the predicted joints (20, 3)."""
        return self.joints + min(max(self.seconds_unseen(time_ns), 0.0), MAX_BODY_AGE_S) * self.velocity

    def fuse(self, group: Group, views: list[SensorView], time_ns: int) -> Body:
        """Returns the body of this person, fused from all sensors of the group."""
        seconds = self.seconds_unseen(time_ns)
        has_prediction = seconds < _MAX_GLIDE_S
        expected = self.predict_joints(time_ns) if self.hits else group.mean
        if not has_prediction:
            self._reset_offsets()
        bodies, expected = self._correct_sides(group, views, expected, seconds if has_prediction else 0.0)
        x, w = self._weigh_observations(bodies, views, seconds if has_prediction else np.inf)
        if has_prediction:
            doubt_outliers(x, w, expected)
            self._down_weight_unsteady(x, w, expected, seconds)
        step = 1.0 - np.exp(-max(seconds, 0.0) / _BLEND_TIME_CONSTANT_S)
        gain = float(step) if has_prediction else 1.0
        joints = np.empty((20, 3))
        blend(x, w, expected, has_prediction, self._had_value, self._offsets, gain, joints)
        confidence = _fuse_confidence(x, w, bodies, joints)
        orientations = self._fuse_orientations(bodies, w, has_prediction, gain)
        self._store_joints(joints, time_ns, seconds, has_prediction)
        self.confidence, self.seen_by = confidence, frozenset(bodies)
        for sensor, sighting in group.sightings.items():
            views[sensor].assign_person(sighting, self.id, _NUMBER_TRUST_S)
        return Body(
            self.id, joints, confidence, orientations, _fuse_contacts(bodies, w), _fuse_stature(bodies, w)
        )

    def _down_weight_unsteady(self, x: Float, w: Float, expected: Float, seconds: float) -> None:
        """Lowers the weights (S, 20) of sensors with large prediction errors over the last seconds.

        A sensor's constant offset does not count as an error.
        """
        sensors = np.flatnonzero(w.any(1) & self._had_value.any(1))
        surprise = ((x[sensors] - self._offsets[sensors] - expected) ** 2).sum(2).mean(1)
        gain = 1.0 - np.exp(-seconds / _SURPRISE_TIME_CONSTANT_S)
        self._surprise[sensors] += gain * (surprise - self._surprise[sensors])
        if len(sensors) > 1:
            minimum = self._surprise[sensors].min()
            w[sensors] *= ((minimum + _USUAL_ERROR_M2) / (self._surprise[sensors] + _USUAL_ERROR_M2))[:, None]

    def _reset_offsets(self) -> None:
        self._had_value[:], self._had_orientation[:] = False, False
        self._has_orientation = False

    def _store_joints(self, joints: Float, time_ns: int, seconds: float, has_prediction: bool) -> None:
        """Updates the state for the next prediction."""
        if has_prediction and seconds > 1e-4:
            speed = (joints - self.joints) / seconds
            self.velocity = self.velocity + 0.5 * (speed - self.velocity)
        elif not has_prediction:
            self.velocity = np.zeros((20, 3))
        self.joints, self.last_ns = joints, time_ns

    def _correct_sides(
        self, group: Group, views: list[SensorView], expected: Float, seconds: float
    ) -> tuple[dict[int, Body], Float]:
        """Returns the bodies with the right sides, and (20, 3) their predicted joints."""
        bodies, has_prediction = group_bodies(group), bool(self.hits)
        reference = expected if has_prediction else next(iter(bodies.values())).joints
        self._sides.compare(bodies, reference, np.asarray(self._had_value.any(1)), has_prediction)
        weights = {s: float(b.confidence.mean()) / _joint_noise(b, views[s]) ** 2 for s, b in bodies.items()}
        if self._sides.vote(
            weights, walking_direction_sign(self.joints, self.velocity), seconds, has_prediction
        ):
            self._swap_sides()
            expected = expected[OTHER_SIDE]
        return self._sides.correct_sides(bodies), expected

    def _swap_sides(self) -> None:
        """Exchanges left and right in the state."""
        self.joints, self.velocity = self.joints[OTHER_SIDE], self.velocity[OTHER_SIDE]
        self._had_value, self._offsets = (
            self._had_value.take(OTHER_SIDE, 1),
            self._offsets.take(OTHER_SIDE, 1),
        )
        self._sure = self._sure[:, OTHER_SIDE]
        self._had_orientation[:] = False
        self._has_orientation = False

    def _weigh_observations(
        self, bodies: dict[int, Body], views: list[SensorView], seconds: float
    ) -> tuple[Float, Float]:
        """Returns (S, 20, 3) joints and (S, 20) weights. Confident and near observations weigh most.

        The confidence of a joint rises only gradually, so a joint that a sensor has just found again has a
        low weight.
        """
        x, w = np.zeros(self._offsets.shape), np.zeros(self._had_value.shape)
        confidences = np.zeros(self._sure.shape)
        for sensor, body in bodies.items():
            confidences[sensor] = np.minimum(
                body.confidence, self._sure[sensor] + _CONFIDENCE_RISE_RATE * seconds
            )
            x[sensor] = body.joints
            w[sensor] = (confidences[sensor] + _UNSEEN_WEIGHT) / _joint_noise(body, views[sensor]) ** 2
            if views[sensor].state is SensorState.MOVED:
                w[sensor] *= _MOVED_SENSOR_WEIGHT
        self._sure = confidences
        return x, w

    def _fuse_orientations(
        self, bodies: dict[int, Body], w: Float, has_prediction: bool, share: float
    ) -> Float | None:
        """Returns the weighted mean (20, 4) of the orientations, with quaternions of one sign.

        Returns None if the bodies have no orientations.
        """
        available = {s: b.orientations for s, b in bodies.items() if b.orientations is not None}
        if not available:
            self._has_orientation = False
            self._had_orientation[:] = False
            return None
        reference = self._turns if self._has_orientation else next(iter(available.values()))
        x, weights = np.zeros(self._turn_habit.shape), np.zeros(w.shape)
        for sensor, turns in available.items():
            x[sensor] = np.where((turns * reference).sum(1, keepdims=True) < 0, -turns, turns)
            weights[sensor] = w[sensor]
        mean = np.empty((20, 4))
        has_prediction = has_prediction and self._has_orientation
        blend(x, weights, reference, has_prediction, self._had_orientation, self._turn_habit, share, mean)
        self._turns, self._has_orientation = normalized(mean), True
        return self._turns.copy()


def group_bodies(group: Group) -> dict[int, Body]:
    """Returns by sensor the bodies predicted to this moment, with left and right as named by the sensors."""
    return {s: _replace_joints(sighting.body, group.joints[s]) for s, sighting in group.sightings.items()}


def _replace_joints(body: Body, joints: Float) -> Body:
    if joints is body.joints:
        return body
    return Body(body.id, joints, body.confidence, body.orientations, body.contacts, body.stature)


def _joint_noise(body: Body, view: SensorView) -> float:
    """Returns the noise in metres of a sensor's joints at the distance of a body."""
    distance = body.joints[Joint.HIP_CENTER] - view.eye
    return float(_NEAR_SIGMA_M + _SIGMA_GROWTH_PER_M * (distance @ distance))


def _fuse_confidence(x: Float, w: Float, bodies: dict[int, Body], joints: Float) -> Float:
    """Returns the confidence (20,) of the most trusted sensor, lower if sensors contradict each other."""
    confidences, result = np.zeros(w.shape), np.empty(len(joints))
    for sensor, body in bodies.items():
        confidences[sensor] = body.confidence
    fuse_confidence(x, w, confidences, joints, result)
    return result


def _fuse_contacts(bodies: dict[int, Body], w: Float) -> Float | None:
    """Returns the contact (2,) of each foot, from the sensors that see the ankles best."""
    available = [(s, b.contacts) for s, b in bodies.items() if b.contacts is not None]
    if not available:
        return None
    weights = np.array([w[s, [Joint.ANKLE_LEFT, Joint.ANKLE_RIGHT]] for s, _ in available]) + 1e-12
    return np.asarray((weights * np.array([c for _, c in available])).sum(0) / weights.sum(0))


def _fuse_stature(bodies: dict[int, Body], w: Float) -> float | None:
    """Returns the mean stature in metres over the sensors that have measured it, or None."""
    available = [(float(w[s].sum()), b.stature) for s, b in bodies.items() if b.stature is not None]
    total = sum(weight for weight, _ in available)
    return sum(weight * stature for weight, stature in available) / total if total else None
