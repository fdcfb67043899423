"""Settings of one control, ``[controls.NAME]`` in an edge's settings file."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Literal

from enliven.errors import InputError
from enliven.settings import setting


@dataclass(frozen=True)
class ControlSettings:
    """One pedal, panel, clicker or microphone. Keys of another kind must be left out."""

    kind: Literal["serial", "hid", "voice"] = setting(doc="What it is: serial, hid or voice.")
    map: dict[str, str] = field(
        default_factory=dict,
        metadata={"doc": "From what it sends (a line, a byte, a button, spoken words) to a command."},
    )
    debounce: float = setting(
        0.08, "A key counts anew after it was still for so long.", unit="s", low=0.0, high=5.0
    )
    retry: float = setting(
        0.5, "Wait between two looks for an unplugged device.", unit="s", low=0.01, high=60.0
    )
    port: str = setting("", "serial: the port, such as /dev/serial/by-id/...")
    baud: int = setting(9600, "serial: the speed.", unit="bits/s", low=50, high=4_000_000)
    sends: Literal["line", "byte", "panel"] = setting(
        "line", "serial: what a press sends: a line, one byte, or what the panel's firmware says."
    )
    vendor: int = setting(0, "hid: the maker's number, such as 0x0c45.", low=0, high=0xFFFF)
    product: int = setting(0, "hid: the product's number.", low=0, high=0xFFFF)
    interface: int = setting(-1, "hid: which of the device's interfaces; -1: the first.", low=-1, high=255)
    report: Literal["keyboard", "buttons"] = setting(
        "keyboard", "hid: what a report holds: keys as keyboards send them, or a bit a button."
    )
    number: int = setting(
        0, "hid: which reports count, by their first byte; 0: reports have no number.", low=0, high=255
    )
    skip: int = setting(
        0, "hid: bytes before that in a report, after its number.", unit="bytes", low=0, high=63
    )
    microphone: str = setting("", "voice: part of the microphone's name; empty: the system's own.")
    wav: str = setting("", "voice: a 16 kHz mono WAV instead, for rehearsals; beside this file.")


_KINDS = {
    "serial": ("port", "baud", "sends"),
    "hid": ("vendor", "product", "interface", "report", "number", "skip"),
    "voice": ("microphone", "wav"),
}


def refuse_other_kinds(settings: ControlSettings, where: str) -> None:
    """Raises InputError for a key that this kind of control would ignore.

    Raises:
        InputError: for a key of another kind that is not at its default.
    """
    for kind, keys in _KINDS.items():
        for item in fields(settings):
            given = item.name in keys and getattr(settings, item.name) != item.default
            if given and kind != settings.kind:
                own = ", ".join(("map", "debounce", "retry", *_KINDS[settings.kind]))
                what = f"{item.name} is of kind {kind!r}, and this is {settings.kind!r}"
                raise InputError(what, where=where, mend=f"It takes: {own}.")
