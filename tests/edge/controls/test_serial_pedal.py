"""Tests of serial pedals over a pseudo-terminal with the real pyserial."""

from __future__ import annotations

import contextlib
import logging
import sys
import tracemalloc
from pathlib import Path

import pytest

from enliven.doctor import need
from enliven.errors import InputError, ResourceError
from enliven_edge.controls.base import ControlReader, Debouncer
from enliven_edge.controls.control_set import create_device, open_readers
from enliven_edge.controls.serial_pedal import ByteKeys, LineKeys
from enliven_edge.controls.settings import ControlSettings

sys.path.insert(0, str(Path(__file__).parent))

from patience import wait_until
from pedals_for_tests import Pedal

pytest.importorskip("serial", reason="pyserial is not installed (the extra 'controls')")

MAP = {"A": "possess", "B": "next", "0x1b": "release", "left foot": "join"}


@pytest.fixture
def pedal(tmp_path):
    device = Pedal(tmp_path / "pedal")
    yield device
    device.close()


class Ear:
    """Collects the reported messages in a list."""

    def __init__(self, control: ControlReader) -> None:
        self._control = control
        self.words: list[str] = []

    def heard(self, count: int) -> bool:
        self.words += self._control.poll()
        return len(self.words) >= count


@contextlib.contextmanager
def opened(pedal: Pedal, **more):
    """Reads the pedal. Yields the collected messages."""
    given = {"map": MAP, "port": str(pedal.path), "debounce": 0.0, "retry": 0.02, **more}
    (control,) = open_readers({"pedal": ControlSettings("serial", **given)})
    with contextlib.closing(control):
        yield Ear(control)


def test_a_line_is_a_press(pedal, caplog):
    caplog.set_level(logging.INFO)
    with opened(pedal) as ear:
        wait_until(lambda: "is connected" in caplog.text)
        pedal.send(b"A\r\n  left foot\nnobody\nB")
        wait_until(lambda: ear.heard(2))
        pedal.send(b"\n")
        wait_until(lambda: ear.heard(3))
    assert ear.words == ["possess", "join", "next"]
    assert "sent 'nobody', which is not in the map of this control" in caplog.text


def test_a_byte_is_a_press(pedal, caplog):
    caplog.set_level(logging.INFO)
    with opened(pedal, sends="byte") as ear:
        wait_until(lambda: "is connected" in caplog.text)
        pedal.send(b"AB\x1b")
        wait_until(lambda: ear.heard(3))
    assert ear.words == ["possess", "next", "release"]


def test_unplugged_pedal_is_found_again_and_both_are_reported_once(pedal, caplog):
    caplog.set_level(logging.INFO)
    with opened(pedal) as ear:
        wait_until(lambda: caplog.text.count("is connected") == 1)
        pedal.send(b"A\nhalf a li")
        wait_until(lambda: ear.heard(1))
        pedal.unplug()
        wait_until(lambda: "is not available" in caplog.text)
        pedal.plug()
        wait_until(lambda: caplog.text.count("is connected") == 2)
        pedal.send(b"B\n")
        wait_until(lambda: ear.heard(2))
    assert ear.words == ["possess", "next"]
    assert caplog.text.count("is not available") == 1


def test_a_pedal_may_come_after_the_edge(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    pedal = Pedal(tmp_path / "pedal")
    pedal.unplug()
    with opened(pedal) as ear:
        wait_until(lambda: "is not available" in caplog.text)
        pedal.plug()
        wait_until(lambda: "is connected" in caplog.text)
        pedal.send(b"A\n")
        wait_until(lambda: ear.heard(1))
    pedal.close()


def test_a_bounce_is_the_same_press():
    contact = Debouncer(0.08)
    times = [0.0, 0.003, 0.011, 0.09, 0.2, 0.27, 0.5]
    assert [contact.is_new_press("A", t) for t in times] == [True, False, False, False, True, False, True]
    assert contact.is_new_press("B", 0.5), "another key is another press"
    still = Debouncer(0.0)
    assert still.is_new_press("A", 1.0) and still.is_new_press("A", 1.0)


def test_a_bouncing_contact_is_heard_once(pedal, caplog):
    caplog.set_level(logging.INFO)
    with opened(pedal, debounce=5.0) as ear:
        wait_until(lambda: "is connected" in caplog.text)
        pedal.send(b"A\nA\nA\nB\n")
        wait_until(lambda: ear.heard(2))
    assert ear.words == ["possess", "next"]


def test_noise_without_an_end_is_no_press_and_takes_no_room():
    keys, noise = LineKeys(), b"\xff" * 100
    tracemalloc.start()
    try:
        assert all(keys.feed(noise) == [] for _ in range(1000))
        assert tracemalloc.get_traced_memory()[1] < 10_000
    finally:
        tracemalloc.stop()
    assert keys.feed(b"\nA\n") == ["A"]
    assert ByteKeys().feed(bytes([0x41, 0x00, 0xFE])) == ["A", "0x00", "0xfe"]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (ControlSettings("serial", {"A": "posess"}, port="x"), "Did you mean 'possess'"),
        (ControlSettings("serial", {"A": "zzz"}, port="x"), "Known commands: possess, join"),
        (ControlSettings("serial"), "the serial control has no port"),
        (
            ControlSettings("serial", port="x", vendor=3),
            "vendor is a setting of kind 'hid', but this control is of kind 'serial'",
        ),
        (ControlSettings("voice"), "the voice control has no phrases"),
        (ControlSettings("hid", vendor=3), "the settings vendor and product"),
    ],
)
def test_invalid_settings_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        create_device("pedal", settings)


def test_missing_serial_library_is_reported_with_the_install_command():
    with pytest.raises(ResourceError, match=r"pip install .enliven-edge\[controls\]"):
        need("a_library_that_nobody_has", "controls", "controls.pedal")
