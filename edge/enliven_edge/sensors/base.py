"""The base class of all sensors, their faults and the condition of a device."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from enliven.arrays import Float
from enliven.errors import ResourceError
from enliven.frames import Frame
from enliven.health import HealthState
from enliven.supervision.closeable import Closeable

CHECK_IT = "Check the cable and power of the sensor. The edge keeps trying to open the sensor."
"""The advice for a sensor without more specific advice."""


class SensorFault(ResourceError):
    """A sensor failed. Later reads reopen it. Its stream continues when the sensor is open again."""


@dataclass(frozen=True)
class Condition:
    """The condition of a device, as far as the device reports it.

    Attributes:
        link: the connection, such as "USB 3" or "PoE"; empty if unknown.
        slow_link: True if the link is too slow for the requested images.
        temperature: degrees Celsius of its hottest part.
        hot: degrees Celsius above which it stops, according to its data sheet.
        gravity: the downward direction in the camera's frame, of any length.
        calibrated: True if it reports its own intrinsics. Otherwise the typical intrinsics of its model are
            used.
    """

    link: str = ""
    slow_link: bool = False
    temperature: float | None = None
    hot: float | None = None
    gravity: tuple[float, float, float] | None = None
    calibrated: bool = True

    @property
    def down(self) -> Float | None:
        """Returns the (3,) unit vector of gravity in the camera's frame, or None if no usable value was
        measured.
        """
        if self.gravity is None:
            return None
        length = float(np.linalg.norm(self.gravity))
        return np.array(self.gravity) / length if np.isfinite(length) and length > 0 else None


class Sensor(Closeable):
    """A stream of frames from hardware, from a file or synthetic. The base class of every sensor.

    A subclass sets ``name`` and implements ``read``. The defaults of the other members suit a live camera
    that reports nothing about itself.

    Attributes:
        name: the sensor's identity in its frames.
        fps: fixed frame rate in frames per second; None if it is unknown or varies.
        recorded: True for a recording. Its frames may wait for a slow reader.
        made_up: True for a live source that is not a device, for example a synthetic performer.
        may_be_silent: True if no frames arrive without a performer, as from a port for another program.
        again: options that open the same device again, if the sensor chose one of several devices.
        isolated: True for a class with a library that may crash or hang. Such a sensor runs in its own
            process (:mod:`enliven_edge.sensors.isolation`).
    """

    name: str
    fps: float | None = None
    recorded: bool = False
    made_up: bool = False
    may_be_silent: bool = False
    again: Mapping[str, Any] = MappingProxyType({})
    isolated: ClassVar[bool] = False

    @abstractmethod
    def read(self, timeout: float | None = None) -> Frame | None:
        """Returns the next frame as soon as it is due. Returns None if the stream has ended.

        Args:
            timeout: maximum seconds to wait. None waits without limit.

        Raises:
            TimeoutError: if no frame arrived in time. The stream continues with the next call.
            InputError: for a frame that cannot be used. The stream continues with the next call.
            SensorFault: if the sensor was lost and is being reopened.
            Exception: any other error, if the sensor was lost permanently.
        """

    def close(self) -> None:
        """Releases the device. A second call does nothing. By default, there is nothing to release."""

    def condition(self) -> Condition | None:
        """Returns the condition of the device, or None if it reports none."""
        return None

    @property
    def health_states(self) -> Sequence[HealthState]:
        """Returns the health states of a sensor that checks itself, such as a combination of several
        sensors.
        """
        return ()

    @property
    def is_device(self) -> bool:
        """Returns True for a device, and False for a recording or a source that is made up."""
        return not (self.recorded or self.made_up)

    @property
    def is_waiting(self) -> bool:
        """Returns True if no frames are due now, and a restart of the edge would not change this.

        Examples are a recording between two frames, and a port to which no program sends. A lost camera
        counts as waiting as long as each attempt to open it returns. A camera does not count as waiting
        while a call of its driver hangs.
        """
        return self.recorded
