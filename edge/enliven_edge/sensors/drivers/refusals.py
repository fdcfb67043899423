"""Errors of camera libraries that cannot open a camera, as sentences with advice: one table for all.

The pieces of messages are the libraries' own; a test looks for them in the installed libraries, so that an
update that words them anew is noticed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from enliven.errors import ResourceError
from enliven_edge.sensors.attached_cameras import ALLOW, FORBIDDEN, attached

Device = TypeVar("Device")
Sentence = tuple[str, str]
"""What is wrong, and what to do about it."""

_CHECK = "then type: enliven doctor"
IN_USE: Sentence = ("another program uses it", f"Close that program, {_CHECK}")
NOT_ALLOWED: Sentence = (FORBIDDEN, ALLOW)
UNPLUGGED: Sentence = ("it is not there any more", f"Plug it in again, {_CHECK}")
BROKEN_LINK: Sentence = (
    "its link broke",
    "Use another USB 3 cable and port; a camera on a hub may need a power supply of its own.",
)
NOT_BACK: Sentence = (
    "it does not come back after its firmware was loaded",
    f"Use another USB 3 cable and port; on Linux it needs the project's udev rules: {_CHECK}",
)
NO_PAIR: Sentence = ("it has no pair of cameras for depth", "Use an OAK-D, which has one.")
NOT_OPENED: Sentence = (
    "it cannot be opened",
    f"Close what else uses it, and see whether your user may open it: {_CHECK}",
)
NO_MODE: Sentence = (
    "it has no such images on this port",
    "Use a USB 3 port and cable; else ask for a smaller image or fewer images a second.",
)
REHEARSE = "Rehearse with another recording: --set rehearse=OTHER.mcap; enliven inspect says what is in one."
"""The advice where no device is found."""

SAID: dict[str, tuple[tuple[str, Sentence], ...]] = {
    "oak": (
        ("it is used by another process", IN_USE),
        ("connected, but in use", IN_USE),
        ("X_LINK_DEVICE_ALREADY_IN_USE", IN_USE),
        ("Insufficient permissions", NOT_ALLOWED),
        ("X_LINK_INSUFFICIENT_PERMISSIONS", NOT_ALLOWED),
        ("Failed to find device after booting", NOT_BACK),
        ("does not have stereo pair available", NO_PAIR),
        ("Failed to boot device!", BROKEN_LINK),
        ("Failed to connect to device", BROKEN_LINK),
        ("Couldn't open stream", BROKEN_LINK),
        ("Couldn't read data from stream", BROKEN_LINK),
        ("Device already closed or disconnected", BROKEN_LINK),
        ("Failed to find device", UNPLUGGED),
        ("Cannot find any device with given deviceInfo", UNPLUGGED),
    ),
    "realsense": (
        ("RS2_USB_STATUS_ACCESS", NOT_ALLOWED),
        ("RS2_USB_STATUS_BUSY", IN_USE),
        ("Resource busy", IN_USE),
        ("RS2_USB_STATUS_NO_DEVICE", UNPLUGGED),
        ("Couldn't resolve requests", NO_MODE),
        ("Device disconnected", UNPLUGGED),
        ("UVC sensor is not alive", UNPLUGGED),
        ("acquire_power failed", BROKEN_LINK),
    ),
    "orbbec": (
        ("Access denied (insufficient permissions)", NOT_ALLOWED),
        ("No such device (it may have been disconnected)", UNPLUGGED),
        ("Device is deactivated", UNPLUGGED),
        ("Resource busy", IN_USE),
        ("usbEnumerator openUsbDevice failed!", NOT_OPENED),
    ),
}
"""By sensor: a part of a library's message, and its meaning; the first match counts."""

SYSTEM: tuple[tuple[str, Sentence], ...] = (
    ("Permission denied", NOT_ALLOWED),
    ("Operation not permitted", NOT_ALLOWED),
    ("Device or resource busy", IN_USE),
    ("No such device", UNPLUGGED),
    ("No such file or directory", UNPLUGGED),
)
"""Parts of the system's messages, which libraries pass on; for every sensor, after its own."""


def refused(sensor: str, error: Exception, where: str = "", rehearsed: bool = False) -> ResourceError:
    """A library's error as one of enliven's, with the library's own message where that is not known.

    Args:
        sensor: the driver's name, such as "oak".
        where: the device, where it is known.
        rehearsed: a recording is played, so that no cable, port or other program is at fault.
    """
    said, where = in_a_line(error), where or f"sensor {sensor}"
    if rehearsed:
        return ResourceError(f"its library does not play the recording ({said})", where=where, mend=REHEARSE)
    for piece, (what, mend) in (*SAID.get(sensor, ()), *SYSTEM):
        if piece in said:
            return ResourceError(what, where=where, mend=mend)
    return ResourceError(
        f"it cannot be used ({said})", where=where, mend=f"Unplug it once and plug it in again, {_CHECK}"
    )


def in_a_line(error: Exception) -> str:
    """The message of an error, in one line without a full stop."""
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__


def chosen(
    sensor: str, make: str, found: Mapping[str, Device], wanted: str, option: str, before: str = ""
) -> Device:
    """The wanted device, or the only one.

    Args:
        make: what people call a device of this kind, with its article.
        found: the connected devices by identity.
        wanted: the identity that was asked for; empty: none.
        option: the option by which it is asked for.
        before: the identity of the one that was open last, which goes before others.

    Raises:
        ResourceError: where it is not there, or there are several and none was named.
    """
    if not found:
        raise _absent(sensor, f"{make} called {wanted}" if wanted else make)
    if wanted:
        if wanted in found:
            return found[wanted]
        mend = f"Connected: {', '.join(found)}. Give one of them: --set {option}={next(iter(found))}"
        raise ResourceError(f"{make} called {wanted} is not connected", where=f"sensor {sensor}", mend=mend)
    if len(found) > 1 and before not in found:
        first, second, *_ = found
        mend = (
            f"Name the one you mean: --set {option}={first}. Two at once: --sensor left={sensor} "
            f"--sensor right={sensor} --set left.{option}={first} --set right.{option}={second}"
        )
        what = f"{len(found)} are connected: {', '.join(found)}"
        raise ResourceError(what, where=f"sensor {sensor}", mend=mend)
    return found.get(before) or next(iter(found.values()))


def _absent(sensor: str, which: str) -> ResourceError:
    """The error of a library that finds no device; the system may know more."""
    where = f"sensor {sensor}"
    for camera in attached():
        if camera.kind.sensor == sensor:
            troubles = dict(camera.troubles())
            if FORBIDDEN in troubles:
                return ResourceError(f"{camera.title}: {FORBIDDEN}", where=where, mend=ALLOW)
            what = f"{camera.title} is plugged in, but its library does not find it"
            mend = f"Close what else uses it; else unplug it once and plug it in again, {_CHECK}"
            return ResourceError(what, where=where, mend=mend)
    return ResourceError(
        f"{which} is not connected",
        where=where,
        mend=f"Plug it into a USB 3 port, see with enliven doctor that it is there, and type: "
        f"enliven run --sensor {sensor}",
    )
