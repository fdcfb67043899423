"""One sensor of a fused set: its state, its warnings, and its last bodies, predicted to a moment."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from enliven.arrays import Float
from enliven.person import Body


class SensorState(StrEnum):
    """The state of one of several sensors. Every state except LIVE gives a warning."""

    WAITING = "waiting"
    """The sensor has not sent any frame yet."""
    LIVE = "live"
    SILENT = "silent"
    """The sensor no longer sends frames."""
    FROZEN = "frozen"
    """The sensor sends frames, but all are equal."""
    MOVED = "moved"
    """The sensor sees people at other positions than the other sensors do: it was moved, or is not
    calibrated."""
    LOST = "lost"
    """The sensor was unplugged, or failed."""
    ENDED = "ended"
    """The sensor's recording has ended."""


@dataclass(frozen=True)
class SensorWarning:
    """A change of a sensor's state for the user.

    Attributes:
        sensor: its identity.
        state: the new state.
        what: one sentence.
        time_ns: the common clock.
    """

    sensor: str
    state: SensorState
    what: str
    time_ns: int


STATE_SENTENCES = {
    SensorState.WAITING: "has not sent anything yet",
    SensorState.LIVE: "sends frames again",
    SensorState.SILENT: "no longer sends frames; the other sensors continue",
    SensorState.FROZEN: "sends the same image again and again; the other sensors continue",
    SensorState.MOVED: "sees people at other positions than the other sensors: this sensor was moved, "
    "calibrate again",
    SensorState.LOST: "was lost; the other sensors continue",
    SensorState.ENDED: "has reached its end",
}
"""The sentence about each state."""


_SLOW_WEIGHT = 0.2
"""Weight per frame of a new velocity that changes little. Small changes are mostly noise."""
_FAST_WEIGHT = 0.7
"""Weight per frame of a new velocity that changes much: a start or a stop."""
_START_SPEED = 1.5
"""Change of velocity in metres per second that fully counts as a start or a stop."""
_MAX_TRUNK_SPEED = 8.0
"""Maximum speed of a trunk in metres per second. A faster trunk belongs to another person, even if the sensor
reports the same identity."""
_VELOCITY_RESET_S = 0.5
"""Seconds without a frame after which a velocity restarts at zero."""


@dataclass
class BodySighting:
    """One body of one sensor.

    Attributes:
        body: the last reported body, world frame.
        time_ns: the time of the report on the common clock.
        velocity: (20, 3) m/s.
        person: the last assigned identity, or 0.
    """

    body: Body
    time_ns: int
    velocity: Float
    person: int = 0

    def age(self, time_ns: int) -> float:
        """Returns the seconds since the sensor sent the body."""
        return (time_ns - self.time_ns) * 1e-9

    def joints(self, time_ns: int, longest: float) -> Float:
        """Returns the predicted joints (20, 3). The prediction is limited to ``longest`` seconds."""
        seconds = min(max(self.age(time_ns), -longest), longest)
        return self.body.joints + seconds * self.velocity if seconds else self.body.joints


class SensorView:
    """The sightings of one sensor.

    Args:
        name: its identity.
        eye: (3,) the position of its lens in metres, world frame.
    """

    def __init__(self, name: str, eye: Float) -> None:
        self.name, self.eye = name, eye
        self.state = SensorState.WAITING
        self.sightings: dict[int, BodySighting] = {}
        self.last_ns: int | None = None
        self.displacement_m = np.zeros(3)
        self._same_since_ns = 0
        self._last_bodies: list[Body] = []
        self._person_by_body: dict[int, tuple[int, int]] = {}

    def update(self, bodies: list[Body], time_ns: int, silence: float, *, frozen: bool = False) -> bool:
        """Updates the view with a sensor's bodies. Returns False if they are late and contain nothing new.

        Args:
            bodies: the bodies in the world frame.
            time_ns: time of the bodies on the common clock.
            silence: seconds of unchanged bodies after which the sensor counts as frozen.
            frozen: whether the sensor repeats the same image.
        """
        if self.last_ns is not None and time_ns <= self.last_ns:
            return False
        if not self._has_unchanged_bodies(bodies):
            self._same_since_ns = time_ns
        frozen = frozen or time_ns - self._same_since_ns > silence * 1e9
        self.last_ns = time_ns
        if frozen:
            self.state = SensorState.FROZEN
            self.sightings = {}
            return True
        if self.state is not SensorState.MOVED:
            self.state = SensorState.LIVE
        self.sightings = {body.id: self._create_sighting(body, time_ns) for body in bodies}
        return True

    def assign_person(self, sighting: BodySighting, person: int, believed: float) -> None:
        """Stores the person of a body, in case the sensor loses and finds the body again.

        Args:
            sighting: the body.
            person: the identity.
            believed: seconds for which the person is stored.
        """
        sighting.person = person
        self._person_by_body[sighting.body.id] = (person, sighting.time_ns)
        oldest = sighting.time_ns - believed * 1e9
        if len(self._person_by_body) > len(self.sightings):
            self._person_by_body = {body: b for body, b in self._person_by_body.items() if b[1] >= oldest}

    def _has_unchanged_bodies(self, bodies: list[Body]) -> bool:
        """Returns True if there are people, and all their joints are bitwise equal to the previous ones."""
        previous, self._last_bodies = self._last_bodies, bodies
        return (
            bool(bodies)
            and len(bodies) == len(previous)
            and all(
                b.id == o.id and np.array_equal(b.joints, o.joints)
                for b, o in zip(bodies, previous, strict=True)
            )
        )

    def _create_sighting(self, body: Body, time_ns: int) -> BodySighting:
        previous = self.sightings.get(body.id)
        if previous is None:
            return BodySighting(
                body, time_ns, np.zeros((20, 3)), self._person_by_body.get(body.id, (0, 0))[0]
            )
        seconds = previous.age(time_ns)
        # An unseen person has only a predicted position. The difference between it and the new position is
        # not a motion, so assume no velocity.
        if seconds > _VELOCITY_RESET_S or not previous.body.confidence.any():
            return BodySighting(body, time_ns, np.zeros((20, 3)), previous.person)
        speed = (body.joints - previous.body.joints) / seconds
        if np.linalg.norm(speed[:4].mean(0)) > _MAX_TRUNK_SPEED:
            return BodySighting(body, time_ns, np.zeros((20, 3)))
        change = speed - previous.velocity
        size = np.minimum(np.sqrt((change**2).sum(1, keepdims=True)) / _START_SPEED, 1.0)
        velocity = previous.velocity + (_SLOW_WEIGHT + (_FAST_WEIGHT - _SLOW_WEIGHT) * size) * change
        return BodySighting(body, time_ns, velocity, previous.person)
