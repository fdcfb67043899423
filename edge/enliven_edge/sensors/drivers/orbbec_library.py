"""Orbbec's library and the cameras that it finds."""

from __future__ import annotations

import ipaddress
import tempfile
from typing import Any

from enliven.errors import InputError, ResourceError
from enliven_edge.sensors.attached_cameras import import_library
from enliven_edge.sensors.drivers.refusals import choose_device, convert_error

_PORT = 8090
"""The network port of Orbbec's cameras."""
_MIN_SDK_VERSION = (2, 0)
"""Minimum version of OrbbecSDK. Version 1 has another interface."""
_MODES_SHOWN = 8
"""Maximum number of modes that an error message lists."""


def orbbec_library() -> Any:
    """Imports pyorbbecsdk, and turns off its log files."""
    ob = import_library("pyorbbecsdk", "orbbec", "--no-deps pyorbbecsdk2")
    sdk_version = (
        tuple(int(part) for part in ob.get_version().split(".")[:2]) if hasattr(ob, "get_version") else (0,)
    )
    if sdk_version < _MIN_SDK_VERSION:
        problem = f"pyorbbecsdk has version {'.'.join(map(str, sdk_version))}, which is not supported"
        remedy = "Type: pip uninstall pyorbbecsdk; pip install --no-deps pyorbbecsdk2"
        raise ResourceError(problem, where="sensor orbbec", remedy=remedy)
    ob.Context.set_logger_to_file(ob.OBLogLevel.NONE, tempfile.gettempdir())
    ob.Context.set_logger_to_console(ob.OBLogLevel.ERROR)
    return ob


def open_device(ob: Any, context: Any, requested_name: str, last_serial: str = "") -> Any:
    """Opens a camera by its serial number, name, USB path or network address.

    If no name is given, opens the only camera.

    Args:
        last_serial: the serial number of the camera that was open last, which is preferred.

    Raises:
        ResourceError: if it is missing or cannot be opened, or there are several and none was named.
    """
    try:
        listed = context.query_devices()
        all_names = [_accepted_names(listed, index) for index in range(len(listed))]
        # If the user has no permission to open a camera, the camera has no serial number.
        indices = {names[0] or names[2]: index for index, names in enumerate(all_names)}
        matching = {
            name: index for name, index in indices.items() if requested_name in ("", *all_names[index])
        }
        if not matching and _is_address(requested_name):
            return context.create_net_device(requested_name, _PORT)
        index = choose_device(
            "orbbec",
            "an Orbbec camera",
            matching or indices,
            "" if matching else requested_name,
            "device",
            last_serial,
        )
        return listed.get_device_by_index(index)
    except ob.OBError as error:
        raise convert_error("orbbec", error, f"sensor orbbec {requested_name}".rstrip()) from None


def depth_mode(ob: Any, pipeline: Any, mode: tuple[int, int, int], name: str) -> Any:
    """Returns the depth stream of a width, height and rate.

    0 matches any value, and the camera's default is preferred.

    Raises:
        InputError: if no such mode exists. The message lists the nearest ones.
    """
    listed = pipeline.get_stream_profile_list(ob.OBSensorType.DEPTH_SENSOR)
    modes: dict[tuple[int, int, int], Any] = {}
    for profile in (listed.get_default_video_stream_profile(), *(listed[i] for i in range(len(listed)))):
        if profile.get_format() in (ob.OBFormat.Y16, ob.OBFormat.Z16):
            video = profile.as_video_stream_profile()
            modes.setdefault((video.get_width(), video.get_height(), video.get_fps()), video)
    for offered, profile in modes.items():
        if all(not want or want == has for want, has in zip(mode, offered, strict=True)):
            return profile
    near = sorted(modes, key=lambda m: sum(abs(a - b) for a, b in zip(m, mode, strict=True) if b))
    alternatives = ", ".join(f"{w}x{h} at {fps}" for w, h, fps in near[:_MODES_SHOWN])
    raise InputError(
        f"the camera has no depth of {mode[0]}x{mode[1]} at {mode[2]} images a second on this port",
        where=name,
        remedy=f"Modes on this port: {alternatives}. 0 accepts any value. USB 3 offers more modes than USB "
        "2.",
    )


def _accepted_names(listed: Any, index: int) -> list[str]:
    """Returns the accepted names of a connected camera, its serial number first."""
    ask = ("serial_number", "name", "uid", "ip_address", "user_name")
    return [getattr(listed, f"get_device_{word}_by_index")(index) for word in ask]


def _is_address(word: str) -> bool:
    try:
        ipaddress.ip_address(word)
    except ValueError:
        return False
    return True
