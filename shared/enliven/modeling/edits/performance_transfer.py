"""Transfers a recorded performance to another character: the performers possess that character's mesh."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, fields, replace

import numpy as np

from enliven.arrays import Float
from enliven.document import GraphCharacter, GraphLayer, GraphPart, Project, RigBase, TimeMap, unused
from enliven.errors import InputError
from enliven.modeling.edits.characters import move_character, scale_character
from enliven.modeling.edits.rigs import compute_vertices, find_base_centre
from enliven.modeling.possessed.another_mesh import possess_another
from enliven.possession import apply_vertex_motion, settings_from_possession

_RECORDING_ATTRIBUTES = ("recorded", "alternatives")
"""Attributes of a layer that identify its recording. The other attributes define its timing."""


def performance_in(shape: GraphCharacter) -> GraphPart | GraphLayer | None:
    """Returns the first part of a shape that performers moved. If no part was performed, returns the first
    performed layer on top of the motion, or None."""
    return next((part for part in (*shape.parts, *shape.over) if part.possession is not None), None)


def transfer_performance(
    project: Project,
    source_id: str,
    target_id: str,
    *,
    time: float = 0.0,
    nodes: int = 128,
    progress: Callable[[float], None] | None = None,
    notes: list[str] | None = None,
) -> tuple[Project, str]:
    """Transfers the motion of performers from one mesh to another. Returns the project and the new mesh's id.

    The performers possess the mesh in its pose at ``time``, temporarily scaled to their size. Afterwards the
    mesh has its own size again, and its motion starts at its old position. A mesh without motion, bones and
    key poses is replaced by the performed character. Any other character is copied, and the original stays
    unchanged.

    Args:
        time: time of the project in seconds.
        nodes: number of nodes of the deformation graph.
        progress: a function that is called with the completed fraction, from 0 to 1.
        notes: a list that receives a sentence about each attachment that failed.

    Raises:
        InputError: if the source is not a mesh that performers moved. Also if the target has no surface or is
            the source, or if the performers cannot attach to any part of it.
    """
    shape, target = project.graph(source_id), project.character(target_id)
    layer = performance_in(shape)
    if layer is None or layer.possession is None:
        raise InputError(
            "no performer has moved a part of this mesh",
            where=shape.where,
            remedy="Choose a mesh that a performer has moved.",
        )
    if target is shape:
        remedy = "Choose another character as the target."
        raise InputError("the source and the target are the same character", where=shape.where, remedy=remedy)
    if target.mesh is None or not len(target.mesh.faces):
        raise InputError(
            "the target character has no surface",
            where=target.where,
            remedy="Choose a character with a mesh.",
        )
    posed = compute_vertices(project, target_id, time)
    mesh = replace(target.mesh, vertices=posed, name=target_id)
    take = project.bodies[layer.possession.take]
    # The original mesh may have been placed at a fixed position in the room. The new mesh is elsewhere, so it
    # is placed at the performer's position.
    settings = replace(settings_from_possession(layer.possession), place="meet")
    possession = replace(layer.possession, settings=json.dumps(asdict(settings)))
    ends, joints = _find_known_ends(target, posed)
    new_project, name = possess_another(
        project,
        mesh,
        take,
        possession,
        ends=ends,
        joints=joints,
        nodes=nodes,
        progress=progress,
        notes=notes,
    )
    new_project = _scale_and_place(new_project, name, posed)
    new_shape = new_project.graph(name)
    when = {
        attribute.name: getattr(layer, attribute.name)
        for attribute in fields(TimeMap)
        if attribute.name not in _RECORDING_ATTRIBUTES
    }
    new_shape = new_shape.with_changes(parts=(replace(new_shape.parts[0], **when),))
    if _is_plain(project, target):
        return new_project.drop_character(name).with_characters(
            new_shape.with_changes(id=target_id)
        ), target_id
    called = unused(f"{target_id} performed", project.characters)
    return new_project.drop_character(name).with_characters(new_shape.with_changes(id=called)), called


def _find_known_ends(target: RigBase, posed: Float) -> tuple[Float | None, Float | None]:
    """Returns the ends and the joints that an artist marked on a mesh, moved to its posed vertices (V, 3).
    Each is an array of points (K, 3) in metres, or None if there are none.
    """
    if not isinstance(target, GraphCharacter):
        return None, None
    rest = target.mesh.vertices
    ends, joints = (
        apply_vertex_motion(points, rest, posed) if len(points) else None
        for points in (target.ends, target.joints)
    )
    return ends, joints


def _scale_and_place(project: Project, name: str, posed: Float) -> Project:
    """Scales a new mesh to the size of its posed vertices (V, 3), and moves its start to their position."""
    shape = project.graph(name)
    first = project.streams[shape.parts[0].take].linear[0]
    scaled_project = float(np.cbrt(np.median(np.abs(np.linalg.det(first))))) * _measure_vertical_extent(
        shape.mesh.vertices
    )
    project = scale_character(project, name, _measure_vertical_extent(posed) / scaled_project)
    return move_character(
        project, name, find_base_centre(posed) - find_base_centre(compute_vertices(project, name, 0.0))
    )


def _measure_vertical_extent(vertices: Float) -> float:
    """Returns the vertical extent of vertices (V, 3), in metres."""
    return max(float(np.ptp(vertices[:, 1])), 1e-6)


def _is_plain(project: Project, character: RigBase) -> bool:
    """Returns True if a character is a mesh without motion, such as a file or a scan that was just opened."""
    return character.is_possessable and not any(project.length_of(layer) > 0.0 for layer in character.playing)
