"""Edits of a character of any kind, by its id: a rigged shape, a possessed mesh, or a puppet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import AnyArray, Float
from enliven.deformation import skin_vertices
from enliven.document import Project, character_of
from enliven.errors import InputError
from enliven.examples import in_world, state_of
from enliven.meshes import Mesh
from enliven.modeling.mesh import CutSurface
from enliven.modeling.possessed import (
    copy_graph,
    cut_graph,
    graph_pose,
    graph_vertices,
    merge_graphs,
    move_graph,
)
from enliven.modeling.puppet import copy_puppet, cut_puppet, merge_puppets, surface_of_puppet
from enliven.modeling.rigged import copy_shape, cut_stroke
from enliven.modeling.rigged import merge as merge_shapes
from enliven.motion.layers import Player


def cut(
    project: Project, character: str, surface: CutSurface, time: float
) -> tuple[Project, tuple[str, ...]]:
    """A project with a character cut in two along a plane or a stroke; both parts go on moving.

    At ``time`` nothing turns or moves. The meshes are closed where they were cut.

    Args:
        character: its id.
        surface: a ``PlaneCut`` or ``StrokeCut``, in metres of the world.
        time: seconds of the project.

    Returns:
        The project, and the ids of the parts; the first keeps its id.

    Raises:
        InputError: where there is no such character, or nothing of it comes off.
    """
    if character in project.shapes:
        return cut_stroke(project, character, surface, time)
    edit = cut_graph if character in project.graphs else cut_puppet
    return edit(_known(project, character), character, surface, time)


def merge(
    project: Project,
    host: str,
    graft: str,
    time: float,
    joint: int | str | None = None,
    *,
    loose: bool = False,
) -> Project:
    """A project in which one character is put onto another of its kind, where both are at ``time``.

    From then on the graft rides on the host, with its own motion on top; the meshes become one.

    Args:
        host, graft: their ids; the whole keeps the host's.
        time: seconds of the project.
        joint: of a rigged host, by number or name, that the graft is put onto; a node of a possessed one.
        loose: put both shells into one mesh where no union of the meshes can be made.

    Raises:
        InputError: for two kinds, a character merged with itself, or meshes without a union.
    """
    if host in project.shapes:
        if joint is None:
            raise InputError("a joint is needed", where=f"character {host!r}", mend="Name one of the host.")
        return merge_shapes(project, host, joint, graft, time, loose=loose)[0]
    if host in project.graphs:
        node = joint if isinstance(joint, int) else None
        return merge_graphs(project, host, graft, time, node=node, loose=loose)
    return merge_puppets(_known(project, host), host, graft, time, loose=loose)


def copy(
    project: Project, character: str, *, offset: AnyArray | None = None, delay: float = 0.0
) -> tuple[Project, str]:
    """A project with a copy of a character, which moves as it does, and the copy's id.

    Args:
        character: its id.
        offset: (3,) metres from the character to its copy; None puts it there as well.
        delay: seconds by which the copy moves later.

    Raises:
        InputError: where there is no such character, or a number is not finite.
    """
    way = np.zeros(3) if offset is None else offset
    if character in project.graphs:
        made, name = copy_graph(project, character, delay=delay)
        return move_graph(made, name, way), name
    edit = copy_shape if character in project.shapes else copy_puppet
    return edit(_known(project, character), character, offset=way, delay=delay)


def mesh_at(project: Project, character: str, time: float) -> Mesh:
    """The mesh of a character as it is at a time of the project, in metres of the world.

    Args:
        character: its id.
        time: seconds of the project.

    Raises:
        InputError: where there is no such character, or it has no mesh.
    """
    mesh, vertices = _surface(_known(project, character), character, time)
    return replace(mesh, vertices=vertices)


def _surface(project: Project, character: str, time: float) -> tuple[Mesh, Float]:
    """The mesh of a character at rest, and its vertices (V, 3) at a time."""
    if character in project.shapes:
        shape = project.shapes[character]
        seen = skin_vertices(character_of(shape), Player(project, character).pose(time))
        assert shape.mesh is not None
        return shape.mesh, seen.astype(float)
    if character in project.graphs:
        graph = project.graphs[character]
        return graph.mesh, graph_vertices(graph, *graph_pose(project, graph, time))
    puppet = project.puppets[character]
    state = state_of(project, puppet, time)
    return puppet.mesh, in_world(puppet, state, surface_of_puppet(puppet).settle(state.places))


def _known(project: Project, character: str) -> Project:
    """The project; refuses a character that is not in it."""
    known = [*project.shapes, *project.graphs, *project.puppets]
    if character not in known:
        mend = f"Known: {', '.join(known)}." if known else "Add one first."
        raise InputError(f"there is no character {character!r}", where="project", mend=mend)
    return project
