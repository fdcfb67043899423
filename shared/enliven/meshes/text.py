"""Readers of two plain-text mesh formats: OFF and MEDIT (.mesh, surface or tetrahedra)."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float, Int, Int32

_TETRAHEDRON_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
_MEDIT_COLUMNS = {"Vertices": 4, "Triangles": 4, "Quadrilaterals": 5, "Tetrahedra": 5}
"""Numbers in a line of each section of a Medit file: coordinates or vertices, and a reference number."""


def read_off(data: bytes) -> tuple[Float, Int32]:
    """(V, 3) vertices and (F, 3) triangles of an OFF file (also COFF, NOFF, STOFF); polygons become fans.

    Raises:
        ValueError: where the file is not what its header says.
    """
    lines = [line.split("#", 1)[0].split() for line in data.decode("utf-8", "replace").splitlines()]
    rows = [line for line in lines if line]
    if not rows or not rows[0][0].upper().endswith("OFF"):
        raise ValueError("the first word is not OFF")
    # The counts may share the first line with the word OFF.
    counts, start = (rows[0][1:], 1) if len(rows[0]) > 1 else (rows[1] if len(rows) > 1 else [], 2)
    if len(counts) < 2:
        raise ValueError("the counts of vertices and faces are missing")
    vertex_count, face_count = int(counts[0]), int(counts[1])
    if vertex_count < 0 or face_count < 0:
        raise ValueError(f"it says {vertex_count} vertices and {face_count} faces")
    if len(rows) < start + vertex_count + face_count:
        said = f"{vertex_count} vertices and {face_count} faces"
        raise ValueError(f"it ends early: it says {said}, and has {len(rows) - start} lines of them")
    vertices = np.array([row[:3] for row in rows[start : start + vertex_count]], np.float64)
    polygons = []
    for row in rows[start + vertex_count : start + vertex_count + face_count]:
        polygon = [int(index) for index in row[1 : 1 + int(row[0])]]
        if len(polygon) != int(row[0]):
            raise ValueError("a face has fewer corners than it says")
        polygons.append(polygon)
    return vertices.reshape(-1, 3), fans(polygons)


def fans(polygons: list[list[int]]) -> Int32:
    """(F, 3) the triangles of polygons of three corners or more, each a fan from its first corner."""
    triangles = [[p[0], p[i], p[i + 1]] for p in polygons for i in range(1, len(p) - 1)]
    return np.array(triangles, np.int32).reshape(-1, 3)


def read_medit(data: bytes) -> tuple[Float, Int32]:
    """(V, 3) vertices and (F, 3) triangles of an ASCII MEDIT file; of tetrahedra alone, their boundary.

    Raises:
        ValueError: where the file is not MEDIT, or ends early.
    """
    words = data.decode("utf-8", "replace").split()
    if not words or words[0] != "MeshVersionFormatted":
        raise ValueError("the first word is not MeshVersionFormatted")
    tables: dict[str, Float] = {}
    for i, word in enumerate(words[:-1]):
        if word in _MEDIT_COLUMNS:
            columns = _MEDIT_COLUMNS[word]
            if int(words[i + 1]) < 0:
                raise ValueError(f"it says {words[i + 1]} {word}")
            values = words[i + 2 : i + 2 + int(words[i + 1]) * columns]
            if len(values) < int(words[i + 1]) * columns:
                raise ValueError(f"it ends early, in {word}")
            tables[word] = np.array(values, np.float64).reshape(-1, columns)[:, :-1]
    if "Vertices" not in tables:
        raise ValueError("it has no Vertices")
    triangles = [tables[t].astype(np.int64) - 1 for t in ("Triangles",) if t in tables]
    if "Quadrilaterals" in tables:
        quads = tables["Quadrilaterals"].astype(np.int64) - 1
        triangles += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
    if not sum(map(len, triangles)) and "Tetrahedra" in tables:
        triangles = [_boundary(tables["Tetrahedra"].astype(np.int64) - 1)]
    faces = np.concatenate(triangles) if triangles else np.empty((0, 3))
    return tables["Vertices"], faces.astype(np.int32)


def _boundary(tetrahedra: Int) -> Int:
    """(F, 3) the triangles that belong to one tetrahedron of (T, 4) only, facing outwards."""
    faces = tetrahedra[:, _TETRAHEDRON_FACES].reshape(-1, 3)
    _, first, count = np.unique(np.sort(faces, 1), axis=0, return_index=True, return_counts=True)
    return np.asarray(faces[first[count == 1]])
