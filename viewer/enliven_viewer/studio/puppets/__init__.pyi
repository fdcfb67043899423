from .gizmo import Gizmo as Gizmo
from .point_marks import (
    GHOST_RADIUS as GHOST_RADIUS,
    POINT_RADIUS as POINT_RADIUS,
    ghost_at as ghost_at,
    point_rows as point_rows,
)
from .mesh_cache import middle_of as middle_of, normals_of as normals_of, size_of as size_of
from .symmetry import partner_vertex as partner_vertex, plane_for as plane_for
from .puppet_editor import PuppetEditor as PuppetEditor
from .puppet_overlay import PuppetOverlay as PuppetOverlay
from .puppet_stage import StagePuppet as StagePuppet, puppet_meshes as puppet_meshes
from .point_suggestions import PointSuggestions as PointSuggestions
from .surfaces import PuppetSurfaces as PuppetSurfaces
