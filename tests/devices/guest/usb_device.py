"""USB devices created by the kernel's vhci_hcd: a program plays the device, and the kernel treats it as real.

The protocol is USB/IP, as described in Linux' Documentation/usb/usbip_protocol.rst. Descriptors follow USB
2.0 chapter 9 and, for a device on USB 3, of USB 3.2 chapter 9.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

HIGH, SUPER = 3, 5
"""Speed numbers of the kernel: USB 2 with 480 Mbit/s, USB 3 with 5000."""
_HUB = Path("/sys/devices/platform/vhci_hcd.0")
_FIRST_SUPER = 15
"""Ports before this one are USB 2's, the others USB 3's (CONFIG_USBIP_VHCI_HC_PORTS)."""
_SUBMIT, _UNLINK = 1, 2
_DONE, _UNLINKED = 3, 4
_STALL, _RESET = -32, -104
"""EPIPE means that the device refused; ECONNRESET means that a transfer was cancelled."""
_HEAD = struct.Struct(">5I5i8s")
_REPLY_HEAD = struct.Struct(">5I5i8x")


@dataclass(frozen=True)
class Kind:
    """A model of device: its numbers, its name, its speed, and its only interface."""

    vendor: int
    product: int
    title: str
    maker: str = "Maker"
    serial: str = ""
    speed: int = HIGH
    interfaces: tuple[bytes, ...] = field(default=(bytes([9, 4, 0, 0, 0, 255, 0, 0, 0]),))
    more: dict[int, bytes] = field(default_factory=dict)
    """Class-specific descriptors by type, such as HID's report descriptor."""


class UsbDevice:
    """A device, plugged in on creation.

    Attributes:
        heard: callback with an endpoint and the bytes received on it.
    """

    def __init__(self, kind: Kind, port: int = 0) -> None:
        self._kind, self._port = kind, port + (_FIRST_SUPER if kind.speed >= SUPER else 0)
        self.heard: Callable[[int, bytes], None] = lambda endpoint, data: None
        self._asked: dict[int, deque[tuple[int, int]]] = {}
        self._to_say: dict[int, deque[bytes]] = {}
        self._lock = threading.Lock()
        self._link, kernel = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        with kernel:
            words = f"{self._port} {kernel.fileno()} {port + 1} {kind.speed}"
            (_HUB / "attach").write_text(words)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def send(self, endpoint: int, data: bytes) -> None:
        """Sends bytes on an IN endpoint: to the waiting transfer, or to the next one."""
        with self._lock:
            waiting = self._asked.get(endpoint)
            if waiting:
                number, size = waiting.popleft()
                self._reply(number, data[:size])
            else:
                self._to_say.setdefault(endpoint, deque()).append(data)

    def unplug(self) -> None:
        """Pulls it out; a second call does nothing."""
        with contextlib.suppress(OSError):
            (_HUB / "detach").write_text(str(self._port))
        self._thread.join(5.0)
        self._link.close()

    def _serve(self) -> None:
        """Answers requests until the kernel disconnects."""
        with contextlib.suppress(OSError, EOFError):
            while True:
                head = _HEAD.unpack(self._take(_HEAD.size))
                word, number, _, inward, endpoint, first, size, _, _, _, setup = head
                if word == _UNLINK:
                    self._take_back(number, first)
                    continue
                data = b"" if inward else self._take(size)
                self._transfer(number, bool(inward), endpoint, size, setup, data)

    def _transfer(
        self, number: int, inward: bool, endpoint: int, size: int, setup: bytes, data: bytes
    ) -> None:
        with self._lock:
            if endpoint == 0:
                answer = self._control(setup)
                self._reply(
                    number,
                    (answer or b"")[:size] if inward else b"",
                    _STALL if answer is None else 0,
                    len(data),
                )
            elif not inward:
                self._reply(number, b"", 0, len(data))
            elif self._to_say.get(endpoint):
                self._reply(number, self._to_say[endpoint].popleft()[:size])
            else:
                self._asked.setdefault(endpoint, deque()).append((number, size))
        if endpoint and not inward:
            self.heard(endpoint, data)

    def _control(self, setup: bytes) -> bytes | None:
        """Returns the answer to a control request; None refuses it."""
        kind, request, value, _, _ = struct.unpack("<BBHHH", setup)
        if request == 6 and kind & 0x80:
            return self._descriptor(value >> 8, value & 0xFF)
        if request == 0 and kind & 0x80:
            return bytes(2)
        return b""

    def _descriptor(self, which: int, index: int) -> bytes | None:
        kind = self._kind
        fast = kind.speed >= SUPER
        if which == 1:
            version, packet = (0x320, 9) if fast else (0x200, 64)
            has_serial = 3 if kind.serial else 0
            return struct.pack(
                "<BBHBBBBHHHBBBB",
                18,
                1,
                version,
                0,
                0,
                0,
                packet,
                kind.vendor,
                kind.product,
                0x100,
                1,
                2,
                has_serial,
                1,
            )
        if which == 2:
            body = b"".join(kind.interfaces)
            count = len({part[2] for part in _parts(body) if part[1] == 4})
            return struct.pack("<BBHBBBBB", 9, 2, 9 + len(body), count, 1, 0, 0x80, 50) + body
        if which == 3:
            texts = ["", kind.maker, kind.title, kind.serial]
            body = struct.pack("<H", 0x409) if index == 0 else texts[index].encode("utf-16-le")
            return bytes([2 + len(body), 3]) + body
        if which == 15 and fast:
            power = struct.pack("<BBBI", 7, 16, 2, 2)
            link = struct.pack("<BBBBHBBH", 10, 16, 3, 0, 0b1110, 3, 10, 0)
            return struct.pack("<BBHB", 5, 15, 5 + len(power + link), 2) + power + link
        return kind.more.get(which)

    def _take_back(self, number: int, taken: int) -> None:
        """Cancels a transfer."""
        with self._lock:
            is_pending = False
            for waiting in self._asked.values():
                for asked in list(waiting):
                    if asked[0] == taken:
                        waiting.remove(asked)
                        is_pending = True
            self._link.sendall(
                _REPLY_HEAD.pack(_UNLINKED, number, 0, 0, 0, _RESET if is_pending else 0, 0, 0, 0, 0)
            )

    def _reply(self, number: int, data: bytes, status: int = 0, taken: int = 0) -> None:
        head = _REPLY_HEAD.pack(_DONE, number, 0, 0, 0, status, len(data) or taken, 0, 0, 0)
        with contextlib.suppress(OSError):
            self._link.sendall(head + data)

    def _take(self, count: int) -> bytes:
        """Reads ``count`` bytes.

        Raises:
            EOFError: if the kernel disconnected.
        """
        data = b""
        while len(data) < count:
            more = self._link.recv(count - len(data))
            if not more:
                raise EOFError
            data += more
        return data


def _parts(body: bytes) -> list[bytes]:
    """Splits bytes into the consecutive descriptors that they contain."""
    parts = []
    while body:
        parts.append(body[: body[0]])
        body = body[body[0] :]
    return parts
