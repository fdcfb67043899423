"""HID devices created by the kernel's uhid. Everything above the kernel's HID core treats them as real."""

from __future__ import annotations

import os
import select
import struct
from dataclasses import dataclass

USB, BLUETOOTH = 3, 5
"""Bus numbers of the kernel."""
_DESTROY, _START, _OPEN, _CLOSE, _CREATE, _INPUT = 1, 2, 4, 5, 11, 12
_EVENT = 4380
"""Size of a struct uhid_event, bytes."""


@dataclass(frozen=True)
class Kind:
    """A model of device: its numbers, its name, and its report descriptor."""

    name: str
    vendor: int
    product: int
    descriptor: bytes
    bus: int = USB


def _items(text: str) -> bytes:
    return bytes.fromhex("".join(line.split("#")[0] for line in text.splitlines()))


_KEYS = """
    05 01 09 06 a1 01                               # generic desktop, keyboard, application
    {number}
    05 07 19 e0 29 e7 15 00 25 01 75 01 95 08 81 02 # eight modifiers
    95 01 75 08 81 01                               # a reserved byte
    95 06 75 08 15 00 26 ff 00 05 07 19 00 29 ff 81 00  # six key codes
    c0
"""
FOOT_SWITCH = Kind("PCsensor FootSwitch", 0x0C45, 0x7403, _items(_KEYS.format(number="")))
"""A foot switch that is a keyboard with the boot report."""

CLICKER = Kind(
    "Logitech USB Receiver",
    0x046D,
    0xC540,
    _items(
        _KEYS.format(number="85 01")
        + """
    05 01 09 02 a1 01 85 02 09 01 a1 00             # a mouse, report 2
    05 09 19 01 29 03 15 00 25 01 95 03 75 01 81 02 95 01 75 05 81 01
    05 01 09 30 09 31 15 81 25 7f 75 08 95 02 81 06 c0 c0
    05 0c 09 01 a1 01 85 03 15 00 26 ff 03 19 00 2a ff 03 75 10 95 01 81 00 c0  # media keys, report 3
    """
    ),
)
"""A presenter's clicker: keyboard, mouse and media keys behind one node, each with its own report number."""

JOYSTICK = Kind(
    "Foot pedals",
    0x1D50,
    0x5055,
    _items("05 01 09 04 a1 01 05 09 19 01 29 08 15 00 25 01 75 01 95 08 81 02 c0"),
)
"""A joystick without axes: eight buttons, one bit each."""

OWN = Kind(
    "Programmable panel",
    0x1209,
    0xE001,
    _items("06 00 ff 09 01 a1 01 09 02 15 00 26 ff 00 75 08 95 08 81 02 c0"),
    BLUETOOTH,
)
"""A Bluetooth device with eight vendor-defined bytes."""


class HidDevice:
    """A device, plugged in on creation."""

    def __init__(self, kind: Kind, serial: str = "") -> None:
        self._file = os.open("/dev/uhid", os.O_RDWR | os.O_CLOEXEC)
        head = struct.pack(
            "<I128s64s64sHHIIII",
            _CREATE,
            kind.name.encode(),
            b"guest",
            serial.encode(),
            len(kind.descriptor),
            kind.bus,
            kind.vendor,
            kind.product,
            0x100,
            0,
        )
        os.write(self._file, head + kind.descriptor.ljust(4096, b"\0"))

    def send(self, report: bytes) -> None:
        """Sends one report from the device."""
        os.write(self._file, struct.pack("<IH", _INPUT, len(report)) + report.ljust(4096, b"\0"))

    def opened(self) -> int:
        """Returns the number of opens minus closes since the last call, by any driver or program."""
        count = 0
        while select.select([self._file], [], [], 0)[0]:
            (event,) = struct.unpack_from("<I", os.read(self._file, _EVENT))
            count += (event == _OPEN) - (event == _CLOSE)
        return count

    def unplug(self) -> None:
        """Pulls it out; a second call does nothing."""
        if self._file >= 0:
            os.write(self._file, struct.pack("<I", _DESTROY))
            os.close(self._file)
            self._file = -1
