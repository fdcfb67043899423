"""Joins two surfaces in their poses at one moment. Each keeps its rest shape away from the seam.

The union is computed on the posed surfaces, so that artists join what they see, whatever the two look like at
rest. Vertices away from the seam keep their rest positions and weights bit-exactly. A vertex at the seam is
mapped back to rest by the inverse of its blended transform. At the moment of the join it is therefore where
it was joined, and otherwise it follows its weights.
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


def joined(
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
        first, second: skinned to the same bone numbers.
        maps: (B, 3, 4) the transform of each bone at that moment, world from rest.
        loose: if the union fails, put both surfaces into one mesh.
        notes: receives what was repaired, or why there are two shells and not one surface.
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
        mend = "Repair the mesh, or merge loosely: both shells in one mesh."
        raise InputError(f"no union can be made: {union.notes[0]}", where=where, mend=mend)
    notes.extend(union.notes)
    mesh, skin = union.mesh, union.skin
    if union.seam.any():
        mesh, skin = heal(mesh, skin, union.seam)
    rest = _kept_rest(union, first, second)
    changed = union.seam | ((union.first < 0) & (union.second < 0))
    changed |= (mesh.vertices != union.mesh.vertices).any(1)
    changed |= (skin.indices != union.skin.indices).any(1) | (skin.weights != union.skin.weights).any(1)
    rows = np.flatnonzero(changed)
    rest[rows] = unpose_vertices(
        mesh.vertices[rows], SkinWeights(skin.indices[rows], skin.weights[rows]), maps
    )
    return replace(mesh, vertices=rest), skin


def unpose_vertices(seen: Float, skin: SkinWeights, maps: Float) -> Float:
    """Computes the rest positions (V, 3) that the blend of ``maps`` (B, 3, 4) takes to ``seen`` (V, 3).

    A nearly singular blend (of bones that turned against one another) has no useful inverse. In that case the
    inverse transform of the bone with the largest weight is used.
    """
    blend = np.einsum("vk,vkab->vab", skin.weights.astype(np.float64), maps[skin.indices])
    flat = np.abs(np.linalg.det(blend[:, :, :3])) < 0.05
    blend[flat] = maps[skin.indices[flat, skin.weights[flat].argmax(1)]]
    return np.asarray(np.linalg.solve(blend[:, :, :3], (seen - blend[:, :, 3])[..., None])[..., 0])


def _kept_rest(union: Union, first: SkinnedSurface, second: SkinnedSurface) -> Float:
    """Returns (V, 3) rest positions of vertices from either mesh. New vertices keep their posed positions."""
    rest = union.mesh.vertices.copy()
    ours, theirs = union.first >= 0, (union.second >= 0) & (union.first < 0)
    rest[ours] = first.mesh.vertices[union.first[ours]]
    rest[theirs] = second.mesh.vertices[union.second[theirs]]
    return rest
