from .copying import copy_motion
from .evaluate import Player, pose_from, pose_of
from .polyline import arc_of, goes_down
from .retarget import bind_chain, branch, clear_chain, set_travel
from .travel import travel_scale

__all__ = [
    "Player",
    "arc_of",
    "bind_chain",
    "branch",
    "clear_chain",
    "copy_motion",
    "goes_down",
    "pose_from",
    "pose_of",
    "set_travel",
    "travel_scale",
]
