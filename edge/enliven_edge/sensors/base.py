"""The protocol of a sensor, its faults and its device's condition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from enliven.arrays import Float
from enliven.errors import ResourceError
from enliven.frames import Frame
from enliven.health import HealthState
from enliven_edge.closing import Closing

CHECK_IT = "Check its cable and power; it is opened again and again by itself."
"""The advice for a sensor without a better one."""


class SensorFault(ResourceError):
    """A sensor failed; later reads reopen it, and its stream goes on once that works."""


@dataclass(frozen=True)
class Condition:
    """The condition of a device, as far as it reports one.

    Attributes:
        link: how it is connected, such as "USB 3" or "PoE"; empty where that is not known.
        slow_link: whether the link is too slow for the requested images.
        temperature: degrees Celsius of its hottest part.
        hot: degrees Celsius above which it stops, by its data sheet.
        gravity: the direction downwards in the camera's frame, of any length.
        calibrated: whether it reports its own lens; otherwise the typical lens of its model is used.
    """

    link: str = ""
    slow_link: bool = False
    temperature: float | None = None
    hot: float | None = None
    gravity: tuple[float, float, float] | None = None
    calibrated: bool = True

    @property
    def down(self) -> Float | None:
        """(3,) the unit vector of gravity in the camera's frame; None where nothing usable was measured."""
        if self.gravity is None:
            return None
        length = float(np.linalg.norm(self.gravity))
        return np.array(self.gravity) / length if np.isfinite(length) and length > 0 else None


class Sensor(Closing, Protocol):
    """A stream of frames, from hardware, from a file or made up.

    ``name`` is the sensor's identity, as its frames carry it. A sensor with a fixed frame rate has it as
    ``fps``, frames a second. A sensor that reports its device's condition has ``condition()``, which returns
    a :class:`Condition`. A sensor that judges itself, as several in one do, has ``health_states``, a list of
    :class:`enliven.health.HealthState`. A sensor without a device has ``made_up = True``. A class with a
    library that may crash or hang sets ``isolated = True``: it runs in a process of its own
    (:mod:`enliven_edge.sensors.isolation`).
    """

    name: str

    def read(self, timeout: float | None = None) -> Frame | None:
        """The next frame, as soon as it is due; None when the stream has ended.

        Args:
            timeout: seconds to wait at most; None waits for as long as it takes.

        Raises:
            TimeoutError: when no frame came in time; the stream goes on with the next call.
            InputError: for a frame that cannot be used; the stream goes on with the next call.
            SensorFault: when the sensor was lost and is being reopened.
            Exception: any other, when the sensor was lost for good.
        """
        ...


def is_device(sensor: Sensor) -> bool:
    """Returns whether a sensor is a device, and neither a recording nor a made-up performer."""
    return not (getattr(sensor, "recorded", False) or getattr(sensor, "made_up", False))


def condition_of(sensor: Sensor) -> Condition | None:
    """The condition of a sensor's device; None where it reports none."""
    ask = getattr(sensor, "condition", None)
    return None if ask is None else ask()


def health_of(sensor: Sensor) -> list[HealthState]:
    """The health states of a sensor that judges itself; none of any other."""
    return list(getattr(sensor, "health_states", ()))
