"""One character as the bytes of a project: what a client sends to put it on the stage of an edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.document import Project, RigBase, graph_shape_at_rest
from enliven.formats.project.file import project_bytes
from enliven.meshes import Mesh


def character_bytes(project: Project, character: str, textures: int = 0) -> bytes:
    """Returns a project of one character at rest: equal bytes for equal characters.

    A rigged shape comes without layers, a possessed mesh without motion, a puppet with the takes of its key
    poses alone. Coordinates are rounded to float32.

    Args:
        textures: bytes that its textures may have; with larger ones it comes without materials.

    Raises:
        InputError: where there is no such character.
    """
    rig = project.character(character)
    return project_bytes(_project_of_one(rig, project, painted=0 < texture_bytes(rig) <= textures))


def texture_bytes(one: RigBase) -> int:
    """Returns the bytes of the textures of a character; 1 of one with materials alone, 0 without those."""
    materials = None if one.mesh is None else one.mesh.materials
    return 0 if materials is None else max(sum(len(each.image) for each in materials.textures), 1)


def project_of_mesh(mesh: Mesh, name: str) -> Project:
    """Returns a project of a mesh that is to be possessed: it has one node, until it is put on a stage."""
    vertices = _rounded_coordinates(mesh.vertices)
    shape_and_stream = graph_shape_at_rest(
        name, vertices.mean(0)[None], np.empty((0, 2), np.int32), replace(mesh, vertices=vertices)
    )
    return Project().with_streams(shape_and_stream[1]).with_characters(shape_and_stream[0])


def _project_of_one(one: RigBase, project: Project, *, painted: bool) -> Project:
    """Returns a project of a character at rest, with the takes that it needs then."""
    still, streams = one.at_rest(None if one.mesh is None else _lightened_mesh(one.mesh, painted))
    takes = (project.takes[name] for name in still.needed()["takes"])
    return Project().with_takes(*takes).with_streams(*streams).with_characters(still)


def _lightened_mesh(mesh: Mesh, painted: bool) -> Mesh:
    """Returns a mesh with its coordinates rounded, half of the bytes, and its materials or none."""
    return replace(
        mesh, vertices=_rounded_coordinates(mesh.vertices), materials=mesh.materials if painted else None
    )


def _rounded_coordinates(numbers: np.ndarray) -> np.ndarray:
    return np.asarray(numbers, np.float32).astype(np.float64)
