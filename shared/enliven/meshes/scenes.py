"""Writes a mesh as OBJ, OFF, PLY or STL, with the library trimesh."""

from __future__ import annotations

import trimesh

from enliven.meshes.mesh import Mesh


def scene_bytes(mesh: Mesh, kind: str) -> bytes:
    """Returns the bytes of a file with one mesh. ``kind`` is the file format, such as "obj"."""
    scene = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=mesh.colours, process=False)
    data = scene.export(file_type=kind)
    return data if isinstance(data, bytes) else str(data).encode()
