"""Repairs a mesh: removes unusable vertices and faces, and reports each repair in a sentence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Bool
from enliven.errors import InputError
from enliven.meshes.kernels import shells
from enliven.meshes.mesh import Mesh, extract_submesh, weld
from enliven.meshes.winding import repair_winding

SAME_POSITION = "vertices have the same position as another vertex"
"""Part of the note about duplicate positions. The STL reader leaves this note out."""


def repair(mesh: Mesh) -> tuple[Mesh, list[str]]:
    """Removes defects of a mesh that would prevent its deformation. Returns the repaired mesh, and one
    sentence for each repair.

    It removes non-finite vertices and their faces, faces without area, duplicate faces, and unused vertices.
    It flips faces that are wound against their neighbours, and closed parts that are inside out. Separate
    shells and duplicate vertex positions are kept, but reported.

    Raises:
        InputError: if no face is left.
    """
    notes: list[str] = []
    count = len(mesh.vertices)
    mesh = _remove_broken_vertices(mesh, notes)
    mesh = _remove_useless_faces(mesh, notes)
    if len(mesh.faces) == 0:
        problem = "after the repair, the mesh has no faces" if notes else "the mesh has no faces"
        advice = "Use a triangle mesh. Convert a point cloud to a mesh first."
        raise InputError("; ".join([problem, *notes]), where=mesh.name, remedy=advice)
    mesh, winding_notes = repair_winding(mesh)
    notes += winding_notes
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces] = True
    unused_count = int((~used).sum())
    if unused_count:
        notes.append(f"{unused_count} of {count} vertices were removed, because no face uses them")
        mesh = extract_submesh(mesh, np.ones(len(mesh.faces), bool))
    _describe_oddities(mesh, notes)
    return mesh, notes


def _remove_broken_vertices(mesh: Mesh, notes: list[str]) -> Mesh:
    """Removes faces at vertices that are not finite or extremely far away. The vertices themselves remain,
    but are unused.
    """
    # The limit is far below the largest float64, because the squares of coordinates must stay finite too.
    is_valid = np.asarray((np.abs(mesh.vertices) < 1e100).all(1))
    if is_valid.all():
        return mesh
    face_mask = np.asarray(is_valid[mesh.faces].all(1))
    notes.append(
        f"{int((~is_valid).sum())} vertices with invalid positions and "
        f"{int((~face_mask).sum())} faces that use them were removed"
    )
    vertices = np.where(is_valid[:, None], mesh.vertices, 0.0)
    return replace(mesh, vertices=vertices).with_faces(face_mask)


def _remove_useless_faces(mesh: Mesh, notes: list[str]) -> Mesh:
    """Removes degenerate and duplicate faces. A face with opposite winding also counts as a duplicate."""
    if len(mesh.faces) == 0:
        return mesh
    flat = ~(np.linalg.norm(mesh.face_vectors(), axis=1) > 0)
    if flat.any():
        notes.append(f"{int(flat.sum())} faces without area were removed")
        mesh = mesh.with_faces(~flat)
    repeated = _find_repeated_faces(mesh)
    if repeated.any():
        notes.append(f"{int(repeated.sum())} duplicate faces were removed")
        mesh = mesh.with_faces(~repeated)
    return mesh


def _find_repeated_faces(mesh: Mesh) -> Bool:
    """Returns (F,) True for each face with the same three positions as an earlier face."""
    welded, _ = weld(mesh)
    corners = np.sort(welded.faces.astype(np.int64), 1)
    count = len(welded.vertices)
    order = np.lexsort((corners[:, 2], corners[:, 0] * count + corners[:, 1]))
    equals_previous = (corners[order[1:]] == corners[order[:-1]]).all(1)
    repeated = np.zeros(len(corners), bool)
    repeated[order[1:][equals_previous]] = True
    return repeated


def _describe_oddities(mesh: Mesh, notes: list[str]) -> None:
    """Adds sentences to ``notes`` about unusual properties that are not repaired."""
    welded, _ = weld(mesh)
    duplicate_count = len(mesh.vertices) - len(welded.vertices)
    if duplicate_count:
        notes.append(
            f"{duplicate_count} {SAME_POSITION}: they are kept for shading, and joined for deformation"
        )
    shell_count = int(shells(welded.faces, len(welded.vertices)).max()) + 1
    if shell_count > 1:
        notes.append(f"the mesh has {shell_count} separate shells, and all of them are kept")
    low, high = mesh.bounds
    extent = np.sort(high - low)
    if extent[0] <= 1e-6 * extent[2]:
        notes.append("the mesh is flat and has no volume")
