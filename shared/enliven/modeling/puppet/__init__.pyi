from .baking import bake_puppet, frame_times, graph_of
from .edits import make_puppet
from .layers import change_layer, play_take, remove_layer
from .merge import merge_puppets
from .points import add_point, change_point, remove_point
from .poses import add_key_pose, change_key_pose, mirror_key_pose, remove_key_pose, set_symmetry
from .rig import PuppetRig
from .suggest import suggested_puppet
from .surgery import cut_puppet

__all__ = [
    "PuppetRig",
    "add_key_pose",
    "add_point",
    "bake_puppet",
    "change_key_pose",
    "change_layer",
    "change_point",
    "cut_puppet",
    "frame_times",
    "graph_of",
    "make_puppet",
    "merge_puppets",
    "mirror_key_pose",
    "play_take",
    "remove_key_pose",
    "remove_layer",
    "remove_point",
    "set_symmetry",
    "suggested_puppet",
]
