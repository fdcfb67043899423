"""Settings of one control, ``[controls.NAME]`` in an edge's settings file."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Literal

from enliven.errors import InputError
from enliven.settings import parameter, setting


@dataclass(frozen=True)
class ControlSettings:
    """Settings of one pedal, panel, clicker or microphone. Leave out the keys of other kinds."""

    kind: Literal["serial", "hid", "voice"] = setting(doc="Kind of control: serial, hid or voice.")
    map: dict[str, str] = field(
        default_factory=dict,
        metadata={"doc": "Maps each input (a line, a byte, a button, spoken words) to a command."},
    )
    debounce: float = setting(
        0.08,
        "Time without input from a key before the key counts again. Raise it if one press counts twice.",
        unit="s",
        low=0.0,
        high=5.0,
    )
    retry: float = parameter(
        0.5, "Time between attempts to find an unplugged device.", unit="s", low=0.01, high=60.0
    )
    port: str = setting("", "serial: device path of the port, such as /dev/serial/by-id/NAME.")
    baud: int = setting(9600, "serial: transmission speed.", unit="bits/s", low=50, high=4_000_000)
    sends: Literal["line", "byte", "panel"] = setting(
        "line", "serial: what a key press sends: a line, one byte, or the protocol of the panel's firmware."
    )
    vendor: int = setting(0, "hid: vendor number of the device, such as 0x0c45.", low=0, high=0xFFFF)
    product: int = setting(0, "hid: product number of the device.", low=0, high=0xFFFF)
    interface: int = setting(
        -1, "hid: interface number of the device. -1 uses the first one.", low=-1, high=255
    )
    report: Literal["keyboard", "buttons"] = setting(
        "keyboard", "hid: content of a report: key codes of a keyboard, or one bit per button."
    )
    number: int = setting(
        0,
        "hid: report number (first byte) of the reports to use. 0 if reports have no number.",
        low=0,
        high=255,
    )
    skip: int = setting(
        0, "hid: number of bytes to skip after the report number.", unit="bytes", low=0, high=63
    )
    microphone: str = setting(
        "", "voice: part of the microphone's name. If empty, the default microphone of the system is used."
    )
    wav: str = setting(
        "",
        "voice: path of a 16 kHz mono WAV file instead of a microphone, relative to this file. Use it "
        "for rehearsals.",
    )


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
            is_set = item.name in keys and getattr(settings, item.name) != item.default
            if is_set and kind != settings.kind:
                valid_keys = ", ".join(("map", "debounce", *_KINDS[settings.kind]))
                problem = (
                    f"{item.name} is a setting of kind {kind!r}, but this control is of kind "
                    f"{settings.kind!r}"
                )
                raise InputError(problem, where=where, remedy=f"Use only these settings: {valid_keys}.")
