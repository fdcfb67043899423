"""Reads and writes the poses of the sensors in a TOML file, which people can read and edit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.files import read_file, write_file
from enliven.settings import data_field, load_settings, read_toml, refuse_later_toml

_Row = tuple[float, float, float, float]
_Rows = tuple[_Row, _Row, _Row, _Row]
_UNIT = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
"""Rows of the identity matrix: a sensor is at the world's origin unless the file contains another pose."""


@dataclass(frozen=True)
class Place:
    """The pose of one sensor, and the offset of its clock."""

    world_from_sensor: _Rows = data_field(
        _UNIT, "(4, 4) world pose of the level frame in which the sensor reports bodies."
    )
    world_from_camera: _Rows | None = data_field(
        None, "(4, 4) world pose of the depth camera. Omit this key for a sensor without a depth camera."
    )
    clock_offset_ns: int = data_field(
        0, "Nanoseconds to add to the sensor's clock to match the first sensor's clock."
    )

    @property
    def camera(self) -> Float | None:
        """Returns the transform (4, 4) from camera to world, or None for a sensor that tracks bodies
        itself."""
        return None if self.world_from_camera is None else np.array(self.world_from_camera)

    @property
    def level(self) -> Float:
        """Returns the transform (4, 4) from the sensor's level frame to the world."""
        return np.array(self.world_from_sensor)

    @property
    def eye(self) -> Float:
        """Returns the position (3,) of the sensor's lens in the world, metres. For a sensor without a depth
        camera, it is 1 m above the origin of the sensor.
        """
        camera = self.camera
        return self.level[:3, 3] + [0.0, 1.0, 0.0] if camera is None else camera[:3, 3]


@dataclass(frozen=True)
class Space:
    """The poses of all sensors in one space, by sensor id."""

    sensors: dict[str, Place]


def load_space(path: Path) -> Space:
    """Reads a space from a file that :func:`save_space` wrote.

    Raises:
        InputError: if the file is unreadable, or a matrix is not a rigid transform.
    """
    where = str(path)
    if not path.exists():
        raise InputError(
            "the space file is missing", where=where, remedy="Create the file: enliven calibrate."
        )
    read = read_toml(path)
    sensors = read.get("sensors")
    if not isinstance(sensors, Mapping) or not sensors:
        raise InputError(
            "the space file contains no sensors",
            where=where,
            remedy="Create the file again: enliven calibrate.",
        )
    sensor_places = {}
    for name, values in sensors.items():
        if not isinstance(values, Mapping):
            raise InputError(f"sensors.{name} must be a table", where=where)
        sensor_places[name] = load_settings(Place, values, where=f"{where}, sensor {name}")
        _check_rigid(sensor_places[name].level, f"{where}, sensor {name}")
        camera = sensor_places[name].camera
        if camera is not None:
            _check_rigid(camera, f"{where}, sensor {name}")
    return Space(sensor_places)


def save_space(path: Path, space: Space, remarks: list[str]) -> Path | None:
    """Writes the file atomically, and keeps the previous file next to it.

    Returns:
        The path of the previous file, or None.

    Raises:
        InputError: if the existing file has a later version. It is not changed.
        ResourceError: if the file cannot be written. The existing file is then not changed.
    """
    refuse_later_toml(path)
    old = path.with_name(path.name + ".old") if path.exists() else None
    if old is not None:
        write_file(old, read_file(path))
    write_file(path, _format_space(space, remarks))
    return old


def convert_to_nested_tuples(transform: Float) -> _Rows:
    """Converts an array (4, 4) to nested tuples."""
    a, b, c, d = (tuple(float(v) for v in row) for row in transform)
    return a, b, c, d  # type: ignore[return-value]


def _format_space(space: Space, remarks: list[str]) -> str:
    """Returns the file's text: remarks as comments, and one table per sensor."""
    lines = [f"# {' '.join(remark.split())}" for remark in remarks]
    for name, place in space.sensors.items():
        quoted = name.replace("\\", "\\\\").replace('"', '\\"')
        lines += ["", f'[sensors."{quoted}"]', f"clock_offset_ns = {place.clock_offset_ns}"]
        lines += _format_matrix("world_from_sensor", place.world_from_sensor)
        if place.world_from_camera is not None:
            lines += _format_matrix("world_from_camera", place.world_from_camera)
    return "\n".join(lines) + "\n"


def _format_matrix(key: str, matrix: _Rows) -> list[str]:
    body = [f"  [{', '.join(f'{value!r}' for value in row)}]," for row in matrix]
    return [f"{key} = [", *body, "]"]


def _check_rigid(transform: Float, where: str) -> None:
    """Raises InputError if a matrix is not a rigid transform.

    The check is needed because a typing error in the file would distort all bodies.
    """
    rotation = transform[:3, :3]
    is_invalid = np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-3 or np.linalg.det(rotation) < 0
    if is_invalid or not np.array_equal(transform[3], [0, 0, 0, 1]) or not math.isfinite(transform.sum()):
        raise InputError(
            "a matrix is not a rigid transform", where=where, remedy="Run enliven calibrate again."
        )
