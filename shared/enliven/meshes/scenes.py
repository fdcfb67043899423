"""Writes a mesh as OBJ, OFF, PLY or STL by trimesh."""

from __future__ import annotations

import trimesh

from enliven.meshes.mesh import Mesh


def scene_bytes(mesh: Mesh, kind: str) -> bytes:
    """Returns the bytes of a file of a kind, such as "obj", with one mesh."""
    out = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=mesh.colours, process=False)
    data = out.export(file_type=kind)
    return data if isinstance(data, bytes) else str(data).encode()
