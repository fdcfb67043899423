"""Pedals and button panels on a serial port, such as an Arduino: each press sends a line or a byte."""

from __future__ import annotations

import importlib
from typing import Any

from enliven.doctor import need
from enliven.errors import InputError
from enliven_edge.controls.base import READ_TIMEOUT_S, Device
from enliven_edge.controls.panel_protocol import PanelKeys
from enliven_edge.controls.settings import ControlSettings

_MAX_LINE_BYTES = 64
"""Maximum bytes of a line. A longer line means a wrong baud rate or another device."""


class SerialPedal(Device):
    """One serial port.

    Raises:
        InputError: if no port is named.
        ResourceError: if pyserial is not installed.
    """

    def __init__(self, settings: ControlSettings, where: str) -> None:
        if not settings.port:
            remedy = (
                "Set port, such as port = '/dev/serial/by-id/...'. To list the ports: ls /dev/serial/by-id"
            )
            raise InputError("the serial control has no port", where=where, remedy=remedy)
        need("serial", "controls", where)
        self._settings = settings
        self._port: Any = None
        self._keys: LineKeys | ByteKeys | PanelKeys = LineKeys() if settings.sends == "line" else ByteKeys()

    def open(self) -> None:
        """Opens the port exclusively. An incomplete key of the earlier connection is dropped.

        Raises:
            OSError: if the port does not exist or is in use.
        """
        serial: Any = importlib.import_module("serial")
        self._keys.forget()
        self._port = serial.Serial(
            self._settings.port, self._settings.baud, timeout=READ_TIMEOUT_S, exclusive=True
        )

    def read(self) -> list[str]:
        """Returns keys as soon as the first byte arrives, so that a short press is reported immediately."""
        data = self._port.read(1)
        if data and self._port.in_waiting:
            data += self._port.read(self._port.in_waiting)
        return self._keys.feed(data)

    def close(self) -> None:
        """Closes the port if it is open."""
        if self._port is not None:
            self._port.close()
            self._port = None


class ByteKeys:
    """Reads each byte as a key: its character if printable, else its number such as ``0x1b``."""

    def feed(self, data: bytes) -> list[str]:
        """Returns the keys of received bytes."""
        return [chr(byte) if 0x20 <= byte < 0x7F else f"0x{byte:02x}" for byte in data]

    def forget(self) -> None:
        """Does nothing: a byte is never incomplete."""


class LineKeys:
    """Reads each line as a key, stripped of blanks. Empty lines are ignored."""

    def __init__(self) -> None:
        self._line = bytearray()

    def feed(self, data: bytes) -> list[str]:
        """Returns the lines that have ended, by a carriage return or a line feed or both."""
        keys = []
        for byte in data:
            if byte not in b"\r\n":
                if len(self._line) <= _MAX_LINE_BYTES:
                    self._line.append(byte)
                continue
            key = self._line.decode("ascii", "replace").strip()
            if key and len(self._line) <= _MAX_LINE_BYTES:
                keys.append(key)
            self._line.clear()
        return keys

    def forget(self) -> None:
        """Resets the state after the port was opened again: an incomplete line is dropped."""
        self._line.clear()
