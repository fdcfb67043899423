"""Settings for how a puppet moves over the floor, and the times at which its performer touches it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.document.pin import ContactSettings
from enliven.settings import setting

Kind = Literal["contact", "flight"]


@dataclass(frozen=True)
class LocomotionSettings:
    """Settings for how a mesh moves over the floor."""

    contact: ContactSettings = setting(ContactSettings)
    runner: float = setting(
        0.4, "A foot that stands may also be as fast as this share of the feet's mean.", low=0.0, high=1.0
    )
    gravity: float = setting(9.81, "How fast what falls gets faster.", unit="m/s^2", low=0.0, high=1000.0)
    landing: Literal["timed", "free"] = setting(
        "timed", '"timed": it lands when the performer does; "free": when gravity brings it down.'
    )
    grip: float = setting(
        0.02,
        "How much lower than the anchor another foot must be to take over.",
        unit="mesh sizes",
        low=0.0,
        high=1.0,
    )
    plant: float = setting(
        0.0,
        "How much of their sliding is taken from feet beside the anchor; they meet key poses less then.",
        low=0.0,
        high=1.0,
    )
    leash: float = setting(
        0.03,
        "How far from the performer's path, in its own strides, it may be before it is drawn back.",
        unit="mesh sizes",
        low=0.0,
        high=1000.0,
    )
    throw: float = setting(
        0.1,
        "How long before it leaves the floor the mesh's velocity is measured.",
        unit="s",
        low=0.0,
        high=2.0,
    )


@dataclass(frozen=True)
class Switch:
    """The start of contact with the floor, or of flight, at a frame."""

    frame: int = setting(doc="Of the layer's take.", low=0)
    kind: Kind = setting(doc='"contact" or "flight" from there on.')
