"""USB and Bluetooth pedals, clickers and panels that are no serial port, by hidapi."""

from __future__ import annotations

import importlib
import importlib.util
import sys
import threading
from typing import Any

from enliven.errors import InputError
from enliven_edge.controls.base import PATIENCE, Device
from enliven_edge.controls.hid_reports import Edges
from enliven_edge.controls.settings import ControlSettings
from enliven_edge.extras import need

_OPENING = threading.Lock()
"""Held while devices are listed: hidapi's list is not safe for two threads at once."""
_LONGEST_REPORT = 64
"""Bytes of a report that are read: the most that USB's full speed sends in one."""
_KEYBOARD = (1, 6)
"""Usage page and usage: generic desktop, keyboard."""


class HidPedal(Device):
    """One HID device, found by its vendor and product numbers.

    Raises:
        InputError: where it has no vendor and product.
        ResourceError: where hidapi is not installed.
    """

    def __init__(self, settings: ControlSettings, where: str) -> None:
        if not (settings.vendor and settings.product):
            mend = "lsusb lists them: 0c45:7403 is vendor = 0x0c45, product = 0x7403."
            raise InputError("a HID control needs its vendor and product", where=where, mend=mend)
        need("hid", "controls", where)
        self._settings = settings
        self._edges = Edges(settings.report, settings.skip, settings.number)
        self._device: Any = None

    def open(self) -> None:
        hid = _library()
        self._edges.forget()
        with _OPENING:
            device = hid.device()
            device.open_path(self._path(hid))
        self._device = device

    def read(self) -> list[str]:
        report = bytes(self._device.read(_LONGEST_REPORT, int(PATIENCE * 1000)))
        return self._edges.feed(report) if report else []

    def close(self) -> None:
        if self._device is not None:
            self._device.close()
            self._device = None

    def _path(self, hid: Any) -> bytes:
        """Returns the path of the wanted interface; of several, one that declares itself a keyboard.

        Raises:
            OSError: where there is none.
        """
        chosen = self._settings
        found = hid.enumerate(chosen.vendor, chosen.product)
        if chosen.interface >= 0:
            found = [one for one in found if one["interface_number"] == chosen.interface]
        if not found:
            raise OSError(f"no HID device {chosen.vendor:04x}:{chosen.product:04x}")
        if chosen.report == "keyboard":
            found.sort(key=lambda one: (one["usage_page"], one["usage"]) != _KEYBOARD)
        path: bytes = found[0]["path"]
        return path


def _library() -> Any:
    """Imports the kernel's own HID interface where it exists, which supports Bluetooth too; else libusb's."""
    raw = sys.platform.startswith("linux") and importlib.util.find_spec("hidraw") is not None
    return importlib.import_module("hidraw" if raw else "hid")
