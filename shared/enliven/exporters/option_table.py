"""The options that several formats share, for the command line and the window.

This module imports nothing heavy, so that ``enliven export --help`` is quick.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

Value = TypeVar("Value")


@dataclass(frozen=True)
class ExportOption(Generic[Value]):
    """An option of exports.

    Attributes:
        name: the keyword of :meth:`enliven.exporters.Exporter.save`.
        default: the value without an effect.
        help: its effect in one sentence.
        choices: all values, if there are few.
    """

    name: str
    default: Value
    help: str
    choices: tuple[Value, ...] = ()


SCALE = ExportOption("scale", 1.0, "Factor of all lengths.")
UP = ExportOption("up", "y", "Vertical axis. Some formats fix it.", ("y", "z"))
UNIT = ExportOption("unit", "m", "Unit of lengths. Some formats are always in metres.", ("m", "cm"))
IN_PLACE = ExportOption("in_place", False, "Remove the horizontal motion of each character's root.")
SHARED_OPTIONS: tuple[ExportOption[float] | ExportOption[str] | ExportOption[bool], ...] = (
    SCALE,
    UP,
    UNIT,
    IN_PLACE,
)
"""All shared options."""
MAX_SCALE = 1e6
"""Maximum scale, and maximum of its reciprocal. Beyond it, float32 is not accurate enough for motion."""
