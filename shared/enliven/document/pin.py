"""Pins (foot lock): joints that stay in place while they are in contact."""

from __future__ import annotations

from dataclasses import dataclass, field

from enliven.settings import setting


@dataclass(frozen=True)
class ContactSettings:
    """Settings for when a joint stands on the floor, relative to the length of its limb."""

    height: float = setting(
        0.04, "How high above its lowest a foot that stands may be.", unit="limb lengths", low=0.0, high=2.0
    )
    speed: float = setting(
        0.5, "How fast a foot that stands may move.", unit="limb lengths/s", low=0.0, high=100.0
    )
    release: float = setting(
        1.6, "How many times higher or faster than that it must be to be off the floor.", low=1.0, high=10.0
    )
    shortest: float = setting(0.1, "A contact shorter than this is none.", unit="s", low=0.0, high=10.0)
    blend: float = setting(
        0.12, "How long a foot takes into its place and out of it.", unit="s", low=0.0, high=10.0
    )
    rise: float = setting(
        1.0,
        "How much of its own rise a foot that stands keeps, as a heel that comes off before the toe.",
        low=0.0,
        high=1.0,
    )
    sink: float = setting(
        0.0,
        "How much of its own sinking a foot that stands keeps; 1 where the floor is kept otherwise.",
        low=0.0,
        high=1.0,
    )
    above: bool = setting(False, "Keep the foot above the floor that its shape stands on at rest.")
    drop: float = setting(
        0.1,
        "How far the root may come down so that a foot reaches its place.",
        unit="limb lengths",
        low=0.0,
        high=1.0,
    )


@dataclass(frozen=True)
class Pin:
    """A joint that stays in place while it is in contact; the limb above follows by two-bone IK.

    Attributes:
        joint: the name of the foot's joint. A pin is ignored if an edit removed one of its joints.
        start: the name of the joint at which the limb starts (a hip), above the foot.
        settings: when it is in contact.
    """

    joint: str
    start: str
    settings: ContactSettings = field(default_factory=ContactSettings)
