from .boolean_union import Union as Union
from .cut_loops import signed_area as signed_area
from .cut_pieces import Piece as Piece
from .cut_surfaces import CutSurface as CutSurface, PlaneCut as PlaneCut, StrokeCut as StrokeCut
from .joining import SkinnedSurface as SkinnedSurface, joined as joined
from .mesh_cut import Cut as Cut, cut_across_bone as cut_across_bone, cut_by_stroke as cut_by_stroke
from .mesh_union import unite_meshes as unite_meshes
from .meshes import (
    blend_vertices as blend_vertices,
    bone_maps as bone_maps,
    identity_maps as identity_maps,
    numbers_in as numbers_in,
    divide_by_bones as divide_by_bones,
    posed_vertices as posed_vertices,
    with_piece as with_piece,
)
from .mirror_plane import plane_of_symmetry as plane_of_symmetry
from .planar import refine_triangulation as refine_triangulation, triangulate_loops as triangulate_loops
from .poisson_equation import SYMMETRIC_LU as SYMMETRIC_LU, poisson as poisson
from .remesh import flip_to_delaunay as flip_to_delaunay, smooth_taubin as smooth_taubin
from .seam import SeamSettings as SeamSettings, heal_seam as heal_seam, smooth_seam as smooth_seam
