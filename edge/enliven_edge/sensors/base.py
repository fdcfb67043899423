"""The protocol of a sensor, its faults and the condition of its device."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from enliven.arrays import Float
from enliven.errors import ResourceError
from enliven.frames import Frame
from enliven.health import HealthState
from enliven_edge.closeable import Closeable

CHECK_IT = "Check its cable and power. The edge keeps trying to open it."
"""The advice for a sensor without a more specific one."""


class SensorFault(ResourceError):
    """A sensor failed. Later reads reopen it, and its stream continues once that works."""


@dataclass(frozen=True)
class Condition:
    """The condition of a device, as far as it reports one.

    Attributes:
        link: the connection, such as "USB 3" or "PoE". Empty if it is not known.
        slow_link: True if the link is too slow for the requested images.
        temperature: degrees Celsius of its hottest part.
        hot: degrees Celsius above which it stops, by its data sheet.
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
        """(3,) the unit vector of gravity in the camera's frame. None if no usable value was measured."""
        if self.gravity is None:
            return None
        length = float(np.linalg.norm(self.gravity))
        return np.array(self.gravity) / length if np.isfinite(length) and length > 0 else None


class Sensor(Closeable, Protocol):
    """A stream of frames from hardware, from a file or synthetic.

    ``name`` is the sensor's identity in its frames. Optional members extend the protocol. ``fps`` is a fixed
    frame rate in frames per second. ``condition()`` returns a :class:`Condition` of the device.
    ``health_states`` is a list of :class:`enliven.health.HealthState` of a sensor that checks itself, such as
    a combination of several. ``made_up = True`` marks a sensor without a device. ``isolated = True`` marks a
    class with a library that may crash or hang: it runs in its own process
    (:mod:`enliven_edge.sensors.isolation`).
    """

    name: str

    def read(self, timeout: float | None = None) -> Frame | None:
        """Returns the next frame as soon as it is due. None when the stream has ended.

        Args:
            timeout: maximum seconds to wait. None waits without limit.

        Raises:
            TimeoutError: if no frame came in time. The stream continues with the next call.
            InputError: for a frame that cannot be used. The stream continues with the next call.
            SensorFault: if the sensor was lost and is being reopened.
            Exception: any other, if the sensor was lost for good.
        """
        ...


def is_device(sensor: Sensor) -> bool:
    """Returns True if a sensor is a device, and neither a recording nor synthetic."""
    return not (getattr(sensor, "recorded", False) or getattr(sensor, "made_up", False))


def condition_of(sensor: Sensor) -> Condition | None:
    """Returns the condition of a sensor's device. None if it reports none."""
    ask = getattr(sensor, "condition", None)
    return None if ask is None else ask()


def health_of(sensor: Sensor) -> list[HealthState]:
    """Returns the health states of a sensor that checks itself. Empty for any other sensor."""
    return list(getattr(sensor, "health_states", ()))
