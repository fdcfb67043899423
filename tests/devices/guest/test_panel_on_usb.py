"""Tests of a button panel on a USB serial port, plugged and unplugged, with the kernel's own driver on
virtual USB.

The panel is simulated here as docs/panel.md describes it; tests/devices runs the firmware itself.
"""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from as_user import SLOW, Listener
from usb_device import HIGH, Kind, UsbDevice

from enliven_edge.controls.panel_protocol import GREETING_REQUEST, VERSION, Decoder, encode

BY_ID = Path("/dev/serial/by-id")
PORT = Kind(
    0x2341,
    0x0043,
    "Uno",
    "Arduino",
    "85430",
    HIGH,
    (
        bytes([9, 4, 0, 0, 1, 2, 2, 1, 0, 5, 36, 0, 0x10, 1, 5, 36, 1, 0, 1, 4, 36, 2, 2, 5, 36, 6, 0, 1]),
        bytes([7, 5, 0x81, 3, 8, 0, 9]),
        bytes([9, 4, 1, 0, 2, 10, 0, 0, 0, 7, 5, 0x02, 2, 0, 2, 0, 7, 5, 0x82, 2, 0, 2, 0]),
    ),
)
"""A CDC-ACM serial port like that of an Arduino Uno: notifications on endpoint 1, data on endpoint 2."""
TIMES = 10
BACK = 5.0
"""Time from udev's creation of the port until the panel is heard, seconds: a check every 0.5 s, and its
greeting."""


class Panel:
    """A panel with three buttons on its own USB port, which records the lamp commands it receives."""

    def __init__(self) -> None:
        self.lamps = ""
        self._decoder, self._began = Decoder(), time.monotonic()
        self._counts = [0, 0, 0]
        self._gone = threading.Event()
        self._device = UsbDevice(PORT)
        self._device.heard = self._hear
        self._say(f"H{VERSION}P")
        self._thread = threading.Thread(target=self._beat, daemon=True)
        self._thread.start()

    def press(self, button: int) -> None:
        self._counts[button - 1] += 1
        self._say_counts()

    def unplug(self) -> None:
        self._gone.set()
        self._thread.join(5.0)
        self._device.unplug()

    def _beat(self) -> None:
        while not self._gone.wait(0.25):
            self._say_counts()

    def _hear(self, endpoint: int, data: bytes) -> None:
        for body in self._decoder.feed(data):
            if body == GREETING_REQUEST:
                self._say(f"H{VERSION}P")
            self.lamps = body if body.startswith("L") else self.lamps

    def _say_counts(self) -> None:
        beats = int((time.monotonic() - self._began) * 4) % 0x10000
        self._say(f"P{beats:04X}" + "".join(f"{count % 16:X}" for count in self._counts))

    def _say(self, body: str) -> None:
        self._device.send(2, encode(body))


def appeared() -> Path:
    """Returns the stable name of the port, as soon as udev has created it for its users."""
    deadline = time.monotonic() + SLOW
    while not (BY_ID.exists() and any(BY_ID.iterdir())):
        assert time.monotonic() < deadline, "the port is not there"
        time.sleep(0.02)
    return next(iter(BY_ID.iterdir()))


def test_panel_is_heard_after_each_replugging():
    subprocess.run(["modprobe", "vhci_hcd"], check=True)
    panel = Panel()
    port = appeared()
    control = {"kind": "serial", "port": str(port), "baud": 38400, "sends": "panel", "debounce": 0.0}
    words = {"1": "possess", "2": "release", "3": "next"}
    waits, held = [], []
    with Listener({"panel": {**control, "map": words}}) as listener:
        for _ in range(TIMES):
            plugged = time.monotonic()
            listener.until(lambda: listener.there, "the panel")
            waits.append(time.monotonic() - plugged)
            listener.words.clear()
            for button in (1, 2, 3, 3):
                panel.press(button)
            listener.until(lambda: len(listener.words) >= 4, "four presses")
            listener.until(lambda: panel.lamps == "L-S--", "the lamps")  # noqa: B023
            panel.unplug()
            listener.until(lambda: not listener.there, "no panel")
            assert listener.said == ["possess", "release", "next", "next"]
            held.append(listener.count())
            panel = Panel()
            assert appeared() == port, "its name stays the same"
        panel.unplug()
    middle = sorted(waits[1:])[TIMES // 2]
    print(
        f"{port}: heard {middle:.2f} s after udev, at most {max(waits[1:]):.2f} s; {held[-1]} files, threads"
    )
    assert max(waits[1:]) < BACK and held[-1] == held[1]
