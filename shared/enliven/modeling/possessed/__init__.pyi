from .copying import copy_graph, move_graph, paste_graph
from .pose import graph_pose, graph_vertices, pose_of_graph
from .surgery import cut_graph, merge_graphs

__all__ = [
    "copy_graph",
    "cut_graph",
    "graph_pose",
    "graph_vertices",
    "merge_graphs",
    "move_graph",
    "paste_graph",
    "pose_of_graph",
]
