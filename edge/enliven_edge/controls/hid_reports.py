"""Decodes which keys the reports of a pedal or a clicker state as down; pure functions over bytes.

A keyboard's report is the boot report (Device Class Definition for HID 1.11, appendix B.1): one byte of
modifiers, one reserved, then up to six key codes (HID Usage Tables, page 7). A panel's has a bit a button.
"""

from __future__ import annotations

from typing import Literal

_MODIFIERS = ("ctrl", "shift", "alt", "meta", "right ctrl", "right shift", "right alt", "right meta")
_ROLL_OVER = 3
"""Codes up to this one are no keys: they state that more keys are down than a report can hold."""
_NAMES = {
    **{4 + i: chr(ord("a") + i) for i in range(26)},
    **{30 + i: str((i + 1) % 10) for i in range(10)},
    **{58 + i: f"f{i + 1}" for i in range(12)},
    0x28: "enter",
    0x29: "escape",
    0x2A: "backspace",
    0x2B: "tab",
    0x2C: "space",
    0x37: ".",
    0x4A: "home",
    0x4B: "page up",
    0x4C: "delete",
    0x4D: "end",
    0x4E: "page down",
    0x4F: "right",
    0x50: "left",
    0x51: "down",
    0x52: "up",
}
"""Name of each key code of a US keyboard (HID Usage Tables, page 7)."""


def keys_down(report: bytes) -> frozenset[str] | None:
    """Returns the keys that a keyboard's report states as down; None where it states too many.

    Keys have the names of a US keyboard: a, 1, f5, enter, page down, ...; those without one are such as 0x65.
    """
    if len(report) < 3:
        return None
    codes = [code for code in report[2:8] if code]
    if any(code <= _ROLL_OVER for code in codes):
        return None
    modifiers = {name for bit, name in enumerate(_MODIFIERS) if report[0] >> bit & 1}
    return frozenset(modifiers | {_NAMES.get(code, f"0x{code:02x}") for code in codes})


def buttons_down(report: bytes) -> frozenset[str]:
    """Returns the bits that are set, as "byte.bit", both from 0: "0.2" is the third button of the first
    byte."""
    return frozenset(
        f"{place}.{bit}" for place, byte in enumerate(report) for bit in range(8) if byte >> bit & 1
    )


class Edges:
    """Converts reports, which state the keys that are down, to the keys that went down since the last one.

    Args:
        report: what they hold.
        skip: bytes before that, after the report's number.
        number: the first byte of the reports that count; others, such as a clicker's mouse, are no keys. 0:
            all count, and have no number.
    """

    def __init__(self, report: Literal["keyboard", "buttons"], skip: int = 0, number: int = 0) -> None:
        self._report, self._skip, self._number = report, skip, number
        self._down: frozenset[str] = frozenset()

    def feed(self, report: bytes) -> list[str]:
        """Returns the keys that went down with this report, by name; a broken report changes nothing."""
        if self._number and report[:1] != bytes([self._number]):
            return []
        rest = report[self._skip + (self._number > 0) :]
        now = keys_down(rest) if self._report == "keyboard" else buttons_down(rest)
        if now is None:
            return []
        new, self._down = now - self._down, now
        return sorted(new)

    def forget(self) -> None:
        """Resets the state after the device was opened anew: no key is down."""
        self._down = frozenset()
