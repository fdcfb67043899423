"""Surgery on triangle meshes: cuts with caps, unions with seams, remeshing and symmetry."""

from enliven.modeling.mesh.boolean_union import Union
from enliven.modeling.mesh.cut_loops import area
from enliven.modeling.mesh.cut_pieces import Piece
from enliven.modeling.mesh.cut_surfaces import CutSurface, StrokeCut
from enliven.modeling.mesh.joining import Surface, joined
from enliven.modeling.mesh.limb_ends import extremities
from enliven.modeling.mesh.mesh_cut import Cut, cut_across_bone, cut_by_stroke
from enliven.modeling.mesh.mesh_union import united
from enliven.modeling.mesh.meshes import bone_maps, no_maps, numbers_in, parted, posed_vertices, with_piece
from enliven.modeling.mesh.mirror_plane import plane_of_symmetry
from enliven.modeling.mesh.planar import refined, triangulated
from enliven.modeling.mesh.poisson_equation import SYMMETRIC_LU, poisson
from enliven.modeling.mesh.remesh import flipped, slid
from enliven.modeling.mesh.seam import SeamSettings, healed, smoothed

__all__ = [
    "SYMMETRIC_LU",
    "Cut",
    "CutSurface",
    "Piece",
    "SeamSettings",
    "StrokeCut",
    "Surface",
    "Union",
    "area",
    "bone_maps",
    "cut_across_bone",
    "cut_by_stroke",
    "extremities",
    "flipped",
    "healed",
    "joined",
    "no_maps",
    "numbers_in",
    "parted",
    "plane_of_symmetry",
    "poisson",
    "posed_vertices",
    "refined",
    "slid",
    "smoothed",
    "triangulated",
    "united",
    "with_piece",
]
