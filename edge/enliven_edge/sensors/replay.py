"""A recording that is played back instead of a sensor."""

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
from enliven.files import TemporaryFolder, open_file
from enliven.frames import TIME_LIMIT_NS, Frame
from enliven.recording import BODIES_TOPIC, DEPTH_TOPIC, Recorder, Recording, RecordingInfo
from enliven_edge.sensors.base import Condition, Sensor
from enliven_edge.sensors.event_log import LogEntry, LogReader

log = logging.getLogger(__name__)

_USUAL_STEP_NS = 33_333_333
"""Nanoseconds between two loops of a recording with a single frame. It is the interval of 30 frames per
second."""
CAPTURE_SUFFIXES = (".bvh", ".txt")
"""File suffixes of motion captures."""


class ReplaySensor(Sensor):
    """Delivers every frame of a recording without drops, at the recorded pace or another pace.

    For a recording of a live sensor, it reproduces sequence numbers, device conditions and losses. Each loss
    is raised as an error at its recorded time.

    The pace follows a monotonic clock that starts with the first frame. A late reader gets the next frames
    immediately until it has caught up. In a loop, times continue one usual interval after the last frame.

    Args:
        path: a recording of enliven, or a motion capture (BVH, CMU's tables), which is imported first.
        speed: 1 for the recorded pace, 2 twice as fast, 0 without waiting.
        loop: whether to start again at the end.
        longest_pause: maximum seconds of a pause. Longer pauses are shortened, but the frames keep their
            times.

    Raises:
        InputError: if the file is not a recording, has no frames, or the speed is invalid.
    """

    recorded = True
    """True if the sensor's frames may wait for the frames of another recording."""

    def __init__(
        self, path: str | Path, speed: float = 1.0, loop: bool = False, longest_pause: float = math.inf
    ) -> None:
        if not (math.isfinite(speed) and speed >= 0):
            raise InputError(
                f"the replay speed is {speed}",
                where="replay",
                remedy="Use 1 for the recorded speed, or 0 for as fast as possible.",
            )
        self._made = TemporaryFolder("replay")
        self.recording = Recording(_import_capture(Path(path), Path(self._made.name)))
        info = self.recording.info
        self.name = info.sensors[0] if info.sensors else "replay"
        self.fps = _estimate_rate(info)
        self._speed = speed
        # Keep the file open, so that a lack of file descriptors cannot end a loop later.
        self._file = open_file(self.recording.path)
        entries = functools.partial(LogReader, self.recording, self._file)
        self._entries: Iterator[LogEntry] = _LoopedEntries(entries) if loop else entries()
        self._ahead = _read_to_first_frame(self._entries)
        if not self._ahead:
            self._file.close()
            raise InputError(
                "the recording contains no frames", where=str(path), remedy="Choose a recording with frames."
            )
        self._first_ns = self._now_ns = self._ahead[-1].time_ns
        self._longest_ns = round(1e9 * min(longest_pause, 1e-9 * TIME_LIMIT_NS))
        self._cut_ns = 0
        self._condition: Condition | None = None
        self._started: float | None = None

    def read(self, timeout: float | None = None) -> Frame | None:
        """Returns the next frame at its due time, or immediately if the speed is 0. Returns None at the end.

        Raises:
            TimeoutError: if the next frame is due later than ``timeout``. The full timeout has then passed.
            Exception: the recorded error, if the recorded sensor had a fault at this time.
        """
        if not self._ahead:
            self._ahead.extend(itertools.islice(self._entries, 1))
        if not self._ahead:
            return None
        entry = self._ahead[0]
        wait = self._due_time_s(entry) - time.monotonic() if self._speed else 0.0
        if timeout is not None and wait > timeout:
            time.sleep(max(timeout, 0.0))
            raise TimeoutError(f"the next frame of {self.name} is due in {wait - timeout:.3f} s")
        if wait > 0:
            time.sleep(wait)
        self._ahead.popleft()
        self._cut_ns += self._excess_pause(entry)
        self._now_ns = max(self._now_ns, entry.time_ns)
        self._condition = entry.condition
        if isinstance(entry.content, Exception):
            raise entry.content
        return entry.content

    def condition(self) -> Condition | None:
        """Returns the device's condition at the last frame that was read. Returns None if it was not
        recorded.
        """
        return self._condition

    def close(self) -> None:
        """Closes the recording, and deletes the temporary file of an imported capture."""
        self._ahead.clear()
        self._entries = iter(())
        self._file.close()
        self._made.cleanup()

    def _due_time_s(self, entry: LogEntry) -> float:
        """Returns the time of the monotonic clock in seconds at which an entry is due."""
        if self._started is None:
            self._started = time.monotonic()
        passed_ns = entry.time_ns - self._first_ns - self._cut_ns - self._excess_pause(entry)
        return self._started + passed_ns * 1e-9 / self._speed

    def _excess_pause(self, entry: LogEntry) -> int:
        """Returns the nanoseconds in excess of the maximum pause before an entry."""
        return max(0, entry.time_ns - self._now_ns - self._longest_ns)


def _import_capture(path: Path, folder: Path) -> Path:
    """Returns the path of a recording. A motion capture is converted into one in ``folder``."""
    if path.suffix.lower() not in CAPTURE_SUFFIXES or not path.is_file():
        return path
    # Import it here, because recordings do not need it.
    from enliven_edge.importing.motion_capture import MotionCaptureReader

    recording = folder / f"{path.stem}.mcap"
    with Recorder(recording) as recorder:
        for frame in MotionCaptureReader().read([path]):
            recorder.write_frame(frame)
    return recording


def _estimate_rate(info: RecordingInfo) -> float | None:
    """Returns the recorded frames per second. Returns None if there are too few frames."""
    counts = [topic.count for name, topic in info.topics.items() if name in (DEPTH_TOPIC, BODIES_TOPIC)]
    frames = max(counts, default=0) / max(1, len(info.sensors))
    return (frames - 1) / info.duration if frames > 1 and info.duration > 0 else None


def _read_to_first_frame(entries: Iterator[LogEntry]) -> deque[LogEntry]:
    """Returns the entries up to the first usable frame, or no entries without such a frame."""
    ahead: deque[LogEntry] = deque()
    while True:
        try:
            entry = next(entries, None)
        except InputError as error:
            log.warning("%s", error)
            continue
        if entry is None:
            return deque()
        ahead.append(entry)
        if not isinstance(entry.content, Exception):
            return ahead


class _LoopedEntries:
    """Repeats the entries endlessly, with increasing times. Frames that cannot be used are skipped."""

    def __init__(self, entries: Callable[[], Iterator[LogEntry]]) -> None:
        self._again, self._entries = entries, entries()
        self._shift, self._step = 0, _USUAL_STEP_NS
        self._first: int | None = None
        self._last: int | None = None

    def __iter__(self) -> _LoopedEntries:
        return self

    def __next__(self) -> LogEntry:
        entry = next(self._entries, None)
        if entry is None:
            if self._first is None or self._last is None:
                raise StopIteration
            self._shift += self._last - self._first + self._step
            self._first = self._last = None
            self._entries = self._again()
            return next(self)
        if self._last is not None and entry.time_ns > self._last:
            self._step = entry.time_ns - self._last
        self._first = entry.time_ns if self._first is None else self._first
        self._last = entry.time_ns
        return _shift_entry(entry, self._shift) if self._shift else entry


def _shift_entry(entry: LogEntry, shift_ns: int) -> LogEntry:
    reading, time_ns = entry.content, entry.time_ns + shift_ns
    frame = reading if isinstance(reading, Exception) else dataclasses.replace(reading, time_ns=time_ns)
    return LogEntry(time_ns, frame, entry.condition)
