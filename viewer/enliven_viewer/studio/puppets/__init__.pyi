from .manipulator import Manipulator
from .marks import GHOST_RADIUS, POINT_RADIUS, ghost_at, point_at, point_rows
from .mesh_cache import middle_of, normals_of, size_of
from .mirrored import partner_vertex, plane_for
from .posing import PuppetDesk
from .ray import vertex_hit
from .shades import Shades
from .stage import PuppetCharacters, Standing, puppet_at
from .suggested import Suggested

__all__ = [
    "GHOST_RADIUS",
    "POINT_RADIUS",
    "Manipulator",
    "PuppetCharacters",
    "PuppetDesk",
    "Shades",
    "Standing",
    "Suggested",
    "ghost_at",
    "middle_of",
    "normals_of",
    "partner_vertex",
    "plane_for",
    "point_at",
    "point_rows",
    "puppet_at",
    "size_of",
    "vertex_hit",
]
