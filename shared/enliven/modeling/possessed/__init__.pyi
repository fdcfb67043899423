from .pose import graph_pose, graph_vertices, pose_of_graph
from .rig import GraphRig
from .surgery import cut_graph, merge_graphs

__all__ = ["GraphRig", "cut_graph", "graph_pose", "graph_vertices", "merge_graphs", "pose_of_graph"]
