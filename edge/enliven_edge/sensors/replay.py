"""A recording in place of a sensor."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import logging
import math
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

from enliven.errors import InputError
from enliven.files import open_file
from enliven.frames import TIME_LIMIT_NS, Frame
from enliven.recording import BODIES_TOPIC, DEPTH_TOPIC, Recording, RecordingInfo
from enliven_edge.sensors.base import Condition, Sensor
from enliven_edge.sensors.diary import DiaryEntry, Moments

log = logging.getLogger(__name__)

_USUAL_STEP_NS = 33_333_333


class ReplaySensor(Sensor):
    """Delivers every frame of a recording, none dropped, at the recorded pace or another.

    A recording of a live sensor is that sensor again: with its sequence numbers, the conditions of its
    device, and its losses, each raised where it was.

    The pace is kept against a monotonic clock from the first frame on: who reads late gets the next frames
    at once until the pace is caught up. When looping, times go on where they ended, one usual step later.

    Args:
        path: a recording of enliven.
        speed: 1 as recorded, 2 twice as fast, 0 as fast as it goes.
        loop: begin again at the end.
        longest_pause: seconds of silence at most; longer ones are cut, and the frames' times stay.

    Raises:
        InputError: where the file is no recording, holds no frames, or the speed is not possible.
    """

    recorded = True
    """Its frames may wait for those of another recording."""

    def __init__(
        self, path: str | Path, speed: float = 1.0, loop: bool = False, longest_pause: float = math.inf
    ) -> None:
        if not (math.isfinite(speed) and speed >= 0):
            raise InputError(
                f"the speed is {speed}",
                where="replay",
                mend="Give 1 for the recorded pace, 0 for no waiting.",
            )
        self.recording = Recording(path)
        info = self.recording.info
        self.name = info.sensors[0] if info.sensors else "replay"
        self.fps = _rate(info)
        self._speed = speed
        # Held open, so that a lack of descriptors later on cannot end a loop.
        self._file = open_file(self.recording.path)
        moments = functools.partial(Moments, self.recording, self._file)
        self._moments: Iterator[DiaryEntry] = _Endless(moments) if loop else moments()
        self._ahead = _up_to_first_frame(self._moments)
        if not self._ahead:
            self._file.close()
            raise InputError(
                "the recording holds no frames", where=str(path), mend="Record or import something first."
            )
        self._first_ns = self._now_ns = self._ahead[-1].time_ns
        self._longest_ns = round(1e9 * min(longest_pause, 1e-9 * TIME_LIMIT_NS))
        self._cut_ns = 0
        self._condition: Condition | None = None
        self._started: float | None = None

    def read(self, timeout: float | None = None) -> Frame | None:
        """The next frame, when it is due; None after the last.

        Raises:
            TimeoutError: when it is not due within ``timeout`` seconds.
            InputError: in place of a frame that cannot be used; the one after it comes next.
            SensorFault: where the sensor was lost when it was recorded.
        """
        if not self._ahead:
            self._ahead.extend(itertools.islice(self._moments, 1))
        if not self._ahead:
            return None
        moment = self._ahead[0]
        wait = self._due(moment) - time.monotonic() if self._speed else 0.0
        if timeout is not None and wait > timeout:
            time.sleep(max(timeout, 0.0))
            raise TimeoutError(f"the next frame of {self.name} is due in {wait - timeout:.3f} s")
        if wait > 0:
            time.sleep(wait)
        self._ahead.popleft()
        self._cut_ns += self._too_long(moment)
        self._now_ns = max(self._now_ns, moment.time_ns)
        self._condition = moment.condition
        if isinstance(moment.said, Exception):
            raise moment.said
        return moment.said

    def condition(self) -> Condition | None:
        """How the device fared at the frame that was read last; None where that was not recorded."""
        return self._condition

    def close(self) -> None:
        """End the stream."""
        self._ahead.clear()
        self._moments = iter(())
        self._file.close()

    def _due(self, moment: DiaryEntry) -> float:
        """The monotonic second at which a moment has come."""
        if self._started is None:
            self._started = time.monotonic()
        passed_ns = moment.time_ns - self._first_ns - self._cut_ns - self._too_long(moment)
        return self._started + passed_ns * 1e-9 / self._speed

    def _too_long(self, moment: DiaryEntry) -> int:
        """Nanoseconds by which the silence before a moment is longer than it may be."""
        return max(0, moment.time_ns - self._now_ns - self._longest_ns)


def _rate(info: RecordingInfo) -> float | None:
    """Frames a second as they were recorded; None where there are too few to tell."""
    counts = [topic.count for name, topic in info.topics.items() if name in (DEPTH_TOPIC, BODIES_TOPIC)]
    frames = max(counts, default=0) / max(1, len(info.sensors))
    return (frames - 1) / info.duration if frames > 1 and info.duration > 0 else None


def _up_to_first_frame(moments: Iterator[DiaryEntry]) -> deque[DiaryEntry]:
    """The moments up to the first frame that can be used; empty where there is none."""
    ahead: deque[DiaryEntry] = deque()
    while True:
        try:
            moment = next(moments, None)
        except InputError as error:
            log.warning("%s", error)
            continue
        if moment is None:
            return deque()
        ahead.append(moment)
        if not isinstance(moment.said, Exception):
            return ahead


class _Endless:
    """The moments again and again, with times that go on rising; a frame that cannot be used costs itself."""

    def __init__(self, moments: Callable[[], Iterator[DiaryEntry]]) -> None:
        self._again, self._moments = moments, moments()
        self._shift, self._step = 0, _USUAL_STEP_NS
        self._first: int | None = None
        self._last: int | None = None

    def __iter__(self) -> _Endless:
        return self

    def __next__(self) -> DiaryEntry:
        moment = next(self._moments, None)
        if moment is None:
            if self._first is None or self._last is None:
                raise StopIteration
            self._shift += self._last - self._first + self._step
            self._first = self._last = None
            self._moments = self._again()
            return next(self)
        if self._last is not None and moment.time_ns > self._last:
            self._step = moment.time_ns - self._last
        self._first = moment.time_ns if self._first is None else self._first
        self._last = moment.time_ns
        return _later(moment, self._shift) if self._shift else moment


def _later(moment: DiaryEntry, shift_ns: int) -> DiaryEntry:
    """The same moment, so much later."""
    said, time_ns = moment.said, moment.time_ns + shift_ns
    frame = said if isinstance(said, Exception) else dataclasses.replace(said, time_ns=time_ns)
    return DiaryEntry(time_ns, frame, moment.condition)
