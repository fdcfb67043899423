"""Deformation graphs: nodes sampled on a surface, their edges, and the weights of each vertex."""

from enliven.deformation.graph.graph import DeformationGraph, character_from
from enliven.deformation.graph.sampling import scatter
from enliven.deformation.graph.stiffness import stiffness_at
from enliven.deformation.graph.surface import Net, net_of
from enliven.deformation.graph.surface_kernels import dijkstra_workspace, settle_within, ways
from enliven.deformation.graph.weights import insert

__all__ = [
    "DeformationGraph",
    "Net",
    "character_from",
    "dijkstra_workspace",
    "insert",
    "net_of",
    "scatter",
    "settle_within",
    "stiffness_at",
    "ways",
]
