from .copying import copy_graph as copy_graph, move_graph as move_graph, paste_graph as paste_graph
from .pose import graph_pose as graph_pose, graph_vertices as graph_vertices, pose_of_graph as pose_of_graph
from .surgery import cut_graph as cut_graph, merge_graphs as merge_graphs
