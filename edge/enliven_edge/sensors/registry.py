"""The registry of sensors: opens any of them by name."""

from __future__ import annotations

import difflib
import functools
import inspect
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from enliven.errors import InputError
from enliven_edge.sensors.base import Sensor
from enliven_edge.sensors.isolation import IsolatedOpener

ENTRY_POINTS = "enliven.sensors"
"""Other packages add sensors through this group: an entry point names a class that makes a Sensor."""
_BUILT_IN = {
    "libcamera": "enliven_edge.sensors.drivers.libcamera:LibcameraSensor",
    "oak": "enliven_edge.sensors.drivers.oak:OakSensor",
    "orbbec": "enliven_edge.sensors.drivers.orbbec:OrbbecSensor",
    "realsense": "enliven_edge.sensors.drivers.realsense:RealSenseSensor",
    "replay": "enliven_edge.sensors.replay:ReplaySensor",
    "tof": "enliven_edge.sensors.drivers.tof:TofSensor",
    "webcam": "enliven_edge.sensors.webcam:WebcamSensor",
}
_IN_PACKAGES = {"synthetic": "enliven-synthesis"}
"""Sensors of packages that may not be installed, by the name of the package."""


def sensor_names() -> list[str]:
    """The names that :func:`open_sensor` takes, sorted."""
    return sorted({*_BUILT_IN, *(entry.name for entry in entry_points(group=ENTRY_POINTS))})


def open_sensor(name: str, **options: Any) -> Sensor:
    """The sensor called ``name``, opened.

    Args:
        name: one of :func:`sensor_names`.
        options: what the sensor's class takes.

    Raises:
        InputError: for an unknown name or option, naming the nearest known one.
        ResourceError: where the device is missing or taken.
    """
    return sensor_opener(name, **options)()


def sensor_opener(name: str, *, every_frame: bool = False, **options: Any) -> Callable[[], Sensor]:
    """A function that opens the sensor ``name``, also again; in a helper process where it is isolated.

    Args:
        every_frame: frames wait for a slow reader, for a recording, in place of the newest alone, for a live
            performance; a rehearsal's always wait, as those of a replay do.
        options: what the sensor's class takes.

    Raises:
        InputError: for an unknown name or option, naming the nearest known one.
    """
    kind = _checked(name, options)
    if getattr(kind, "isolated", False):
        return IsolatedOpener(name, kind, options, every_frame or bool(options.get("rehearse")))
    return functools.partial(kind, **options)


def _checked(name: str, options: dict[str, Any]) -> Any:
    """The class of a sensor that takes these options.

    Raises:
        InputError: for an unknown name or option.
    """
    kind = _kind(name)
    known = inspect.signature(kind).parameters
    for option in options:
        if option not in known and not any(p.kind is p.VAR_KEYWORD for p in known.values()):
            raise InputError(
                f"unknown option {option!r}", where=f"sensor {name}", mend=_nearest(option, list(known))
            )
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    missing = [p.name for p in known.values() if p.default is p.empty and p.kind in kinds]
    for option in missing:
        if option not in options:
            raise InputError(f"the option {option!r} is missing", where=f"sensor {name}", mend="Give it.")
    return kind


def _kind(name: str) -> Any:
    """The class of a sensor; imported only now, so that a missing camera library stops no other sensor."""
    if name in _BUILT_IN:
        module, _, kind = _BUILT_IN[name].partition(":")
        return getattr(import_module(module), kind)
    for entry in entry_points(group=ENTRY_POINTS):
        if entry.name == name:
            return entry.load()
    raise InputError(f"there is no sensor called {name!r}", where="sensor", mend=sensor_advice(name))


def sensor_advice(name: str) -> str:
    """Returns what to do about a sensor that is not there: the package that has it, or names near to it."""
    package = _IN_PACKAGES.get(name)
    return f"Install it: pip install {package}" if package else _nearest(name, sensor_names())


def _nearest(word: str, known: list[str]) -> str:
    near = difflib.get_close_matches(word, known, n=1)
    return f"Did you mean {near[0]}?" if near else f"Known: {', '.join(known)}."
