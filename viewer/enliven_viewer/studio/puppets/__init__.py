"""Puppets in the studio: their surfaces as they stand, control points, key poses and dragging."""

from enliven_viewer.studio.puppets.manipulator import Manipulator
from enliven_viewer.studio.puppets.marks import GHOST_RADIUS, POINT_RADIUS, ghost_at, point_at, point_rows
from enliven_viewer.studio.puppets.mesh_cache import middle_of, normals_of, size_of
from enliven_viewer.studio.puppets.mirrored import partner_vertex, plane_for
from enliven_viewer.studio.puppets.posing import PuppetDesk
from enliven_viewer.studio.puppets.ray import vertex_hit
from enliven_viewer.studio.puppets.shades import Shades
from enliven_viewer.studio.puppets.stage import PuppetCharacters, Standing, puppet_at
from enliven_viewer.studio.puppets.suggested import Suggested

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
