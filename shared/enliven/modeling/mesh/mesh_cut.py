"""Cuts a skinned mesh locally along a surface, into two closed meshes with their skins.

    cut_across_bone(mesh, skin, skeleton, bone, u) -> Cut        a plane across a bone, around that bone only
    cut_by_stroke(mesh, skin, stroke, posed=None) -> Cut         StrokeCut or PlaneCut, all parts it crosses

``Cut.near`` is the root's side of a bone (behind a plane), and ``Cut.far`` is the other side. Each is a
:class:`Piece` with its mesh, its skin (bone numbers from before the cut) and ``kept``, the old number of each
vertex or -1. Away from the cut, positions, colours and weights of vertices stay bit-exact, and faces keep
their order. Both sides share the points of their caps, so that their two volumes add up to the whole.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph.connectivity import label_components
from enliven.document import Skeleton, SkinWeights
from enliven.errors import InputError
from enliven.meshes import Mesh, face_areas, weld
from enliven.modeling.mesh.cut_pieces import Piece, build_piece
from enliven.modeling.mesh.cut_plan import CutPlan, CutSettings
from enliven.modeling.mesh.cut_surfaces import CutSurface, PlaneCut
from enliven.modeling.mesh.poisson_equation import solve_poisson
from enliven.modeling.skinning import skin_values as skins

_MIN_OWN_FRACTION = 0.75
"""Minimum fraction of each side that follows its own bones. Below it, the skin weights decide where to
cut."""
_LARGER_SIDE_RATIO = 1.01
"""The far side counts as larger if its area exceeds the other area by this factor, to allow for rounding."""


@dataclass(frozen=True)
class Cut:
    """The two sides of a cut, and notes about the cut as sentences for the user."""

    near: Piece
    far: Piece
    notes: tuple[str, ...] = ()

    @property
    def larger_first(self) -> tuple[Piece, Piece]:
        """Both sides, the side with more surface first. If both have equal areas, the near side comes
        first."""
        near, far = (
            float(face_areas(piece.mesh.vertices, piece.mesh.faces).sum()) for piece in (self.near, self.far)
        )
        return (self.far, self.near) if far > _LARGER_SIDE_RATIO * near else (self.near, self.far)


def cut_across_bone(
    mesh: Mesh,
    skin: SkinWeights,
    skeleton: Skeleton,
    bone: int,
    u: float,
    settings: CutSettings | None = None,
) -> Cut:
    """Cuts the limb around a bone, perpendicular to the bone.

    Shells that the plane does not touch stay with the bones that they follow. If the bone runs outside the
    mesh, the nearby part that follows the bone is cut. If no part follows it, whole shells are separated by
    the bones they follow.

    Args:
        mesh: at rest, in the skeleton's frame.
        bone: the joint at the end of the bone. The root has no bone.
        u: position along the bone: 0 at its parent joint, 1 at its own joint.

    Raises:
        InputError: if the bone has no length, or if no part of the mesh surrounds it at the cut.
    """
    settings = settings or CutSettings()
    location = f"bone {skeleton.names[bone]!r}"
    if bone == 0 or not skeleton.lengths[bone] > 0:
        raise InputError("the bone has no length", where=location, remedy="Choose another bone.")
    start = skeleton.positions[skeleton.parents[bone]]
    surface = PlaneCut(start + u * skeleton.vectors[bone], skeleton.vectors[bone])
    beyond = np.zeros(max(skins.bone_count(skin), len(skeleton)))
    beyond[list(skeleton.list_subtree(bone))] = 1.0
    beyond[bone] = 0.5
    loyal = (beyond[skin.indices] * skin.weights).sum(1)
    bone_weight = np.where(skin.indices == bone, skin.weights, 0.0).sum(1, dtype=np.float64)
    work = CutPlan(mesh, skin, surface, None, settings, loyal)
    work.choose_around(surface.compute_coordinates(surface.point[None])[0], bone_weight, location)
    cut = _build_pieces(work)
    beyond[bone] = 0.0
    ahead = (beyond[skin.indices] * skin.weights).sum(1)
    behind = 1.0 - ahead - bone_weight
    if len(work.chosen) == 0 or _bone_match(cut, ahead, behind) > _MIN_OWN_FRACTION:
        return cut
    # This plane does not separate the vertices of the bones on its two sides well. For example, a plane
    # across the bone to a hip would cut the body in half. So try a cut that follows the skin weights.
    along = np.clip(work.surface.compute_distances(mesh.vertices) / skeleton.lengths[bone], -1, 1)
    other = CutPlan(mesh, skin, surface, None, settings, loyal, ahead - behind + bone_weight * along)
    other.choose_all()
    by_skin = _build_pieces(other) if other.count else cut
    if _bone_match(by_skin, ahead, behind) <= _bone_match(cut, ahead, behind):
        return cut
    note = (
        "a flat cut would also cut other parts, so the mesh was cut where the skin weights of "
        "the outer bones begin"
    )
    return Cut(by_skin.near, by_skin.far, (*by_skin.notes, note))


def _bone_match(cut: Cut, ahead: Float, behind: Float) -> float:
    """Returns a score from 0 to 1 of how well the two sides of a cut match the bones on these sides: the
    lower score of the two sides.

    The score of a side is the fraction of its bones' total skin weight that is on this side of the cut.

    Args:
        ahead: (V,) total skin weight of the bones beyond the cut at each vertex.
        behind: (V,) total skin weight of the bones before the cut.
    """
    worst = 1.0
    for right, wrong, weight in ((cut.near, cut.far, behind), (cut.far, cut.near, ahead)):
        mine = float(weight[right.kept[right.kept >= 0]].sum())
        other = float(weight[wrong.kept[wrong.kept >= 0]].sum())
        # Also penalize a cut if many vertices of a side follow bones of the opposite side. Otherwise cutting
        # off a foot could remove half of the body.
        size = max(np.count_nonzero(wrong.kept >= 0), 1)
        worst = min(worst, mine / max(mine + other, 1e-9), 1.0 - other / size)
    return worst


def cut_by_stroke(
    mesh: Mesh,
    skin: SkinWeights | None,
    surface: CutSurface,
    posed: Float | None = None,
    settings: CutSettings | None = None,
) -> Cut:
    """Cuts all parts that a stroke passes through.

    The cutting surface intersects the mesh in closed loops. A loop is cut if the stroke covers at least half
    of it.

    Args:
        surface: a :class:`enliven.modeling.mesh.cut_surfaces.StrokeCut` or PlaneCut.
        posed: (V, 3) positions of the vertices when the stroke was drawn; None uses the positions in the
            mesh.

    Raises:
        InputError: if the stroke passes through no part of the mesh.
    """
    work = CutPlan(mesh, skin, surface, posed, settings or CutSettings(), None)
    work.choose_covered()
    return _build_pieces(work)


def _build_pieces(work: CutPlan) -> Cut:
    """Builds both sides of a cut, after its loops were chosen."""
    side = work.sides()
    if not side.any() or side.all():
        raise InputError(
            "the cut does not separate the mesh into two parts",
            where="cut",
            remedy="Cut at another position.",
        )
    caps = work.caps()
    near, far = (
        round_caps(build_piece(work, side == half, caps, half), work.settings.rounding)
        for half in (False, True)
    )
    return Cut(near, far, tuple(work.notes))


def round_caps(piece: Piece, roundness: float) -> Piece:
    """Inflates the caps of a piece with the method of :mod:`enliven.modeling.sketching.inflate`. A
    ``roundness`` of 1 gives hemispheres, and 0 gives flat caps."""
    if roundness == 0.0 or piece.caps == 0:
        return piece
    mesh = piece.mesh
    caps, of = weld(Mesh(mesh.vertices, mesh.faces[-piece.caps :]))
    rim = np.zeros(len(caps.vertices), bool)
    ends = np.sort(caps.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), 1)
    edges, counts = np.unique(ends, axis=0, return_counts=True)
    rim[edges[counts == 1]] = True
    used = np.zeros(len(caps.vertices), bool)
    used[caps.faces] = True
    height = roundness * np.sqrt(2.0 * np.maximum(solve_poisson(caps.vertices, caps.faces, used & ~rim), 0.0))
    moved = mesh.vertices + (height[:, None] * cap_normals(caps))[of]
    return replace(
        piece, mesh=replace(mesh, vertices=np.where((height > 0)[of][:, None], moved, mesh.vertices))
    )


def cap_normals(caps: Mesh) -> Float:
    """Returns (V, 3) for each vertex the mean normal of the cap that contains the vertex."""
    part = label_components(len(caps.vertices), caps.faces[:, [0, 1, 1, 2]].reshape(-1, 2))
    total = np.zeros((int(part.max()) + 1, 3))
    np.add.at(total, part[caps.faces[:, 0]], caps.face_vectors())
    return np.asarray((total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300))[part])
