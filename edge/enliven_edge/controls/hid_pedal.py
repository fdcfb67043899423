"""USB and Bluetooth pedals, clickers and panels that are not serial ports, read with hidapi.

A keyboard's report is the boot report (Device Class Definition for HID 1.11, appendix B.1): one byte of
modifiers, one reserved, then up to six key codes (HID Usage Tables, page 7). A panel's report has one bit per
button.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
import threading
from typing import Any, Literal

from enliven.doctor import need
from enliven.errors import InputError
from enliven_edge.controls.base import READ_TIMEOUT_S, Device
from enliven_edge.controls.settings import ControlSettings

_MODIFIERS = ("ctrl", "shift", "alt", "meta", "right ctrl", "right shift", "right alt", "right meta")
_MAX_ERROR_CODE = 3
"""Highest code that reports an error instead of a key. The usual error is roll-over: more keys are pressed
than a report can hold."""
_NAMES = {
    **{4 + i: chr(ord("a") + i) for i in range(26)},
    **{30 + i: str((i + 1) % 10) for i in range(10)},
    **{58 + i: f"f{i + 1}" for i in range(12)},
    0x28: "enter",
    0x29: "escape",
    0x2A: "backspace",
    0x2B: "tab",
    0x2C: "space",
    0x37: ".",
    0x4A: "home",
    0x4B: "page up",
    0x4C: "delete",
    0x4D: "end",
    0x4E: "page down",
    0x4F: "right",
    0x50: "left",
    0x51: "down",
    0x52: "up",
}
"""Name of each key code of a US keyboard (HID Usage Tables, page 7)."""


def keys_down(report: bytes) -> frozenset[str] | None:
    """Returns the pressed keys of a keyboard's report. Returns None if more keys are pressed than a report
    can hold.

    Keys have the names of a US keyboard: a, 1, f5, enter, page down, ... Keys without a name get their code,
    such as 0x65.
    """
    if len(report) < 3:
        return None
    codes = [code for code in report[2:8] if code]
    if any(code <= _MAX_ERROR_CODE for code in codes):
        return None
    modifiers = {name for bit, name in enumerate(_MODIFIERS) if report[0] >> bit & 1}
    return frozenset(modifiers | {_NAMES.get(code, f"0x{code:02x}") for code in codes})


def buttons_down(report: bytes) -> frozenset[str]:
    """Returns the set bits as "byte.bit", both counted from 0: "0.2" is the first byte's third button."""
    return frozenset(
        f"{place}.{bit}" for place, byte in enumerate(report) for bit in range(8) if byte >> bit & 1
    )


class ButtonEdges:
    """Converts reports of pressed keys to the keys that were pressed since the previous report.

    Args:
        report: the content of the reports.
        skip: number of bytes between the report's number and the keys.
        number: the report number (first byte) to read. Other reports, such as those of a clicker's mouse, are
            ignored. If 0, all reports are read, and they have no number.
    """

    def __init__(self, report: Literal["keyboard", "buttons"], skip: int = 0, number: int = 0) -> None:
        self._report, self._skip, self._number = report, skip, number
        self._down: frozenset[str] = frozenset()

    def feed(self, report: bytes) -> list[str]:
        """Returns the names of the keys that were pressed since the previous report. A broken report is
        ignored.
        """
        if self._number and report[:1] != bytes([self._number]):
            return []
        payload = report[self._skip + (self._number > 0) :]
        now = keys_down(payload) if self._report == "keyboard" else buttons_down(payload)
        if now is None:
            return []
        new_keys, self._down = now - self._down, now
        return sorted(new_keys)

    def forget(self) -> None:
        """Resets the state after the device was opened again: no key is down."""
        self._down = frozenset()


_LISTING_LOCK = threading.Lock()
"""Lock for listing devices: hidapi's enumeration is not thread-safe."""
_MAX_REPORT_BYTES = 64
"""Maximum bytes read of a report: the largest report of a full-speed USB device."""
_KEYBOARD_USAGE = (1, 6)
"""Usage page and usage: generic desktop, keyboard."""


class HidPedal(Device):
    """One HID device, found by its vendor and product numbers.

    Raises:
        InputError: if vendor or product is not given.
        ResourceError: if hidapi is not installed.
    """

    def __init__(self, settings: ControlSettings, where: str) -> None:
        if not (settings.vendor and settings.product):
            remedy = "Find both with lsusb: 0c45:7403 means vendor = 0x0c45, product = 0x7403."
            raise InputError(
                "the settings vendor and product of the HID device are missing", where=where, remedy=remedy
            )
        need("hid", "controls", where)
        self._settings = settings
        self._edges = ButtonEdges(settings.report, settings.skip, settings.number)
        self._device: Any = None

    def open(self) -> None:
        """Finds the device and opens it. Keys that were held before count as released.

        Raises:
            OSError: if no such device is connected, or if it cannot be opened, for example without
                permission.
        """
        hid = _import_hidapi()
        self._edges.forget()
        with _LISTING_LOCK:
            device = hid.device()
            device.open_path(self._find_path(hid))
        self._device = device

    def read(self) -> list[str]:
        """Returns the keys that were pressed since the previous report, or no keys if no report arrives in
        time.
        """
        report = bytes(self._device.read(_MAX_REPORT_BYTES, int(READ_TIMEOUT_S * 1000)))
        return self._edges.feed(report) if report else []

    def close(self) -> None:
        """Closes the device if it is open."""
        if self._device is not None:
            self._device.close()
            self._device = None

    def _find_path(self, hid: Any) -> bytes:
        """Returns the path of the requested interface.

        If there are several, an interface that declares itself a keyboard is preferred.

        Raises:
            OSError: if the device is missing.
        """
        wanted_ids = self._settings
        interfaces = hid.enumerate(wanted_ids.vendor, wanted_ids.product)
        if wanted_ids.interface >= 0:
            interfaces = [
                interface for interface in interfaces if interface["interface_number"] == wanted_ids.interface
            ]
        if not interfaces:
            raise OSError(f"no HID device {wanted_ids.vendor:04x}:{wanted_ids.product:04x} is connected")
        if wanted_ids.report == "keyboard":
            interfaces.sort(
                key=lambda interface: (interface["usage_page"], interface["usage"]) != _KEYBOARD_USAGE
            )
        path: bytes = interfaces[0]["path"]
        return path


def _import_hidapi() -> Any:
    """Imports the hidapi variant for the kernel's HID interface if it exists, because it also supports
    Bluetooth.

    Otherwise imports the libusb variant.
    """
    kernel_hid = sys.platform.startswith("linux") and importlib.util.find_spec("hidraw") is not None
    return importlib.import_module("hidraw" if kernel_hid else "hid")
