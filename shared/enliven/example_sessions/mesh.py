"""Loads a session's mesh from its file, rotates it upright, scales it to its height and puts it on the
floor."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from enliven.arrays import Float
from enliven.example_sessions.tables import MeshTable
from enliven.formats.project.file import read_project
from enliven.meshes import Mesh, fit_height, load_mesh
from enliven.rotation import from_rotation_vector, rotate


class SessionMesh(NamedTuple):
    """A mesh, the default name of its puppet, and notes on unusual content of the file."""

    mesh: Mesh
    name: str
    notes: list[str]


def load_session_mesh(table: MeshTable, path: Path) -> SessionMesh:
    """Loads the mesh of a session from the file at ``path``, with the settings in the table [mesh].

    Raises:
        InputError: if the file cannot be read, or the project does not contain the puppet.
    """
    if path.suffix.lower() == ".enliven":
        project = read_project(path)
        puppet = project.puppet(table.puppet or next(iter(project.puppets), ""))
        return SessionMesh(fit_mesh(puppet.mesh, table), puppet.id, [])
    mesh, notes = load_mesh(path)
    return SessionMesh(fit_mesh(mesh, table), path.stem, notes)


def fit_mesh(mesh: Mesh, table: MeshTable) -> Mesh:
    """Returns the mesh upright, scaled to the table's height, and standing on the floor. A mesh from a
    project is returned unchanged."""
    if Path(table.file).suffix.lower() != ".enliven" or table.height is not None or table.up != "y":
        axis = "xyz".index(table.up)
        height = table.height or float(np.ptp(mesh.vertices[:, axis]))
        mesh = fit_height(mesh, height, table.up)
    if table.turned:
        rotation = from_rotation_vector(np.array([0.0, np.radians(table.turned), 0.0]))
        mesh = replace(mesh, vertices=rotate(rotation, mesh.vertices))
    return mesh


def find_nearest_vertex(mesh: Mesh, place: Float) -> int:
    """Returns the vertex nearest to a position (3,). Only vertices that belong to a face count."""
    used_vertices = np.unique(mesh.faces)
    return int(used_vertices[np.linalg.norm(mesh.vertices[used_vertices] - place, axis=1).argmin()])
