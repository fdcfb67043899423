from .connectivity import components as components
from .geodesic_kernels import (
    dijkstra_workspace as dijkstra_workspace,
    settle_within as settle_within,
    ways as ways,
)
from .graph import (
    DeformationGraph as DeformationGraph,
    character_from as character_from,
    graph_of as graph_of,
)
from .surface_ends import LimbEnds as LimbEnds, extremities as extremities, limb_ends as limb_ends
from .sampling import scatter as scatter
from .stiffness import painted_stiffness as painted_stiffness, stiffness_at as stiffness_at
from .surface import SurfaceNet as SurfaceNet, build_net as build_net
from .surface_kernels import insert as insert
