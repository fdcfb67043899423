from .geodesic_kernels import dijkstra_workspace, settle_within, ways
from .graph import DeformationGraph, character_from
from .sampling import scatter
from .stiffness import stiffness_at
from .surface import SurfaceNet, net_of
from .weights import insert

__all__ = [
    "DeformationGraph",
    "SurfaceNet",
    "character_from",
    "dijkstra_workspace",
    "insert",
    "net_of",
    "scatter",
    "settle_within",
    "stiffness_at",
    "ways",
]
