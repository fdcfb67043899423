"""The union of two skinned meshes in one frame. Every vertex is traced to its origin.

    unite_meshes(first, first_skin, second, second_skin, offset=0) -> Union

``offset`` is added to the bone numbers of the second skin (0 if they are already numbered for the merged
skeleton). ``Union.first`` and ``Union.second`` give the old number of each vertex in either mesh, or -1.
``Union.seam`` marks the vertices where the two meshes meet. Vertices and faces that the seam does not touch
stay bit-exact. Those of the first mesh come first, then those of the second mesh, then the new ones. If the
union fails, the result is one mesh that contains both surfaces as separate, unchanged shells, and
``Union.notes`` gives the reason.
"""

from __future__ import annotations

from dataclasses import replace

import manifold3d
import numpy as np
import scipy

from enliven.arrays import Bool, Float
from enliven.document import SkinWeights
from enliven.meshes import Mesh, MeshMaterials, join_materials, materials_within, weld
from enliven.modeling.mesh.boolean_union import MeshPair, Union
from enliven.modeling.mesh.collapse_slivers import remove_slivers
from enliven.modeling.mesh.seam import find_creases
from enliven.modeling.mesh.solids import Solid, solid_from_mesh
from enliven.modeling.skinning import skin_values as skins


def unite_meshes(
    first: Mesh,
    first_skin: SkinWeights,
    second: Mesh,
    second_skin: SkinWeights,
    offset: int = 0,
    tidy: bool = False,
) -> Union:
    """Returns the union of two meshes. See the module's docstring for the data that the union preserves.

    Args:
        offset: added to the bone numbers of the second skin.
        tidy: True to contract the short edges that a union leaves along a creased seam, so that it can be
            smoothed. The seam then deviates from both surfaces by less than an edge length, and only new
            vertices move. Meshes with duplicate vertices stay unchanged.
    """
    moved = SkinWeights((second_skin.indices + np.uint16(offset)).astype(np.uint16), second_skin.weights)
    pair = MeshPair((first, second), (first_skin, moved))
    solids = [solid_from_mesh(mesh) for mesh in pair.meshes]
    for solid, mesh in zip(solids, pair.meshes, strict=True):
        if isinstance(solid, str):
            return pair.combine_shells(
                f"the mesh {mesh.name!r} is not a solid ({solid}), so both meshes remain separate "
                "shells in one mesh",
                True,
            )
    first_solid, second_solid = (solid for solid in solids if isinstance(solid, Solid))
    both = first_solid.manifold + second_solid.manifold
    if both.status() != manifold3d.Error.NoError:
        return pair.combine_shells(
            f"the union failed ({both.status()}), so both meshes remain separate shells in one mesh", True
        )
    notes = tuple(f"{s.mesh.name!r}: {note}" for s in (first_solid, second_solid) for note in s.notes)
    union = pair.build_union((first_solid, second_solid), both.to_mesh64(), notes)
    return _remove_slivers(union) if tidy and union.fused else union


def _remove_slivers(union: Union) -> Union:
    """Removes slivers at the new vertices of a union, where the seam has a crease."""
    new = find_creases(union.mesh, union.seam) & (union.first < 0) & (union.second < 0)
    # If positions occur twice, as in a flat-shaded mesh, moving only one of two equal vertices would open a
    # crack. So the slivers of such a mesh are kept.
    if not new.any() or len(weld(union.mesh)[0].vertices) < len(union.mesh.vertices):
        return union
    vertices, faces, is_kept, drawn = remove_slivers(union.mesh.vertices, union.mesh.faces, new)
    number = np.cumsum(is_kept) - 1
    colours, stiffness = union.mesh.paint_at(is_kept)
    materials = _materials_after(union.mesh, new, vertices[faces])
    faces = number[faces].astype(np.int32)
    mesh = Mesh(vertices[is_kept], faces, union.mesh.name, colours, materials, stiffness)
    return replace(
        union,
        mesh=mesh,
        skin=skins.select_vertices(union.skin, is_kept),
        first=union.first[is_kept],
        second=union.second[is_kept],
        seam=(union.seam | drawn)[is_kept],
    )


def _materials_after(mesh: Mesh, new: Bool, corners: Float) -> MeshMaterials | None:
    """Returns the materials after slivers were removed. Faces at new vertices get the material of the nearest
    old face.

    Args:
        new: (V,) True for new vertices, which may have moved.
        corners: (F, 3, 3) metres, the corners of the remaining faces.
    """
    if mesh.materials is None:
        return None
    touching = np.asarray(new[mesh.faces].any(1))
    changed_faces, unchanged_faces = np.flatnonzero(touching), np.flatnonzero(~touching)
    old = mesh.vertices[mesh.faces]
    after = corners[len(unchanged_faces) :]
    if not len(after):
        return mesh.materials.select_faces(unchanged_faces)
    nearest = scipy.spatial.cKDTree(old[changed_faces].mean(1)).query(after.mean(1))[1]
    inner = materials_within(mesh.materials, old, after, changed_faces[nearest])
    return join_materials(
        [(mesh.materials.select_faces(unchanged_faces), len(unchanged_faces)), (inner, len(after))]
    )
