"""A recording in place of a sensor."""

from __future__ import annotations

import dataclasses
import functools
import logging
import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType

from enliven.errors import InputError
from enliven.files import open_file
from enliven.frames import Frame
from enliven.recording import Recording
from enliven.recording.reader import RecordingInfo
from enliven.recording.schemas import BODIES_TOPIC, DEPTH_TOPIC

log = logging.getLogger(__name__)

_USUAL_STEP_NS = 33_333_333


class ReplaySensor:
    """Delivers every frame of a recording, none dropped, at the recorded pace or another.

    The pace is kept against a monotonic clock from the first frame on: who reads late gets the next frames
    at once until the pace is caught up. When looping, times go on where they ended, one usual step later.

    Args:
        path: a recording of enliven.
        speed: 1 as recorded, 2 twice as fast, 0 as fast as it goes.
        loop: begin again at the end.

    Raises:
        InputError: where the file is no recording, holds no frames, or the speed is not possible.
    """

    recorded = True
    """Its frames may wait for those of another recording."""

    def __init__(self, path: str | Path, speed: float = 1.0, loop: bool = False) -> None:
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
        frames = functools.partial(self.recording.frames, self._file)
        self._frames = _Endless(frames) if loop else frames()
        self._next = _first(self._frames)
        if self._next is None:
            self._file.close()
            raise InputError(
                "the recording holds no frames", where=str(path), mend="Record or import something first."
            )
        self._first_ns = self._next.time_ns
        self._started: float | None = None

    def read(self, timeout: float | None = None) -> Frame | None:
        """The next frame, when it is due; None after the last.

        Raises:
            TimeoutError: when it is not due within ``timeout`` seconds.
            InputError: in place of a frame that cannot be used; the one after it comes next.
        """
        if self._next is None:
            self._next = next(self._frames, None)
        frame = self._next
        if frame is None:
            return None
        wait = self._due(frame) - time.monotonic() if self._speed else 0.0
        if timeout is not None and wait > timeout:
            time.sleep(max(timeout, 0.0))
            raise TimeoutError(f"the next frame of {self.name} is due in {wait - timeout:.3f} s")
        if wait > 0:
            time.sleep(wait)
        self._next = None
        return frame

    def close(self) -> None:
        """End the stream."""
        self._next = None
        self._frames = iter(())
        self._file.close()

    def __enter__(self) -> ReplaySensor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _due(self, frame: Frame) -> float:
        """The monotonic second at which a frame is to be delivered."""
        if self._started is None:
            self._started = time.monotonic()
        return self._started + (frame.time_ns - self._first_ns) * 1e-9 / self._speed


def _rate(info: RecordingInfo) -> float | None:
    """Frames a second as they were recorded; None where there are too few to tell."""
    counts = [topic.count for name, topic in info.topics.items() if name in (DEPTH_TOPIC, BODIES_TOPIC)]
    frames = max(counts, default=0) / max(1, len(info.sensors))
    return (frames - 1) / info.duration if frames > 1 and info.duration > 0 else None


def _first(frames: Iterator[Frame]) -> Frame | None:
    """The first frame that can be used, or None."""
    while True:
        try:
            return next(frames, None)
        except InputError as error:
            log.warning("%s", error)


class _Endless:
    """The frames again and again, with times that go on rising; a frame that cannot be used costs itself."""

    def __init__(self, frames: Callable[[], Iterator[Frame]]) -> None:
        self._again, self._frames = frames, frames()
        self._shift, self._step = 0, _USUAL_STEP_NS
        self._first: int | None = None
        self._last: int | None = None

    def __iter__(self) -> _Endless:
        return self

    def __next__(self) -> Frame:
        frame = next(self._frames, None)
        if frame is None:
            if self._first is None or self._last is None:
                raise StopIteration
            self._shift += self._last - self._first + self._step
            self._first = self._last = None
            self._frames = self._again()
            return next(self)
        if self._last is not None and frame.time_ns > self._last:
            self._step = frame.time_ns - self._last
        self._first = frame.time_ns if self._first is None else self._first
        self._last = frame.time_ns
        return dataclasses.replace(frame, time_ns=frame.time_ns + self._shift) if self._shift else frame
