"""Repairs of a mesh: unusable vertices and faces are removed, and each repair is reported in a sentence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Bool
from enliven.errors import InputError
from enliven.meshes.kernels import shells
from enliven.meshes.mesh import Mesh, submesh, weld
from enliven.meshes.winding import repair_winding


def repair(mesh: Mesh) -> tuple[Mesh, list[str]]:
    """Returns the mesh without defects that break a deformation, and one sentence for every repair.

    It removes vertices that are not finite with their faces, faces without area, duplicate faces, and unused
    vertices. It flips faces that are wound against their neighbours, and closed parts that are inside out.
    Separate shells and duplicate vertex positions are kept, but reported.

    Raises:
        InputError: if no face is left.
    """
    notes: list[str] = []
    count = len(mesh.vertices)
    mesh = _remove_broken_vertices(mesh, notes)
    mesh = _remove_useless_faces(mesh, notes)
    if len(mesh.faces) == 0:
        problem = "no usable face is left" if notes else "it has no faces"
        mend = "Give a triangle mesh; a point cloud must be meshed first."
        raise InputError("; ".join([problem, *notes]), where=mesh.name, mend=mend)
    mesh, turned = repair_winding(mesh)
    notes += turned
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces] = True
    loose = int((~used).sum())
    if loose:
        notes.append(f"dropped {loose} of {count} vertices that no face uses")
        mesh = submesh(mesh, np.ones(len(mesh.faces), bool))
    _describe_oddities(mesh, notes)
    return mesh, notes


def _remove_broken_vertices(mesh: Mesh, notes: list[str]) -> Mesh:
    """Removes faces at vertices that are not finite, or extremely far. The vertices remain, unused."""
    # The limit is far below the largest number, because the squares of coordinates must stay finite too.
    good = np.asarray((np.abs(mesh.vertices) < 1e100).all(1))
    if good.all():
        return mesh
    keep = np.asarray(good[mesh.faces].all(1))
    notes.append(
        f"removed {int((~good).sum())} vertices that are not finite, with {int((~keep).sum())} faces"
    )
    vertices = np.where(good[:, None], mesh.vertices, 0.0)
    return replace(mesh, vertices=vertices).with_faces(keep)


def _remove_useless_faces(mesh: Mesh, notes: list[str]) -> Mesh:
    """Removes degenerate and duplicate faces. A face with opposite winding also counts as a duplicate."""
    if len(mesh.faces) == 0:
        return mesh
    flat = ~(np.linalg.norm(mesh.face_vectors(), axis=1) > 0)
    if flat.any():
        notes.append(f"dropped {int(flat.sum())} degenerate faces (no area)")
        mesh = mesh.with_faces(~flat)
    repeated = _repeated_faces(mesh)
    if repeated.any():
        notes.append(f"dropped {int(repeated.sum())} faces that repeat another one")
        mesh = mesh.with_faces(~repeated)
    return mesh


def _repeated_faces(mesh: Mesh) -> Bool:
    """Returns (F,) True if an earlier face has the same three positions."""
    welded, _ = weld(mesh)
    corners = np.sort(welded.faces.astype(np.int64), 1)
    count = len(welded.vertices)
    order = np.lexsort((corners[:, 2], corners[:, 0] * count + corners[:, 1]))
    same = (corners[order[1:]] == corners[order[:-1]]).all(1)
    repeated = np.zeros(len(corners), bool)
    repeated[order[1:][same]] = True
    return repeated


def _describe_oddities(mesh: Mesh, notes: list[str]) -> None:
    """Reports unusual properties that are kept."""
    welded, _ = weld(mesh)
    doubles = len(mesh.vertices) - len(welded.vertices)
    if doubles:
        notes.append(f"{doubles} vertices repeat a position: kept for shading, welded for deformation")
    pieces = int(shells(welded.faces, len(welded.vertices)).max()) + 1
    if pieces > 1:
        notes.append(f"it has {pieces} separate shells, all kept")
    low, high = mesh.bounds
    extent = np.sort(high - low)
    if extent[0] <= 1e-6 * extent[2]:
        notes.append("it is flat: it has no volume")
