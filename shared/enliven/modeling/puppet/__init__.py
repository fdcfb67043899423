"""Edits of meshes that example poses move: control points, key poses, layers, cuts, merges and baking."""

from enliven.modeling.puppet.baking import bake_puppet, end_of_puppet, frame_times, graph_of
from enliven.modeling.puppet.copying import (
    copy_puppet,
    delete_puppet,
    mirror_puppet,
    move_puppet,
    paste_puppet,
    scale_puppet,
    turn_puppet,
)
from enliven.modeling.puppet.edits import make_puppet
from enliven.modeling.puppet.layers import change_layer, play_take, remove_layer
from enliven.modeling.puppet.merge import merge_puppets
from enliven.modeling.puppet.points import add_point, change_point, remove_point
from enliven.modeling.puppet.poses import (
    add_key_pose,
    change_key_pose,
    mirror_key_pose,
    remove_key_pose,
    set_symmetry,
)
from enliven.modeling.puppet.suggest import suggested_puppet
from enliven.modeling.puppet.surgery import cut_puppet

__all__ = [
    "add_key_pose",
    "add_point",
    "bake_puppet",
    "change_key_pose",
    "change_layer",
    "change_point",
    "copy_puppet",
    "cut_puppet",
    "delete_puppet",
    "end_of_puppet",
    "frame_times",
    "graph_of",
    "make_puppet",
    "merge_puppets",
    "mirror_key_pose",
    "mirror_puppet",
    "move_puppet",
    "paste_puppet",
    "play_take",
    "remove_key_pose",
    "remove_layer",
    "remove_point",
    "scale_puppet",
    "set_symmetry",
    "suggested_puppet",
    "turn_puppet",
]
