from .layers import GraphLayer as GraphLayer, GraphPart as GraphPart, Ride as Ride, SolvedLayer as SolvedLayer
from .shape import (
    GraphShape as GraphShape,
    character_of_graph as character_of_graph,
    graph_shape_at_rest as graph_shape_at_rest,
    graph_shape_of as graph_shape_of,
)
from .stream import PoseStream as PoseStream, keyed_stream as keyed_stream
