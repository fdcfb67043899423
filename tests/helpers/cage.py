"""A fourth kind of rigged character for tests: a tetrahedral cage that deforms a mesh by barycentric weights.

Importing this module registers it: a type of character, its implementation of each edit, and its line in the
table of rigs. Nothing else in enliven depends on it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.document import (
    Character,
    GraphCharacter,
    GraphPart,
    Pose,
    PoseStream,
    Project,
    SkinWeights,
    unused,
)
from enliven.document.rig import RigBase
from enliven.document.time_map import LayerBase
from enliven.meshes import Mesh
from enliven.modeling.edits import RIGS
from enliven.modeling.mesh.cut_surfaces import CutSurface
from enliven.modeling.mesh.mesh_cut import cut_by_stroke
from enliven.modeling.rig import CharacterState, Merge, Player, RigEdits
from enliven.modeling.rigged.axes import Axes
from enliven.rotation import rotate

CORNERS = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
"""(4, 3) corners of a regular tetrahedron. A ball of radius 0.57 fits inside it."""


@dataclass(frozen=True, eq=False)
class Swing(LayerBase):
    """Recorded motion of a cage: a stream of the four corner positions."""

    take: str
    muted: bool = False
    source = "streams"

    def __post_init__(self) -> None:
        self.check_time(f"swing {self.take!r}")


@dataclass(frozen=True, eq=False)
class Cage(RigBase):
    """A mesh in a tetrahedron: a vertex is at w @ (corners + played offsets) @ linear.T + place.

    Attributes:
        corners: (4, 3) metres at rest.
        bent: (4, 3) metres, offsets by which a user dragged the corners.
        linear, place: (3, 3) and (3,) metres, the transform from the cage to the world.
    """

    id: str
    mesh: Mesh
    corners: Float
    bent: Float
    linear: Float
    place: Float
    layers: tuple[Swing, ...] = ()

    kind = "cage"
    word = "caged mesh"
    drawn_by = ("mesh", "corners")
    handles = ("right", "front", "left", "back")


def cage_of(mesh: Mesh, name: str, layers: tuple[Swing, ...] = ()) -> Cage:
    """Returns a mesh in a tetrahedron around its bounding box."""
    low, high = mesh.bounds
    corners = (low + high) / 2 + CORNERS * 1.1 * float(np.linalg.norm(high - low))
    return Cage(name, mesh, corners, np.zeros((4, 3)), np.eye(3), np.zeros(3), layers)


def weights(points: Float, corners: Float) -> Float:
    """Returns (N, 4) barycentric weights of positions (N, 3)."""
    whole = np.vstack([corners.T, np.ones(4)])
    return np.linalg.solve(whole, np.vstack([points.T, np.ones(len(points))])).T


class CageRig(RigEdits):
    """The cage's implementation of each edit."""

    def corners_at(self, project: Project, cage: Cage, time: float) -> Float:
        """Returns (4, 3) world positions of the corners, metres."""
        corners = cage.corners + cage.bent
        for layer in cage.layers:
            stream = project.streams[layer.take]
            at = layer.moment(time, stream.duration)
            weight = 0.0 if layer.muted else at.weight
            ways = [_compute_offsets(stream, second) for second in (0.0, at.second, at.other)]
            played = ways[1] + at.share * (ways[2] - ways[1])
            corners = corners + ways[0] + weight * (played - ways[0])
        return corners @ cage.linear.T + cage.place

    def centre(self, cage: Cage) -> Float:
        return cage.linear @ cage.corners.mean(0) + cage.place

    def compute_vertices(self, project: Project, cage: Cage, time: float) -> Float:
        return weights(cage.mesh.vertices, cage.corners) @ self.corners_at(project, cage, time)

    def make_drawing(self, cage: Cage) -> Character:
        shares = weights(cage.mesh.vertices, cage.corners).astype(np.float32)
        skin = SkinWeights(np.tile(np.arange(4, dtype=np.uint16), (len(shares), 1)), shares)
        edges = np.array([(a, b) for a in range(4) for b in range(a)], np.int32)
        vertices, corners = cage.mesh.vertices.astype(np.float32), cage.corners.astype(np.float32)
        return Character(cage.id, vertices, cage.mesh.faces, skin, corners, edges)

    def create_player(self, project: Project, cage: Cage) -> Player:
        def at(time: float) -> CharacterState:
            corners = self.corners_at(project, cage, time)
            linear = np.tile(cage.linear.astype(np.float32), (4, 1, 1))
            return CharacterState(
                Pose(cage.id, round(time * 1e9), linear, corners.astype(np.float32)), corners
            )

        return at

    def drag_handle(self, project: Project, cage: Cage, handle: int, place: Float, time: float) -> Project:
        bent = np.array(cage.bent)
        bent[handle] += np.linalg.solve(cage.linear, place - self.corners_at(project, cage, time)[handle])
        return project.with_characters(cage.with_changes(bent=bent))

    def move(self, cage: Cage, offset: Float, turn: Float, about: Float) -> Cage:
        return _map_cage(cage, rotate(turn, np.eye(3)).T, about, about + offset)

    def scale(self, cage: Cage, factor: float) -> Cage:
        return _map_cage(cage, factor * np.eye(3), self.centre(cage), self.centre(cage))

    def mirror(self, project: Project, cage: Cage, axes: Axes) -> Cage:
        inside_out = replace(cage.mesh, faces=np.ascontiguousarray(cage.mesh.faces[:, ::-1]))
        mapped = _map_cage(cage, axes.vectors(np.eye(3)).T, self.centre(cage), self.centre(cage))
        return mapped.with_changes(mesh=inside_out)

    def convert_to_graph_shape(
        self, project: Project, cage: Cage, times: Float, stream_id: str
    ) -> tuple[GraphCharacter, PoseStream, str]:
        drawn, player = self.make_drawing(cage), self.create_player(project, cage)
        poses = [player(float(time)) for time in times]
        linear = np.array([posed.pose.linear for posed in poses], np.float64)
        moved = np.array([posed.handles for posed in poses])
        part = GraphPart(stream_id, np.arange(4), offset=float(times[0]))
        stream = PoseStream(stream_id, linear, moved, float(times[1] - times[0]))
        return GraphCharacter(cage.id, cage.corners, drawn.edges, cage.mesh, drawn.skin, (part,)), stream, ""

    def cut(
        self, project: Project, name: str, stroke: CutSurface, time: float, *, notes: list[str]
    ) -> tuple[Project, tuple[str, ...]]:
        cage = project.character(name, Cage)
        cut = cut_by_stroke(
            cage.mesh, self.make_drawing(cage).skin, stroke, self.compute_vertices(project, cage, time)
        )
        far = unused(name, project.characters)
        notes.extend(cut.notes)
        parts = ((name, cut.near), (far, cut.far))
        cages = [cage.with_changes(id=piece_name, mesh=piece.mesh) for piece_name, piece in parts]
        return project.with_characters(*cages), (name, far)

    def merge(self, project: Project, merge: Merge) -> Project:
        """Returns the project with the graft's mesh added to the host's cage at its current position. The
        mesh then moves with the cage.
        """
        host, graft = project.character(merge.host, Cage), project.character(merge.graft, Cage)
        there = weights(
            self.compute_vertices(project, graft, merge.time), self.corners_at(project, host, merge.time)
        )
        vertices = np.concatenate([host.mesh.vertices, there @ host.corners])
        faces = np.concatenate([host.mesh.faces, graft.mesh.faces + len(host.mesh.vertices)])
        mesh = Mesh(vertices, faces.astype(np.int32), host.mesh.name)
        return project.drop_character(graft.id).with_characters(host.with_changes(mesh=mesh))


def _compute_offsets(stream: PoseStream, second: float) -> Float:
    """Returns (4, 3) metres, the offsets of a stream at a time."""
    frame = second / stream.step
    first = min(int(frame), len(stream.positions) - 2)
    before, after = stream.positions[first : first + 2]
    return np.asarray(before + (frame - first) * (after - before))


def _map_cage(cage: Cage, linear: Float, about: Float, to: Float) -> Cage:
    """Returns the cage transformed by x -> linear (x - about) + to."""
    return cage.with_changes(linear=linear @ cage.linear, place=linear @ (cage.place - about) + to)


RIGS[Cage.kind] = CageRig()
