"""Meshes as closed oriented solids for manifold3d, with every vertex traced; small holes are filled."""

from __future__ import annotations

from dataclasses import dataclass

import manifold3d
import numpy as np

from enliven.arrays import Bool, Int
from enliven.meshes import Mesh, joined_materials, weld
from enliven.modeling.mesh.caps import HarmonicInterpolation, cap_of, flattened
from enliven.modeling.mesh.cut_loops import chains_of

_OPEN = 0.25
"""Holes are closed where what closes them is at most this share of the mesh's surface."""


@dataclass(frozen=True)
class Solid:
    """A closed mesh and where its parts come from.

    Attributes:
        manifold: the library's own; each vertex has its number in ``mesh`` as a property.
        mesh: vertices as given, then those that close holes; faces that could not be used left out.
        closing: for each hole the vertices around it, and what spreads from them to those inside.
        faces: (F', ) for each face of ``mesh`` the given face, or -1 for one that closes a hole.
        id: the number under which the library's results name it.
        notes: what was mended.
    """

    manifold: manifold3d.Manifold
    mesh: Mesh
    closing: tuple[tuple[Int, HarmonicInterpolation], ...]
    faces: Int
    id: int
    notes: tuple[str, ...]


def solid_of(mesh: Mesh) -> Solid | str:
    """The mesh as a solid, or why it is none."""
    notes: list[str] = []
    welded, of = weld(mesh)
    use = _usable(welded)
    if not use.all():
        notes.append(f"left out {int((~use).sum())} faces without area or there twice")
    faces = np.flatnonzero(use)
    whole, closing, mended = _closed(mesh.with_faces(use), of)
    if isinstance(mended, str):
        return mended
    if mended:
        notes.append(f"closed {mended} holes" if mended > 1 else "closed a hole")
    faces = np.concatenate([faces, np.full(len(whole.faces) - len(faces), -1)])
    if signed_volume(whole) < 0:
        notes.append("it was inside out: turned")
        whole = whole.turned()
    made, number = _manifold(whole)
    if made.status() != manifold3d.Error.NoError:
        return _REASONS.get(made.status(), f"the library says {made.status()}")
    return Solid(made, whole, closing, faces, number, tuple(notes))


_REASONS = {
    manifold3d.Error.NotManifold: "its surface is not closed everywhere, or edges have more than two faces",
    manifold3d.Error.NonFiniteVertex: "some vertices are not finite",
}


def signed_volume(mesh: Mesh) -> float:
    """Cubic metres inside a closed mesh; below zero where its faces materials inward."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - mesh.vertices.mean(0) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def _usable(welded: Mesh) -> Bool:
    """(F,) faces with three corners that are not there before, either way about."""
    corners = np.sort(welded.faces, 1)
    whole = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2])
    _, first = np.unique(corners, axis=0, return_index=True)
    once = np.zeros(len(corners), bool)
    once[first] = True
    return np.asarray(whole & once)


def _closed(mesh: Mesh, of: Int) -> tuple[Mesh, tuple[tuple[Int, HarmonicInterpolation], ...], int | str]:
    """The mesh with its holes filled, what the new points are made of, and how many holes there were; or why
    they are not filled."""
    spreads: list[tuple[Int, HarmonicInterpolation]] = []
    faces = of[mesh.faces]
    starts, ends = faces.ravel(), np.roll(faces, -1, 1).ravel()
    count = len(of)
    key = starts * count + ends
    lonely = np.flatnonzero(~np.isin(ends * count + starts, key))
    if len(lonely) == 0:
        return mesh, (), 0
    own = mesh.faces.ravel()[lonely]
    # The border of a hole runs against the edges of the faces around it.
    chains = chains_of(np.stack([ends[lonely], starts[lonely]], 1))
    if not all(shut for _, shut in chains):
        return mesh, (), "the borders of its holes do not close"
    vertex_at = np.zeros(count, np.int64)
    vertex_at[starts[lonely]] = own
    vertices, closing, colours, added = [mesh.vertices], [mesh.faces], mesh.colours, 0.0
    total = len(mesh.vertices)
    for order, _ in chains:
        rim = vertex_at[order]
        cap = cap_of([np.arange(len(rim))], flattened(mesh.vertices[rim]))
        points = cap.inside(mesh.vertices[rim][cap.rim])
        numbers = np.concatenate([rim[cap.rim], total + np.arange(len(points))])
        vertices.append(points)
        spreads.append((rim[cap.rim], cap.inside))
        closing.append(numbers[cap.faces].astype(np.int32))
        if colours is not None:
            more = np.clip(np.rint(cap.inside(colours[rim][cap.rim].astype(np.float64))), 0, 255).astype(
                np.uint8
            )
            colours = np.concatenate([colours, more])
        total += len(points)
        added += Mesh(np.concatenate([mesh.vertices[rim][cap.rim], points]), cap.faces.astype(np.int32)).area
    if added > _OPEN * mesh.area:
        return mesh, (), "it is open: too much of its surface is missing to close it"
    faces = np.concatenate(closing)
    materials = joined_materials([(mesh.materials, len(mesh.faces)), (None, len(faces) - len(mesh.faces))])
    whole = Mesh(np.concatenate(vertices), faces, mesh.name, colours, materials)
    return whole, tuple(spreads), len(chains)


def _manifold(mesh: Mesh) -> tuple[manifold3d.Manifold, int]:
    """The library's solid, its vertices numbered in a property, faces by themselves."""
    _, of = weld(mesh)
    first = np.full(len(mesh.vertices), len(mesh.vertices), np.int64)
    np.minimum.at(first, of, np.arange(len(of)))
    twice = np.flatnonzero(first[of] != np.arange(len(of)))
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces] = True
    # Loose vertices are left out: the library would count them as solids without faces.
    number = np.cumsum(used) - 1
    twice = twice[used[twice]]
    kept = np.flatnonzero(used)
    properties = np.concatenate([mesh.vertices[kept], kept[:, None].astype(np.float64)], 1)
    own = manifold3d.Manifold.reserve_ids(1)
    lowest = _lowest_used(of, used)
    made = manifold3d.Mesh64(
        np.ascontiguousarray(properties),
        np.ascontiguousarray(number[mesh.faces], np.uint64),
        merge_from_vert=np.asarray(number[twice], np.uint64),
        merge_to_vert=np.asarray(number[lowest[of[twice]]], np.uint64),
        run_index=np.array([0, 3 * len(mesh.faces)], np.uint64),
        run_original_id=np.array([own], np.uint32),
        face_id=np.arange(len(mesh.faces), dtype=np.uint64),
    )
    return manifold3d.Manifold(made), own


def _lowest_used(of: Int, used: Bool) -> Int:
    """(V,) the first used vertex of each welded one."""
    lowest = np.full(len(of), len(of), np.int64)
    np.minimum.at(lowest, of[used], np.flatnonzero(used))
    return lowest
