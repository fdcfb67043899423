"""A puppet's session in an animator's terms: positions of the control points, and the directions of each key
pose.

project = staged(ACTS["cactus"])                # a project with the puppet, its key poses and its take text =
session_of(ACTS["cactus"], project)      # the same as a session file (TOML)
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from example_posing import Direction, Figure, Limb
from scipy.spatial import cKDTree

from enliven.arrays import Float
from enliven.document.example_settings import ExampleSettings
from enliven.document.locomotion import LocomotionSettings
from enliven.document.project import Project
from enliven.document.puppet import ControlPoint, ExampleCharacter, KeyPose, Plane, PuppetLayer
from enliven.document.surface_settings import ArapSettings
from enliven.example_sessions.mesh import fit_mesh
from enliven.example_sessions.session import Session, read_session
from enliven.example_sessions.tables import MeshTable, TakeTable
from enliven.example_sessions.text import session_text
from enliven.meshes.files import load_mesh
from enliven.meshes.mesh import Axis, Mesh, refine
from enliven.motion_clips.take_files import read_take

DATA = Path(os.environ.setdefault("ENLIVEN_DATA", str(Path(__file__).parents[4] / "shared" / "data")))
SESSIONS = Path(__file__).parent / "example_sessions"
MIDDLE = Plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
"""Sagittal plane. Control points on the left are mirrored to the right."""
_MOST_VERTICES = 3_000_000
_TENTH_MM = 4
"""Decimals of key poses, metres. Rounding makes a session identical on every machine."""


@dataclass(frozen=True)
class Point:
    """A control point on the vertex nearest to a position (3,), metres, paired with a joint."""

    name: str
    near: tuple[float, float, float]
    joint: str
    foot: bool = False


@dataclass(frozen=True)
class Key:
    """A key pose: the performer's pose at a time of the take, and the puppet's directions for it."""

    seconds: float
    sees: str
    does: tuple[Direction, ...]


@dataclass(frozen=True)
class Shown:
    """A filmed part of the take: start and end in seconds, speed, and camera direction.

    Attributes:
        azimuth: degrees from the puppet's front towards its left.
    """

    first: float
    last: float
    azimuth: float = 14.0
    speed: float = 1.0


@dataclass(frozen=True)
class Act:
    """A character, its take, and its directions.

    Attributes:
        title: title of the film.
        mesh, take: files of the data.
        height: metres after scaling.
        up, turned: the axis that points up in the file, and the rotation about it in degrees after which
            the mesh faces +Z.
        points: control points.
        limbs: limbs by the names used in directions.
        keys: the key poses.
        mirrored: True to add the mirror image of each key pose.
        shown: the film.
        colour: sRGB.
        of: name of another act whose session this act plays, empty for its own session.
        finer: maximum edge length after refining the mesh, metres. 0 does not refine.
    """

    title: str
    mesh: str
    take: str
    height: float
    points: tuple[Point, ...]
    limbs: Mapping[str, Limb]
    keys: tuple[Key, ...]
    shown: tuple[Shown, ...]
    colour: tuple[int, int, int]
    up: Axis = "y"
    turned: float = 0.0
    mirrored: bool = False
    examples: ExampleSettings = field(default_factory=ExampleSettings)
    surface: ArapSettings = field(default_factory=lambda: ArapSettings(hold=0.03))
    level_feet: bool = True
    locomotion: LocomotionSettings = field(default_factory=lambda: LocomotionSettings(plant=1.0))
    of: str = ""
    finer: float = 0.0

    @property
    def mesh_table(self) -> MeshTable:
        """Returns the session's mesh table."""
        return MeshTable(f"$ENLIVEN_DATA/{self.mesh}", self.height, self.up, self.turned)

    @property
    def missing(self) -> list[Path]:
        """Returns the data files that are missing."""
        return [DATA / file for file in (self.mesh, self.take) if not (DATA / file).is_file()]


def staged(act: Act, keys: int | None = None) -> Project:
    """Returns the project of an act, with its first ``keys`` key poses or all of them."""
    mesh = fit_mesh(load_mesh(DATA / act.mesh).mesh, act.mesh_table)
    take = read_take(DATA / act.take)[0]
    figure, points = figure_of(act, mesh)
    poses = [
        KeyPose(take.id, key.seconds, _round_values(figure.posed(*key.does)))
        for key in act.keys[: keys or len(act.keys)]
    ]
    puppet = ExampleCharacter(
        id=Path(act.mesh).stem,
        mesh=mesh,
        points=points,
        poses=tuple(poses),
        layers=(PuppetLayer(take.id, level_feet=act.level_feet),),
        symmetry=MIDDLE if act.mirrored else None,
        examples=act.examples,
        surface=act.surface,
        locomotion=act.locomotion,
    )
    return Project(takes={take.id: take}, characters={puppet.id: puppet})


def figure_of(act: Act, mesh: Mesh) -> tuple[Figure, tuple[ControlPoint, ...]]:
    """Returns the figure that is directed, and its control points."""
    used = np.unique(mesh.faces)
    held = used[cKDTree(mesh.vertices[used]).query([point.near for point in act.points])[1]]
    points = [
        ControlPoint(point.name, int(vertex), point.joint, point.foot)
        for point, vertex in zip(act.points, held, strict=True)
    ]
    names = tuple(point.name for point in points)
    feet = tuple(point.name for point in points if point.foot)
    return Figure(names, mesh.vertices[held], act.limbs, feet, act.height), tuple(points)


def session_of(act: Act, project: Project) -> str:
    """Returns the text of the session."""
    puppet = next(iter(project.puppets.values()))
    takes = {name: TakeTable(f"$ENLIVEN_DATA/{act.take}") for name in project.takes}
    return session_text(puppet, act.mesh_table, takes)


def stored(name: str) -> Session:
    """Returns the session stored in the repository."""
    return read_session(SESSIONS / f"{name}.toml")


def playing(name: str, act: Act) -> Project:
    """Returns the project that an act plays: its stored session, on a finer mesh if the act asks for it."""
    project = stored(act.of or name).project
    if act.finer <= 0.0:
        return project
    puppet = next(iter(project.puppets.values()))
    # Refining keeps the numbers of existing vertices.
    mesh = refine(puppet.mesh, act.finer, _MOST_VERTICES)
    return project.with_characters(puppet.with_changes(mesh=mesh))


def _round_values(places: Float) -> Float:
    return np.round(places, _TENTH_MM) + 0.0
