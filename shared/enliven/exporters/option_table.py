"""The export options that several formats share. The command line and the window use this table.

This module imports no large libraries, so that ``enliven export --help`` is fast.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

Value = TypeVar("Value")


@dataclass(frozen=True)
class ExportOption(Generic[Value]):
    """An export option.

    Attributes:
        name: the keyword of :meth:`enliven.exporters.Exporter.save`.
        default: the value that has no effect.
        help: one sentence about the effect of the option.
        choices: all valid values, if there are only a few.
    """

    name: str
    default: Value
    help: str
    choices: tuple[Value, ...] = ()


SCALE = ExportOption("scale", 1.0, "Scale factor for all lengths.")
UP = ExportOption("up", "y", "Vertical axis of the file. Some formats allow only one axis.", ("y", "z"))
UNIT = ExportOption("unit", "m", "Unit of lengths in the file. Some formats always use metres.", ("m", "cm"))
IN_PLACE = ExportOption("in_place", False, "Remove the horizontal motion of each character's root.")
SHARED_OPTIONS: tuple[ExportOption[float] | ExportOption[str] | ExportOption[bool], ...] = (
    SCALE,
    UP,
    UNIT,
    IN_PLACE,
)
"""All shared options."""
MAX_SCALE = 1e6
"""Maximum scale. Its reciprocal is the minimum scale. Beyond these limits, float32 is not accurate enough for
motion."""
