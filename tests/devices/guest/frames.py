"""Reads a sensor with timeouts for an emulated processor."""

from __future__ import annotations

import time
from pathlib import Path

from as_user import SLOW

from enliven.errors import InputError
from enliven_edge.sensors.base import Sensor, SensorFault


def read(sensor: Sensor, count: int) -> list:
    """Returns ``count`` frames, ignoring losses and reconnections meanwhile."""
    frames, deadline = [], time.monotonic() + SLOW
    while len(frames) < count:
        assert time.monotonic() < deadline, f"{len(frames)} of {count} frames in {SLOW} s"
        try:
            frames.append(sensor.read(1.0))
        except InputError as damaged:
            print(damaged)
        except (TimeoutError, SensorFault):
            continue
    return frames


def lost(sensor: Sensor) -> tuple[float, str]:
    """Reads until the sensor is lost. Returns the seconds until then, and the error."""
    began = time.monotonic()
    while True:
        assert time.monotonic() < began + SLOW, "it was never lost"
        try:
            sensor.read(1.0)
        except TimeoutError:
            continue
        except SensorFault as fault:
            return time.monotonic() - began, str(fault)


def bind(driver: str, device: str, there: bool) -> None:
    """Unbinds a device from its driver, like pulling it out, or binds it again."""
    Path(f"/sys/bus/platform/drivers/{driver}", "bind" if there else "unbind").write_text(device)
