"""A button panel on a USB serial port that is plugged and unplugged: the kernel's gadget on its dummy controller.

What answers there is written here after docs/panel.md; tests/devices runs the firmware itself.
"""

from __future__ import annotations

import os
import select
import subprocess
import sys
import threading
import time
import tty
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from as_user import SLOW, Listener

from enliven_edge.controls.panel_protocol import ASK, VERSION, Decoder, encode

PLUG = Path("/sys/class/udc/dummy_udc.0/soft_connect")
BY_ID = Path("/dev/serial/by-id")
TIMES = 10
BACK = 5.0
"""Seconds from when udev has made the port until the panel is heard: a look each 0.5 s, and its greeting."""


class Panel:
    """Three buttons at the device's end of the wire."""

    def __init__(self) -> None:
        self._file = os.open("/dev/ttyGS0", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self._file)
        self._decoder, self._began = Decoder(), time.monotonic()
        self._counts, self._lock = [0, 0, 0], threading.Lock()
        self.lamps, self._on = "", True
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def press(self, button: int) -> None:
        with self._lock:
            self._counts[button - 1] += 1
        self._say_counts()

    def close(self) -> None:
        self._on = False
        self._thread.join(5.0)
        os.close(self._file)

    def _run(self) -> None:
        said = 0.0
        self._say(f"H{VERSION}P")
        while self._on:
            if select.select([self._file], [], [], 0.05)[0]:
                try:
                    bodies = self._decoder.feed(os.read(self._file, 256))
                except OSError:
                    bodies = []
                    time.sleep(0.05)
                for body in bodies:
                    if body == ASK:
                        self._say(f"H{VERSION}P")
                    self.lamps = body if body.startswith("L") else self.lamps
            if time.monotonic() - said > 0.25:
                said = time.monotonic()
                self._say_counts()

    def _say_counts(self) -> None:
        beats = int((time.monotonic() - self._began) * 4) % 0x10000
        with self._lock:
            counts = "".join(f"{count % 16:X}" for count in self._counts)
        self._say(f"P{beats:04X}{counts}")

    def _say(self, body: str) -> None:
        try:
            os.write(self._file, encode(body))
        except OSError:
            pass  # pulled out, or its buffer is full: the next message makes it good


@pytest.fixture(scope="module")
def port():
    for module in ("dummy_hcd", "g_serial"):
        subprocess.run(["modprobe", module], check=True)
    appeared(True)
    yield next(iter(BY_ID.iterdir()))
    subprocess.run(["modprobe", "-r", "g_serial"], check=True)


def appeared(there: bool) -> None:
    deadline = time.monotonic() + SLOW
    while (BY_ID.exists() and any(BY_ID.iterdir())) is not there:
        assert time.monotonic() < deadline, f"the port is {'not ' if there else ''}there"
        time.sleep(0.02)


def test_a_panel_is_heard_however_often_it_is_plugged_in(port):
    settings = {
        "panel": {
            "kind": "serial",
            "port": str(port),
            "baud": 38400,
            "sends": "panel",
            "debounce": 0.0,
            "map": {"1": "possess", "2": "release", "3": "next"},
        }
    }
    waits, held = [], []
    with Listener(settings) as listener:
        panel = Panel()
        for _ in range(TIMES):
            plugged = time.monotonic()
            listener.until(lambda: listener.there, "the panel")
            waits.append(time.monotonic() - plugged)
            listener.words.clear()
            for button in (1, 2, 3, 3):
                panel.press(button)
            listener.until(lambda: len(listener.words) >= 4, "four presses")
            listener.until(lambda: panel.lamps == "L-S--", "the lamps")  # noqa: B023
            held.append(listener.count())
            PLUG.write_text("disconnect")
            listener.until(lambda: not listener.there, "no panel")
            appeared(False)
            panel.press(1)  # what is pressed while it is out is no command
            assert listener.said == ["possess", "release", "next", "next"]
            PLUG.write_text("connect")
            appeared(True)
        panel.close()
    print(f"{port}: heard {sorted(waits[1:])[TIMES // 2]:.2f} s after udev, at most {max(waits[1:]):.2f} s; {held[-1]}")
    assert max(waits[1:]) < BACK and held[-1] == held[1]
