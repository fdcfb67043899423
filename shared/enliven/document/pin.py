"""Pins (foot lock): joints that stay in place while they are in contact."""

from __future__ import annotations

from dataclasses import dataclass, field

from enliven.settings import data_field


@dataclass(frozen=True)
class ContactSettings:
    """Criteria for the contact of a joint with the floor, relative to the length of its limb, and settings of
    the foot lock."""

    height: float = data_field(
        0.04,
        "Maximum height of a standing foot above the foot's lowest position.",
        unit="limb lengths",
        low=0.0,
        high=2.0,
    )
    speed: float = data_field(
        0.5, "Maximum speed of a standing foot.", unit="limb lengths/s", low=0.0, high=100.0
    )
    release: float = data_field(
        1.6,
        "A standing foot counts as lifted above these limits of height and speed times this factor.",
        low=1.0,
        high=10.0,
    )
    shortest: float = data_field(
        0.1,
        "Minimum duration of a floor contact. Shorter contacts are ignored.",
        unit="s",
        low=0.0,
        high=10.0,
    )
    blend: float = data_field(
        0.12, "Duration of the blend into and out of a foot lock.", unit="s", low=0.0, high=10.0
    )
    rise: float = data_field(
        1.0,
        "Fraction of the recorded rise that a standing foot keeps, for example when the heel "
        "lifts before the toe.",
        low=0.0,
        high=1.0,
    )
    sink: float = data_field(
        0.0,
        "Fraction of the recorded sinking that a standing foot keeps. Use 1 if another "
        "function keeps the foot above the floor.",
        low=0.0,
        high=1.0,
    )
    above: bool = data_field(False, "Keeps the foot above the floor level of the model's rest pose.")
    drop: float = data_field(
        0.1,
        "Maximum lowering of the root so that a foot reaches its locked position.",
        unit="limb lengths",
        low=0.0,
        high=1.0,
    )


@dataclass(frozen=True)
class Pin:
    """A joint that stays in place while it touches the floor. The limb above it follows by two-bone IK.

    Attributes:
        joint: the name of the foot's joint. A pin is ignored if an edit removed one of its joints.
        start: the name of the joint at which the limb starts (a hip), above the foot.
        settings: criteria for contact, and settings of the foot lock.
    """

    joint: str
    start: str
    settings: ContactSettings = field(default_factory=ContactSettings)
