"""Healing: the surface made smooth around a seam, and skin weights computed anew there, and nowhere else.

    healed(mesh, skin, skeleton, seam) -> (Mesh, SkinWeights)      both of the below
    smoothed(mesh, seam) -> Mesh                                   positions only
    reweighted(mesh, skin, skeleton, seam) -> SkinWeights          weights only

``seam`` is (V,) true at the vertices of the seam: ``Union.seam``, or ``Piece.kept < 0``. Whatever is
farther than the given number of rings from it stays the same to the bit. Positions near the seam minimise
the squared Laplacian with what is around held fixed, so the surface goes on in the direction in which it
comes (M. Botsch and L. Kobbelt, "An intuitive framework for real-time freeform modeling", 2004): a crease
becomes a fillet and no volume is lost. Weights near the seam are those of :mod:`enliven.modeling.bone_heat`
with the old weights held around them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.linalg import spsolve

from enliven.arrays import Bool, Float, Int
from enliven.character import SkinWeights
from enliven.mesh import Mesh, weld
from enliven.modeling.bone_heat import HeatSettings, heat_weights, segments_of
from enliven.modeling.skin_values import bone_count, dense, sparse
from enliven.settings import setting
from enliven.skeleton import Skeleton


@dataclass(frozen=True)
class SeamSettings:
    """How far a seam is healed."""

    smooth_rings: int = setting(2, "rings of vertices around a seam that are smoothed", low=0, high=20)
    strength: float = setting(
        0.7, "how far they move to where they are smoothest", unit="share", low=0.0, high=1.0
    )
    weight_rings: int = setting(
        4, "rings of vertices around a seam that get new skin weights", low=0, high=40
    )


def healed(
    mesh: Mesh, skin: SkinWeights, skeleton: Skeleton, seam: Bool, settings: SeamSettings | None = None
) -> tuple[Mesh, SkinWeights]:
    """The mesh and its skin with the seam smoothed and weighted anew.

    Args:
        skeleton: whose bones the skin names, in the mesh's frame.
        seam: (V,) where it is.
    """
    smooth = smoothed(mesh, seam, settings)
    return smooth, reweighted(smooth, skin, skeleton, seam, settings)


def smoothed(mesh: Mesh, seam: Bool, settings: SeamSettings | None = None) -> Mesh:
    """The mesh with the rings around the seam as smooth as what is around them allows."""
    settings = settings or SeamSettings()
    free = _rings(mesh, seam, settings.smooth_rings)
    if not free.any() or free.all() or settings.strength == 0.0:
        return mesh
    vertices = fair(mesh, free)
    moved = mesh.vertices + settings.strength * (vertices - mesh.vertices)
    return Mesh(np.where(free[:, None], moved, mesh.vertices), mesh.faces, mesh.name, mesh.colours)


def reweighted(
    mesh: Mesh, skin: SkinWeights, skeleton: Skeleton, seam: Bool, settings: SeamSettings | None = None
) -> SkinWeights:
    """The skin with the rings around the seam computed by bone heat, the rest held and unchanged."""
    settings = settings or SeamSettings()
    free = _rings(mesh, seam, settings.weight_rings)
    if not free.any():
        return skin
    bones = max(len(skeleton), bone_count(skin))
    weights = heat_weights(mesh, *segments_of(skeleton), bones, HeatSettings(), dense(skin, bones), free)
    new = sparse(weights[free], smooth=True)
    indices, kept = skin.indices.copy(), skin.weights.copy()
    indices[free], kept[free] = new.indices, new.weights
    return SkinWeights(indices, kept)


def fair(mesh: Mesh, free: Bool) -> Float:
    """(V, 3) positions with the least squared Laplacian where ``free`` (V,), the others as they are."""
    welded, of = weld(mesh)
    loose = np.zeros(len(welded.vertices), bool)
    loose[of[free]] = True
    web = _web(welded)
    inner = np.flatnonzero(loose)
    # Only rows that a free vertex takes part in.
    rows = np.unique(np.concatenate([inner, web[inner].indices]))
    laplacian = (csr_matrix(diags(np.ones(web.shape[0]))) - web)[rows]
    own, rest = laplacian[:, inner], laplacian[:, np.flatnonzero(~loose)]
    right = -(own.T @ (rest @ welded.vertices[~loose]))
    square = (own.T @ own + 1e-12 * diags(np.ones(len(inner)))).tocsc()
    vertices = welded.vertices.copy()
    vertices[inner] = np.asarray(spsolve(square, right)).reshape(len(inner), 3)
    return np.asarray(vertices[of])


def _web(welded: Mesh) -> csr_matrix:
    """(V, V) for each vertex the shares of its neighbours, nearer ones more; rows sum to one."""
    faces = welded.faces
    starts, ends = faces.ravel(), np.roll(faces, -1, 1).ravel()
    length = np.linalg.norm(welded.vertices[starts] - welded.vertices[ends], axis=1)
    share = 1.0 / np.maximum(length, 0.2 * float(np.median(length)) + 1e-300)
    rows, columns = np.concatenate([starts, ends]), np.concatenate([ends, starts])
    count = len(welded.vertices)
    web = coo_matrix((np.tile(share, 2), (rows, columns)), (count, count)).tocsr()
    total = np.asarray(web.sum(1)).ravel()
    return csr_matrix(diags(1.0 / np.where(total > 0, total, 1.0)) @ web)


def _rings(mesh: Mesh, seam: Bool, rings: int) -> Bool:
    """(V,) the vertices within so many edges of the seam, across duplicated vertices too."""
    first: Int = weld(mesh)[1]
    near = np.zeros(int(first.max(initial=-1)) + 1, bool)
    near[first[seam]] = True
    faces = first[mesh.faces]
    for _ in range(rings):
        near[faces[near[faces].any(1)]] = True
    return np.asarray(near[first])
