"""A panel for tests: its firmware in simavr, its serial port on a pseudo-terminal."""

from __future__ import annotations

import contextlib
import ctypes
import os
import random
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "edge" / "controls"))
from pedals_for_tests import Pedal

PANEL = Path(__file__).resolve().parents[2] / "firmware_configs" / "panel"
BUTTONS = [("D", 2), ("D", 3), ("D", 4), ("D", 5), ("D", 6), ("D", 7), ("C", 0), ("C", 1), ("C", 2)]
"""The pins of the buttons 1 to 9; docs/panel.md has the wiring."""
LAMPS = {"attract": 1, "possess": 2, "locked": 3, "ill": 4}
"""The pins of port B."""
HERTZ = 16_000_000
"""The board's clock."""
EXTERNAL, FRAMING_ERROR = 1 << 1, 0x8000
"""The bit of MCUSR for an external reset, and the flag for a byte with a missing stop bit (framing error)."""


def missing() -> str:
    """Returns one sentence about software missing for these tests; empty if everything is installed."""
    for tool in ("avr-gcc", "make", "cc"):
        if shutil.which(tool) is None:
            return f"{tool} is not installed: make test-devices installs it"
    for compiler, header in (("avr-gcc", "avr/io.h"), ("cc", "simavr/sim_avr.h")):
        command = [compiler, "-E", "-include", header, "-x", "c", os.devnull]
        if subprocess.run([*command, "-o", os.devnull], capture_output=True).returncode:
            return f"{header} is not installed: make test-devices installs it"
    return ""


def build(folder: Path) -> Path:
    """Builds the firmware with its Makefile, and the board around the simulator. Returns the firmware."""
    source, library = Path(__file__).with_name("board.c"), folder / "board.so"
    subprocess.run(["make", "-s", "-C", str(PANEL), f"OUT={folder}"], check=True, stdout=subprocess.DEVNULL)
    warnings = ["-Wall", "-Wextra", "-Werror"]
    command = ["cc", "-O2", *warnings, "-shared", "-fPIC", "-o", str(library), str(source), "-lsimavr"]
    subprocess.run(command, check=True)
    return folder / "panel.elf"


def _loaded(path: Path) -> ctypes.CDLL:
    """Loads board.c, with the types of its functions."""
    board, number, wide = ctypes.c_void_p, ctypes.c_int, ctypes.c_uint64
    library = ctypes.CDLL(str(path))
    for name, result, *arguments in (
        ("new", board, ctypes.c_char_p),
        ("free", None, board),
        ("run", number, board, wide),
        ("reset", None, board, number),
        ("reset_after", None, board, number),
        ("drive", None, board, ctypes.c_char, number, number),
        ("feed", None, board, number),
        ("said", number, board, ctypes.c_char_p),
        ("high", wide, board, number),
        ("edges", wide, board, number),
        ("hang", None, board, number),
    ):
        function = getattr(library, f"board_{name}")
        function.restype, function.argtypes = result, arguments
    return library


class MatchList:
    """An ATmega328P with the firmware. Its time advances only within :meth:`run`."""

    def __init__(self, firmware: Path) -> None:
        self._library = _loaded(firmware.with_name("board.so"))
        self._board = self._library.board_new(str(firmware).encode())
        assert self._board, f"simavr cannot read {firmware}"
        self._buffer = ctypes.create_string_buffer(4096)
        for button in range(1, len(BUTTONS) + 1):
            self.press(button, False)

    def run(self, milliseconds: float) -> bytes:
        """Advances the time. Returns the bytes sent meanwhile."""
        assert self._library.board_run(self._board, round(1000 * milliseconds)), "the CPU stopped"
        count = self._library.board_said(self._board, self._buffer)
        return self._buffer.raw[:count]

    def press(self, button: int, down: bool) -> None:
        """Closes a contact to ground, or opens it to the pull-up."""
        port, pin = BUTTONS[button - 1]
        self._library.board_drive(self._board, port.encode(), pin, not down)

    def feed(self, data: bytes) -> None:
        """Feeds received bytes, at most 60 at a time."""
        for byte in data:
            self._library.board_feed(self._board, byte)

    def feed_broken(self, byte: int) -> None:
        """Feeds a received byte with a missing stop bit."""
        self._library.board_feed(self._board, byte | FRAMING_ERROR)

    def reset(self) -> None:
        self._library.board_reset(self._board, EXTERNAL)

    def reset_after(self, count: int) -> None:
        """Resets the CPU as soon as it has sent ``count`` more bytes."""
        self._library.board_reset_after(self._board, count)

    def hang(self, interrupts_too: bool = False) -> None:
        """Makes the main loop hang and, if asked for, the clock's interrupt, too."""
        self._library.board_hang(self._board, interrupts_too)

    def lamp(self, name: str) -> tuple[float, int]:
        """Returns the seconds for which a lamp was lit so far, and how often it changed."""
        pin = LAMPS[name]
        high = self._library.board_high(self._board, pin)
        return high / HERTZ, self._library.board_edges(self._board, pin)

    def close(self) -> None:
        self._library.board_free(self._board)


class LivePanel(Pedal):
    """A board that runs in real time, on a port that can be unplugged. Unplugged, it has no power.

    Args:
        path: path of the port, which does not change.
        garbled: fraction of bytes that noise changes, in both directions.

    Attributes:
        hits: number of bytes that noise has changed.
    """

    STEP = 2.0
    """Milliseconds that the board advances between two polls of the port: the time of eight bytes."""

    def __init__(self, firmware: Path, path: Path, garbled: float = 0.0) -> None:
        self._firmware, self.garbled = firmware, garbled
        self.lock, self.frozen = threading.Lock(), False
        self._random, self.hits = random.Random(7), 0
        super().__init__(path)

    def plug(self) -> None:
        super().plug()
        os.set_blocking(self._master, False)
        self.board = MatchList(self._firmware)
        self._on, self._elapsed = True, 0.0
        self._thread = threading.Thread(target=self._live, daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        self._on = False
        self._thread.join()
        self.board.close()
        super().unplug()

    def click(self, button: int) -> None:
        """Presses a button with contact bounce: 3 ms when closing and when opening."""
        for down in (True, False):
            with self.lock:
                for bounce in range(7):
                    self.board.press(button, down == (bounce % 2 == 0))
                    self._go_on(0.5)
            self.rest(20.0)

    def rest(self, milliseconds: float) -> None:
        """Waits for a time on the board's clock."""
        end = self._elapsed + milliseconds
        while self._elapsed < end:
            time.sleep(0.001)

    def levels(self, milliseconds: float = 100.0) -> dict[str, float]:
        """Returns the fraction of time for which each lamp is lit, from now on."""
        began, before = self._lit()
        self.rest(milliseconds)
        ended, after = self._lit()
        return {name: (after[name] - before[name]) * 1000.0 / (ended - began) for name in LAMPS}

    def _lit(self) -> tuple[float, dict[str, float]]:
        """Returns the milliseconds since the start, and the seconds for which each lamp was lit until
        then."""
        with self.lock:
            return self._elapsed, {name: self.board.lamp(name)[0] for name in LAMPS}

    def _live(self) -> None:
        ahead = time.monotonic()
        while self._on:
            if not self.frozen:
                self._step()
            ahead = max(ahead + 0.001 * self.STEP, time.monotonic() - 0.05)
            time.sleep(max(0.0, ahead - time.monotonic()))

    def _step(self) -> None:
        with self.lock, contextlib.suppress(BlockingIOError, OSError):
            self.board.feed(self._noisy(os.read(self._master, 8)))
        with self.lock:
            self._go_on(self.STEP)

    def _go_on(self, milliseconds: float) -> None:
        """Advances the board and sends its output to the port. If the port is full, output is lost, as on a
        real line."""
        data = self.board.run(milliseconds)
        self._elapsed += milliseconds
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, self._noisy(data))

    def _noisy(self, data: bytes) -> bytes:
        noisy = bytearray(data)
        for place in range(len(noisy)):
            if self._random.random() < self.garbled:
                noisy[place] ^= self._random.randrange(1, 256)
                self.hits += 1
        return bytes(noisy)
