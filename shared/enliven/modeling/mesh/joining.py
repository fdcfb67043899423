"""Two surfaces made one as they are seen at a moment, each keeping its rest away from the seam.

The union is made where the two are at that moment, so what an artist sees is what is joined, whatever the
two look like at rest. A vertex away from the seam keeps its rest position and weights to the bit. One at the
seam is taken back to rest by the inverse of its own blended transform: at that moment it is where it was
joined, and from then on it follows its weights.
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
from enliven.modeling.mesh.mesh_union import united

Heal = Callable[[Mesh, SkinWeights, Bool], tuple[Mesh, SkinWeights]]
"""What makes a surface smooth and its weights good around a seam (V,)."""


class Surface(NamedTuple):
    """A mesh at rest with its skin, and (V, 3) where its vertices are seen."""

    mesh: Mesh
    skin: SkinWeights
    seen: Float


def joined(
    first: Surface, second: Surface, maps: Float, heal: Heal, *, loose: bool, notes: list[str], where: str
) -> tuple[Mesh, SkinWeights]:
    """One mesh at rest, and its skin.

    Args:
        first, second: skinned to the same numbers.
        maps: (B, 3, 4) what each number's transform does at that moment, world from rest.
        loose: put both into one mesh where no union can be made.
        notes: takes what was mended, or why there are two shells and not one surface.
        where: named when it is refused.

    Raises:
        InputError: where no union can be made and ``loose`` is false.
    """
    whole = united(
        replace(first.mesh, vertices=first.seen),
        first.skin,
        replace(second.mesh, vertices=second.seen),
        second.skin,
        tidy=True,
    )
    if whole.failed and not loose:
        mend = "Repair the mesh, or merge loosely: both shells in one mesh."
        raise InputError(f"no union can be made: {whole.notes[0]}", where=where, mend=mend)
    notes.extend(whole.notes)
    mesh, skin = whole.mesh, whole.skin
    if whole.seam.any():
        mesh, skin = heal(mesh, skin, whole.seam)
    rest = _kept_rest(whole, first, second)
    changed = whole.seam | ((whole.first < 0) & (whole.second < 0))
    changed |= (mesh.vertices != whole.mesh.vertices).any(1)
    changed |= (skin.indices != whole.skin.indices).any(1) | (skin.weights != whole.skin.weights).any(1)
    rows = np.flatnonzero(changed)
    rest[rows] = unposed(mesh.vertices[rows], SkinWeights(skin.indices[rows], skin.weights[rows]), maps)
    return replace(mesh, vertices=rest), skin


def unposed(seen: Float, skin: SkinWeights, maps: Float) -> Float:
    """(V, 3) the rest positions that the blend of ``maps`` (B, 3, 4) takes to ``seen`` (V, 3).

    A blend that is nearly flat (bones that turned against one another) has no inverse worth having: there the
    map of the first bone is taken back.
    """
    blend = np.einsum("vk,vkab->vab", skin.weights.astype(np.float64), maps[skin.indices])
    flat = np.abs(np.linalg.det(blend[:, :, :3])) < 0.05
    blend[flat] = maps[skin.indices[flat, skin.weights[flat].argmax(1)]]
    return np.asarray(np.linalg.solve(blend[:, :, :3], (seen - blend[:, :, 3])[..., None])[..., 0])


def _kept_rest(whole: Union, first: Surface, second: Surface) -> Float:
    """(V, 3) the rest of the vertices that were one in either mesh; the others as they are seen."""
    rest = whole.mesh.vertices.copy()
    ours, theirs = whole.first >= 0, (whole.second >= 0) & (whole.first < 0)
    rest[ours] = first.mesh.vertices[whole.first[ours]]
    rest[theirs] = second.mesh.vertices[whole.second[theirs]]
    return rest
