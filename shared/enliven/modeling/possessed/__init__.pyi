from .pose import graph_pose as graph_pose, graph_vertices as graph_vertices, pose_of_graph as pose_of_graph
from .rig import GraphRig as GraphRig
from .surgery import cut_graph as cut_graph
