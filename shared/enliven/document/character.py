"""A character and its poses: a mesh and the transforms that move it. Each vertex follows at most four
transforms.

A bone of a rig and a node of a deformation graph are both a transform about a pivot that moves the vertices
around it. So network messages, the shader and exports treat them in the same way. A control point of a puppet
is a transform too. The program that displays the puppet solves the surface between the control points
(:class:`enliven.deformation.arap.solver.ArapSolver`), in the frame of transform 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enliven.arrays import Float, Float32, Int32, UInt8, UInt16
from enliven.errors import InputError
from enliven.meshes import MeshMaterials, stiffness_error

if TYPE_CHECKING:
    from enliven.document.surface_settings import ArapSettings


@dataclass(frozen=True)
class SkinWeights:
    """At most four transforms per vertex: indices (V, 4) uint16, weights (V, 4) float32 that sum to one."""

    indices: UInt16
    weights: Float32


@dataclass(frozen=True)
class Character:
    """A mesh at rest, in metres in the world frame, with the pivots of the transforms that move it.

    Attributes:
        id: name of the character on the network. It is unique on an edge computer.
        vertices: (V, 3) float32 metres.
        faces: (F, 3) int32.
        skin: four transforms per vertex.
        pivots: (J, 3) float32 rest positions of the graph nodes, or of the bones' joints.
        edges: (E, 2) int32 pairs of pivots to draw: graph edges, or bones.
        kind: "graph", "bones" or "points".
        colours: (V, 3) uint8 sRGB, or None.
        held: (J - 1,) int32, for kind "points": the vertex that each transform except the first one moves.
        pulls: (J - 1,) float32, the strength of each of these handles if it is soft, 0 if it is hard. None
            means that all are hard.
        surface: settings of the solver that makes the surface follow the handles. None means the defaults.
        names: (J,) unique names of the joints at the ends of the bones. None if they have no names.
        materials: the materials of the faces with their textures, or None for colours only.
        stiffness: (V,) float32 as in :class:`enliven.meshes.Mesh`, for kind "graph". None means 1 everywhere.
    """

    id: str
    vertices: Float32
    faces: Int32
    skin: SkinWeights
    pivots: Float32
    edges: Int32
    kind: str = "graph"
    colours: UInt8 | None = None
    held: Int32 | None = None
    pulls: Float32 | None = None
    surface: ArapSettings | None = None
    names: tuple[str, ...] | None = None
    materials: MeshMaterials | None = None
    stiffness: Float32 | None = None

    def __post_init__(self) -> None:
        problem = _describe_problem(self)
        if problem:
            raise InputError(problem, where=f"character {self.id!r}", remedy="Build the character again.")

    def rest_pose(self, time_ns: int = 0) -> Pose:
        """Returns the pose that leaves every vertex at rest."""
        count = len(self.pivots)
        return Pose(
            self.id,
            time_ns,
            np.tile(np.eye(3, dtype=np.float32), (count, 1, 1)),
            self.pivots.astype(np.float32),
        )


def _describe_problem(character: Character) -> str:
    """Returns a sentence about inconsistent arrays of a character, or an empty string."""
    count, vertices = len(character.pivots), len(character.vertices)
    if vertices == 0 or len(character.faces) == 0 or count == 0:
        return "the character has no vertices, no faces or no transforms"
    if character.skin.indices.shape != (vertices, 4) or character.skin.weights.shape != (vertices, 4):
        return f"the skin weights have the shape {character.skin.indices.shape}, expected ({vertices}, 4)"
    if character.materials is not None and len(character.materials.of) != len(character.faces):
        return (
            f"{len(character.materials.of)} faces have a material, but the mesh has "
            f"{len(character.faces)} faces"
        )
    if character.colours is not None and character.colours.shape != (vertices, 3):
        return f"the vertex colours have the shape {character.colours.shape}, expected ({vertices}, 3)"
    if character.stiffness is not None and (
        stiffness_problem := stiffness_error(character.stiffness, vertices)
    ):
        return stiffness_problem
    if (character.kind == "points") != (character.held is not None):
        return (
            "only a character of kind 'points' has handle vertices: the kind is "
            f"{character.kind!r}, the handle vertices are {character.held}"
        )
    if character.held is not None and (
        character.held.shape != (count - 1,)
        or (count > 1 and not 0 <= int(character.held.min()) <= int(character.held.max()) < vertices)
    ):
        return (
            f"the array of handle vertices {character.held.shape} does not match {count - 1} "
            f"control points, or a vertex is outside 0..{vertices - 1}"
        )
    if character.pulls is not None and (
        character.pulls.shape != (count - 1,)
        or not (np.isfinite(character.pulls).all() and (character.pulls >= 0).all())
    ):
        return (
            f"the handle weights of the {count - 1} control points are not valid: {character.pulls.tolist()}"
        )
    if character.names is not None and not len(character.names) == len(set(character.names)) == count:
        return f"the character has {count} bones, but {len(set(character.names))} different bone names"
    if int(character.skin.indices.max()) >= count:
        return (
            f"a vertex refers to transform {int(character.skin.indices.max())}, but only {count} "
            "transforms exist"
        )
    if int(character.faces.min()) < 0 or int(character.faces.max()) >= vertices:
        return f"a face refers to a vertex outside 0..{vertices - 1}"
    if len(character.edges) and (int(character.edges.min()) < 0 or int(character.edges.max()) >= count):
        return f"an edge of the graph refers to a transform outside 0..{count - 1}"
    return ""


@dataclass(frozen=True)
class Pose:
    """The transforms of a character at a time: v' = sum_k w_k (linear_k (v - pivot_k) + position_k).

    Attributes:
        character: the id of the character.
        time_ns: time of the sensor's clock, nanoseconds.
        linear: (J, 3, 3) float32 linear maps: a rotation for a bone, and nearly a rotation for a graph node.
        positions: (J, 3) float32 metres, the positions of the moved pivots, world frame.
    """

    character: str
    time_ns: int
    linear: Float32
    positions: Float32

    def matrices(self, pivots: Float32 | Float) -> Float32:
        """Returns (J, 3, 4) world_from_rest of every transform: linear | position - linear @ pivot."""
        offset = self.positions - np.einsum("jab,jb->ja", self.linear, pivots)
        return np.concatenate([self.linear, offset[..., None]], -1).astype(np.float32)
