"""What a sensor is to the rest of the edge."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

from enliven.errors import ResourceError
from enliven.frames import Frame

CHECK_IT = "Check its cable and power; it is opened again and again by itself."
"""What to do about a sensor of which nothing better is known."""


class SensorFault(ResourceError):
    """A sensor failed; the reads that follow open it anew, and its stream goes on once that works."""


@dataclass(frozen=True)
class Condition:
    """How a device fares, as far as it can say.

    Attributes:
        link: how it is connected, such as "USB 3" or "PoE"; empty where that is not known.
        slow_link: whether that is too slow for what is asked of the device.
        temperature: degrees Celsius of its hottest part.
        hot: degrees Celsius above which its maker says that it stops.
        gravity: the direction downwards in the camera's frame, of any length.
        calibrated: whether it knows its own lens; else that of its kind is used.
    """

    link: str = ""
    slow_link: bool = False
    temperature: float | None = None
    hot: float | None = None
    gravity: tuple[float, float, float] | None = None
    calibrated: bool = True


class Sensor(Protocol):
    """A stream of frames, from hardware, from a file or made up; a context manager that closes itself.

    ``name`` is the sensor's identity, as its frames carry it. A sensor that promises a frame rate has it as
    ``fps``, frames a second; one that knows how its device fares has ``condition()``, which returns a
    :class:`Condition`. A class whose library may crash or hang says ``isolated = True``: it is run in a
    process of its own (:mod:`enliven_edge.sensors.isolation`).
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

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def condition_of(sensor: Sensor) -> Condition | None:
    """How a sensor's device fares; None where it does not say."""
    ask = getattr(sensor, "condition", None)
    return None if ask is None else ask()
