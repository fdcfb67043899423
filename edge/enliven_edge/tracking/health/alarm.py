"""Alarms with hysteresis in time, each with its sentence, severity and delay from ``messages.toml``."""

from __future__ import annotations

import logging
import tomllib
from dataclasses import dataclass
from importlib.resources import files

from enliven.health import NO_PERFORMER, HealthKind, HealthState, Severity, sort_by_severity


@dataclass(frozen=True)
class MessageTemplate:
    """The message of one kind of problem.

    Attributes:
        severity: how severe the problem is.
        what, remedy: the problem and the remedy, one sentence each, with placeholders for facts in braces.
        raise_after, clear_after: seconds of trouble before it is reported, and seconds without trouble before
            it is over.
        remedy_made: the remedy for a recorded or synthetic sensor, which has no cable. If empty, ``remedy``
            is used.
    """

    severity: Severity
    what: str
    remedy: str
    raise_after: float = 0.5
    clear_after: float = 1.0
    remedy_made: str = ""


def _read() -> dict[HealthKind, MessageTemplate]:
    table = tomllib.loads(files(__package__).joinpath("messages.toml").read_text("utf-8"))
    return {
        HealthKind(kind): MessageTemplate(Severity[entry.pop("severity")], **entry)
        for kind, entry in table.items()
    }


HEALTH_MESSAGES = _read()
"""The message of each kind. A test checks that every kind has a message."""


log = logging.getLogger(__name__)

Key = tuple[HealthKind, int]
"""A kind of problem, and the performer's id or ``NO_PERFORMER``."""


class Alarm:
    """Raises and clears one alarm with hysteresis in time.

    Args:
        raise_after: seconds of trouble before it is raised.
        clear_after: seconds without trouble before it is cleared.

    Attributes:
        active: whether it is raised.
        since_ns: when the trouble began.
    """

    def __init__(self, raise_after: float, clear_after: float) -> None:
        self._raise_ns, self._clear_ns = int(raise_after * 1e9), int(clear_after * 1e9)
        self.active = False
        self.since_ns = 0
        self._wrong_ns: int | None = None
        self._right_ns: int | None = None

    def update(self, is_wrong: bool | None, time_ns: int) -> bool:
        """Updates the alarm with the state at one moment. Returns True if the alarm is active now.

        Args:
            is_wrong: whether there is trouble. If None, the state is unknown and nothing changes.
            time_ns: the moment.
        """
        if is_wrong is None:
            return self.active
        if is_wrong:
            self._right_ns = None
            if self._wrong_ns is None or time_ns < self._wrong_ns:
                self._wrong_ns = time_ns
            if not self.active and time_ns - self._wrong_ns >= self._raise_ns:
                self.active, self.since_ns = True, self._wrong_ns
        else:
            self._wrong_ns = None
            if self._right_ns is None or time_ns < self._right_ns:
                self._right_ns = time_ns
            if time_ns - self._right_ns >= self._clear_ns:
                self.active = False
        return self.active


class Alarms:
    """The alarms of each kind of problem and performer. Logs the beginning and end of each.

    Args:
        sensor: the name of the sensor at the beginning of a sentence.

    Attributes:
        is_device: whether the sensor is a device. A recording and a synthetic performer have no cable.
    """

    def __init__(self, sensor: str) -> None:
        self._sensor = sensor
        self.is_device = True
        self._alarms: dict[Key, tuple[Alarm, dict[str, object]]] = {}
        self._logged: set[Key] = set()

    @property
    def states(self) -> list[HealthState]:
        """Returns the current problems, the most severe first."""
        return sort_by_severity([self._state(key) for key, alarm in self._alarms.items() if alarm[0].active])

    def update(
        self,
        kind: HealthKind,
        is_wrong: bool | None,
        now: int,
        performer: int = NO_PERFORMER,
        **facts: object,
    ) -> None:
        """Updates the alarm of one kind. ``is_wrong`` is None if its state is unknown.

        Args:
            kind: the kind of problem.
            is_wrong: whether there is trouble.
            now: nanoseconds.
            performer: the performer's id, or ``NO_PERFORMER``.
            facts: values that are filled into the message. The values of the last moment of trouble are kept.
        """
        key = (kind, performer)
        alarm = self._alarms.get(key)
        if alarm is None:
            if not is_wrong:
                return
            message = HEALTH_MESSAGES[kind]
            alarm = self._alarms[key] = (Alarm(message.raise_after, message.clear_after), {})
        if is_wrong and facts:
            alarm[1].update(facts)
        alarm[0].update(is_wrong, now)

    def is_too_low(
        self, kind: HealthKind, value: float | None, good: float, bad: float, performer: int = NO_PERFORMER
    ) -> bool | None:
        """Returns True if a value is too low, with hysteresis, or None if the value is unknown.

        The value becomes too low below ``bad``, and stays too low until it is above ``good``.
        """
        if value is None:
            return None
        alarm = self._alarms.get((kind, performer))
        return value < (good if alarm is not None and alarm[0].active else bad)

    def log_changes(self) -> None:
        """Logs each alarm that is new or over, once."""
        active = {key for key, alarm in self._alarms.items() if alarm[0].active}
        for key in active - self._logged:
            state = self._state(key)
            log.log(logging.INFO if state.severity is Severity.NOTE else logging.WARNING, "%s", state)
        for kind, performer in self._logged - active:
            log.info("over: %s%s", kind, "" if performer == NO_PERFORMER else f" (performer {performer})")
        self._logged = active

    def keep_present(self, present: set[int]) -> None:
        """Drops the alarms of performers who are not present."""
        for key in [k for k in self._alarms if k[1] != NO_PERFORMER and k[1] not in present]:
            del self._alarms[key]

    def clear(self) -> None:
        """Drops all alarms."""
        self._alarms.clear()

    def _state(self, key: Key) -> HealthState:
        kind, performer = key
        alarm, facts = self._alarms[key]
        message = HEALTH_MESSAGES[kind]
        words = {**facts, "performer": f"Performer {performer}", "sensor": self._sensor}
        remedy = message.remedy if self.is_device else message.remedy_made or message.remedy
        problem, remedy = message.what.format(**words), remedy.format(**words)
        return HealthState(kind, message.severity, alarm.since_ns, problem, remedy, performer)
