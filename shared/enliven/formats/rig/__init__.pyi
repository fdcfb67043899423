from .rig import Rig, on_floor, playing, resized, welded
from .rig_links import LinkBody
from .rig_tree import Tree, strays, tree_of

__all__ = ["LinkBody", "Rig", "Tree", "on_floor", "playing", "resized", "strays", "tree_of", "welded"]
