"""Turns the fits of the people in view into the output bodies of the tracker.

The steps are: replace NaN, limit the speed, smooth, detect foot contacts, predict, mirror. Every step
processes each person separately and can be switched off. With smoothing 0 and all other steps off, the fit is
output unchanged.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from enliven.arrays import Float
from enliven.person import Body, mirror_body
from enliven_edge.tracking.output.contact import FootContacts
from enliven_edge.tracking.output.prediction import Predictor
from enliven_edge.tracking.output.smoothing import OneEuro, OneEuroTurns
from enliven_edge.tracking.output.speed_limit import SpeedLimit, replace_nan_joints, replace_nan_rotations
from enliven_edge.tracking.settings import TrackerSettings

_FORGET_AFTER_NS = 10_000_000_000
"""Nanoseconds after which the state of a person who is out of view is deleted, to free memory. The filters
are reset earlier."""
_MAX_LATENCY_S = 0.3
"""Maximum latency in seconds that the prediction compensates: the upper bound of the setting ``predict``."""
_MAX_AMOUNTS = 64
"""Maximum number of people with their own smoothing amount, because viewers may send any number of ids."""
_MIN_SMOOTHING_AMOUNT = 1e-3
"""Smoothing amounts below this count as 0, because the filter divides by the amount."""


class Output:
    """Smooths, predicts and mirrors any number of bodies, from the tracker or any other source.

    Attributes:
        latency: seconds from the sensor's frame to the published pose, measured by the edge. It is the
            prediction time if the settings say "measured".
    """

    def __init__(self, settings: TrackerSettings | None = None) -> None:
        self.settings = settings or TrackerSettings()
        self.latency = 0.0
        self._amounts = {i + 1: a for i, a in enumerate(self.settings.smoothing.amounts) if a >= 0.0}
        self._people: dict[int, _Person] = {}
        self._time_ns: int | None = None

    def smooth(self, person: int, amount: float | None) -> None:
        """Sets the amount of smoothing of one performer. None selects the amount in the settings."""
        self._amounts.pop(person, None)
        if amount is not None:
            self._amounts[person] = max(0.0, amount)
            absent = [
                absent_person
                for absent_person in self._amounts
                if absent_person not in self._people and absent_person != person
            ]
            for absent_person in absent[: max(len(self._amounts) - _MAX_AMOUNTS, 0)]:
                del self._amounts[absent_person]
        if person in self._people:
            self._people[person].set_amount(self.smoothing_amount(person))

    @property
    def amounts(self) -> dict[int, float]:
        """Returns the amounts of smoothing that were set for single people, by id."""
        return dict(self._amounts)

    @amounts.setter
    def amounts(self, amounts: dict[int, float]) -> None:
        self._amounts = dict(amounts)
        for person, state in self._people.items():
            state.set_amount(self.smoothing_amount(person))

    def smoothing_amount(self, person: int) -> float:
        """Returns the amount of smoothing of a performer. 0 means no smoothing."""
        amount = self._amounts.get(person, self.settings.smoothing.amount)
        return amount if amount >= _MIN_SMOOTHING_AMOUNT else 0.0

    @property
    def prediction_seconds(self) -> float:
        """Returns the prediction time of the joints in seconds."""
        prediction = self.settings.output.predict
        return min(max(self.latency, 0.0), _MAX_LATENCY_S) if prediction == "measured" else float(prediction)

    def __call__(
        self, bodies: list[Body], time_ns: int, world_from_camera: Float | None = None
    ) -> list[Body]:
        """Returns the output bodies of the tracker.

        Args:
            bodies: the fits of one frame, world frame.
            time_ns: the sensor's clock.
            world_from_camera: (4, 4) pose of the sensor, which defines the mirror plane. If None, the sensor
                is assumed at the world's origin.
        """
        self._forget(time_ns)
        output_bodies = [self._person(body.id)(body, time_ns, self.prediction_seconds) for body in bodies]
        if self.settings.output.mirror:
            plane = mirror_plane(world_from_camera)
            output_bodies = [mirror_body(body, *plane) for body in output_bodies]
        return output_bodies

    def forget(self) -> None:
        """Forgets all people. The next bodies are not smoothed with earlier ones."""
        self._people.clear()

    def _person(self, person: int) -> _Person:
        if person not in self._people:
            self._people[person] = _Person(self.settings, self.smoothing_amount(person))
        return self._people[person]

    def _forget(self, time_ns: int) -> None:
        """Forgets people who have been out of view for long, and all people if the clock was set back."""
        if self._time_ns is not None and time_ns < self._time_ns:
            self._people.clear()
        self._time_ns = time_ns
        forgotten_ids = [p for p, state in self._people.items() if time_ns - state.time_ns > _FORGET_AFTER_NS]
        for person in forgotten_ids:
            del self._people[person]


class _Person:
    """The filters of one person."""

    def __init__(self, settings: TrackerSettings, amount: float) -> None:
        self.time_ns = 0
        self._limit = SpeedLimit()
        self._joints = OneEuro(settings.smoothing, amount)
        self._turns = OneEuroTurns(settings.smoothing, amount)
        self._undelayed = settings.smoothing.undelayed
        self._contacts = FootContacts()
        self._predictor = Predictor()
        self._last: Float | None = None
        self._last_turns: Float | None = None

    def set_amount(self, amount: float) -> None:
        self._joints.amount = self._turns.amount = amount

    def __call__(self, body: Body, time_ns: int, ahead: float) -> Body:
        """Filters one frame of this person."""
        self.time_ns = time_ns
        joints, confidence = replace_nan_joints(body.joints, body.confidence, self._last)
        turns = (
            None if body.orientations is None else replace_nan_rotations(body.orientations, self._last_turns)
        )
        self._last, self._last_turns = joints, turns
        if self._joints.amount > 0.0:
            joints, confidence = self._limit(joints, confidence, time_ns)
            self._last = joints
        joints = self._joints(joints, time_ns)
        turns = None if turns is None else self._turns(turns, time_ns)
        contacts = self._contacts(joints, confidence, time_ns)
        if ahead > 0.0 or (self._undelayed > 0.0 and self._joints.amount > 0.0):
            delays = self._undelayed * self._joints.delay, self._undelayed * self._turns.delay
            joints, turns = self._predictor(joints, turns, time_ns, ahead, *delays)
        return dataclasses.replace(
            body, joints=joints, confidence=confidence, orientations=turns, contacts=contacts
        )


def mirror_plane(world_from_camera: Float | None) -> tuple[Float, Float]:
    """Returns a (3,) point and (3,) unit normal of the vertical plane through the sensor's line of sight."""
    if world_from_camera is None:
        return np.zeros(3), np.array([1.0, 0.0, 0.0])
    forward = world_from_camera[:3, 2] * np.array([1.0, 0.0, 1.0])
    length = float(np.linalg.norm(forward))
    if length < 0.1:
        # The sensor looks straight down, so use the x axis of the world as the forward direction.
        return world_from_camera[:3, 3], np.array([1.0, 0.0, 0.0])
    return world_from_camera[:3, 3], np.array([-forward[2], 0.0, forward[0]]) / length
