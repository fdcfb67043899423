from .manipulator import Manipulator as Manipulator
from .marks import (
    GHOST_RADIUS as GHOST_RADIUS,
    POINT_RADIUS as POINT_RADIUS,
    ghost_at as ghost_at,
    point_rows as point_rows,
)
from .mesh_cache import middle_of as middle_of, normals_of as normals_of, size_of as size_of
from .mirrored import partner_vertex as partner_vertex, plane_for as plane_for
from .posing import PuppetEditor as PuppetEditor
from .shades import PuppetOverlay as PuppetOverlay
from .stage import StandingPuppet as StandingPuppet, puppet_meshes as puppet_meshes
from .suggested import PointSuggestions as PointSuggestions
from .surfaces import PuppetSurfaces as PuppetSurfaces
