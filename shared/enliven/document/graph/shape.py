"""A possessed mesh: its surface follows a deformation graph, and the nodes of the graph play recorded
motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from enliven.arrays import Float, Int32, freeze, frozen
from enliven.document.character import Character, Pose, SkinWeights
from enliven.document.graph.layers import GraphLayer, GraphPart
from enliven.document.graph.stream import PoseStream
from enliven.document.layers import RootLayer
from enliven.document.rig import RigBase
from enliven.document.time_map import LayerBase
from enliven.errors import InputError
from enliven.meshes import Mesh


@dataclass(frozen=True, eq=False)
class GraphCharacter(RigBase):
    """A mesh with the graph nodes that move it, and the parts and layers that the nodes play. Nodes are
    numbered part by part.

    Attributes:
        id: its name in the project.
        positions: (N, 3) metres, the nodes at rest.
        edges: (E, 2) int32 pairs of nodes, to be drawn.
        mesh: the surface at rest.
        skin: the four nodes that each vertex follows.
        parts: the groups of nodes with their streams. Their node counts sum to N. A part can only be carried
            by an earlier part.
        over: the layers on top of the parts, the outermost first.
        ends: (5, 3) the ends of head, left and right hand, left and right foot at rest, metres, if an artist
            or a scan provided them. Otherwise empty.
        joints: (20, 3) the joints of a scanned person at rest, metres. Empty for other meshes.

    Raises:
        InputError: if the attributes are inconsistent.
    """

    id: str
    positions: Float
    edges: Int32
    mesh: Mesh
    skin: SkinWeights
    parts: tuple[GraphPart, ...]
    over: tuple[GraphLayer, ...] = ()
    ends: Float = field(default_factory=lambda: np.empty((0, 3)))
    joints: Float = field(default_factory=lambda: np.empty((0, 3)))

    is_possessable = True

    def __post_init__(self) -> None:
        freeze(self, "positions", "ends", "joints")
        object.__setattr__(self, "edges", frozen(np.reshape(self.edges, (-1, 2)), np.int32))
        object.__setattr__(self, "parts", tuple(self.parts))
        object.__setattr__(self, "over", tuple(self.over))
        problem = _describe_problem(self)
        if problem:
            raise InputError(problem, where=self.where, remedy="Build the shape again.")

    kind = "graph"
    word = "possessed mesh"
    played = "parts"
    drawn_by = ("mesh", "skin", "positions")
    sent_by = (*drawn_by, "ends", "joints")

    @property
    def performed_parts(self) -> tuple[str, ...]:
        """The takes of the parts, if there are several."""
        return tuple(part.take for part in self.parts) if len(self.parts) > 1 else ()

    @property
    def playing(self) -> tuple[LayerBase, ...]:
        """All layers: the parts, the layers on top of them, and the root layers."""
        return (*self.parts, *self.over, *self.root_layers)

    @property
    def keyable(self) -> int:
        """The number of nodes."""
        return len(self.positions)

    def with_playing(self, *layers: LayerBase) -> GraphCharacter:
        """Returns the shape with other parts and layers."""
        parts = tuple(layer for layer in layers if isinstance(layer, GraphPart))
        upper_layers = tuple(layer for layer in layers if isinstance(layer, GraphLayer))
        root = tuple(layer for layer in layers if isinstance(layer, RootLayer))
        return self.with_changes(parts=parts, over=upper_layers, root_layers=root)

    def check(self, held: Mapping[str, Mapping[str, Any]]) -> None:
        """Raises InputError if a take does not exist, or does not match the nodes."""
        super().check(held)
        for layer in (*self.parts, *self.over):
            node_count = held["streams"][layer.take].positions.shape[1]
            if layer.nodes.size and not 0 <= layer.nodes.min() <= layer.nodes.max() < node_count:
                raise InputError(
                    f"the shape plays nodes that the recording {layer.take!r} does not contain",
                    where=self.where,
                )

    def without_layer(self, number: int) -> GraphCharacter:
        """Returns the shape without a layer on top of its motion.

        Raises:
            InputError: if the layer is a part, since its nodes have no other motion.
        """
        if number < len(self.parts):
            advice = "Mute the layer, or cut off the part of the mesh that it moves."
            raise InputError(
                "the layer cannot be removed, because its nodes have no other motion",
                where=self.where,
                remedy=advice,
            )
        return super().without_layer(number)

    def at_rest(self, mesh: Mesh | None) -> tuple[GraphCharacter, tuple[PoseStream, ...]]:
        """Returns the possessed mesh without motion. Its skin is recomputed from the mesh on the stage."""
        shape, stream = graph_shape_at_rest(self.id, self.positions, self.edges, mesh or self.mesh)
        return shape.with_changes(ends=self.ends, joints=self.joints), (stream,)

    @property
    def starts(self) -> tuple[int, ...]:
        """The number of the first node of each part, and N."""
        return tuple(np.cumsum([0, *(len(part.nodes) for part in self.parts)]).tolist())


_REST_STREAM_ID = "rest"
"""The id of the motionless stream of a possessed mesh at rest."""


def graph_shape_at_rest(
    name: str, nodes: Float, edges: Int32, mesh: Mesh
) -> tuple[GraphCharacter, PoseStream]:
    """Returns a shape with static nodes (N, 3), and the stream of these nodes. Every vertex of the shape
    follows the first node.
    """
    count = len(mesh.vertices)
    skin = SkinWeights(
        np.zeros((count, 4), np.uint16), np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1))
    )
    stream = PoseStream(_REST_STREAM_ID, np.tile(np.eye(3), (1, len(nodes), 1, 1)), nodes[None], 1.0)
    part = GraphPart(_REST_STREAM_ID, np.arange(len(nodes)))
    return GraphCharacter(name, nodes, edges, mesh, skin, (part,)), stream


def graph_shape_from_poses(
    character: Character, poses: Sequence[Pose], stream_id: str, step: float | None = None
) -> tuple[GraphCharacter, PoseStream]:
    """Converts a possessed character and its recorded poses to a shape and its stream.

    Args:
        poses: recorded poses in the order of time, one per ``step``.
        step: seconds between poses; None uses the mean interval of the poses' times.

    Raises:
        InputError: if the character is rigged, if there are fewer than two poses, or if poses belong to
            another character.
    """
    where = f"character {character.id!r}"
    if character.kind != "graph":
        raise InputError(
            "the character has bones, so poses of mesh nodes cannot move it",
            where=where,
            remedy="Retarget the motion to the character's skeleton instead.",
        )
    if len(poses) < 2 or any(len(pose.positions) != len(character.pivots) for pose in poses):
        raise InputError(
            f"the {len(poses)} recorded poses are too few, or do not match the character",
            where=where,
            remedy="Record the take again.",
        )
    seconds = (poses[-1].time_ns - poses[0].time_ns) / 1e9 / (len(poses) - 1) if step is None else step
    linear = np.array([pose.linear for pose in poses], np.float64)
    positions = np.array([pose.positions for pose in poses], np.float64)
    stream = PoseStream(stream_id, linear, positions, seconds)
    vertices = np.asarray(character.vertices, np.float64)
    painted = character.colours, character.materials, character.stiffness
    mesh = Mesh(vertices, character.faces, character.id, *painted)
    part = GraphPart(stream_id, np.arange(len(character.pivots)))
    pivots = np.asarray(character.pivots, np.float64)
    return GraphCharacter(character.id, pivots, character.edges, mesh, character.skin, (part,)), stream


def character_from_graph_shape(shape: GraphCharacter) -> Character:
    """Returns the shape in the form that viewers use."""
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
        stiffness=shape.mesh.stiffness,
    )


def _describe_problem(shape: GraphCharacter) -> str:
    count = len(shape.positions)
    if shape.positions.shape != (count, 3) or shape.starts[-1] != count or count == 0:
        return (
            f"the array of node positions has the shape {shape.positions.shape}, but the parts "
            f"have {shape.starts[-1]} nodes"
        )
    if shape.edges.size and not 0 <= shape.edges.min() <= shape.edges.max() < count:
        return "an edge of the graph refers to a node that does not exist"
    if shape.ends.shape not in ((0, 3), (5, 3)) or not np.isfinite(shape.ends).all():
        return f"the limb ends have the shape {shape.ends.shape}, expected five finite positions or none"
    if shape.joints.shape not in ((0, 3), (20, 3)) or not np.isfinite(shape.joints).all():
        return (
            f"the body joints have the shape {shape.joints.shape}, expected twenty finite positions or none"
        )
    vertices = (len(shape.mesh.vertices), 4)
    if shape.skin.indices.shape != vertices or shape.skin.weights.shape != vertices:
        return f"the skin weights have the shape {shape.skin.indices.shape}, expected {vertices}"
    if shape.skin.indices.size and int(shape.skin.indices.max()) >= count:
        return f"a vertex refers to node {int(shape.skin.indices.max())}, but only {count} nodes exist"
    for part, start in zip(shape.parts, shape.starts, strict=False):
        if part.ride is not None and not 0 <= part.ride.node < start:
            return f"a part is attached to node {part.ride.node}, which does not belong to an earlier part"
    for layer in shape.over:
        if not 0 <= layer.own.min() <= layer.own.max() < count or len(set(layer.own.tolist())) < len(
            layer.own
        ):
            return f"the layer {layer.take!r} moves a node that does not exist, or moves a node twice"
    return ""
