"""The settings of the physics simulation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.deformation import SphereSettings
from enliven.settings import setting

WorldName = Literal["none", "boxes", "dodgeball"]


@dataclass(frozen=True)
class EngineSettings:
    """Settings of the engine's time steps."""

    substep: float = setting(0.0056, "Longest time step.", unit="s", low=0.0005, high=0.02)
    catch_up: float = setting(
        0.1, "Time made up after a pause; more is left out.", unit="s", low=0.0, high=2.0
    )
    budget: float = setting(
        0.02,
        "Wall time a live frame may take; the rest of it is left out. 0: no bound.",
        unit="s",
        low=0.0,
    )
    gravity: float = setting(9.81, "Downwards.", unit="m/s²", low=-50.0, high=50.0)
    stiffness: float = setting(0.02, "Time in which a contact settles.", unit="s", low=0.001, high=0.2)
    friction: float = setting(0.6, "Between everything.", low=0.0, high=5.0)
    push_out: float = setting(
        0.8, "Speed at which what got inside something is pushed out.", unit="m/s", low=0.01, high=20.0
    )
    fastest: float = setting(
        15.0, "A sphere that would move faster has jumped, and hits nobody.", unit="m/s", low=0.1, high=200.0
    )
    fastest_prop: float = setting(12.0, "No box or ball moves faster.", unit="m/s", low=0.1, high=100.0)


@dataclass(frozen=True)
class BoxesSettings:
    """Settings of towers of boxes to knock over."""

    at: tuple[tuple[float, float], ...] = setting(
        ((0.62, 0.15), (0.12, 0.90)),
        "The towers: metres to the performer's left and ahead; or x and z of the world.",
        unit="m",
    )
    wide: int = setting(2, "Boxes along each side of a tower.", low=1, high=6)
    high: int = setting(6, "Boxes above each other.", low=1, high=20)
    side: float = setting(0.17, "Edge of a box.", unit="m", low=0.02, high=2.0)
    mass: float = setting(0.35, "Of a box.", unit="kg", low=0.001, high=100.0)
    rebuild: float = setting(
        12.0,
        "Fallen towers stand again after everything has been still for this; 0: never.",
        unit="s",
        low=0.0,
    )


@dataclass(frozen=True)
class DodgeballSettings:
    """Settings of balls that are thrown at every target in turn."""

    balls: int = setting(4, "Balls.", low=1, high=64)
    radius: float = setting(0.11, "Of a ball.", unit="m", low=0.02, high=1.0)
    mass: float = setting(0.25, "Of a ball.", unit="kg", low=0.001, high=100.0)
    bounce: float = setting(0.7, "Speed after a bounce over the speed before.", low=0.0, high=0.95)
    every: float = setting(1.2, "From one throw to the next.", unit="s", low=0.05, high=600.0)
    distance: float = setting(2.6, "From where a ball is thrown to its target.", unit="m", low=0.5, high=20.0)
    hand: float = setting(1.3, "Height from which it is thrown.", unit="m", low=0.0, high=10.0)
    flight: float = setting(0.7, "Time a ball takes to its target.", unit="s", low=0.1, high=5.0)


@dataclass(frozen=True)
class PhysicsSettings:
    """Settings of the physics world."""

    world: WorldName = setting("none", "'boxes' are towers to knock over; in 'dodgeball' balls are thrown.")
    place: Literal["performer", "fixed"] = setting(
        "performer", "Where: about where a performer first stood still, or in the world's own x and z."
    )
    stand: float = setting(0.3, "Standing still for this long shows the place.", unit="s", low=0.0, high=60.0)
    patience: float = setting(
        5.0,
        "A performer who never stands still shows it too, by where they moved about for this long; 0: never.",
        unit="s",
        low=0.0,
        high=600.0,
    )
    bodies: Literal["never", "free", "always"] = setting(
        "free", "Whether performers push too: 'free' are those who hold no character."
    )
    engine: EngineSettings = setting(EngineSettings, "Time and contact.")
    spheres: SphereSettings = setting(SphereSettings, "How characters become spheres.")
    boxes: BoxesSettings = setting(BoxesSettings, "The towers.")
    dodgeball: DodgeballSettings = setting(DodgeballSettings, "The balls.")
