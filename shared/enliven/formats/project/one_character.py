"""One character as the bytes of a project: what a client sends to put it on the stage of an edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.document import Project, RigBase, graph_shape_at_rest
from enliven.formats.project.file import project_bytes
from enliven.meshes import Mesh


def character_bytes(project: Project, character: str) -> bytes:
    """Returns a project of one character at rest, without textures: equal bytes for equal characters.

    A rigged shape comes without layers, a possessed mesh without motion, a puppet with the takes of its key
    poses alone. Coordinates are rounded to float32.

    Raises:
        InputError: where there is no such character.
    """
    return project_bytes(_alone(project.character(character), project))


def project_of_mesh(mesh: Mesh, name: str) -> Project:
    """Returns a project of a mesh that is to be possessed: it has one node, until it is put on a stage."""
    vertices = _rounded(mesh.vertices)
    one = graph_shape_at_rest(
        name, vertices.mean(0)[None], np.empty((0, 2), np.int32), replace(mesh, vertices=vertices)
    )
    return Project().with_streams(one[1]).with_characters(one[0])


def _alone(one: RigBase, project: Project) -> Project:
    """Returns a project of a character at rest, with the takes that it needs then."""
    still, streams = one.at_rest(None if one.mesh is None else _bare(one.mesh))
    takes = (project.takes[name] for name in still.needed()["takes"])
    return Project().with_takes(*takes).with_streams(*streams).with_characters(still)


def _bare(mesh: Mesh) -> Mesh:
    """Returns a mesh without materials, its coordinates rounded: half of the bytes."""
    return replace(mesh, vertices=_rounded(mesh.vertices), materials=None)


def _rounded(numbers: np.ndarray) -> np.ndarray:
    return np.asarray(numbers, np.float32).astype(np.float64)
