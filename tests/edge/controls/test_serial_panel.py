"""Tests of the panel's driver with pyserial over a pseudo-terminal. tests/devices tests the firmware."""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path

import pytest

from enliven_edge.controls import serial_panel
from enliven_edge.controls.control_set import open_controls
from enliven_edge.controls.panel_protocol import Decoder, Lamps, encode
from enliven_edge.controls.settings import ControlSettings

sys.path.insert(0, str(Path(__file__).parent))

from patience import wait_until
from pedals_for_tests import Pedal

pytest.importorskip("serial", reason="pyserial is not installed (the extra 'controls')")


class Port(Pedal):
    """A port on which the test acts as the panel. It also reads the edge's output."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        os.set_blocking(self._master, False)
        self.decoder = Decoder()

    def edge_says(self) -> list[str]:
        try:
            return self.decoder.feed(os.read(self._master, 4096))
        except BlockingIOError:
            return []


@pytest.fixture
def port(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    device = Port(tmp_path / "panel")
    yield device
    device.close()


def opened(port: Port):
    given = ControlSettings(
        "serial", {"1": "next"}, port=str(port.path), sends="panel", debounce=0.0, retry=0.02
    )
    return open_controls({"panel": given})


def test_a_port_is_no_panel_before_it_has_greeted(port, monkeypatch, caplog):
    monkeypatch.setattr(serial_panel, "_GREETING_TIMEOUT_S", 0.3)
    with opened(port) as controls:
        wait_until(lambda: "the panel does not answer. Check that the panel has the firmware" in caplog.text)
        port.send(b"AT+GMM\r\n\xff\x00$P0000\n$H01P*0000\n")
        assert controls.missing == ["panel"] and "is connected" not in caplog.text
        assert port.edge_says() == [], "what may be a modem or a boot loader is not spoken to"
    assert caplog.text.count("does not answer") == 1, "it is said once, however often it is tried"


def test_a_panel_that_runs_already_is_asked_for_its_greeting(port):
    def asked() -> bool:
        port.send(encode("P0123000000000"))
        return "?" in port.edge_says()

    with opened(port) as controls:
        wait_until(asked)
        port.send(encode("H01P"))
        wait_until(lambda: not controls.missing)


def test_panel_of_another_protocol_is_ignored_and_reported_once(port, caplog):
    def greeted() -> str:
        port.send(encode("H07P"))
        return caplog.text

    with opened(port) as controls:
        wait_until(lambda: "the panel uses version 07 of the protocol, but this edge uses 01" in greeted())
        assert controls.missing == ["panel"]
        for _ in range(20):
            greeted()
            port.edge_says()
    assert caplog.text.count("uses version 07 of the protocol") == 1


class Ear:
    """Reads the edge's output while the panel greets repeatedly and its lamps have to show a state."""

    def __init__(self, port: Port, controls) -> None:
        self._port, self._controls = port, controls
        self.said: list[str] = []

    def hears(self, lamps: Lamps, body: str, times: int) -> bool:
        self._controls.show(lamps)
        self._port.send(encode("H01P") + encode("P0001000000000"))
        self.said += self._port.edge_says()
        return self.said.count(body) >= times


def test_lamp_states_are_repeated_while_the_edge_runs(port, caplog):
    with opened(port) as controls:
        ear = Ear(port, controls)
        wait_until(lambda: ear.hears(Lamps(attract="breathing"), "LB---", 3))
        wait_until(lambda: ear.hears(Lamps(fault="flashing"), "L---F", 3))
    after = ear.said.index("L---F")
    assert set(ear.said[after:]) == {"L---F"} and "L----" not in ear.said
    assert "controls.panel was restarted: the panel had no power" in caplog.text


def test_a_change_of_the_lamps_waits_for_no_beat(port, monkeypatch):
    monkeypatch.setattr(serial_panel, "_MESSAGE_INTERVAL_S", 1000.0)
    with opened(port) as controls:
        ear = Ear(port, controls)
        for lamps, body in (
            (Lamps(locked="steady"), "L--S-"),
            (Lamps(), "L----"),
            (Lamps("steady"), "LS---"),
        ):
            wait_until(lambda lamps=lamps, body=body: ear.hears(lamps, body, 1))
    assert [body for body in ear.said if body[0] == "L"] == ["L--S-", "L----", "LS---"]
