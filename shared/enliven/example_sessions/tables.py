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
from enliven.settings import data_field, group

Vector3 = tuple[float, float, float]


@dataclass(frozen=True)
class MeshTable:
    """The table [mesh]: the mesh's file, and its orientation and size."""

    file: str = data_field(doc="Path of the mesh, or of an .enliven project that contains the puppet.")
    height: float | None = data_field(
        None, "Height of the mesh after scaling. None: the mesh is not scaled.", unit="m", low=1e-6
    )
    up: Literal["x", "y", "z"] = data_field("y", "Axis of the file that points up.")
    turned: float = data_field(
        0.0,
        "Rotation about the vertical axis so that the mesh faces +Z, after `up` is applied.",
        unit="degrees",
    )
    puppet: str = data_field("", "Name of the puppet in an .enliven project. Empty: the first one.")


@dataclass(frozen=True)
class TakeTable:
    """The table [[take]]: a motion file."""

    file: str = data_field(doc="Path of the motion file.")
    name: str = data_field("", "Name of the take in the session. Empty: the file's name.")
    animation: str | None = data_field(None, "Name of the motion in the file. None: the first one.")
    start: float = data_field(0.0, "Start time in the file.", unit="s", low=0.0)
    end: float | None = data_field(None, "End time in the file.", unit="s", low=0.0)


@dataclass(frozen=True)
class PuppetTable:
    """The table [puppet]: name and pose of the puppet."""

    name: str = data_field("", "Name of the puppet. Empty: the mesh's name.")
    place: Vector3 = data_field((0.0, 0.0, 0.0), "Position of the puppet in the world.", unit="m")
    turn: tuple[float, float, float, float] = data_field(
        (1.0, 0.0, 0.0, 0.0), "Rotation of the puppet as a quaternion w, x, y, z."
    )


@dataclass(frozen=True)
class PointTable:
    """The table [[point]]: a control point."""

    name: str = data_field("", "Name of the control point.")
    vertex: int | None = data_field(None, "Vertex number of the control point in the mesh.", low=0)
    at: Vector3 | None = data_field(
        None,
        "Position of the control point, instead of a vertex number. The nearest vertex is used.",
        unit="m",
    )
    joint: str = data_field("", "Joint of the performer that the control point follows.")
    foot: bool = data_field(False, "True if the puppet can stand on this control point.")
    weight: float | None = data_field(
        None, "Weight of the control point. None: the surface meets the control point exactly.", low=1e-9
    )


@dataclass(frozen=True)
class PoseTable:
    """The table [[pose]]: a key pose."""

    take: str = data_field("", "Take with the performer's pose. Empty: the first take.")
    time: float | None = data_field(None, "Time of the performer's pose.", unit="s")
    frame: int | None = data_field(None, "Frame of the performer's pose, instead of a time.")
    places: dict[str, Vector3] | None = data_field(
        None, "Positions of control points by name. Other control points keep their rest positions."
    )
    moves: dict[str, Vector3] | None = data_field(
        None, "Displacements of control points from rest by name, instead of positions."
    )


@dataclass(frozen=True)
class SymmetryTable:
    """The table [symmetry]: the symmetry plane of the mesh."""

    find: bool = data_field(False, "Detects the mesh's own symmetry plane.")
    point: Vector3 = data_field((0.0, 0.0, 0.0), "Point on the symmetry plane.", unit="m")
    normal: Vector3 = data_field((1.0, 0.0, 0.0), "Normal of the symmetry plane.")


@dataclass(frozen=True)
class LayerTable:
    """The table [[layer]]: a take that the puppet plays, and its timing."""

    take: str = data_field("", "Take that the layer plays. Empty: the first take.")
    points: tuple[str, ...] = data_field((), "Control points that the layer moves. Empty: all.")
    offset: float = data_field(0.0, "Start time of the layer.", unit="s")
    speed: float = data_field(1.0, "Playback speed. Negative values play backwards.")
    loop: bool = data_field(False, "Repeats the take at its end.")
    hold: bool = data_field(
        True,
        "Holds the first pose before the take and the last pose after the take. If false, nothing "
        "plays there.",
    )
    ease: float = data_field(0.0, "Duration of fade-in and fade-out if `hold` is false.", unit="s", low=0.0)
    smooth: float = data_field(0.0, "Width of the time window that smooths the take.", unit="s", low=0.0)
    weight: float = data_field(
        1.0, "Blend weight of the layer: 0 keeps the layers below, 1 replaces them.", low=0.0, high=1.0
    )
    muted: bool = data_field(False, "Mutes the layer.")
    travel: bool = data_field(True, "Moves the puppet through the world.")
    level_feet: bool = data_field(
        True, "Keeps both feet at the same height when the anchor changes from one foot to the other."
    )
    mirrored: bool = data_field(False, "Mirrors the puppet's rotations. Set it for a mirrored puppet.")
    recorded: str = data_field("", "Name of the recording that the layer came from.")
    alternatives: str = data_field(
        "", "Name of the layer's group of alternative takes. Only one take of a group plays."
    )


INNER_TABLES: dict[str, tuple[str, type]] = {
    "clip": ("segments", Segment),
    "position": ("positions", Position),
    "velocity": ("velocities", Velocity),
    "coupling": ("couplings", Coupling),
    "switch": ("switches", Switch),
    "weight_key": ("weights", CurveKey),
    "speed_key": ("speeds", CurveKey),
}
"""For each table inside a layer, such as [[layer.clip]]: the attribute of the layer that it sets, and the
type of its values.
"""


ROOT_INNER_TABLES: dict[str, tuple[str, type]] = {
    "key": ("keys", MotionKey),
    **{name: INNER_TABLES[name] for name in ("clip", "weight_key", "speed_key")},
}
"""The tables inside a root layer, such as [[root.key]]. The keys belong to the layer's take."""


@dataclass(frozen=True)
class RootTable:
    """The table [[root]]: a layer that rotates and moves the whole puppet. It is applied after the other
    layers.
    """

    take: str = data_field(
        "",
        "Name of the take that contains the root's keys. Without keys: name of the take that moves the root.",
    )
    about: Vector3 = data_field((0.0, 0.0, 0.0), "World position about which the root turns.", unit="m")
    basis: tuple[float, float, float, float] = data_field(
        (1.0, 0.0, 0.0, 0.0),
        "Rotation of the puppet since its keys were created, as a quaternion w, x, y, z.",
    )
    size: float = data_field(1.0, "Scale of the puppet since its keys were created.", low=1e-9)
    offset: float = data_field(0.0, "Start time of the layer.", unit="s")
    speed: float = data_field(1.0, "Playback speed. Negative values play backwards.")
    loop: bool = data_field(False, "Repeats the take at its end.")
    hold: bool = data_field(
        True,
        "Holds the first pose before the take and the last pose after the take. If false, nothing "
        "plays there.",
    )
    ease: float = data_field(0.0, "Duration of fade-in and fade-out if `hold` is false.", unit="s", low=0.0)
    smooth: float = data_field(0.0, "Width of the time window that smooths the take.", unit="s", low=0.0)
    weight: float = data_field(1.0, "Strength of the layer, from 0 to 1.", low=0.0, high=1.0)
    muted: bool = data_field(False, "Mutes the layer.")
    mirrored: bool = data_field(False, "True if the puppet was mirrored after its keys were created.")
    recorded: str = data_field("", "Name of the recording that the layer came from.")
    alternatives: str = data_field(
        "", "Name of the layer's group of alternative takes. Only one take of a group plays."
    )


@dataclass(frozen=True)
class SettingsTable:
    """The table [settings]: settings of the solvers."""

    surface: ArapSettings = group(ArapSettings)
    examples: ExampleSettings = group(ExampleSettings)
    locomotion: LocomotionSettings = group(LocomotionSettings)
