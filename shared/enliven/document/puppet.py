"""A puppet: a mesh driven by control points, with example poses. An example pairs a performer's pose with a
pose of the mesh.

A mesh may have no part that corresponds to a skeleton, like a cactus that directs traffic. The user then
pairs joints of a performer with control points of the mesh, and poses a few examples. The examples determine
how the mesh follows all similar motions (Celikcan, Yaz and Capin, "Example-based retargeting of human motion
to arbitrary mesh models", 2015). :mod:`enliven.examples` computes the trajectories of the points, and
:mod:`enliven.deformation.arap.solver` computes the surface between them. Motion is not baked: a puppet stores
its examples, and layers that refer to takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from enliven.arrays import Float, freeze
from enliven.document.character import Character, SkinWeights
from enliven.document.constraints import Coupling, Position, Velocity
from enliven.document.example_settings import ExampleSettings
from enliven.document.locomotion import LocomotionSettings, Switch
from enliven.document.rig import RigBase
from enliven.document.surface_settings import ArapSettings
from enliven.document.time_map import LayerBase
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.rotation import IDENTITY

MIN_EXAMPLES = 2
"""Minimum number of key poses that the solver needs to move a puppet."""


@dataclass(frozen=True)
class ControlPoint:
    """A vertex of the mesh that is moved by a performer's joint, or by the user.

    Attributes:
        name: name of the point, unique on the puppet.
        vertex: number of the vertex in the mesh.
        joint: the performer's joint that is paired with the point, or empty.
        foot: True if the puppet can stand on the point.
        weight: strength of the point as a soft handle, or None for a hard handle (see ``Handle``).
    """

    name: str
    vertex: int
    joint: str = ""
    foot: bool = False
    weight: float | None = None


@dataclass(frozen=True, eq=False)
class KeyPose:
    """An example pose: the positions of the control points that correspond to the performer's pose at a time
    of a take.

    Attributes:
        take: id of the take.
        time: seconds since the start of the take.
        places: (P, 3) metres in the mesh's own frame, one row per control point of the puppet.
    """

    take: str
    time: float
    places: Float

    def __post_init__(self) -> None:
        freeze(self, "places")


@dataclass(frozen=True)
class Plane:
    """The mesh's symmetry plane: a point on it (3,), metres, and its normal (3,)."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float]


@dataclass(frozen=True)
class PuppetLayer(LayerBase):
    """A take that the puppet plays as an animation layer. The first layer is at the bottom.

    Attributes:
        take: id of the take, which contains the joints that are paired with the control points.
        points: names of the control points that the layer moves. Empty means all.
        weight: interpolation weight, 0 to 1, from the positions of the layers below (0) to those of this
            layer (1).
        travel: True if the layer moves the puppet through the world (``locomotion``). The first unmuted layer
            with ``travel`` determines the path. Otherwise the puppet stays in place.
        level_feet: True constrains two feet to equal heights at the frame at which the anchor changes from
            one foot to the other.
        switches: frames of the take at which contact and flight begin, or None to detect them.
        positions, velocities, couplings: hard constraints. Their frame numbers refer to the take.
        mirrored: True reverses rotations as in a mirror. It is set if the puppet was mirrored.
    """

    take: str
    points: tuple[str, ...] = ()
    weight: float = 1.0
    muted: bool = False
    travel: bool = True
    level_feet: bool = True
    switches: tuple[Switch, ...] | None = None
    positions: tuple[Position, ...] = ()
    velocities: tuple[Velocity, ...] = ()
    couplings: tuple[Coupling, ...] = ()
    mirrored: bool = False

    def __post_init__(self) -> None:
        where = f"layer of {self.take!r}"
        self.check_time(where)
        if not 0.0 <= self.weight <= 1.0:
            raise InputError(
                f"the weight {self.weight} of the layer is not valid",
                where=where,
                remedy="Set a weight from 0 to 1.",
            )


@dataclass(frozen=True, eq=False)
class ExampleCharacter(RigBase):
    """A mesh with control points, its example poses, and the takes that it plays.

    Its position in the world is ``turn`` (yaw(t) x + root(t)) + ``place``, with x in the mesh's own frame and
    the yaw and root of the layer that travels; see :class:`PuppetLayer`.

    Attributes:
        id: its name in the project.
        mesh: the surface at rest, metres, +Y up. If it has feet, it stands on y = 0.
        points: its control points.
        poses: its example poses, in the order in which they were created.
        layers: the layers that it plays, the first at the bottom.
        symmetry: the mesh's symmetry plane, if mirrored examples are to be added; otherwise None.
        place: (3,) position in the world, metres.
        turn: (4,) rotation in the world, unit quaternion.
        surface, examples, locomotion: settings of the surface solver, the example-based retargeting and the
            locomotion.

    Raises:
        InputError: if the attributes are inconsistent. A puppet with too few examples, or with points without
            a joint, is accepted. Solving its motion raises an error.
    """

    id: str
    mesh: Mesh
    points: tuple[ControlPoint, ...] = ()
    poses: tuple[KeyPose, ...] = ()
    layers: tuple[PuppetLayer, ...] = ()
    symmetry: Plane | None = None
    place: Float = field(default_factory=lambda: np.zeros(3))
    turn: Float = field(default_factory=lambda: IDENTITY)
    surface: ArapSettings = field(default_factory=ArapSettings)
    examples: ExampleSettings = field(default_factory=ExampleSettings)
    locomotion: LocomotionSettings = field(default_factory=LocomotionSettings)

    def __post_init__(self) -> None:
        for name in ("points", "poses", "layers"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        freeze(self, "place", "turn")
        problem = _describe_problem(self)
        if problem:
            raise InputError(problem, where=f"puppet {self.id!r}", remedy="Build the puppet again.")

    kind = "points"
    word = "puppet"
    is_solved = True
    locks_feet = False
    drawn_by = ("mesh", "points")

    @property
    def handles(self) -> tuple[str, ...]:
        """The names of its control points."""
        return tuple(point.name for point in self.points)

    @property
    def is_possessable(self) -> bool:
        """True if performers can attach to its surface. This requires a mesh, and fewer example poses than
        the example-based solver needs.
        """
        return self.mesh is not None and len(self.poses) < MIN_EXAMPLES

    def examples_of(self, layer: LayerBase) -> list[tuple[int, KeyPose]]:
        """Returns the key poses in the layer's take, each with its number."""
        return [(number, pose) for number, pose in enumerate(self.poses) if pose.take == layer.take]

    def find_needed_ids(self) -> Mapping[str, set[str]]:
        """Returns the ids of all takes that the puppet refers to, also in its key poses."""
        ids = super().find_needed_ids()
        ids["takes"].update(pose.take for pose in self.poses)
        return ids

    def with_takes_named(self, names: Mapping[tuple[str, str], str]) -> ExampleCharacter:
        """Returns the puppet with renamed ids of takes in layers and key poses."""
        poses = tuple(replace(pose, take=names["takes", pose.take]) for pose in self.poses)
        return super().with_takes_named(names).with_changes(poses=poses)

    @property
    def rest(self) -> Float:
        """(P, 3) the control points at rest in the mesh's frame, metres."""
        return np.asarray(self.mesh.vertices[[point.vertex for point in self.points]])

    def index(self, name: str) -> int:
        """Returns the number of a control point.

        Raises:
            InputError: if the name does not exist. The message lists the existing names.
        """
        for number, point in enumerate(self.points):
            if point.name == name:
                return number
        names = ", ".join(point.name for point in self.points) or "none"
        problem = f"the puppet has no control point {name!r}"
        raise InputError(problem, where=f"puppet {self.id!r}", remedy=f"Known control points: {names}.")


def character_from_puppet(puppet: ExampleCharacter) -> Character:
    """Converts the puppet to a character for viewers, of kind "points". Its frame is transform 0, and control
    point k - 1 is transform k.

    Viewers solve the surface. In a viewer without a solver, the puppet moves as a rigid object, because all
    vertices follow transform 0.

    Raises:
        InputError: if the puppet has no control points.
    """
    if not puppet.points:
        advice = "Add a control point on the mesh."
        raise InputError("the puppet has no control points", where=f"puppet {puppet.id!r}", remedy=advice)
    vertices, count = puppet.mesh.vertices, len(puppet.points)
    indices = np.zeros((len(vertices), 4), np.uint16)
    weights = np.zeros((len(vertices), 4), np.float32)
    weights[:, 0] = 1.0
    pivots = np.concatenate([np.zeros((1, 3)), puppet.rest]).astype(np.float32)
    edges = np.stack([np.zeros(count, np.int32), np.arange(1, count + 1, dtype=np.int32)], 1)
    return Character(
        id=puppet.id,
        vertices=vertices.astype(np.float32),
        faces=puppet.mesh.faces,
        skin=SkinWeights(indices, weights),
        pivots=pivots,
        edges=edges,
        kind="points",
        colours=puppet.mesh.colours,
        held=np.array([point.vertex for point in puppet.points], np.int32),
        pulls=np.array([point.weight or 0.0 for point in puppet.points], np.float32),
        surface=puppet.surface,
        materials=puppet.mesh.materials,
    )


def _describe_problem(puppet: ExampleCharacter) -> str:
    names = [point.name for point in puppet.points]
    if len(set(names)) < len(names):
        return f"two control points have the same name in this list: {', '.join(names)}"
    if puppet.place.shape != (3,) or puppet.turn.shape != (4,):
        return (
            f"the placement of the puppet has wrong shapes: position {puppet.place.shape}, "
            f"rotation {puppet.turn.shape}"
        )
    if not np.isclose(np.linalg.norm(puppet.turn), 1.0, atol=1e-6):
        return f"the rotation {puppet.turn} of the puppet is not a unit quaternion"
    for point in puppet.points:
        if not point.name or not 0 <= point.vertex < len(puppet.mesh.vertices):
            return (
                f"the control point {point.name!r} has no name, or its vertex {point.vertex} is not "
                f"among the {len(puppet.mesh.vertices)} vertices of the mesh"
            )
    for number, pose in enumerate(puppet.poses):
        if pose.places.shape != (len(names), 3):
            return f"key pose {number} has {len(pose.places)} positions for {len(names)} control points"
        if not np.isfinite(pose.places).all() or not np.isfinite(pose.time):
            return f"a position or the time of key pose {number} is not a finite number"
    for layer in puppet.layers:
        missing = sorted(set(layer.points) - set(names))
        if missing:
            return (
                f"the layer with the take {layer.take!r} moves the control point {missing[0]!r}, which "
                "does not exist"
            )
    return ""
