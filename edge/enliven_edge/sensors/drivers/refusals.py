"""Converts error messages of camera libraries that cannot open a camera to sentences with advice.

The sentences are in ``refusals.toml``.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from importlib.resources import files
from typing import TypeVar

from enliven.errors import ResourceError
from enliven_edge.sensors.attached_cameras import ALLOW, FORBIDDEN, list_attached

Device = TypeVar("Device")
Sentence = tuple[str, str]
"""A problem and its remedy."""
_CONNECTION_ADVICE = "then type: enliven doctor"
REHEARSE = (
    "Rehearse with another recording: --set rehearse=OTHER.mcap. enliven inspect lists the contents of a "
    "recording."
)
"""The advice if no device is found."""


def _read() -> dict[str, tuple[tuple[str, Sentence], ...]]:
    """Returns the table of the file: message parts and sentences by sensor, and for "system"."""
    table = tomllib.loads(files(__package__).joinpath("refusals.toml").read_text("utf-8"))
    sentences = {
        name: (sentence["what"], sentence["remedy"]) for name, sentence in table.pop("sentences").items()
    }
    sentences["not allowed"] = (FORBIDDEN, ALLOW)
    return {
        sensor: tuple((piece, sentences[name]) for piece, name in names_by_piece.items())
        for sensor, names_by_piece in table.items()
    }


LIBRARY_MESSAGES = _read()
"""Parts of a library's messages, and their meaning, by sensor. The first match is used."""
SYSTEM_MESSAGES = LIBRARY_MESSAGES.pop("system")
"""Parts of the operating system's messages, and their meaning.

Libraries pass these messages on. They apply to every sensor, after the sensor's own entries."""


def convert_error(sensor: str, error: Exception, where: str = "", rehearsed: bool = False) -> ResourceError:
    """Converts a library's error to one of enliven's. An unknown error keeps the library's own message.

    Args:
        sensor: the driver's name, such as "oak".
        where: the device, if it is known.
        rehearsed: True if a recording is played. The cause is then no cable, port or other program.
    """
    message, where = make_one_line_message(error), where or f"sensor {sensor}"
    if rehearsed:
        return ResourceError(
            f"the library of the camera cannot play the recording ({message})", where=where, remedy=REHEARSE
        )
    for piece, (problem, remedy) in (*LIBRARY_MESSAGES.get(sensor, ()), *SYSTEM_MESSAGES):
        if piece in message:
            return ResourceError(problem, where=where, remedy=remedy)
    return ResourceError(
        f"the camera cannot be used ({message})",
        where=where,
        remedy=f"Unplug the camera and plug it in again, {_CONNECTION_ADVICE}",
    )


def make_one_line_message(error: Exception) -> str:
    """Returns the message of an error in one line, without a full stop."""
    return " ".join(str(error).split()).rstrip(".") or "the reason is unknown"


def choose_device(
    sensor: str,
    common_name: str,
    devices: Mapping[str, Device],
    requested_name: str,
    option: str,
    last_name: str = "",
) -> Device:
    """Returns the requested device, or the only one.

    Args:
        common_name: the common name of a device of this kind, with its article.
        devices: the connected devices by identity.
        requested_name: the requested identity; empty if none is requested.
        option: the name of the option that requests it.
        last_name: the identity of the device that was open last, which is preferred.

    Raises:
        ResourceError: if it is missing, or there are several and none was named.
    """
    if not devices:
        raise _make_missing_device_error(
            sensor, f"{common_name} called {requested_name}" if requested_name else common_name
        )
    if requested_name:
        if requested_name in devices:
            return devices[requested_name]
        remedy = f"Connected: {', '.join(devices)}. Choose one: --set {option}={next(iter(devices))}"
        raise ResourceError(
            f"{common_name} called {requested_name} is not connected", where=f"sensor {sensor}", remedy=remedy
        )
    if len(devices) > 1 and last_name not in devices:
        first, second, *_ = devices
        remedy = (
            f"Choose one: --set {option}={first}. To use two at once: --sensor left={sensor} --sensor "
            f"right={sensor} --set left.{option}={first} --set right.{option}={second}"
        )
        problem = f"{len(devices)} cameras are connected: {', '.join(devices)}"
        raise ResourceError(problem, where=f"sensor {sensor}", remedy=remedy)
    return devices.get(last_name) or next(iter(devices.values()))


def _make_missing_device_error(sensor: str, which: str) -> ResourceError:
    """Returns the error for the case that a library finds no device, with details that the system reports."""
    where = f"sensor {sensor}"
    for camera in list_attached():
        if camera.kind.sensor == sensor:
            problems = dict(camera.find_problems())
            if FORBIDDEN in problems:
                return ResourceError(f"{camera.title}: {FORBIDDEN}", where=where, remedy=ALLOW)
            problem = f"{camera.title} is plugged in, but the library of the camera does not find it"
            remedy = (
                "Close other programs that use the camera. If this does not help, unplug the camera and "
                f"plug it in again, {_CONNECTION_ADVICE}"
            )
            return ResourceError(problem, where=where, remedy=remedy)
    return ResourceError(
        f"{which} is not connected",
        where=where,
        remedy="Plug the camera into a USB 3 port, check with enliven doctor that it is connected, and "
        f"type: enliven run --sensor {sensor}",
    )
