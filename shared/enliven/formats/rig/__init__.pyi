from .rig import Rig, on_floor, playing, resized, welded
from .rig_links import LinkBody
from .rig_tree import Tree, joint_drift, tree_of

__all__ = ["LinkBody", "Rig", "Tree", "joint_drift", "on_floor", "playing", "resized", "tree_of", "welded"]
