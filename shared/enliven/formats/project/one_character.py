"""Serialises one character as the bytes of a project. A client sends these bytes to add the character to the
stage of an edge.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.document import Project, RigBase, graph_shape_at_rest
from enliven.formats.project.file import project_bytes
from enliven.meshes import Mesh


def character_bytes(project: Project, character: str, textures: int = 0) -> bytes:
    """Returns the bytes of a project with one character at rest. Equal characters give identical bytes.

    A rigged shape has no layers, a possessed mesh has no motion, and a puppet has only the takes of its key
    poses. Coordinates are rounded to float32.

    Args:
        textures: maximum size of the character's textures in bytes. If they are larger, its materials are
            left out.

    Raises:
        InputError: if the character does not exist.
    """
    rig = project.character(character)
    return project_bytes(
        _make_one_character_project(rig, project, painted=0 < texture_bytes(rig) <= textures)
    )


def texture_bytes(character: RigBase) -> int:
    """Returns the size of a character's textures in bytes. The result is at least 1 if the character has
    materials, and otherwise 0."""
    materials = None if character.mesh is None else character.mesh.materials
    return 0 if materials is None else max(sum(len(texture.image) for texture in materials.textures), 1)


def project_of_mesh(mesh: Mesh, name: str) -> Project:
    """Returns a project with a mesh that performers can attach to. The mesh has a single node until it is
    added to a stage.
    """
    vertices = _round_coordinates(mesh.vertices)
    shape_and_stream = graph_shape_at_rest(
        name, vertices.mean(0)[None], np.empty((0, 2), np.int32), replace(mesh, vertices=vertices)
    )
    return Project().with_streams(shape_and_stream[1]).with_characters(shape_and_stream[0])


def _make_one_character_project(character: RigBase, project: Project, *, painted: bool) -> Project:
    """Returns a project with a character at rest, and the takes that it needs at rest."""
    at_rest, streams = character.at_rest(
        None if character.mesh is None else _lighten_mesh(character.mesh, painted)
    )
    takes = (project.takes[name] for name in at_rest.find_needed_ids()["takes"])
    return Project().with_takes(*takes).with_streams(*streams).with_characters(at_rest)


def _lighten_mesh(mesh: Mesh, painted: bool) -> Mesh:
    """Returns the mesh with coordinates rounded to float32, which halves their size. ``painted`` keeps its
    materials."""
    return replace(
        mesh, vertices=_round_coordinates(mesh.vertices), materials=mesh.materials if painted else None
    )


def _round_coordinates(numbers: np.ndarray) -> np.ndarray:
    return np.asarray(numbers, np.float32).astype(np.float64)
