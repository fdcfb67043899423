"""The sources of frames: sensors or recordings, as users name them on the command line or in settings.

On the command line a source is one word, such as ``synthetic``, ``take.mcap`` or ``left=synthetic``. In a
settings file it is a table with more options.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from enliven.errors import InputError
from enliven.settings import group, setting
from enliven_edge.sensors import (
    CameraPower,
    Sensor,
    open_reopening,
    sensor_advice,
    sensor_names,
    sensor_opener,
)
from enliven_edge.tracking.settings import SceneSettings

Value = bool | int | float | str


@dataclass(frozen=True)
class SourceSettings:
    """Settings of one of several sensors in a settings file: ``[sensors.left]``."""

    sensor: str = setting("replay", "Sensor type, such as synthetic or replay.")
    options: dict[str, Value] = field(
        default_factory=dict, metadata={"doc": "Options of the sensor, such as path, serial or width."}
    )
    scene: SceneSettings = group(
        SceneSettings, "Sensor pose, and the part of its image that may show people."
    )


@dataclass(frozen=True)
class SensorCareSettings:
    """Settings of the recovery of all cameras of the edge: ``[sensor]``."""

    power_cycle: int = setting(
        0,
        "Number of failed attempts to open a USB camera, or of hanging calls to it, before its USB port "
        "is reset (Linux). With the default 0 no port is reset, because other programs may use a camera "
        "of the same brand.",
        low=0,
        high=1000,
    )


@dataclass(frozen=True)
class Source:
    """A sensor to be opened.

    Attributes:
        name: the user's name for the source; None for the sensor's own name.
        sensor: a name of :func:`enliven_edge.sensors.registry.sensor_names`.
        options: the arguments of its class.
        scene: the scene settings of this sensor; None for the common settings.
    """

    name: str | None
    sensor: str
    options: Mapping[str, Any]
    scene: SceneSettings | None = None


def parse_source(word: str, options: Mapping[str, Any], replay: Mapping[str, Any] | None = None) -> Source:
    """Returns the source that a word of the command line describes.

    Args:
        word: a sensor's name or the path of a recording, optionally preceded by ``NAME=``.
        options: options of the sensor. ``NAME.KEY`` applies only to the source with that name.
        replay: additional options of recordings.

    Raises:
        InputError: if it is neither a sensor nor a recording.
    """
    name_prefix, equals, sensor_or_path = word.partition("=")
    if not equals or Path(word).exists():
        name_prefix, sensor_or_path = "", word
    own_options = {
        k.removeprefix(f"{name_prefix}."): v
        for k, v in options.items()
        if name_prefix and k.startswith(f"{name_prefix}.")
    }
    chosen_options = {**{k: v for k, v in options.items() if "." not in k}, **own_options}
    if sensor_or_path in sensor_names() and sensor_or_path != "replay":
        return Source(name_prefix or None, sensor_or_path, chosen_options)
    if sensor_or_path != "replay" and not Path(sensor_or_path).exists():
        raise InputError(
            f"{sensor_or_path!r} is neither a sensor nor a recording",
            where="sensor",
            remedy=sensor_advice(sensor_or_path),
        )
    path = {} if sensor_or_path == "replay" else {"path": sensor_or_path}
    return Source(name_prefix or None, "replay", {**(replay or {}), **path, **chosen_options})


def sources_from_settings(tables: Mapping[str, SourceSettings], folder: Path | None = None) -> list[Source]:
    """Returns the sources of a settings file. A recording's path is relative to the file's ``folder``."""
    sources = []
    for name, table in tables.items():
        options = dict(table.options)
        path = options.get("path")
        if folder is not None and isinstance(path, str) and not Path(path).is_absolute():
            options["path"] = str(folder / path)
        sources.append(Source(name, table.sensor, options, table.scene))
    return sources


def open_sources(
    sources: Sequence[Source], stack: contextlib.ExitStack, wait: bool = False, power_cycle: int = 0
) -> dict[str, Sensor]:
    """Opens the sensors and returns them by name. Sensors are reopened after a failure. ``stack`` closes
    them.

    Args:
        wait: whether to wait for live sensors that are missing. Unnamed sensors are then named after their
            type.
        power_cycle: number of failed attempts after which a USB camera is reset. If 0, it is never reset.

    Raises:
        InputError: if two sensors have the same name.
        ResourceError: if a device is missing or in use.
    """
    sensors: dict[str, Sensor] = {}
    for source in sources:
        awaited = (source.name or source.sensor) if wait and source.sensor != "replay" else ""
        power = CameraPower(source.sensor, str(source.options.get("serial", "")), power_cycle)
        opener = sensor_opener(source.sensor, **source.options)
        sensor = stack.enter_context(open_reopening(opener, awaited, power if power_cycle else None))
        name = source.name or sensor.name
        if name in sensors:
            raise InputError(
                f"two sensors are called {name!r}",
                where="sensors",
                remedy="Give each sensor another name: left=FIRST right=SECOND.",
            )
        sensors[name] = sensor
    return sensors
