from .manipulator import Manipulator
from .marks import GHOST_RADIUS, POINT_RADIUS, ghost_at, point_at, point_rows
from .mesh_cache import middle_of, normals_of, size_of
from .mirrored import partner_vertex, plane_for
from .posing import PuppetEditor
from .ray import vertex_hit
from .shades import PuppetOverlay
from .stage import PuppetCharacters, StandingPuppet, puppet_at
from .suggested import PointSuggestions

__all__ = [
    "GHOST_RADIUS",
    "POINT_RADIUS",
    "Manipulator",
    "PointSuggestions",
    "PuppetCharacters",
    "PuppetEditor",
    "PuppetOverlay",
    "StandingPuppet",
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
