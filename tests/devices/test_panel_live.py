"""Tests of the panel's firmware in a simulator, on a pseudo-terminal, with the edge's own serial driver."""

from __future__ import annotations

import logging
import sys
import threading
import time
from pathlib import Path

import pytest
from patience import wait_until

from enliven_edge.controls import serial_panel
from enliven_edge.controls.base import ControlReader
from enliven_edge.controls.control_set import Controls, open_readers
from enliven_edge.controls.panel_protocol import Lamps
from enliven_edge.controls.settings import ControlSettings

sys.path.insert(0, str(Path(__file__).parent))

from panel_for_tests import LAMPS, LivePanel

pytest.importorskip("serial", reason="pyserial is not installed (the extra 'controls')")

WORDS = ("possess", "join", "extend", "release", "next", "previous", "follow", "lock", "unlock")
MAP = {str(button): word for button, word in enumerate(WORDS, 1)}
STEADY = Lamps(possess="steady", locked="steady")


class Stand:
    """An edge's controls with one panel, and the words heard from it so far."""

    def __init__(self, reader: ControlReader, panel: LivePanel) -> None:
        self.controls, self.panel, self._reader = Controls([reader]), panel, reader
        self.heard: list[str] = []
        self.lamps: Lamps | None = Lamps()
        self._open = True
        self._thread = threading.Thread(target=self._show, daemon=True)
        self._thread.start()

    def is_there(self) -> bool:
        return not self.controls.missing

    def says(self, words: list[str]) -> None:
        """Waits until exactly these words were heard."""

        def heard() -> bool:
            self.heard += self._reader.poll()
            return len(self.heard) >= len(words)

        wait_until(heard, f"{words} after {self.heard}")
        assert self.heard == words

    def shows(self, **levels: float) -> None:
        """Waits until these lamps are lit for these fractions of time, and all others are dark."""
        wanted = {name: levels.get(name, 0.0) for name in LAMPS}
        wait_until(lambda: self.panel.levels() == pytest.approx(wanted, abs=0.02), f"lamps {wanted}")

    def close(self) -> None:
        self._open = False
        self._thread.join()

    def _show(self) -> None:
        """Updates the lamps like an edge's loop, at least ten times per second."""
        while self._open:
            if self.lamps is not None:
                self.controls.show(self.lamps)
            time.sleep(0.02)


@pytest.fixture
def panel(firmware, tmp_path):
    opened = LivePanel(firmware, tmp_path / "panel")
    yield opened
    opened.close()


@pytest.fixture
def stand(panel, caplog):
    caplog.set_level(logging.INFO)
    settings = ControlSettings(
        "serial", MAP, port=str(panel.path), sends="panel", baud=38400, debounce=0.0, retry=0.02
    )
    (reader,) = open_readers({"panel": settings})
    opened = Stand(reader, panel)
    with opened.controls:
        wait_until(opened.is_there)
        yield opened
        opened.close()


def test_presses_arrive_and_lamps_are_set(stand):
    for button in range(1, 10):
        stand.panel.click(button)
    stand.says(list(WORDS))
    stand.lamps = STEADY
    stand.shows(possess=1.0, locked=1.0)
    stand.lamps = Lamps(fault="steady")
    stand.shows(ill=1.0)


def test_line_noise_neither_loses_nor_adds_presses(stand, caplog):
    stand.panel.garbled = 0.015
    stand.lamps = STEADY
    pressed = [button for _ in range(3) for button in (1, 5, 9, 2)]
    for count, button in enumerate(pressed, 1):
        stand.panel.click(button)
        stand.says([MAP[str(number)] for number in pressed[:count]])
    stand.shows(possess=1.0, locked=1.0)
    assert stand.panel.hits > 3
    assert stand.is_there() and "which is not in the map of this control" not in caplog.text


@pytest.mark.parametrize("bytes_sent", [3, 15])
def test_reset_in_mid_message_is_neither_press_nor_loss(stand, caplog, bytes_sent):
    stand.panel.click(1)
    stand.says(["possess"])
    with stand.panel.lock:
        stand.panel.board.reset_after(bytes_sent)
    stand.panel.rest(400)
    stand.panel.click(5)
    stand.says(["possess", "next"])
    assert "is not available" not in caplog.text


def test_replugged_panel_works_again_each_time(stand, caplog):
    words = []
    for times in range(1, 4):
        stand.panel.unplug()
        wait_until(lambda: not stand.is_there())
        stand.panel.plug()
        wait_until(stand.is_there)
        stand.panel.click(4)
        words.append("release")
        stand.says(words)
        assert caplog.text.count("is not available") == times
    stand.lamps = STEADY
    stand.shows(possess=1.0, locked=1.0)


def test_watchdog_restart_of_hanging_firmware_is_reported(stand, caplog):
    stand.lamps = STEADY
    stand.panel.click(1)
    stand.says(["possess"])
    with stand.panel.lock:
        stand.panel.board.hang()
    wait_until(lambda: "the watchdog restarted the panel" in caplog.text)
    stand.panel.click(2)
    stand.says(["possess", "join"])
    stand.shows(possess=1.0, locked=1.0)
    assert "is not available" not in caplog.text


def test_silent_panel_is_searched_until_it_speaks(stand, caplog, monkeypatch):
    monkeypatch.setattr(serial_panel, "_SILENCE_TIMEOUT_S", 1.0)
    stand.panel.frozen = True
    wait_until(lambda: "the panel does not answer" in caplog.text)
    assert not stand.is_there()
    stand.panel.frozen = False
    wait_until(stand.is_there)
    stand.panel.click(6)
    stand.says(["previous"])


def test_hanging_edge_is_shown_as_no_edge(stand, monkeypatch):
    monkeypatch.setattr(serial_panel, "_STALE_AFTER_S", 0.3)
    stand.lamps = STEADY
    stand.shows(possess=1.0, locked=1.0)
    stand.lamps = None
    stand.shows()
    assert stand.is_there(), "its thread still reads the panel"
    stand.lamps = STEADY
    stand.shows(possess=1.0, locked=1.0)
