from .boolean_union import Union
from .cut_loops import area
from .cut_pieces import Piece
from .cut_surfaces import CutSurface, PlaneCut, StrokeCut
from .joining import SkinnedSurface, joined
from .limb_ends import extremities
from .mesh_cut import Cut, cut_across_bone, cut_by_stroke
from .mesh_union import united
from .meshes import bone_maps, no_maps, numbers_in, parted, posed_vertices, with_piece
from .mirror_plane import plane_of_symmetry
from .planar import refined, triangulated
from .poisson_equation import SYMMETRIC_LU, poisson
from .remesh import flipped, taubin_smoothed
from .seam import SeamSettings, healed, smoothed

__all__ = [
    "SYMMETRIC_LU",
    "Cut",
    "CutSurface",
    "Piece",
    "PlaneCut",
    "SeamSettings",
    "SkinnedSurface",
    "StrokeCut",
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
    "smoothed",
    "taubin_smoothed",
    "triangulated",
    "united",
    "with_piece",
]
