"""Lists every entry point that reads a glTF file. Each returns the visible surface."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from enliven.example_sessions.mesh import load_session_mesh
from enliven.example_sessions.tables import MeshTable
from enliven.formats.gltf.read import read_gltf
from enliven.meshes import Mesh, load_mesh, load_upright
from enliven.oneshot.exportable import find_exportables
from enliven_edge.stage.character_setup import create_actor
from enliven_edge.stage.rig.rig_actor import create_rig_actor
from enliven_viewer.commands.stage import read_character
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.workspace.files import add_file

Surface = tuple[np.ndarray, np.ndarray]
"""Vertices (V, 3) in metres, and triangles (F, 3)."""


def _surface_of_mesh(mesh: Mesh) -> Surface:
    return mesh.vertices, mesh.faces


def _export(path: Path) -> Surface:
    exportable = find_exportables(path).items[0]
    return _surface_of_mesh(exportable.sample(0.0, 0.0, None, False, False).surface[0])


def _put_on_stage(path: Path) -> Surface:
    project, name, _ = read_character(str(path), "skeleton", None)
    return _surface_of_mesh(project.shape(name).mesh)


def _load_in_studio(path: Path) -> Surface:
    editor = Editor()
    get_puppet_editor(editor)  # This call registers the editor of puppets, as the workspace does.
    add_file(editor, path)
    (character,) = editor.project.characters.values()
    return _surface_of_mesh(character.mesh)


def _possess(path: Path) -> Surface:
    character = create_actor(str(path)).character
    return character.vertices, character.faces


def _drive(path: Path) -> Surface:
    character = create_rig_actor(str(path)).character
    return character.vertices, character.faces


READERS: dict[str, Callable[[Path], Surface]] = {
    "load_mesh": lambda path: _surface_of_mesh(load_mesh(path).mesh),
    "possess": lambda path: _surface_of_mesh(load_upright(path).mesh),
    "retarget": lambda path: _surface_of_mesh(read_gltf(path).shape.mesh),
    "session": lambda path: _surface_of_mesh(load_session_mesh(MeshTable(path.name), path).mesh),
    "export": _export,
    "stage": _put_on_stage,
    "studio": _load_in_studio,
    "edge, by a graph": _possess,
    "edge, by its skeleton": _drive,
}

STILL = {"load_mesh", "possess", "session", "edge, by a graph"}
"""Entry points that ignore the file's animation clips. If a clip mirrors joints, only the other entry points
show a mirrored surface.
"""


def measure_surface(surface: Surface) -> np.ndarray:
    """Returns (2,) width and area, which are invariant to translation, rotation about the vertical, and
    vertex order."""
    vertices, faces = surface
    vertices = np.asarray(vertices, np.float64)[np.unique(faces)]
    extent = np.ptp(vertices, axis=0)
    a, b, c = (np.asarray(surface[0], np.float64)[faces[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    ways = np.linspace(0, np.pi, 90, endpoint=False)
    wide = np.ptp(vertices[:, [0, 2]] @ [np.cos(ways), np.sin(ways)], axis=0).max()
    return np.array([wide / extent[1], area / extent[1] ** 2])
