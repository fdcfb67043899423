from .gizmo import Gizmo as Gizmo
from .point_marks import (
    GHOST_RADIUS as GHOST_RADIUS,
    POINT_RADIUS as POINT_RADIUS,
    find_suggestion_at as find_suggestion_at,
    make_point_rows as make_point_rows,
)
from .mesh_cache import (
    find_mesh_centre as find_mesh_centre,
    find_mesh_normals as find_mesh_normals,
    measure_mesh as measure_mesh,
)
from .symmetry import find_partner_vertex as find_partner_vertex, find_plane as find_plane
from .puppet_editor import PuppetEditor as PuppetEditor
from .puppet_overlay import PuppetOverlay as PuppetOverlay
from .puppet_stage import StagePuppet as StagePuppet, create_puppet_meshes as create_puppet_meshes
from .point_suggestions import PointSuggestions as PointSuggestions
from .surfaces import PuppetSurfaces as PuppetSurfaces
