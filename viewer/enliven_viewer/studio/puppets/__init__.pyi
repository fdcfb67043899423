from .manipulator import Manipulator as Manipulator
from .marks import (
    GHOST_RADIUS as GHOST_RADIUS,
    POINT_RADIUS as POINT_RADIUS,
    ghost_at as ghost_at,
    point_at as point_at,
    point_rows as point_rows,
)
from .mesh_cache import middle_of as middle_of, normals_of as normals_of, size_of as size_of
from .mirrored import partner_vertex as partner_vertex, plane_for as plane_for
from .posing import PuppetEditor as PuppetEditor
from .ray import vertex_hit as vertex_hit
from .shades import PuppetOverlay as PuppetOverlay
from .stage import (
    PuppetCharacters as PuppetCharacters,
    StandingPuppet as StandingPuppet,
    puppet_at as puppet_at,
)
from .suggested import PointSuggestions as PointSuggestions
