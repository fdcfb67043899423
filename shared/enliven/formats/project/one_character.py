"""One character as the bytes of a project: what a client sends to put it on the stage of an edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.document import (
    STILL,
    GraphPart,
    GraphShape,
    PoseStream,
    Project,
    Puppet,
    RigBase,
    Shape,
    SkinWeights,
)
from enliven.formats.project.file import project_bytes
from enliven.meshes import Mesh

_REST = "rest"
"""The id of the stream of a possessed mesh at rest."""


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
    return _graph(replace(mesh, vertices=vertices), name, vertices.mean(0)[None], np.empty((0, 2), np.int32))


def _alone(one: RigBase, project: Project) -> Project:
    if isinstance(one, GraphShape):
        return _graph(_bare(one.mesh), one.id, one.positions, one.edges)
    if isinstance(one, Shape):
        spans, mesh = (STILL,) * len(one.skeleton), None if one.mesh is None else _bare(one.mesh)
        still = one.with_changes(spans=spans, layers=(), travel=None, pins=(), mesh=mesh)
        return Project().with_characters(still)
    assert isinstance(one, Puppet)
    still = one.with_changes(layers=(), mesh=_bare(one.mesh))
    return (
        Project()
        .with_takes(*(project.takes[name] for name in still.needed()["takes"]))
        .with_characters(still)
    )


def _graph(mesh: Mesh, name: str, nodes: np.ndarray, edges: np.ndarray) -> Project:
    """Returns a possessed mesh at rest; its skin is made anew from the mesh on the stage."""
    count = len(mesh.vertices)
    skin = SkinWeights(
        np.zeros((count, 4), np.uint16), np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1))
    )
    stream = PoseStream(_REST, np.tile(np.eye(3), (1, len(nodes), 1, 1)), nodes[None], 1.0)
    part = GraphPart(_REST, np.arange(len(nodes)))
    return Project().with_streams(stream).with_characters(GraphShape(name, nodes, edges, mesh, skin, (part,)))


def _bare(mesh: Mesh) -> Mesh:
    """Returns a mesh without materials, its coordinates rounded: half of the bytes."""
    return replace(mesh, vertices=_rounded(mesh.vertices), materials=None)


def _rounded(numbers: np.ndarray) -> np.ndarray:
    return np.asarray(numbers, np.float32).astype(np.float64)
