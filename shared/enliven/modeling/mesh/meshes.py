"""Functions for the mesh of an edited skeleton: posed vertices, bone numbers, and separation into parts by
bones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.deformation.graph.connectivity import label_components
from enliven.document import RiggedCharacter, SkinWeights
from enliven.meshes import extract_submesh, weld
from enliven.modeling.mesh.cut_pieces import Piece
from enliven.modeling.skinning.skins import renumber_bones


def compute_posed_vertices(shape: RiggedCharacter, linear: Float, joints: Float) -> Float:
    """Returns the vertices (V, 3) in metres for the bones' maps L (N, 3, 3) and the joints x (N, 3): v' =
    sum_j w_j (L_j (v - rest_parent) + x_parent).
    """
    assert shape.mesh is not None and shape.skin is not None
    above = np.maximum(shape.skeleton.parents, 0)
    return blend_vertices(
        shape.mesh.vertices, shape.skin, shape.skeleton.positions[above], linear, joints[above]
    )


def blend_vertices(
    vertices: Float, skin: SkinWeights, pivots: Float, linear: Float, positions: Float
) -> Float:
    """Returns the vertices (V, 3) in metres, v' = sum_k w_k (linear_k (v - pivot_k) + position_k), in double
    precision.
    """
    out = np.zeros_like(vertices)
    for slot in range(4):
        node = skin.indices[:, slot]
        moved = np.einsum("vab,vb->va", linear[node], vertices - pivots[node]) + positions[node]
        out += skin.weights[:, slot, None].astype(np.float64) * moved
    return out


def with_piece(shape: RiggedCharacter, piece: Piece, numbers: Int) -> RiggedCharacter:
    """Returns the shape with the mesh of one side of a cut. ``numbers`` (N,) maps old bones to bones of the
    shape."""
    assert piece.skin is not None
    return shape.with_changes(mesh=piece.mesh, skin=renumber_bones(piece.skin, numbers))


def match_bone_numbers(old_shape: RiggedCharacter, shape: RiggedCharacter, otherwise: str) -> Int:
    """Returns for each bone of ``old_shape`` the number of the bone of ``shape`` with the same name, (N,).

    If no bone has this name, the result is the number of the bone called ``otherwise``.
    """
    number = {name: j for j, name in enumerate(shape.skeleton.names)}
    return np.array([number.get(name, number[otherwise]) for name in old_shape.skeleton.names], np.int64)


def divide_by_bones(piece: Piece, groups: Sequence[Sequence[int]]) -> list[Piece | None]:
    """Divides a piece by groups of bones. Returns one piece for each group, with the shells that follow this
    group most, or None for a group without shells."""
    assert piece.skin is not None
    welded, of = weld(piece.mesh)
    ends = welded.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    shell = label_components(len(welded.vertices), ends)[of]
    follows = np.zeros((int(shell.max()) + 1, len(groups)))
    for k, bones in enumerate(groups):
        weight = np.where(np.isin(piece.skin.indices, list(bones)), piece.skin.weights, 0.0).sum(1)
        np.add.at(follows[:, k], shell, weight)
    chosen = follows.argmax(1)[shell]
    return [_select_piece_faces(piece, chosen == k) for k in range(len(groups))]


def _select_piece_faces(piece: Piece, inside: Bool) -> Piece | None:
    """Returns the faces of a piece with all corners ``inside`` (V,), or None if no face has this property."""
    if not inside.any() or piece.skin is None:
        return None
    if inside.all():
        return piece
    faces = inside[piece.mesh.faces[:, 0]]
    mesh = extract_submesh(piece.mesh, faces)
    used = np.zeros(len(inside), bool)
    used[piece.mesh.faces[faces]] = True
    skin = SkinWeights(piece.skin.indices[used], piece.skin.weights[used])
    return Piece(mesh, skin, piece.kept[used], int(faces[len(faces) - piece.caps :].sum()))


def bone_maps(shape: RiggedCharacter, linear: Float, joints: Float) -> Float:
    """Returns the map (N, 3, 4) of each bone from rest to the world, L_j (v - rest_parent) + x_parent, for L
    (N, 3, 3).
    """
    above = np.maximum(shape.skeleton.parents, 0)
    offset = joints[above] - np.einsum("nab,nb->na", linear, shape.skeleton.positions[above])
    return np.concatenate([linear, offset[..., None]], -1)


def identity_maps(shape: RiggedCharacter) -> Float:
    """Returns the identity (N, 3, 4) for each bone: the rest pose."""
    return np.tile(np.eye(3, 4), (len(shape.skeleton), 1, 1))
