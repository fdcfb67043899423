from .copying import copy_motion as copy_motion
from .evaluate import Player as Player, ShapePose as ShapePose, pose_from as pose_from, pose_of as pose_of
from .polyline import arc_lengths as arc_lengths, is_downward as is_downward
from .retarget import (
    bind_chain as bind_chain,
    branch as branch,
    clear_chain as clear_chain,
    set_travel as set_travel,
)
from .travel import travel_scale as travel_scale
