"""What a sensor is to the rest of the edge."""

from __future__ import annotations

from types import TracebackType
from typing import Protocol, Self

from enliven.errors import ResourceError
from enliven.frames import Frame

TIME_LIMIT_NS = 1 << 62
"""Nanoseconds, 146 years: a time beyond is no time; differences and offsets still fit into 64 bits."""


class SensorFault(ResourceError):
    """A sensor failed; the reads that follow open it anew, and its stream goes on once that works."""


class Sensor(Protocol):
    """A stream of frames, from hardware, from a file or made up; a context manager that closes itself.

    ``name`` is the sensor's identity, as its frames carry it. A sensor that promises a frame rate has it as
    ``fps``, frames a second.
    """

    name: str

    def read(self, timeout: float | None = None) -> Frame | None:
        """The next frame, as soon as it is due; None when the stream has ended.

        Args:
            timeout: seconds to wait at most; None waits for as long as it takes.

        Raises:
            TimeoutError: when no frame was due in time; the stream goes on with the next call.
            InputError: for a frame that cannot be used; the stream goes on with the next call.
            SensorFault: when the sensor was lost, and is being opened anew.
            Exception: any other, when the sensor was lost for good.
        """
        ...

    def close(self) -> None:
        """Let the device or file go; a second call does nothing."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
