"""The settings of the physics simulation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from enliven.deformation.spheres import SphereSettings
from enliven.settings import group, parameter, setting

WorldName = Literal["none", "boxes", "dodgeball"]


@dataclass(frozen=True)
class EngineSettings:
    """Settings of the engine's time steps."""

    REMOVED_SETTINGS: ClassVar = (
        "substep",
        "catch_up",
        "stiffness",
        "push_out",
        "fastest",
        "fastest_prop",
    )
    budget: float = setting(
        0.02,
        "Maximum computing time per live frame; the remaining simulation is skipped. 0 removes the limit.",
        unit="s",
        low=0.0,
    )
    gravity: float = setting(
        9.81, "Gravitational acceleration, downwards.", unit="m/s²", low=-50.0, high=50.0
    )
    friction: float = setting(0.6, "Friction coefficient of all contacts.", low=0.0, high=5.0)


@dataclass(frozen=True)
class BoxesSettings:
    """Settings of towers of boxes to knock over."""

    at: tuple[tuple[float, float], ...] = setting(
        ((0.62, 0.15), (0.12, 0.90)),
        "Positions of the towers: left and ahead of the performer, or x and z in world coordinates.",
        unit="m",
    )
    wide: int = setting(2, "Number of boxes along each side of a tower.", low=1, high=6)
    high: int = setting(6, "Number of boxes on top of each other.", low=1, high=20)
    side: float = setting(0.17, "Edge length of a box.", unit="m", low=0.02, high=2.0)
    mass: float = setting(0.35, "Mass of a box.", unit="kg", low=0.001, high=100.0)
    rebuild: float = setting(
        12.0,
        "Time without any motion after which fallen towers are rebuilt. 0 turns this off.",
        unit="s",
        low=0.0,
    )


@dataclass(frozen=True)
class DodgeballSettings:
    """Settings of balls that are thrown at every target in turn."""

    REMOVED_SETTINGS: ClassVar = ("mass", "bounce", "hand")

    balls: int = setting(4, "Number of balls.", low=1, high=64)
    radius: float = setting(0.11, "Radius of a ball.", unit="m", low=0.02, high=1.0)
    every: float = setting(1.2, "Time between two throws.", unit="s", low=0.05, high=600.0)
    distance: float = setting(
        2.6, "Distance from the throwing position to the target.", unit="m", low=0.5, high=20.0
    )
    flight: float = setting(0.7, "Flight time of a ball to its target.", unit="s", low=0.1, high=5.0)


@dataclass(frozen=True)
class PhysicsSettings:
    """Settings of the physics world."""

    REMOVED_SETTINGS: ClassVar = ("stand",)

    world: WorldName = setting(
        "none",
        "'boxes': towers to knock over; 'dodgeball': balls are thrown at each character and performer "
        "in turn.",
    )
    place: Literal["performer", "fixed"] = setting(
        "performer",
        "Where objects are placed: 'performer': around the first performer that stands still; 'fixed': "
        "at world coordinates.",
    )
    patience: float = parameter(
        5.0,
        "If the performer moves for this time, the mean position of the performer is used. 0 turns this off.",
        unit="s",
        low=0.0,
        high=600.0,
    )
    bodies: Literal["never", "free", "always"] = setting(
        "free",
        "Whether the performers' own bodies push objects. 'free' applies only to performers without a "
        "character.",
    )
    engine: EngineSettings = group(EngineSettings, "Time steps and contacts.")
    spheres: SphereSettings = group(SphereSettings, "Approximation of characters by spheres.")
    boxes: BoxesSettings = group(BoxesSettings, "Towers of boxes.")
    dodgeball: DodgeballSettings = group(DodgeballSettings, "Thrown balls.")
