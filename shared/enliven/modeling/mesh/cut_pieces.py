"""One side of a cut as a mesh: kept vertices, new vertices on crossed edges, and inner vertices of caps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Bool, Float, Int
from enliven.document import SkinWeights
from enliven.meshes import Mesh, join_materials, materials_within, split_paint
from enliven.modeling.mesh.caps import Cap, HarmonicInterpolation
from enliven.modeling.mesh.cut_plan import CutPlan
from enliven.modeling.skinning import skin_values as skins


@dataclass(frozen=True)
class Piece:
    """One side of a cut.

    Attributes:
        mesh: the surface: first the kept faces, then the split faces, then the caps.
        skin: skin weights with the bone numbers from before the cut; None if the mesh had none.
        kept: (V,) the number of each vertex before the cut, or -1 for a new vertex.
        caps: number of faces of caps, which are last in the list of faces.
    """

    mesh: Mesh
    skin: SkinWeights | None
    kept: Int
    caps: int


def build_piece(work: CutPlan, keeps: Bool, caps: list[Cap], is_far_side: bool) -> Piece:
    """Builds one side of a cut from its whole faces, its parts of the split faces, and its caps.

    Args:
        keeps: (W,) True for welded vertices on this side.
        is_far_side: True for the side with positive field values.
    """
    return _PieceBuilder(work, keeps, is_far_side).piece(caps)


class _PieceBuilder:
    """A builder of one side of a cut. First come the kept vertices, then the new vertices on crossed edges,
    then the inner vertices of caps.
    """

    def __init__(self, work: CutPlan, keeps: Bool, is_far_side: bool) -> None:
        self.work, self.is_far_side = work, is_far_side
        self.mesh = work.mesh
        cut = np.isin(work.found.loops, work.chosen)
        self.split = work.found.faces[cut]
        self.pairs = work.found.pairs[cut]
        is_whole = np.ones(len(self.mesh.faces), bool)
        is_whole[self.split] = False
        self.whole = is_whole & keeps[work.faces[:, 0]]
        self.kept = np.flatnonzero(keeps[work.of])
        self.number = np.full(len(self.mesh.vertices), -1, np.int64)
        self.number[self.kept] = np.arange(len(self.kept))

    def piece(self, caps: list[Cap]) -> Piece:
        """Builds the mesh and skin of this side, closed by ``caps``."""
        split, parts, sources, edges = self._split_faces()
        base = len(self.kept)
        doubled = len(self.work.rest) < len(self.mesh.vertices)
        cap_faces: list[Int] = []
        insides: list[tuple[Int, HarmonicInterpolation]] = []
        count = base + len(sources)
        rim_of = np.full(len(self.work.found.edges), -1, np.int64)
        rim_of[edges[::-1]] = base + np.arange(len(edges))[::-1]
        for cap in caps:
            if doubled:
                # A flat-shaded mesh has separate vertices on both sides of an edge, so its rim must be
                # duplicated too.
                rim = count + np.arange(len(cap.rim))
                count += len(rim)
            else:
                rim = rim_of[cap.rim]
            inside = count + np.arange(cap.inner_points.count)
            insides.append((rim_of[cap.rim], cap.inner_points))
            count += len(inside)
            faces = np.concatenate([rim, inside])[cap.faces]
            cap_faces.append(faces[:, ::-1] if self.is_far_side else faces)
        closing = np.concatenate([np.zeros((0, 3), np.int64), *cap_faces])
        faces = np.concatenate([self.number[self.mesh.faces[self.whole]], split, closing])
        vertices, paint, skin = self._attributes(sources, edges, insides, doubled)
        originals = np.full(len(vertices), -1, np.int64)
        originals[:base] = self.kept
        whole_faces = np.flatnonzero(self.whole)
        corners = vertices[faces[len(whole_faces) : len(whole_faces) + len(split)]]
        inside = materials_within(self.mesh.materials, self.mesh.vertices[self.mesh.faces], corners, parts)
        kept_materials = (
            None if self.mesh.materials is None else self.mesh.materials.select_faces(whole_faces)
        )
        materials = join_materials(
            [(kept_materials, len(whole_faces)), (inside, len(split)), (None, len(closing))]
        )
        colours, stiffness = split_paint(paint, self.mesh)
        faces = faces.astype(np.int32)
        mesh = Mesh(vertices, faces, self.mesh.name, colours, materials, stiffness)
        return Piece(mesh, skin, originals, len(closing))

    def _split_faces(self) -> tuple[Int, Int, Int, Int]:
        """Splits the crossed faces.

        Returns:
            (S, 3) faces and (S,) the old face of each; (N, 2) the two old vertices of each new vertex, and
            (N,) its crossed edge.
        """
        work = self.work
        split_faces = self.mesh.faces[self.split].astype(np.int64)
        side = work.far[work.of[split_faces]]
        single_corner = np.where(side.sum(1) == 1, np.argmax(side, 1), np.argmin(side, 1))
        corner = np.take_along_axis(split_faces, (single_corner[:, None] + np.arange(3)) % 3, 1)
        lonely_far = np.take_along_axis(side, single_corner[:, None], 1)[:, 0]
        pairs = np.where(lonely_far[:, None], self.pairs, self.pairs[:, ::-1])
        # Create one new vertex for each different pair of old vertices. A flat-shaded mesh gets a new vertex
        # for each face.
        ends = np.stack([corner[:, [0, 1]], corner[:, [2, 0]]], 1).reshape(-1, 2)
        crossed = pairs.reshape(-1)
        turned = work.of[ends[:, 0]] != work.found.edges[crossed, 0]
        ends = np.where(turned[:, None], ends[:, ::-1], ends)
        unique, first, number = np.unique(ends, axis=0, return_index=True, return_inverse=True)
        new = len(self.kept) + number.reshape(-1, 2)
        is_lonely = lonely_far == self.is_far_side
        a, b, c = self.number[corner].T
        tips = np.stack([a, new[:, 0], new[:, 1]], 1)[is_lonely]
        quad = np.stack([new[:, 0], b, c, new[:, 1]], 1)[~is_lonely]
        of = np.concatenate([self.split[is_lonely], *[self.split[~is_lonely]] * 2])
        return np.concatenate([tips, quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]), of, unique, crossed[first]

    def _attributes(
        self, sources: Int, edges: Int, insides: list[tuple[Int, HarmonicInterpolation]], doubled: bool
    ) -> tuple[Float, Float, SkinWeights | None]:
        """Returns positions (V, 3), paint (V, 4) and skin of all vertices of this side."""
        work, mesh = self.work, self.mesh
        edge_fraction = work.share[edges][:, None]
        base = len(self.kept)

        def grown(old: Float, rim: Float | None = None) -> Float:
            """Returns values (N, K) at the new vertices. Along crossed edges they are interpolated from the
            values ``old`` (V, K), unless given by ``rim``, and inside caps from the rims."""
            on_edges = (
                old[sources[:, 0]] * (1 - edge_fraction) + old[sources[:, 1]] * edge_fraction
                if rim is None
                else rim
            )
            out = [on_edges]
            for around, spread in insides:
                own = on_edges[around - base]
                out += [own, spread(own)] if doubled else [spread(own)]
            return np.concatenate(out)

        between = work.interpolate_on_edges(work.rest, work.found.edges, work.share)[edges]
        vertices = np.concatenate([mesh.vertices[self.kept], grown(mesh.vertices, between)])
        paint = np.concatenate([mesh.paint[self.kept], grown(mesh.paint)])
        if work.skin is None:
            return vertices, paint, None
        old = np.unique(sources)
        indices = np.searchsorted(old, sources)
        full = skins.make_dense_weights(skins.select_vertices(work.skin, old), skins.bone_count(work.skin))
        used_bones = np.flatnonzero(full.any(0))
        full = full[:, used_bones]
        rim_skin = full[indices[:, 0]] * (1 - edge_fraction) + full[indices[:, 1]] * edge_fraction
        new_skin = skins.keep_largest_weights(grown(np.zeros((0, 0)), rim_skin))
        new_skin = SkinWeights(used_bones[new_skin.indices].astype(np.uint16), new_skin.weights)
        return (
            vertices,
            paint,
            skins.concatenate_skins([skins.select_vertices(work.skin, self.kept), new_skin]),
        )
