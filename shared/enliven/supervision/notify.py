"""Reports to a supervisor that a program is ready or makes progress, by the protocol of systemd's
``sd_notify``.

A supervisor restarts a program that is silent for too long. So a program must only report progress that a
visitor could see. Examples are a frame that was read *and* published, or a picture that was drawn *and*
differs from the previous picture. A timer that reports progress would keep a frozen program alive.

Both systemd and ``enliven kiosk`` use this protocol. ``enliven kiosk`` supervises programs on machines
without systemd.
"""

from __future__ import annotations

import contextlib
import os
import socket
import time
from collections.abc import Mapping

SOCKET_VARIABLE = "NOTIFY_SOCKET"
"""Environment variable with the address of the supervisor's datagram socket. An address that starts with "@"
is an abstract socket name.
"""
WATCHDOG_VARIABLE = "WATCHDOG_USEC"
"""Environment variable with the time in microseconds after which the supervisor restarts a silent program."""
MAX_NOTIFICATION_BYTES = 4096
"""Maximum size of one notification in bytes."""
_MIN_INTERVAL_S = 0.5
"""Minimum time between two reports of progress, in seconds. A watchdog waits for several seconds, so more
frequent reports would only cost system calls."""


class Notifier:
    """Reports to the supervisor that started this program. Without a supervisor it does nothing.

    A supervisor that has ended or is busy never delays the program, because reports are dropped.

    Args:
        address: the supervisor's socket. None reads :data:`SOCKET_VARIABLE`.
    """

    def __init__(self, address: str | None = None) -> None:
        self._address = os.environ.get(SOCKET_VARIABLE, "") if address is None else address
        self._socket: socket.socket | None = None
        self._reported_at = -_MIN_INTERVAL_S
        if self._address and hasattr(socket, "AF_UNIX"):
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.setblocking(False)

    @property
    def is_supervised(self) -> bool:
        """True if a supervisor receives this program's reports."""
        return self._socket is not None

    def report_ready(self, status: str = "") -> None:
        """Reports that the program has started. ``status`` is a sentence for operators."""
        self._send_fields(READY="1", STATUS=_join_lines(status))

    def report_progress(self, status: str = "") -> None:
        """Reports visible progress, at most twice per second. Call it after every frame or picture."""
        now = time.monotonic()
        if now - self._reported_at < _MIN_INTERVAL_S:
            return
        self._reported_at = now
        self._send_fields(WATCHDOG="1", STATUS=_join_lines(status))

    def report_status(self, status: str) -> None:
        """Reports a sentence for operators. It does not count as progress."""
        self._send_fields(STATUS=_join_lines(status))

    def extend_timeout(self, seconds: float) -> None:
        """Requests more time until :meth:`report_ready`, for example because kernels are compiled or the
        camera is not ready."""
        self._send_fields(EXTEND_TIMEOUT_USEC=str(round(seconds * 1e6)))

    def report_stopping(self) -> None:
        """Reports that the program ends intentionally."""
        self._send_fields(STOPPING="1")

    def close(self) -> None:
        """Closes the connection to the supervisor."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send_fields(self, **fields: str) -> None:
        """Sends the fields that are not empty as one notification. Drops it if the supervisor does not
        read."""
        if self._socket is None:
            return
        text = "\n".join(f"{key}={value}" for key, value in fields.items() if value)
        address = "\0" + self._address[1:] if self._address.startswith("@") else self._address
        with contextlib.suppress(OSError):
            self._socket.sendto(text.encode()[:MAX_NOTIFICATION_BYTES], address)


def read_notification(data: bytes) -> Mapping[str, str]:
    """Returns the fields of a notification. Like systemd, ignores lines without "="."""
    lines = data.decode("utf-8", "replace").splitlines()
    return {key: value for key, separator, value in (line.partition("=") for line in lines) if separator}


def _join_lines(text: str) -> str:
    """Returns a text without line breaks, which would begin another field."""
    return " ".join(text.split())
