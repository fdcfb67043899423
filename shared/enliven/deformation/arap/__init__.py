"""As-rigid-as-possible surfaces with squash and stretch, moved by control points (example-based retargeting,
2014).
"""

from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.deformation.arap.self_intersection import SelfIntersection
from enliven.deformation.arap.weights import surface_edges, virtual_edges

__all__ = ["PuppetSurface", "SelfIntersection", "surface_edges", "virtual_edges"]
