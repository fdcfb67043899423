from .control_point_surface import PuppetSurface
from .self_intersection import SelfIntersection
from .weights import surface_edges, virtual_edges

__all__ = ["PuppetSurface", "SelfIntersection", "surface_edges", "virtual_edges"]
