"""Scenes of several meshes in one file, read and written by trimesh."""

from __future__ import annotations

import logging
import warnings
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from enliven.arrays import UInt8
from enliven.errors import InputError
from enliven.files import Beside
from enliven.meshes.mesh import Mesh


def read_scene(data: bytes, path: Path) -> Mesh:
    """All triangles of a file in one mesh; what the file names is read from beside ``path``.

    Raises:
        InputError: where there are none.
    """
    suffix = path.suffix.lower()
    log = logging.getLogger("trimesh")
    level, log.level = log.level, logging.CRITICAL
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene = trimesh.load_scene(
                BytesIO(data), file_type=suffix[1:], resolver=_Named(Beside(path)), process=False
            )
    finally:
        log.setLevel(level)
    return _flattened(scene, path.stem)


def scene_bytes(mesh: Mesh, kind: str) -> bytes:
    """The bytes of a file of a kind, such as "obj", with one mesh."""
    out = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=mesh.colours, process=False)
    data = out.export(file_type=kind)
    return data if isinstance(data, bytes) else str(data).encode()


class _Named(trimesh.resolvers.Resolver):  # type: ignore[misc]
    """The files that a mesh names, for the library that reads it."""

    def __init__(self, beside: Beside) -> None:
        self._beside = beside

    def get(self, key: str) -> bytes:
        return self._beside.file(key.strip())

    def keys(self) -> list[str]:
        return []

    def write(self, name: str, data: Any) -> None:
        raise NotImplementedError("a reader writes nothing")

    def namespaced(self, namespace: str) -> _Named:
        return self


def _flattened(scene: Any, name: str) -> Mesh:
    """All triangles of a scene in one mesh, each placed by its node's transform."""
    vertices: list[Any] = []
    faces: list[Any] = []
    colours: list[UInt8 | None] = []
    count = 0
    for node in scene.graph.nodes_geometry:
        world_from_node, key = scene.graph[node]
        part = scene.geometry[key]
        if not isinstance(part, trimesh.Trimesh) or len(part.faces) == 0:
            continue
        turned = bool(np.linalg.det(world_from_node[:3, :3]) < 0)
        faces.append(part.faces[:, ::-1] + count if turned else part.faces + count)
        vertices.append(part.vertices @ world_from_node[:3, :3].T + world_from_node[:3, 3])
        colours.append(_colours(part))
        count += len(part.vertices)
    if not faces:
        raise InputError("it has no faces")
    return Mesh(np.concatenate(vertices), np.concatenate(faces), name, _joined(colours, vertices))


def _joined(colours: list[UInt8 | None], vertices: list[Any]) -> UInt8 | None:
    """One colour array for all parts, light grey where a part has none; None where no part has any."""
    if all(c is None for c in colours):
        return None
    grey = np.array([200, 200, 200], np.uint8)
    parts = zip(colours, vertices, strict=True)
    return np.concatenate([np.tile(grey, (len(v), 1)) if c is None else c for c, v in parts])


def _colours(part: Any) -> UInt8 | None:
    """(V, 3) the vertex colours of a part, or its material's one colour, or None."""
    visual = part.visual
    if visual.kind == "vertex":
        return np.asarray(visual.vertex_colors[:, :3], np.uint8)
    colour = getattr(getattr(visual, "material", None), "main_color", None)
    if visual.kind != "texture" or colour is None or np.shape(colour) != (4,):
        return None
    return np.tile(np.asarray(colour[:3], np.uint8), (len(part.vertices), 1))
