"""The boolean union of two meshes. Kept vertices stay bit-exact. New vertices are traced to both meshes and
get interpolated skin weights."""

from __future__ import annotations

from dataclasses import dataclass, replace

import manifold3d
import numpy as np

from enliven.arrays import Bool, Float, Int, Int32
from enliven.document import SkinWeights
from enliven.meshes import (
    Mesh,
    MeshMaterials,
    barycentric,
    first_of_position,
    join_materials,
    materials_within,
    split_paint,
    weld,
)
from enliven.modeling.mesh.solids import Solid
from enliven.modeling.skinning import skin_values as skins


@dataclass(frozen=True)
class Union:
    """The result of the union of two meshes.

    Attributes:
        mesh: the united surface.
        skin: the combined skin weights.
        first: (V,) the number of each vertex in the first mesh, or -1.
        second: (V,) the number of each vertex in the second mesh, or -1.
        seam: (V,) True for vertices at which the two meshes meet. These are new vertices, or old vertices
            that belong to both meshes.
        fused: True if the result is one surface, False if it is two shells in one mesh.
        notes: sentences about repairs, or about the reason why the meshes were not fused.
        failed: True if manifold3d could not compute the union: one mesh is not a solid, or the library
            reported an error.
    """

    mesh: Mesh
    skin: SkinWeights
    first: Int
    second: Int
    seam: Bool
    fused: bool
    notes: tuple[str, ...] = ()
    failed: bool = False


@dataclass
class MeshPair:
    """The two meshes of a union, with their skin weights."""

    meshes: tuple[Mesh, Mesh]
    skins: tuple[SkinWeights, SkinWeights]

    def combine_shells(self, note: str, failed: bool = False) -> Union:
        """Returns one mesh that contains the shells of both meshes, without fusing them."""
        first, second = self.meshes
        faces = np.concatenate([first.faces, second.faces + np.int32(len(first.vertices))])
        vertices = np.concatenate([first.vertices, second.vertices])
        paint = np.concatenate([mesh.paint for mesh in self.meshes])
        colours, stiffness = split_paint(paint, *self.meshes)
        first_faces = np.concatenate([np.arange(len(first.vertices)), np.full(len(second.vertices), -1)])
        second_faces = np.concatenate([np.full(len(first.vertices), -1), np.arange(len(second.vertices))])
        materials = join_materials([(mesh.materials, len(mesh.faces)) for mesh in self.meshes])
        mesh = Mesh(vertices, faces, first.name, colours, materials, stiffness)
        none = np.zeros(len(vertices), bool)
        return Union(
            mesh, skins.concatenate_skins(self.skins), first_faces, second_faces, none, False, (note,), failed
        )

    def build_union(
        self, solids: tuple[Solid, Solid], made: manifold3d.Mesh64, notes: tuple[str, ...]
    ) -> Union:
        """Builds the union from manifold3d's result. Kept vertices and faces stay in order and bit-exact."""
        sides = [Side(made, solid) for solid in solids]
        if any(len(side.triangles) == 0 for side in sides):
            return self.combine_shells(
                "one mesh is inside the other, so both remain separate shells in one mesh"
            )
        if not any(side.lost or side.new for side in sides):
            return self.combine_shells("the meshes do not touch, so both remain separate shells in one mesh")
        return UnionBuilder(self, sides, made).union(notes)


class Side:
    """The part of manifold3d's result that comes from one of the two solids."""

    def __init__(self, made: manifold3d.Mesh64, solid: Solid) -> None:
        self.solid = solid
        starts = np.asarray(made.run_index, np.int64) // 3
        runs = [k for k, number in enumerate(made.run_original_id) if number == solid.id]
        all_triangles = np.asarray(made.tri_verts, np.int64)
        names = np.asarray(made.face_id, np.int64)
        pick = np.concatenate([np.zeros(0, np.int64), *(np.arange(starts[k], starts[k + 1]) for k in runs)])
        self.triangles, self.source = all_triangles[pick], names[pick]
        properties = np.asarray(made.vert_properties)
        self.used = np.unique(self.triangles)
        number = properties[self.used, 3]
        nearest = np.clip(np.rint(number), 0, len(solid.mesh.vertices) - 1).astype(np.int64)
        same = (properties[self.used, :3] == solid.mesh.vertices[nearest]).all(1) & (number == nearest)
        self.old = np.full(len(properties), -1, np.int64)
        self.old[self.used[same]] = nearest[same]
        corners = self.old[self.triangles]
        source_faces = solid.mesh.faces[self.source] if len(self.source) else corners
        turned = np.stack([np.roll(source_faces, k, 1) for k in range(3)], 1)
        self.whole = np.asarray((turned == corners[:, None]).all(2).any(1))
        self.lost = len(np.unique(self.source)) < len(solid.mesh.faces)
        self.new = bool((~self.whole).any())


class UnionBuilder:
    """Builds the united mesh: first the kept vertices of both meshes in their order, then the new
    vertices."""

    def __init__(self, pair: MeshPair, sides: list[Side], made: manifold3d.Mesh64) -> None:
        self.pair, self.sides = pair, sides
        self.places = np.ascontiguousarray(np.asarray(made.vert_properties)[:, :3])
        self.meshes = [side.solid.mesh for side in sides]
        self.share = all(len(weld(mesh)[0].vertices) == len(mesh.vertices) for mesh in pair.meshes)

    def union(self, notes: tuple[str, ...]) -> Union:
        """Returns the union of both meshes, with its traces, skin and colours."""
        # Number the vertices of the result: first the kept vertices of the first mesh, then those of the
        # second, then the new ones.
        kept_vertices = [
            np.union1d(side.old[side.old >= 0], side.solid.leaves.faces).astype(np.int64)
            for side in self.sides
        ]
        ends = np.cumsum([len(kept_vertices[0]), len(kept_vertices[1])])
        number = np.full(len(self.places), -1, np.int64)
        for side, start, old in zip(self.sides, (0, ends[0]), kept_vertices, strict=True):
            mine = np.flatnonzero(side.old >= 0)
            number[mine] = start + np.searchsorted(old, side.old[mine])
        used = np.zeros(len(self.places), bool)
        for side in self.sides:
            used[side.used] = True
        new = np.flatnonzero(used & (number < 0))
        number[new] = ends[1] + np.arange(len(new))
        # Collect the faces: first the uncut faces of both meshes, then the split faces, then the leaves (open
        # sheets).
        faces = np.concatenate(
            [*(self._find_kept_faces(side, number) for side in self.sides)]
            + [number[side.triangles[~side.whole]] for side in self.sides]
            + [
                start + np.searchsorted(old, side.solid.leaves.faces)
                for side, start, old in zip(self.sides, (0, ends[0]), kept_vertices, strict=True)
            ]
        )
        vertices = np.concatenate(
            [self.meshes[0].vertices[kept_vertices[0]], self.meshes[1].vertices[kept_vertices[1]]]
        )
        vertices = np.concatenate([vertices, self.places[new]])
        # Fill in skin weights and paint. Kept vertices keep their values, and new vertices get interpolated
        # values.
        weights, paint = self._interpolate_new(new)
        whole = skins.bone_count(skins.concatenate_skins(self.pair.skins))
        old_skins = [self._make_kept_skin(k, kept_vertices[k], whole) for k in range(2)]
        skin = skins.concatenate_skins([*old_skins, skins.keep_largest_weights(weights)])
        paint = np.concatenate(
            [*(m.paint[k] for m, k in zip(self.meshes, kept_vertices, strict=True)), paint]
        )
        colours, stiffness = split_paint(paint, *self.meshes)
        # Record for each vertex of the result its number in the first and in the second mesh, or -1.
        counts = [len(mesh.vertices) for mesh in self.pair.meshes]
        first, second = (np.full(len(vertices), -1, np.int64) for _ in range(2))
        first[: ends[0]] = np.where(kept_vertices[0] < counts[0], kept_vertices[0], -1)
        second[ends[0] : ends[1]] = np.where(kept_vertices[1] < counts[1], kept_vertices[1], -1)
        materials = self._face_materials(vertices[faces])
        faces = faces.astype(np.int32)
        mesh = Mesh(vertices, faces, self.meshes[0].name, colours, materials, stiffness)
        whole = self._average_seam_skin(mesh, skin, (first, second), ends, notes)
        return _weld_vertices(whole) if self.share else whole

    def _face_materials(self, corners: Float) -> MeshMaterials | None:
        """Returns the material of each face of the union, with corners (F, 3, 3).

        Faces that were kept whole come first, then the pieces of faces that were split.
        """
        if all(mesh.materials is None for mesh in self.meshes):
            return None
        groups = list[tuple[MeshMaterials | None, int]]()
        for side, mesh in zip(self.sides, self.meshes, strict=True):
            order = np.sort(side.source[side.whole])
            groups.append(
                (None if mesh.materials is None else mesh.materials.select_faces(order), len(order))
            )
        start = sum(count for _, count in groups)
        for side, mesh in zip(self.sides, self.meshes, strict=True):
            source = side.source[~side.whole]
            source_corners = corners[start : start + len(source)]
            groups.append(
                (
                    materials_within(mesh.materials, mesh.vertices[mesh.faces], source_corners, source),
                    len(source),
                )
            )
            start += len(source)
        groups += [(side.solid.leaves.materials, len(side.solid.leaves.faces)) for side in self.sides]
        return join_materials(groups)

    def _find_kept_faces(self, side: Side, number: Int) -> Int:
        """Returns the uncut faces (K, 3) of one side in their old order. ``number`` gives the new number of
        each vertex."""
        order = np.sort(side.source[side.whole])
        new_numbers = np.full(len(side.solid.mesh.vertices), -1, np.int64)
        traced = np.flatnonzero(side.old >= 0)
        new_numbers[side.old[traced]] = number[traced]
        return np.asarray(new_numbers[side.solid.mesh.faces[order]])

    def _make_kept_skin(self, k: int, kept_vertices: Int | Int32, bones: int) -> SkinWeights:
        """Returns the skin of the kept vertices. Vertices that close a hole get the interpolated skin of its
        border.
        """
        mesh, skin = self.meshes[k], self.pair.skins[k]
        given_count = len(self.pair.meshes[k].vertices)
        if len(mesh.vertices) == given_count:
            return skins.select_vertices(skin, kept_vertices)
        full = skins.make_dense_weights(skin, bones)
        for of, how in self.sides[k].solid.closing:
            full = np.concatenate([full, how(full[of])])
        old = skins.select_vertices(skin, kept_vertices[kept_vertices < given_count])
        return skins.concatenate_skins(
            [old, skins.keep_largest_weights(full[kept_vertices[kept_vertices >= given_count]])]
        )

    def _interpolate_new(self, new: Int) -> tuple[Float, Float]:
        """Returns weights (N, B) and paint (N, 4) of the new vertices. Each is interpolated within the old
        face that contains the vertex."""
        bones = skins.bone_count(skins.concatenate_skins(self.pair.skins))
        weights, paint = np.zeros((len(new), bones)), np.zeros((len(new), 4))
        row = np.full(len(self.places), -1, np.int64)
        row[new] = np.arange(len(new))
        for k, side in enumerate(self.sides):
            mesh = self.meshes[k]
            own_paint = mesh.paint
            face, corner = np.nonzero(row[side.triangles] >= 0)
            vertex = side.triangles[face, corner]
            vertex, first = np.unique(vertex, return_index=True)
            source_faces = mesh.faces[side.source[face[first]]]
            coordinates = barycentric(self.places[vertex], mesh.vertices[source_faces])
            corners, inverse = np.unique(source_faces, return_inverse=True)
            full = skins.make_dense_weights(self._make_kept_skin(k, corners, bones), bones)[
                inverse.reshape(-1, 3)
            ]
            weights[row[vertex]] = (coordinates[..., None] * full).sum(1)
            paint[row[vertex]] = (coordinates[..., None] * own_paint[source_faces]).sum(1)
        return weights, paint

    def _average_seam_skin(
        self, mesh: Mesh, skin: SkinWeights, old: tuple[Int, Int], ends: Int, notes: tuple[str, ...]
    ) -> Union:
        """Averages the skin weights over all seam vertices at the same position."""
        count = len(mesh.vertices)
        first = first_of_position(np.ascontiguousarray(mesh.vertices + 0.0))
        seam = np.zeros(count, bool)
        seam[ends[1] :] = True
        mine = np.arange(count) < ends[0]
        has = np.zeros((count, 2), bool)
        has[first[mine], 0] = True
        has[first[~mine & (np.arange(count) < ends[1])], 1] = True
        meets = np.asarray(has.all(1))[first] | np.isin(first, first[seam])
        seam |= meets
        rows = np.flatnonzero(seam)
        bones = skins.bone_count(skin)
        full, counts = np.zeros((count, bones)), np.zeros(count)
        np.add.at(full, first[rows], skins.make_dense_weights(skins.select_vertices(skin, rows), bones))
        np.add.at(counts, first[rows], 1.0)
        mean = skins.keep_largest_weights(full[first[rows]] / counts[first[rows], None])
        indices, weights = skin.indices.copy(), skin.weights.copy()
        indices[rows], weights[rows] = mean.indices, mean.weights
        return Union(mesh, SkinWeights(indices, weights), old[0], old[1], seam, True, notes)


def _weld_vertices(union: Union) -> Union:
    """Merges vertices at the same position. A vertex of the first mesh is kept in preference to others."""
    mesh = union.mesh
    first = first_of_position(np.ascontiguousarray(mesh.vertices + 0.0))
    faces = first[mesh.faces]
    is_proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    is_proper[is_proper] = ~_is_membrane(faces[is_proper])
    is_used, new_numbers = np.unique(faces[is_proper], return_inverse=True)
    second = union.second.copy()
    np.maximum.at(second, first, union.second)
    colours, stiffness = mesh.paint_at(is_used)
    materials = None if mesh.materials is None else mesh.materials.select_faces(is_proper)
    faces = new_numbers.reshape(-1, 3).astype(np.int32)
    return replace(
        union,
        mesh=Mesh(mesh.vertices[is_used], faces, mesh.name, colours, materials, stiffness),
        skin=skins.select_vertices(union.skin, is_used),
        first=union.first[is_used],
        second=second[is_used],
        seam=union.seam[is_used],
    )


def _is_membrane(faces: Int) -> Bool:
    """Returns (F,) True for faces with the same corners as another face. Touching caps leave such pairs of
    opposite faces."""
    if len(faces) == 0:
        return np.zeros(0, bool)
    lowest = np.argmin(faces, 1)
    turned = np.take_along_axis(faces, (lowest[:, None] + np.arange(3)) % 3, 1)
    rotated = turned[:, 1] < turned[:, 2]
    _, same, count = np.unique(np.sort(faces, 1), axis=0, return_inverse=True, return_counts=True)
    same = same.reshape(-1)
    is_pair = (count == 2) & (np.bincount(same, rotated, len(count)) == 1)
    return np.asarray(is_pair[same])
