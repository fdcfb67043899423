"""The event log of a live sensor in a recording: its conditions and losses, in addition to its frames.

The log consists of JSON messages on two topics. :data:`CONDITION_TOPIC` precedes the first frame to which a
condition applies. :data:`EVENTS_TOPIC` follows the last frame before an event. Both have the time of that
frame.
"""

from __future__ import annotations

import functools
import logging
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO, Literal, TypeVar

import msgspec

from enliven.errors import EnlivenError, InputError
from enliven.files import DECODE_ERRORS
from enliven.frames import Frame
from enliven.recording import BODIES_TOPIC, DEPTH_TOPIC, Recording, frame_from_message
from enliven_edge.sensors.base import Condition, SensorFault

log = logging.getLogger(__name__)
T = TypeVar("T")

CONDITION_TOPIC = "/sensor/condition"
"""Topic of the messages of type :class:`~enliven_edge.sensors.base.Condition`."""
EVENTS_TOPIC = "/sensor/events"
"""Topic of the messages of type :class:`SensorEvent`."""
_MAX_EARLY_EVENTS = 100
"""Maximum number of stored events before the first frame. The newest are kept. It bounds the memory if a
camera sends no frame."""


class SensorEvent(msgspec.Struct, frozen=True, rename={"remedy": "mend"}):
    """An event that occurred instead of a frame.

    Attributes:
        kind: the sensor was lost, is back with the frame of this time, or sent a frame that cannot be used.
        after: seconds since the previous frame, by the wall clock.
        what, where, remedy: text of the error; empty if the sensor is back. Recordings call the remedy
            "mend".
    """

    kind: Literal["lost", "back", "bad frame"]
    after: float = 0.0
    what: str = ""
    where: str = ""
    remedy: str = ""

    @property
    def error(self) -> SensorFault | InputError | None:
        """Returns the error that the sensor raised, or None if it raised none."""
        if self.kind == "back":
            return None
        error_type = SensorFault if self.kind == "lost" else InputError
        return error_type(self.what, where=self.where, remedy=self.remedy)


class EventLog:
    """Writes a live sensor's frames into a recording, with its conditions and events.

    Args:
        recorder: a :class:`~enliven.recording.Recorder`, or a recorder in parts.
    """

    def __init__(self, recorder: Any) -> None:
        self._recorder = recorder
        self._condition: Condition | None = None
        self._early_events: deque[SensorEvent] = deque(maxlen=_MAX_EARLY_EVENTS)
        self._last: Frame | None = None
        self._last_frame_at = 0.0
        self._lost = False

    def write_frame(self, frame: Frame, condition: Condition | None) -> None:
        """Writes one frame, and the device's condition if it has changed.

        Raises:
            InputError: for a frame that a recording cannot hold. No part of it is written.
            ResourceError: if it cannot be written.
        """
        for event in self._early_events:
            self._write(EVENTS_TOPIC, event, frame)
        self._early_events.clear()
        if self._lost:
            after = 0.0 if self._last is None else time.monotonic() - self._last_frame_at
            self._write(EVENTS_TOPIC, SensorEvent("back", after), frame)
        if condition is not None and condition != self._condition:
            self._write(CONDITION_TOPIC, condition, frame)
            self._condition = condition
        self._recorder.write_frame(frame)
        self._last, self._last_frame_at, self._lost = frame, time.monotonic(), False

    def write_error(self, error: EnlivenError) -> None:
        """Writes an error that the sensor raised instead of a frame.

        Raises:
            ResourceError: if it cannot be written.
        """
        bad = isinstance(error, InputError)
        after = 0.0 if self._last is None else time.monotonic() - self._last_frame_at
        event = SensorEvent("bad frame" if bad else "lost", after, error.what, error.where, error.remedy)
        self._lost = self._lost or not bad
        if self._last is None:
            self._early_events.append(event)
        else:
            self._write(EVENTS_TOPIC, event, self._last)

    def _write(self, topic: str, message: Condition | SensorEvent, at: Frame) -> None:
        kind: Any = type(message)
        schema = (f"enliven.{kind.__name__}", _json_schema(kind), "jsonschema", "json")
        self._recorder.write(topic, *schema, msgspec.json.encode(message), at.time_ns, at.sensor)


@dataclass(frozen=True)
class LogEntry:
    """One entry of a sensor's event log: a frame or an error, with the device's condition.

    Attributes:
        time_ns: the sensor's clock. For an error, the last frame's time plus the elapsed wall-clock time.
        content: the frame, or the error.
        condition: the device's condition; None if it has reported none.
    """

    time_ns: int
    content: Frame | SensorFault | InputError
    condition: Condition | None


class LogReader:
    """Iterates over the log entries of a recording, in order. An older recording has only frames.

    ``next`` raises InputError for a message that is not a frame, and continues with the message after it.

    Args:
        file: the open file of the recording. If None, it is opened.
    """

    def __init__(self, recording: Recording, file: BinaryIO | None = None) -> None:
        topics = {DEPTH_TOPIC, BODIES_TOPIC, CONDITION_TOPIC, EVENTS_TOPIC}
        self._messages = recording.messages_in_order(topics, file)
        self._condition: Condition | None = None

    def __iter__(self) -> Iterator[LogEntry]:
        return self

    def __next__(self) -> LogEntry:
        for topic, time_ns, data in self._messages:
            if topic == CONDITION_TOPIC:
                self._condition = _decode(Condition, data) or self._condition
            elif topic == EVENTS_TOPIC:
                event = _decode(SensorEvent, data)
                if event is not None and (error := event.error) is not None:
                    return LogEntry(time_ns + round(1e9 * max(event.after, 0.0)), error, self._condition)
            else:
                return LogEntry(time_ns, frame_from_message(topic, data), self._condition)
        raise StopIteration


def _decode(kind: type[T], data: bytes) -> T | None:
    """Returns the message, or None if it is damaged. A damaged log must not prevent reading the frames."""
    try:
        return msgspec.json.decode(data, type=kind)
    except DECODE_ERRORS as error:
        log.warning("the sensor information in a recording cannot be read: %s", error)
        return None


@functools.cache
def _json_schema(kind: Any) -> str:
    return msgspec.json.encode(msgspec.json.schema(kind)).decode()
