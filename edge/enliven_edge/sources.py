"""The sources of frames as a user names them: a sensor's name or a recording, with an optional own name.

The command line takes one word, ``synthetic``, ``take.mcap``, ``left=synthetic``. A table of the settings
file holds more.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from enliven.errors import InputError
from enliven.settings import setting
from enliven_edge.sensors import Sensor, open_reopening, sensor_advice, sensor_names, sensor_opener
from enliven_edge.tracking import SceneSettings

Value = bool | int | float | str


@dataclass(frozen=True)
class SourceSettings:
    """One of several sensors, in a settings file: ``[sensors.left]``."""

    sensor: str = setting("replay", "Sensor type, such as synthetic or replay.")
    options: dict[str, Value] = field(
        default_factory=dict, metadata={"doc": "Options of the sensor, such as path, serial or width."}
    )
    scene: SceneSettings = setting(
        SceneSettings, "Sensor pose, and the part of its image that may show people."
    )


@dataclass(frozen=True)
class Source:
    """A sensor that is to be opened.

    Attributes:
        name: the user's name for it. None for the sensor's own identity.
        sensor: a name of :func:`enliven_edge.sensors.registry.sensor_names`.
        options: the arguments of its class.
        scene: the scene settings of this sensor alone, or None for the common ones.
    """

    name: str | None
    sensor: str
    options: Mapping[str, Any]
    scene: SceneSettings | None = None


def parse_source(word: str, options: Mapping[str, Any], replay: Mapping[str, Any] | None = None) -> Source:
    """Returns the source of a word of the command line.

    Args:
        word: a sensor's name or the path of a recording, optionally preceded by ``NAME=``.
        options: of the sensor. ``NAME.KEY`` applies to the source of that name only.
        replay: options of recordings only.

    Raises:
        InputError: if it is neither.
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
            mend=sensor_advice(sensor_or_path),
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
    sources: Sequence[Source], stack: contextlib.ExitStack, wait: bool = False
) -> dict[str, Sensor]:
    """Opens the sensors and returns them by identity. They reopen after failing, and ``stack`` closes them.

    Args:
        wait: live sensors may be missing, and are waited for. Sensors without a name are called by their
            kind.

    Raises:
        InputError: if two have the same identity.
        ResourceError: if a device is missing or in use.
    """
    sensors: dict[str, Sensor] = {}
    for source in sources:
        awaited = (source.name or source.sensor) if wait and source.sensor != "replay" else ""
        sensor = stack.enter_context(open_reopening(sensor_opener(source.sensor, **source.options), awaited))
        name = source.name or sensor.name
        if name in sensors:
            raise InputError(
                f"two sensors are called {name!r}",
                where="sensors",
                mend="Name them yourself: left=FIRST right=SECOND.",
            )
        sensors[name] = sensor
    return sensors
