"""A possessed mesh as a shape: a deformation graph with nodes that play their recorded motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from enliven.arrays import Float, Int, Int32, freeze, frozen
from enliven.document.body_take import Possession
from enliven.document.character import Character, Pose, SkinWeights
from enliven.document.rig import RigBase
from enliven.document.time_map import Playing
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.rotation import IDENTITY


@dataclass(frozen=True, eq=False)
class PoseStream:
    """The recorded motion of a deformation graph's nodes. Like a take, it never changes.

    Attributes:
        id: its name in the project.
        linear: (F, N, 3, 3) float64, nearly rotations.
        positions: (F, N, 3) float64 metres, where the nodes were, in the world.
        step: seconds from one frame to the next.

    Raises:
        InputError: where the arrays do not fit together or are not finite.
    """

    id: str
    linear: Float
    positions: Float
    step: float

    def __post_init__(self) -> None:
        freeze(self, "linear", "positions")
        frames, nodes = self.positions.shape[:2] if self.positions.ndim == 3 else (0, 0)
        problem = ""
        if frames == 0 or nodes == 0:
            problem = "it has no frames or no nodes"
        elif self.positions.shape != (frames, nodes, 3) or self.linear.shape != (frames, nodes, 3, 3):
            problem = f"linear {self.linear.shape}, positions {self.positions.shape}"
        elif not (np.isfinite(self.linear).all() and np.isfinite(self.positions).all()):
            problem = "something in it is not finite"
        elif not 0.0 < self.step <= 10.0:
            problem = f"a frame lasts {self.step} s"
        if problem:
            raise InputError(problem, where=f"stream {self.id!r}", mend="Record it again.")

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self.positions) - 1) * self.step


@dataclass(frozen=True, eq=False)
class Ride:
    """A part of a graph shape that is carried by a node of another part, as it was put there.

    The carried motion y becomes R(t) R_0^-1 (y - x_0) + x(t), with x the node's position and R the rotation
    nearest to its linear map, x_0 and R_0 those at the moment of the merge.

    Attributes:
        node: of the whole shape.
        turn: (4,) R_0.
        place: (3,) x_0.
    """

    node: int
    turn: Float
    place: Float

    def __post_init__(self) -> None:
        freeze(self, "turn", "place")


class Solved(Playing):
    """What plays a stream that was solved from performers, and can be solved from them again.

    Attributes:
        possession: what the stream was solved from; None: from nothing.
    """

    source = "streams"
    if TYPE_CHECKING:

        @property
        def nodes(self) -> Int: ...
        @property
        def possession(self) -> Possession | None: ...

    def needs(self) -> tuple[tuple[str, str], ...]:
        """Its stream, and the bodies that it was solved from."""
        solved = self.possession
        return (*super().needs(), *(() if solved is None else (("bodies", solved.take),)))

    def with_takes_named(self, names: Mapping[tuple[str, str], str]) -> Self:
        """The same with other ids of its stream and its bodies."""
        solved, named = self.possession, super().with_takes_named(names)
        if solved is None:
            return named
        return replace(named, possession=replace(solved, take=names["bodies", solved.take]))  # type: ignore[call-arg]


@dataclass(frozen=True, eq=False)
class GraphPart(Solved):
    """Nodes that play one stream.

    Attributes:
        take: the id of the stream.
        nodes: (K,) int64 which of the stream's nodes.
        axes: (4,) how the rest pose was turned since the recording: linear becomes linear axes^-1.
        turn: (4,) and
        place: (3,) metres, how the whole motion was moved in the world: x becomes turn x + place.
        size: how many times as large it is as recorded: x becomes size x, before it is moved.
        mirrored: whether it was reflected in the plane x = 0 before that: x becomes S x, linear S linear S,
            S = diag(-1, 1, 1); so is the rest pose.
        ride: what carries it, or None for the world.
        muted: true lets it stand still, as at its stream's first frame.
        possession: what the stream was solved from, and can be solved from again; None: from nothing.
    """

    take: str
    nodes: Int
    axes: Float = field(default_factory=lambda: IDENTITY)
    turn: Float = field(default_factory=lambda: IDENTITY)
    place: Float = field(default_factory=lambda: np.zeros(3))
    size: float = 1.0
    mirrored: bool = False
    ride: Ride | None = None
    muted: bool = False
    possession: Possession | None = None

    def __post_init__(self) -> None:
        freeze(self, "nodes", kind=np.int64)
        freeze(self, "axes", "turn", "place")
        self.check_time(f"part {self.take!r}")
        if not self.size > 0.0:
            raise InputError(f"it cannot be {self.size} times as large", where=f"part {self.take!r}")

        known = np.inf if self.possession is None else len(self.possession.rest)
        if self.nodes.size and not self.nodes.max() < known:
            what = f"it plays node {self.nodes.max()} of {known} that were solved"
            raise InputError(what, where=f"part {self.take!r}", mend="Possess the mesh again.")


@dataclass(frozen=True, eq=False)
class GraphLayer(Solved):
    """What was performed over the motion of a graph shape: how far each node goes from its rest.

    With the base taking a point near a node from rest to the world by B, and the layer taking it within the
    rest by D, the node takes it by B D; of several layers the first is the outermost.

    Attributes:
        take: the id of the stream: where the nodes were, and their linear maps, with the mesh standing as it
            does at rest.
        nodes: (K,) int64 which of the stream's nodes.
        own: (K,) int64 the nodes of the shape that they move.
        rest: (N, 3) metres, the stream's nodes at rest.
        axes, size, mirrored: how the shape's rest was turned, scaled and reflected since: a displacement d
            becomes size axes S d, as of :class:`GraphPart`.
        weight: from 0 to 1, how much of it is played.
        muted: true leaves it out.
        possession: of :class:`Solved`.
    """

    take: str
    nodes: Int
    own: Int
    rest: Float
    axes: Float = field(default_factory=lambda: IDENTITY)
    size: float = 1.0
    mirrored: bool = False
    weight: float = 1.0
    muted: bool = False
    possession: Possession | None = None

    def __post_init__(self) -> None:
        freeze(self, "nodes", "own", kind=np.int64)
        freeze(self, "rest", "axes")
        where = f"layer {self.take!r}"
        self.check_time(where)
        fits = self.nodes.shape == self.own.shape and self.nodes.size > 0 and self.rest.shape[1:] == (3,)
        if not (fits and self.nodes.max() < len(self.rest)):
            what = f"{self.nodes.shape} nodes of {self.rest.shape} move {self.own.shape}"
            raise InputError(what, where=where, mend="Record it again.")
        if not (self.size > 0.0 and 0.0 <= self.weight <= 1.0):
            what = f"it cannot be {self.size} times as large, with a weight of {self.weight}"
            raise InputError(what, where=where, mend="Give a size above 0, and a weight from 0 to 1.")

    @property
    def id(self) -> str:
        """What it is called: as its stream."""
        return self.take


@dataclass(frozen=True, eq=False)
class GraphShape(RigBase):
    """A mesh, the nodes that carry it, and what those play. Nodes are numbered part by part.

    Attributes:
        id: its name in the project.
        positions: (N, 3) metres, the nodes at rest.
        edges: (E, 2) int32 pairs of nodes, to be drawn.
        mesh: the surface at rest.
        skin: the four nodes that each vertex follows.
        parts: what the nodes play; their numbers of nodes sum to N. A part rides on one before it.
        over: what was performed over that, the outermost first.
        ends: (5, 3) metres at rest, the ends of head, left and right hand, left and right foot, where an
            artist named them; else none.

    Raises:
        InputError: where the parts do not fit together.
    """

    id: str
    positions: Float
    edges: Int32
    mesh: Mesh
    skin: SkinWeights
    parts: tuple[GraphPart, ...]
    over: tuple[GraphLayer, ...] = ()
    ends: Float = field(default_factory=lambda: np.empty((0, 3)))

    def __post_init__(self) -> None:
        freeze(self, "positions", "ends")
        object.__setattr__(self, "edges", frozen(np.reshape(self.edges, (-1, 2)), np.int32))
        object.__setattr__(self, "parts", tuple(self.parts))
        object.__setattr__(self, "over", tuple(self.over))
        problem = _problem_of(self)
        if problem:
            raise InputError(problem, where=self.where, mend="Build the shape again.")

    kind = "graph"
    word = "possessed mesh"
    played = "parts"
    drawn_by = ("mesh", "skin", "positions")

    @property
    def playing(self) -> tuple[Solved, ...]:
        """Its parts, and what was performed over them."""
        return (*self.parts, *self.over)

    def with_playing(self, *layers: Playing) -> GraphShape:
        """The same with other parts and layers."""
        parts = tuple(one for one in layers if isinstance(one, GraphPart))
        over = tuple(one for one in layers if isinstance(one, GraphLayer))
        return self.with_changes(parts=parts, over=over)

    def check(self, held: Mapping[str, Mapping[str, Any]]) -> None:
        """Refuse takes that are not there, or that are of something else."""
        super().check(held)
        for one in (*self.parts, *self.over):
            known = held["streams"][one.take].positions.shape[1]
            if one.nodes.size and not 0 <= one.nodes.min() <= one.nodes.max() < known:
                raise InputError(f"it plays nodes of {one.take!r} that are not there", where=self.where)

    def without_layer(self, number: int) -> GraphShape:
        """The same without something that was performed over it; refused for a part.

        Raises:
            InputError: for a part: its nodes play its stream and nothing else.
        """
        if number < len(self.parts):
            mend = "Mute it, or cut that part off."
            raise InputError("its nodes have no other motion", where=self.where, mend=mend)
        return super().without_layer(number)

    def at_rest(self, mesh: Mesh | None) -> tuple[GraphShape, tuple[PoseStream, ...]]:
        """A possessed mesh that stands still; its skin is made anew from the mesh on the stage."""
        shape, stream = graph_shape_at_rest(self.id, self.positions, self.edges, mesh or self.mesh)
        return shape.with_changes(ends=self.ends), (stream,)

    @property
    def starts(self) -> tuple[int, ...]:
        """The number of the first node of each part, and N."""
        return tuple(np.cumsum([0, *(len(part.nodes) for part in self.parts)]).tolist())


_REST = "rest"
"""The id of the stream of a possessed mesh at rest."""


def graph_shape_at_rest(name: str, nodes: Float, edges: Int32, mesh: Mesh) -> tuple[GraphShape, PoseStream]:
    """A mesh with nodes (N, 3) that stand still, every vertex on the first of them, and the nodes' stream."""
    count = len(mesh.vertices)
    skin = SkinWeights(
        np.zeros((count, 4), np.uint16), np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1))
    )
    stream = PoseStream(_REST, np.tile(np.eye(3), (1, len(nodes), 1, 1)), nodes[None], 1.0)
    part = GraphPart(_REST, np.arange(len(nodes)))
    return GraphShape(name, nodes, edges, mesh, skin, (part,)), stream


def graph_shape_of(
    character: Character, poses: Sequence[Pose], stream_id: str, step: float | None = None
) -> tuple[GraphShape, PoseStream]:
    """A possessed character and the poses that were recorded of it, as a shape and its stream.

    Args:
        poses: in the order of time, one each ``step``.
        step: seconds; None takes the mean of the poses' times.

    Raises:
        InputError: for a rigged character, fewer than two poses, or poses of another character.
    """
    where = f"character {character.id!r}"
    if character.kind != "graph":
        raise InputError("it has bones", where=where, mend="Retarget the motion onto its skeleton instead.")
    if len(poses) < 2 or any(len(pose.positions) != len(character.pivots) for pose in poses):
        raise InputError(f"{len(poses)} poses cannot be played", where=where, mend="Record it again.")
    seconds = (poses[-1].time_ns - poses[0].time_ns) / 1e9 / (len(poses) - 1) if step is None else step
    linear = np.array([pose.linear for pose in poses], np.float64)
    positions = np.array([pose.positions for pose in poses], np.float64)
    stream = PoseStream(stream_id, linear, positions, seconds)
    vertices = np.asarray(character.vertices, np.float64)
    mesh = Mesh(vertices, character.faces, character.id, character.colours, character.materials)
    part = GraphPart(stream_id, np.arange(len(character.pivots)))
    pivots = np.asarray(character.pivots, np.float64)
    return GraphShape(character.id, pivots, character.edges, mesh, character.skin, (part,)), stream


def character_of_graph(shape: GraphShape) -> Character:
    """The shape as viewers know it."""
    return Character(
        shape.id,
        shape.mesh.vertices.astype(np.float32),
        shape.mesh.faces,
        shape.skin,
        shape.positions.astype(np.float32),
        shape.edges,
        "graph",
        shape.mesh.colours,
        materials=shape.mesh.materials,
    )


def _problem_of(shape: GraphShape) -> str:
    count = len(shape.positions)
    if shape.positions.shape != (count, 3) or shape.starts[-1] != count or count == 0:
        return f"positions {shape.positions.shape} of {shape.starts[-1]} nodes"
    if shape.edges.size and not 0 <= shape.edges.min() <= shape.edges.max() < count:
        return "an edge names a node that is not there"
    if shape.ends.shape not in ((0, 3), (5, 3)) or not np.isfinite(shape.ends).all():
        return f"ends {shape.ends.shape}, expected five places or none"
    vertices = (len(shape.mesh.vertices), 4)
    if shape.skin.indices.shape != vertices or shape.skin.weights.shape != vertices:
        return f"the skin is {shape.skin.indices.shape}, expected {vertices}"
    if shape.skin.indices.size and int(shape.skin.indices.max()) >= count:
        return f"a vertex follows node {int(shape.skin.indices.max())} of {count}"
    for part, start in zip(shape.parts, shape.starts, strict=False):
        if part.ride is not None and not 0 <= part.ride.node < start:
            return f"a part rides on node {part.ride.node}, which does not come before it"
    for layer in shape.over:
        if not 0 <= layer.own.min() <= layer.own.max() < count or len(set(layer.own.tolist())) < len(
            layer.own
        ):
            return f"layer {layer.take!r} moves a node that is not there, or one twice"
    return ""
