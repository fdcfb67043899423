"""Rigs that a file holds: links, trees of bones, and the shapes that they become."""

from enliven.formats.rig.rig import Rig, on_floor, playing, resized, welded
from enliven.formats.rig.rig_links import Body
from enliven.formats.rig.rig_tree import Tree, strays, tree_of

__all__ = ["Body", "Rig", "Tree", "on_floor", "playing", "resized", "strays", "tree_of", "welded"]
