"""Tests of HID report parsing, and of the real hidapi without any device plugged in."""

from __future__ import annotations

import logging
import sys
import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven_edge.controls.control_set import Controls, open_readers
from enliven_edge.controls.hid_pedal import ButtonEdges, buttons_down, keys_down
from enliven_edge.controls.settings import ControlSettings

sys.path.insert(0, str(Path(__file__).parent))

from patience import wait_until

CODES = {
    "a": 4,
    "z": 29,
    "1": 30,
    "0": 39,
    "enter": 0x28,
    "f1": 58,
    "f12": 69,
    "page down": 0x4E,
    "0x65": 0x65,
}
KEYS = st.lists(st.sets(st.sampled_from(sorted(CODES)), max_size=6), max_size=12)


def boot(keys: list[str], modifiers: int = 0) -> bytes:
    return bytes([modifiers, 0, *[CODES[key] for key in keys], *[0] * (6 - len(keys))])


@given(KEYS, st.randoms(use_true_random=False), st.integers(0, 3))
def test_a_key_goes_down_once_however_the_reports_order_them(held, random, skip):
    edges, before = ButtonEdges("keyboard", skip), set()
    for keys in held:
        order = sorted(keys)
        random.shuffle(order)
        assert edges.feed(b"\x07" * skip + boot(order)) == sorted(keys - before)
        before = keys


@given(KEYS, st.lists(st.binary(max_size=9).filter(lambda other: other[:1] != b"\1"), min_size=1))
def test_reports_of_another_number_change_nothing(held, others):
    edges, before = ButtonEdges("keyboard", number=1), set()
    for turn, keys in enumerate(held):
        assert edges.feed(others[turn % len(others)]) == []
        assert edges.feed(b"\1" + boot(sorted(keys))) == sorted(keys - before)
        before = keys


@given(st.lists(st.binary(max_size=8), max_size=12))
def test_a_button_goes_down_where_its_bit_does(reports):
    edges, before = ButtonEdges("buttons"), 0
    for report in reports:
        now = int.from_bytes(report, "little")
        expected = {f"{bit // 8}.{bit % 8}" for bit in range(64) if (now & ~before) >> bit & 1}
        assert set(edges.feed(report)) == expected
        before = now


@given(st.binary(max_size=64))
def test_no_bytes_break_the_decoding(report):
    down = keys_down(report)
    assert down is None or all(isinstance(key, str) for key in down)
    assert len(buttons_down(report)) == sum(byte.bit_count() for byte in report)


def test_too_many_keys_at_once_change_nothing():
    edges = ButtonEdges("keyboard")
    assert edges.feed(boot(["a"])) == ["a"]
    assert edges.feed(bytes([0, 0, 1, 1, 1, 1, 1, 1])) == []
    assert edges.feed(b"") == []
    assert edges.feed(boot(["a", "1"], modifiers=0b10)) == ["1", "shift"]
    edges.forget()
    assert edges.feed(boot(["a"])) == ["a"]


def is_read(name: str) -> bool:
    """Returns True if a thread reads the control with this name."""
    return any(thread.name == f"control {name}" for thread in threading.enumerate())


def test_missing_device_is_searched_while_the_edge_continues(caplog):
    pytest.importorskip("hid", reason="hidapi is not installed (the extra 'controls')")
    caplog.set_level(logging.INFO)
    settings = ControlSettings("hid", {"page down": "next"}, vendor=0xF055, product=0x0001, retry=0.01)
    (reader,) = open_readers({"clicker": settings})
    with Controls([reader]):
        wait_until(lambda: "no HID device f055:0001" in caplog.text)
        assert reader.poll() == [] and is_read("clicker")
    assert not is_read("clicker")
    assert caplog.text.count("is not available") == 1
