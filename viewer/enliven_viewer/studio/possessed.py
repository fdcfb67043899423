"""Possessed meshes in the studio: how they stand, which is picked, and those of a recorded take."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.body import Body
from enliven.character import Character, Pose
from enliven.errors import InputError
from enliven.graph_shape import GraphShape, character_of_graph, graph_shape_of
from enliven.modeling.graph_pose import graph_vertices, pose_of_graph
from enliven.motion.capture_clip import clip_of_bodies
from enliven.project import Project, unused
from enliven_viewer.document import Document
from enliven_viewer.studio.clay import coloured
from enliven_viewer.studio.picking import Lens, first_face
from enliven_viewer.takes import Take
from enliven_viewer.timeline import NS


@dataclass(frozen=True, eq=False)
class Possessed:
    """A possessed mesh at one moment."""

    shape: GraphShape
    pose: Pose

    @cached_property
    def vertices(self) -> Float:
        """(V, 3) metres."""
        return graph_vertices(self.shape, self.pose.linear.astype(float), self.pose.positions.astype(float))


class Characters:
    """The characters of possessed meshes, the same object while the mesh stays the same."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[GraphShape, Character]] = {}

    def of(self, shape: GraphShape) -> Character:
        """The character that the renderer draws."""
        known = self._known.get(shape.id)
        if known is None or known[0].mesh is not shape.mesh or known[0].positions is not shape.positions:
            known = (shape, coloured(character_of_graph(shape)))
            self._known[shape.id] = known
        return known[1]


def possessed_of(project: Project, time: float) -> tuple[Possessed, ...]:
    """Every possessed mesh of the project at a time, seconds."""
    return tuple(Possessed(shape, pose_of_graph(project, shape, time)) for shape in project.graphs.values())


def possessed_at(
    meshes: Iterable[Possessed], lens: Lens, at: tuple[float, float]
) -> tuple[str, float] | None:
    """The possessed mesh that the ray of a pixel meets first, and metres to it."""
    way, eye = lens.ray(at), lens.view.eye
    found = []
    for mesh in meshes:
        face, distance = first_face(mesh.vertices, mesh.shape.mesh.faces, eye, way)
        if face >= 0:
            found.append((mesh.shape.id, distance))
    return min(found, key=lambda hit: hit[1], default=None)


def end_of_streams(project: Project) -> float:
    """The second at which the last stream in use has been played once."""
    ends = [
        part.offset + project.streams[part.stream].duration / abs(part.speed)
        for shape in project.graphs.values()
        for part in shape.parts
    ]
    return max(ends, default=0.0)


class _Collector(Document):
    """Takes everything that a take brings, and keeps it in order."""

    def __init__(self) -> None:
        super().__init__()
        self.poses: dict[str, list[Pose]] = defaultdict(list)
        self.people: dict[int, list[tuple[float, Body]]] = defaultdict(list)

    def add_pose(self, pose: Pose) -> None:
        self.poses[pose.character].append(pose)

    def add_bodies(self, time_ns: int, bodies: Sequence[Body]) -> None:
        for body in bodies:
            seen = self.people[body.id]
            if not seen or time_ns / NS > seen[-1][0]:
                seen.append((time_ns / NS, body))


def with_performance(project: Project, path: Path) -> tuple[Project, tuple[str, ...]]:
    """The project with what was possessed in a recorded take, and with its performers as takes to map.

    Returns:
        The project, and the ids of all that was added.

    Raises:
        InputError: where the file is no take, or nothing in it moves.
    """
    take, found = Take(path), _Collector()
    while take.poll(found):
        pass
    added: list[str] = []
    for character in found.characters.values():
        poses = found.poses[character.id]
        if character.kind == "graph" and len(poses) > 1:
            taken = {**project.shapes, **project.graphs, **project.streams}
            stream_id = unused(character.id, taken)
            shape, stream = graph_shape_of(character, poses, stream_id)
            project = project.with_streams(stream).with_graphs(_named(shape, unused(character.id, taken)))
            added.append(character.id)
    for seen in found.people.values():
        if len(seen) > 1:
            name = unused(path.stem, project.takes)
            times = np.array([time for time, _ in seen])
            project = project.with_takes(clip_of_bodies([body for _, body in seen], times, name))
            added.append(name)
    if not added:
        raise InputError("nothing in it moves", where=str(path), mend="Record while somebody performs.")
    return project, tuple(added)


def _named(shape: GraphShape, name: str) -> GraphShape:
    return shape if shape.id == name else replace(shape, id=name)
