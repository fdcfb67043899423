from .baking import bake_puppet as bake_puppet, frame_times as frame_times, graph_of as graph_of
from .dragging import drag_point as drag_point, key_pose_at as key_pose_at
from .edits import make_puppet as make_puppet, play_take as play_take
from .points import add_point as add_point, change_point as change_point, remove_point as remove_point
from .poses import (
    add_key_pose as add_key_pose,
    change_key_pose as change_key_pose,
    mirror_key_pose as mirror_key_pose,
    remove_key_pose as remove_key_pose,
    set_symmetry as set_symmetry,
)
from .rig import PuppetRig as PuppetRig
from .suggest import (
    SuggestedPair as SuggestedPair,
    suggested_joint as suggested_joint,
    suggested_pairs as suggested_pairs,
    suggested_puppet as suggested_puppet,
    suggested_vertices as suggested_vertices,
)
from .surgery import cut_puppet as cut_puppet
