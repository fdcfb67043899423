from .baking import bake_puppet, end_of_puppet, frame_times, graph_of
from .copying import (
    copy_puppet,
    delete_puppet,
    mirror_puppet,
    move_puppet,
    paste_puppet,
    scale_puppet,
    turn_puppet,
)
from .edits import make_puppet
from .layers import change_layer, play_take, remove_layer
from .merge import merge_puppets
from .parts import surface_of_puppet
from .points import add_point, change_point, remove_point
from .poses import add_key_pose, change_key_pose, mirror_key_pose, remove_key_pose, set_symmetry
from .suggest import suggested_puppet
from .surgery import cut_puppet

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
    "surface_of_puppet",
    "turn_puppet",
]
