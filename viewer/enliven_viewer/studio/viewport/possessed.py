"""Possessed meshes in the studio: their poses, picking, and loading them from a recorded take."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from enliven.arrays import Float
from enliven.document import Character, GraphShape, Pose, Project, character_of_graph, unused
from enliven.errors import InputError
from enliven.modeling.edits import paste_character
from enliven.modeling.possessed import graph_vertices, pose_of_graph
from enliven.takes import clips_of_recording, read_possessed
from enliven_viewer.studio.viewport.colours import coloured
from enliven_viewer.studio.viewport.picking import Lens, first_face


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


def with_performance(project: Project, path: Path) -> tuple[Project, tuple[str, ...]]:
    """The project with the possessed meshes of a recorded take, and its performers as takes to map.

    Returns:
        The project, and the ids of all that was added.

    Raises:
        InputError: where the file is no recording, or nothing in it moves.
    """
    added, refused = list[str](), list[InputError]()
    try:
        source = read_possessed(path)
        for name in source.graphs:
            project, made = paste_character(project, source, name)
            added.append(made)
    except InputError as error:
        refused.append(error)
    try:
        for clip in clips_of_recording(path):
            named = replace(clip, id=unused(path.stem, project.takes))
            project = project.with_takes(named)
            added.append(named.id)
    except InputError as error:
        refused.append(error)
    if not added:
        raise refused[0]
    return project, tuple(added)
