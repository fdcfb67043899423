from .control_point_surface import PuppetSurface as PuppetSurface
from .self_intersection import SelfIntersection as SelfIntersection
from .weights import surface_edges as surface_edges, virtual_edges as virtual_edges
