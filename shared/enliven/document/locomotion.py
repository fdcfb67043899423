"""Settings of a puppet's locomotion over the floor, and the times at which its performer touches the
floor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.document.pin import ContactSettings
from enliven.settings import data_field, group, setting

Kind = Literal["contact", "flight"]


@dataclass(frozen=True)
class LocomotionSettings:
    """Settings of a mesh's locomotion over the floor."""

    contact: ContactSettings = group(ContactSettings)
    runner: float = data_field(
        0.4,
        "Maximum speed of a standing foot as a fraction of the feet's mean speed. Lower "
        "values miss contacts of fast runners.",
        low=0.0,
        high=1.0,
    )
    gravity: float = data_field(
        9.81, "Gravitational acceleration during flight.", unit="m/s^2", low=0.0, high=1000.0
    )
    landing: Literal["timed", "free"] = setting(
        "timed",
        '"timed": the puppet lands together with the performer; "free": gravity decides when it lands.',
    )
    grip: float = data_field(
        0.02,
        "Minimum height difference at which a lower foot replaces the anchor foot.",
        unit="mesh sizes",
        low=0.0,
        high=1.0,
    )
    plant: float = setting(
        0.0,
        "Fraction of foot sliding that is removed for feet other than the anchor. These feet then "
        "match key poses less exactly.",
        low=0.0,
        high=1.0,
    )
    leash: float = setting(
        0.03,
        "Maximum distance of the puppet from the performer's path. The path is scaled to the "
        "puppet's strides. A farther puppet is pulled back.",
        unit="mesh sizes",
        low=0.0,
        high=1000.0,
    )
    throw: float = data_field(
        0.1,
        "Duration before lift-off over which the launch velocity is averaged.",
        unit="s",
        low=0.0,
        high=2.0,
    )


@dataclass(frozen=True)
class Switch:
    """The start of contact with the floor, or of flight, at a frame."""

    frame: int = data_field(doc="Number of the frame in the layer's take.", low=0)
    kind: Kind = data_field(doc='State from this frame on: "contact" or "flight".')
