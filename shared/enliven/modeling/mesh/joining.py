"""Joins two surfaces in their poses at one time. Away from the seam, each keeps its shape at rest.

The union is computed on the posed surfaces, because these are the surfaces that an artist sees. The rest
poses may differ much from them. Vertices away from the seam keep their rest positions and weights
bit-exactly. A vertex at the seam is mapped back to rest by the inverse of its blended transform. So at the
time of the join it has its position in the union, and at other times it follows its weights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from enliven.arrays import Bool, Float
from enliven.document import SkinWeights
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.mesh.boolean_union import Union
from enliven.modeling.mesh.mesh_union import unite_meshes

Heal = Callable[[Mesh, SkinWeights, Bool], tuple[Mesh, SkinWeights]]
"""A function that smooths a surface and recomputes its weights around a seam (V,)."""


class SkinnedSurface(NamedTuple):
    """A mesh at rest with its skin, and its posed vertices (V, 3)."""

    mesh: Mesh
    skin: SkinWeights
    seen: Float


def join_surfaces(
    first: SkinnedSurface,
    second: SkinnedSurface,
    maps: Float,
    heal: Heal,
    *,
    loose: bool,
    notes: list[str],
    where: str,
) -> tuple[Mesh, SkinWeights]:
    """Joins two posed surfaces in one mesh at rest, with its skin.

    Args:
        first, second: the two surfaces, with the same bone numbers in their skins.
        maps: (B, 3, 4) the transform of each bone at the time of the join, from rest to the world.
        loose: if the union fails, put both surfaces into one mesh.
        notes: a list that receives sentences about repairs, or the reason why two shells remain.
        where: the name used in error messages.

    Raises:
        InputError: if the union fails and ``loose`` is false.
    """
    union = unite_meshes(
        replace(first.mesh, vertices=first.seen),
        first.skin,
        replace(second.mesh, vertices=second.seen),
        second.skin,
        tidy=True,
    )
    if union.failed and not loose:
        remedy = (
            "Repair the mesh, or merge without a union: both meshes then remain separate shells in one mesh."
        )
        raise InputError(f"the union of the two meshes failed: {union.notes[0]}", where=where, remedy=remedy)
    notes.extend(union.notes)
    mesh, skin = union.mesh, union.skin
    if union.seam.any():
        mesh, skin = heal(mesh, skin, union.seam)
    rest = _find_kept_rest(union, first, second)
    is_seam = union.seam | ((union.first < 0) & (union.second < 0))
    is_seam |= (mesh.vertices != union.mesh.vertices).any(1)
    is_seam |= (skin.indices != union.skin.indices).any(1) | (skin.weights != union.skin.weights).any(1)
    rows = np.flatnonzero(is_seam)
    rest[rows] = unpose_vertices(
        mesh.vertices[rows], SkinWeights(skin.indices[rows], skin.weights[rows]), maps
    )
    return replace(mesh, vertices=rest), skin


def unpose_vertices(seen: Float, skin: SkinWeights, maps: Float) -> Float:
    """Computes rest positions (V, 3) from posed positions ``seen`` (V, 3), with the inverse of each vertex's
    blended transform. ``maps`` (B, 3, 4) are the transforms of the bones.

    A nearly singular blend (of bones that are rotated far from each other) has no useful inverse. In that
    case the inverse transform of the bone with the largest weight is used.
    """
    blend = np.einsum("vk,vkab->vab", skin.weights.astype(np.float64), maps[skin.indices])
    flat = np.abs(np.linalg.det(blend[:, :, :3])) < 0.05
    blend[flat] = maps[skin.indices[flat, skin.weights[flat].argmax(1)]]
    return np.asarray(np.linalg.solve(blend[:, :, :3], (seen - blend[:, :, 3])[..., None])[..., 0])


def _find_kept_rest(union: Union, first: SkinnedSurface, second: SkinnedSurface) -> Float:
    """Returns (V, 3) rest positions of vertices from either mesh. New vertices keep their posed positions."""
    rest = union.mesh.vertices.copy()
    first_kept, second_kept = union.first >= 0, (union.second >= 0) & (union.first < 0)
    rest[first_kept] = first.mesh.vertices[union.first[first_kept]]
    rest[second_kept] = second.mesh.vertices[union.second[second_kept]]
    return rest
