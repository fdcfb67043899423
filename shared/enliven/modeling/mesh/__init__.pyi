from .boolean_union import Union as Union
from .cut_loops import area as area
from .cut_pieces import Piece as Piece
from .cut_surfaces import CutSurface as CutSurface, PlaneCut as PlaneCut, StrokeCut as StrokeCut
from .joining import SkinnedSurface as SkinnedSurface, joined as joined
from .mesh_cut import Cut as Cut, cut_across_bone as cut_across_bone, cut_by_stroke as cut_by_stroke
from .mesh_union import united as united
from .meshes import (
    blended as blended,
    bone_maps as bone_maps,
    no_maps as no_maps,
    numbers_in as numbers_in,
    parted as parted,
    posed_vertices as posed_vertices,
    with_piece as with_piece,
)
from .mirror_plane import plane_of_symmetry as plane_of_symmetry
from .planar import refined as refined, triangulated as triangulated
from .poisson_equation import SYMMETRIC_LU as SYMMETRIC_LU, poisson as poisson
from .remesh import flipped as flipped, taubin_smoothed as taubin_smoothed
from .seam import SeamSettings as SeamSettings, healed as healed, smoothed as smoothed
