"""The tables of a session file, each as a settings class. See :mod:`enliven.example_sessions.session` for an
example file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from enliven.document import (
    ArapSettings,
    Coupling,
    CurveKey,
    ExampleSettings,
    LocomotionSettings,
    MotionKey,
    Position,
    Segment,
    Switch,
    Velocity,
)
from enliven.settings import setting

Three = tuple[float, float, float]


@dataclass(frozen=True)
class MeshTable:
    """[mesh]"""

    file: str = setting(doc="The mesh's file, or an .enliven project with the puppet.")
    height: float | None = setting(
        None, "How tall to make it; its own height if not given.", unit="m", low=1e-6
    )
    up: Literal["x", "y", "z"] = setting("y", "The file's axis that points up.")
    turned: float = setting(
        0.0, "How far it is turned about the upright then, to look to +Z.", unit="degrees"
    )
    puppet: str = setting("", "Whose mesh of an .enliven project; the first puppet's if not given.")


@dataclass(frozen=True)
class TakeTable:
    """[[take]]"""

    file: str = setting(doc="The motion's file.")
    name: str = setting("", "What it is called here; as its file if not given.")
    animation: str | None = setting(None, "Which of the file's motions; the first if not given.")
    start: float = setting(0.0, "Where in the file it begins.", unit="s", low=0.0)
    end: float | None = setting(None, "Where in the file it ends.", unit="s", low=0.0)


@dataclass(frozen=True)
class PuppetTable:
    """[puppet]"""

    name: str = setting("", "The puppet's; the mesh's if not given.")
    place: Three = setting((0.0, 0.0, 0.0), "Where it stands.", unit="m")
    turn: tuple[float, float, float, float] = setting((1.0, 0.0, 0.0, 0.0), "w, x, y, z of a rotation.")


@dataclass(frozen=True)
class PointTable:
    """[[point]]"""

    name: str = setting("", "The control point's.")
    vertex: int | None = setting(None, "Of the mesh.", low=0)
    at: Three | None = setting(None, "Instead of a vertex: the nearest one to this place.", unit="m")
    joint: str = setting("", "Of the performer, that it follows.")
    foot: bool = setting(False, "Whether the puppet can stand on it.")
    weight: float | None = setting(None, "How hard it pulls; it holds hard if not given.", low=1e-9)


@dataclass(frozen=True)
class PoseTable:
    """[[pose]]"""

    take: str = setting("", "Of the performer's pose; the first take if not given.")
    time: float | None = setting(None, "Of the performer's pose.", unit="s")
    frame: int | None = setting(None, "Instead of a time.")
    places: dict[str, Three] | None = setting(None, "Where control points are; others stay at rest.")
    moves: dict[str, Three] | None = setting(None, "Or how far they are moved from where they rest.")


@dataclass(frozen=True)
class SymmetryTable:
    """[symmetry]"""

    find: bool = setting(False, "Find the mesh's own plane.")
    point: Three = setting((0.0, 0.0, 0.0), "Of the plane.", unit="m")
    normal: Three = setting((1.0, 0.0, 0.0), "Across the plane.")


@dataclass(frozen=True)
class LayerTable:
    """[[layer]]"""

    take: str = setting("", "What it plays; the first take if not given.")
    points: tuple[str, ...] = setting((), "Which control points it moves; all if none.")
    offset: float = setting(0.0, "When it begins.", unit="s")
    speed: float = setting(1.0, "How fast it plays; below 0 backwards.")
    loop: bool = setting(False, "Whether it begins again.")
    hold: bool = setting(True, "Whether its ends stand still beyond it; otherwise nothing is played there.")
    ease: float = setting(0.0, "How long it comes in and goes out without hold.", unit="s", low=0.0)
    smooth: float = setting(0.0, "Over how long its take is smoothed.", unit="s", low=0.0)
    weight: float = setting(1.0, "How much of it is seen.", low=0.0, high=1.0)
    muted: bool = setting(False, "Whether it is left out.")
    travel: bool = setting(True, "Whether the puppet goes through the world.")
    level_feet: bool = setting(True, "Feet are equally high where one takes over from another.")
    mirrored: bool = setting(False, "Whether it turns the other way round.")
    recorded: str = setting("", "The name of the recording that it came from.")
    alternatives: str = setting("", "The name of the takes of which it is one; one of them is heard.")


INSIDE: dict[str, tuple[str, type]] = {
    "clip": ("segments", Segment),
    "position": ("positions", Position),
    "velocity": ("velocities", Velocity),
    "coupling": ("couplings", Coupling),
    "switch": ("switches", Switch),
    "weight_key": ("weights", CurveKey),
    "speed_key": ("speeds", CurveKey),
}
"""[[layer.clip]] and the other tables inside a layer: the attribute that each one sets, and its type."""


ROOT_INSIDE: dict[str, tuple[str, type]] = {
    "key": ("keys", MotionKey),
    **{name: INSIDE[name] for name in ("clip", "weight_key", "speed_key")},
}
"""[[root.key]] and the other tables inside a root layer. The keys belong to the layer's take."""


@dataclass(frozen=True)
class RootTable:
    """[[root]]: a layer that rotates and moves the whole puppet, applied after its other layers."""

    take: str = setting("", "What its keys are called; without keys, the take that moves it.")
    about: Three = setting((0.0, 0.0, 0.0), "What it is turned about, in the world.", unit="m")
    basis: tuple[float, float, float, float] = setting((1.0, 0.0, 0.0, 0.0), "How it was turned since.")
    size: float = setting(1.0, "How much larger it was made since.", low=1e-9)
    offset: float = setting(0.0, "When it begins.", unit="s")
    speed: float = setting(1.0, "How fast it plays; below 0 backwards.")
    loop: bool = setting(False, "Whether it begins again.")
    hold: bool = setting(True, "Whether its ends stand still beyond it; otherwise nothing is played there.")
    ease: float = setting(0.0, "How long it comes in and goes out without hold.", unit="s", low=0.0)
    smooth: float = setting(0.0, "Over how long its take is smoothed.", unit="s", low=0.0)
    weight: float = setting(1.0, "How much of it is seen.", low=0.0, high=1.0)
    muted: bool = setting(False, "Whether it is left out.")
    mirrored: bool = setting(False, "Whether it turns the other way round.")
    recorded: str = setting("", "The name of the recording that it came from.")
    alternatives: str = setting("", "The name of the takes of which it is one; one of them is heard.")


@dataclass(frozen=True)
class SettingsTable:
    """[settings]"""

    surface: ArapSettings = setting(ArapSettings)
    examples: ExampleSettings = setting(ExampleSettings)
    locomotion: LocomotionSettings = setting(LocomotionSettings)
