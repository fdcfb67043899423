"""Tests of pedals and clickers of the kernel's uhid, plugged and unplugged, heard by an ordinary user's
controls."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from as_user import SLOW, Listener
from hid_device import CLICKER, FOOT_SWITCH, JOYSTICK, OWN, HidDevice, Kind

RULES = Path(__file__).parents[3] / "firmware_configs" / "udev" / "60-enliven-controls.rules"
TIMES = 20
"""Number of times that each device is plugged in."""
BACK = 2.5
"""Time from udev's granting access until the device is heard, seconds: five times the polling interval, since
the emulated processor is busy."""


def key(code: int) -> bytes:
    """The boot report of a keyboard with one key down."""
    return bytes([0, 0, code, 0, 0, 0, 0, 0])


PAGE_DOWN, PAGE_UP, NOTHING = key(0x4E), key(0x4B), key(0)
PEDALS: dict[str, tuple[Kind, dict, list[bytes], list[str]]] = {
    "keyboard": (
        FOOT_SWITCH,
        {"map": {"page down": "next", "page up": "previous"}},
        [PAGE_DOWN, NOTHING, PAGE_UP, NOTHING],
        ["next", "previous"],
    ),
    "clicker": (
        CLICKER,
        {"map": {"page down": "next", "page up": "previous"}, "number": 1},
        # Mouse motion and a volume key between press and release are not keyboard keys.
        [
            b"\1" + PAGE_DOWN,
            b"\2\0\0\x4b",
            b"\3\xe9\0",
            b"\3\0\0",
            b"\1" + NOTHING,
            b"\1" + PAGE_UP,
            b"\1" + NOTHING,
        ],
        ["next", "previous"],
    ),
    "joystick": (
        JOYSTICK,
        {"map": {"0.0": "possess", "0.7": "release"}, "report": "buttons"},
        [b"\x01", b"\x81", b"\x80", b"\x00"],
        ["possess", "release"],
    ),
    "own": (
        OWN,
        {"map": {"1.2": "join"}, "report": "buttons"},
        [b"\0\4\0\0\0\0\0\0", bytes(8)],
        ["join"],
    ),
}


@pytest.fixture(scope="module", autouse=True)
def rules():
    """Installs the project's rules into the system's udev, as docs/controls.md describes."""
    subprocess.run(["modprobe", "uhid"], check=True)
    shutil.copy(RULES, "/etc/udev/rules.d/")
    rest = Path("/etc/udev/rules.d/61-panel.rules")
    rest.write_text(
        'KERNEL=="hidraw*", KERNELS=="*:1209:E001.*", MODE="0660", TAG+="uaccess"\n'
        'KERNEL=="hidraw*", KERNELS=="*:1D50:5055.*", MODE="0660", TAG+="uaccess"\n'
    )
    subprocess.run(["udevadm", "control", "--reload"], check=True)


@pytest.fixture(scope="module")
def listener():
    settings = {
        name: {"kind": "hid", "vendor": kind.vendor, "product": kind.product, "debounce": 0.0, **more}
        for name, (kind, more, _, _) in PEDALS.items()
    }
    with Listener(settings) as heard:
        yield heard


def opened(count: int) -> None:
    """Waits until udev has granted ``count`` devices to the logged-in user."""
    deadline = time.monotonic() + SLOW
    while (
        sum("system.posix_acl_access" in os.listxattr(node) for node in Path("/dev").glob("hidraw*")) < count
    ):
        assert time.monotonic() < deadline, "udev has not opened them"
        time.sleep(0.01)


def test_each_press_is_heard_once_after_each_replugging(listener):
    chance, waits, held = random.Random(7), [], []
    for absence in [*chance.sample([0.0, 0.05, 0.5, 1.5] * 5, TIMES - 1), 6.0]:
        time.sleep(absence)
        listener.words.clear()
        devices = {name: HidDevice(PEDALS[name][0]) for name in chance.sample(sorted(PEDALS), len(PEDALS))}
        opened(len(PEDALS))
        plugged = time.monotonic()
        listener.until(lambda: listener.there == set(PEDALS), "all of them")
        waits.append(time.monotonic() - plugged)
        wanted = {}
        for name, device in devices.items():
            _, _, reports, words = PEDALS[name]
            # The last key is still down when the device is pulled out. It must not be down when the device
            # returns.
            for report in [*reports, reports[0]]:
                device.send(report)
            wanted[name] = [*words, words[0]]
        count = sum(map(len, wanted.values()))
        listener.until(lambda: len(listener.words) >= count, f"{count} presses")  # noqa: B023
        for device in devices.values():
            device.unplug()
        listener.until(lambda: not listener.there, "none of them")
        for name, words in wanted.items():
            assert [word for _, control, word in listener.words if control == name] == words
        held.append(listener.count())
    middle = sorted(waits)[TIMES // 2]
    print(f"{len(PEDALS)} devices, {TIMES} times: heard after {middle:.2f} s, at most {max(waits):.2f} s")
    assert max(waits) < BACK
    assert held[-1] == held[1], "files and threads are as many as after the second time"
    print(f"then {held[-1][0]} files and {held[-1][1]} threads, as after the second time")
    assert listener.log.count("Traceback") == 0
