"""Converts meshes to closed, oriented solids for manifold3d, with every vertex traced to its origin."""

from __future__ import annotations

from dataclasses import dataclass, replace

import manifold3d
import numpy as np

from enliven.arrays import Bool, Int
from enliven.meshes import Mesh, join_materials, split_paint, weld
from enliven.modeling.mesh.closing import ClosedSurface, Interpolation, close_surface


@dataclass(frozen=True)
class Solid:
    """A closed mesh for manifold3d, with the origin of its vertices and faces.

    Attributes:
        manifold: the manifold3d object. Each of its vertices has its number in ``mesh`` as a property.
        mesh: the given vertices, then the vertices that close the surface. Unusable faces are excluded.
        closing: one pair for each group of vertices that close the surface, in order: the vertices that the
            group depends on, and the function that interpolates values at the group's vertices.
        leaves: a mesh of the given faces that do not enclose a volume (open sheets), with the vertices of
            ``mesh``.
        id: number of the solid in manifold3d's results.
        notes: a sentence for each repair.
    """

    manifold: manifold3d.Manifold
    mesh: Mesh
    closing: tuple[tuple[Int, Interpolation], ...]
    leaves: Mesh
    id: int
    notes: tuple[str, ...]


def solid_from_mesh(mesh: Mesh) -> Solid | str:
    """Converts a mesh to a solid. If that fails, returns the reason as a sentence."""
    if not np.isfinite(mesh.vertices).all():
        return "some vertex positions are not finite numbers"
    notes: list[str] = []
    welded, of = weld(mesh)
    use = _is_usable_face(welded)
    if not use.all():
        notes.append(f"{int((~use).sum())} faces without area or with a duplicate were removed")
    used = mesh.with_faces(use)
    closed = close_surface(used, of)
    if not len(closed.faces):
        return "the surface is open, and its holes are too large to close"
    if closed.caps:
        notes.append(f"{closed.caps} holes were closed" if closed.caps > 1 else "a hole was closed")
    if closed.leaf.any():
        notes.append(f"{int(closed.leaf.sum())} faces do not enclose a volume and stay unchanged")
    closed_mesh = _close_mesh(used, closed)
    leaves = replace(
        used.with_faces(closed.leaf),
        vertices=closed_mesh.vertices,
        colours=closed_mesh.colours,
        stiffness=closed_mesh.stiffness,
    )
    if signed_volume(closed_mesh) < 0:
        notes.append("the faces of the mesh pointed inwards, so they were reversed")
        closed_mesh, leaves = closed_mesh.flip_faces(), leaves.flip_faces()
    manifold, number = _manifold_solid(closed_mesh, closed.label)
    if manifold.status() != manifold3d.Error.NoError:
        return f"the library manifold3d reports {manifold.status()}"
    return Solid(manifold, closed_mesh, closed.made, leaves, number, tuple(notes))


def _close_mesh(mesh: Mesh, closed: ClosedSurface) -> Mesh:
    """Returns the mesh with open sheets removed and holes capped. The caps interpolate the paint of their
    borders."""
    paint = mesh.paint
    for of, how in closed.made:
        paint = np.concatenate([paint, how(paint[of])])
    colours, stiffness = split_paint(paint, mesh)
    enclosing = mesh.with_faces(~closed.leaf)
    groups = [(enclosing.materials, len(enclosing.faces)), (None, len(closed.faces) - len(enclosing.faces))]
    faces = closed.faces.astype(np.int32)
    return Mesh(closed.vertices, faces, mesh.name, colours, join_materials(groups), stiffness)


def signed_volume(mesh: Mesh) -> float:
    """Computes the volume of a closed mesh in cubic metres. It is negative if its faces point inward."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - mesh.vertices.mean(0) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def _is_usable_face(welded: Mesh) -> Bool:
    """Returns (F,) true for faces with three different corners that do not repeat an earlier face in either
    direction."""
    corners = np.sort(welded.faces, 1)
    is_proper = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2])
    _, first = np.unique(corners, axis=0, return_index=True)
    once = np.zeros(len(corners), bool)
    once[first] = True
    return np.asarray(is_proper & once)


def _manifold_solid(mesh: Mesh, label: Int) -> tuple[manifold3d.Manifold, int]:
    """Builds the manifold3d solid, with vertex numbers as a property and each face with its own id.

    Args:
        label: (V,) vertices with equal labels are merged.
    """
    # Exclude vertices without faces, because manifold3d would count them as solids without faces.
    used = np.unique(mesh.faces)
    _, first, of = np.unique(label[used], return_index=True, return_inverse=True)
    target = first[of.reshape(-1)]
    twice = np.flatnonzero(target != np.arange(len(used)))
    properties = np.concatenate([mesh.vertices[used], used[:, None].astype(np.float64)], 1)
    face_id = manifold3d.Manifold.reserve_ids(1)
    solid_mesh = manifold3d.Mesh64(
        np.ascontiguousarray(properties),
        np.ascontiguousarray(np.searchsorted(used, mesh.faces), np.uint64),
        merge_from_vert=np.asarray(twice, np.uint64),
        merge_to_vert=np.asarray(target[twice], np.uint64),
        run_index=np.array([0, 3 * len(mesh.faces)], np.uint64),
        run_original_id=np.array([face_id], np.uint32),
        face_id=np.arange(len(mesh.faces), dtype=np.uint64),
    )
    return manifold3d.Manifold(solid_mesh), face_id
