"""The registry of sensors. It opens any sensor by name, with options as words of the command line."""

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
from enliven_edge.sensors.isolation.isolated import IsolatedOpener


def sensor_options(settings: list[str]) -> dict[str, Any]:
    """Returns KEY=VALUE words as a mapping. Numbers and true/false are converted.

    Raises:
        InputError: for a word without '='.
    """
    options: dict[str, Any] = {}
    for word in settings:
        key, equals, value = word.partition("=")
        if not equals or not key:
            raise InputError(
                f"{word!r} does not have the form KEY=VALUE",
                where="--set",
                remedy="For example: --set speed=2",
            )
        options[key.strip().replace("-", "_")] = _option_value(value.strip())
    return options


def _option_value(text: str) -> Any:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


ENTRY_POINTS = "enliven.sensors"
"""The entry-point group for sensors of other packages. An entry point names a subclass of Sensor."""
_BUILT_IN = {
    "libcamera": "enliven_edge.sensors.drivers.libcamera:LibcameraSensor",
    "oak": "enliven_edge.sensors.drivers.oak:OakSensor",
    "osc-trackers": "enliven_edge.sensors.streams.tracker_sensor:TrackerSensor",
    "orbbec": "enliven_edge.sensors.drivers.orbbec:OrbbecSensor",
    "realsense": "enliven_edge.sensors.drivers.realsense:RealSenseSensor",
    "replay": "enliven_edge.sensors.replay:ReplaySensor",
    "rokoko": "enliven_edge.sensors.streams.rokoko_sensor:RokokoSensor",
    "tof": "enliven_edge.sensors.drivers.tof:TofSensor",
    "vmc": "enliven_edge.sensors.streams.vmc_sensor:VmcSensor",
    "webcam": "enliven_edge.sensors.webcam:WebcamSensor",
}
_IN_PACKAGES = {"synthetic": "enliven-synthesis"}
"""Sensors in packages that may not be installed, and the name of the package."""


def sensor_names() -> list[str]:
    """Returns the names that :func:`open_sensor` accepts, sorted."""
    return sorted({*_BUILT_IN, *(entry.name for entry in entry_points(group=ENTRY_POINTS))})


def open_sensor(name: str, **options: Any) -> Sensor:
    """Opens the sensor called ``name``.

    Args:
        name: one of :func:`sensor_names`.
        options: arguments of the sensor's class.

    Raises:
        InputError: for an unknown name or option. The message suggests the nearest known one.
        ResourceError: if the device is missing or in use.
    """
    return sensor_opener(name, **options)()


def sensor_opener(name: str, *, every_frame: bool = False, **options: Any) -> Callable[[], Sensor]:
    """Returns a function that opens the sensor ``name``, also repeatedly.

    Isolated sensors run in a helper process.

    Args:
        every_frame: whether frames wait for a slow reader, which a recording needs. If False, only the newest
            are kept, for a live performance. Frames of a rehearsal or replay always wait.
        options: arguments of the sensor's class.

    Raises:
        InputError: for an unknown name or option. The message suggests the nearest known one.
    """
    kind = _check_options(name, options)
    if kind.isolated:
        return IsolatedOpener(name, kind, options, every_frame or bool(options.get("rehearse")))
    return functools.partial(kind, **options)


def _check_options(name: str, options: dict[str, Any]) -> type[Sensor]:
    """Returns the class of a sensor after checking its options."""
    kind = _find_class(name)
    parameters = inspect.signature(kind).parameters
    for option in options:
        if option not in parameters and not any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
            raise InputError(
                f"unknown option {option!r}",
                where=f"sensor {name}",
                remedy=_suggest(option, list(parameters)),
            )
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    missing = [p.name for p in parameters.values() if p.default is p.empty and p.kind in kinds]
    for option in missing:
        if option not in options:
            raise InputError(
                f"the option {option!r} is missing",
                where=f"sensor {name}",
                remedy=f"Add --set {option}=VALUE.",
            )
    return kind


def _find_class(name: str) -> type[Sensor]:
    """Returns the class of a sensor.

    The class is imported only here. So a missing library does not prevent the use of other sensors.

    Raises:
        InputError: for an unknown name, or a class of another package that is not a subclass of Sensor.
    """
    if name in _BUILT_IN:
        module, _, kind = _BUILT_IN[name].partition(":")
        built_in: type[Sensor] = getattr(import_module(module), kind)
        return built_in
    for entry in entry_points(group=ENTRY_POINTS):
        if entry.name == name:
            kind = entry.load()
            if isinstance(kind, type) and issubclass(kind, Sensor):
                return kind
            raise InputError(
                f"{entry.value} is not a subclass of Sensor",
                where=f"sensor {name}",
                remedy="Derive the class from enliven_edge.sensors.base.Sensor: class NAME(Sensor).",
            )
    raise InputError(f"the sensor {name!r} does not exist", where="sensor", remedy=sensor_advice(name))


def sensor_advice(name: str) -> str:
    """Returns the advice for an unknown sensor: the package that contains it, or similar names."""
    package = _IN_PACKAGES.get(name)
    return (
        f"Install the package of this sensor: pip install {package}"
        if package
        else _suggest(name, sensor_names())
    )


def _suggest(word: str, known: list[str]) -> str:
    near = difflib.get_close_matches(word, known, n=1)
    return f"Did you mean {near[0]}?" if near else f"Known: {', '.join(known)}."
