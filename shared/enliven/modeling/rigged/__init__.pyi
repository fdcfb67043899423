from .axes import Axes, moved_mesh
from .copying import copy_shape, mirror_shape, paste_shape, scale_shape
from .merging import merge
from .nodes import insert_node, remove_node
from .pasting import checked_motion, checked_shift, with_takes_of
from .posing import drag_joint, move_shape, turn_bone
from .spread import spread_motion
from .stroke_cut import cut_stroke

__all__ = [
    "Axes",
    "checked_motion",
    "checked_shift",
    "copy_shape",
    "cut_stroke",
    "drag_joint",
    "insert_node",
    "merge",
    "mirror_shape",
    "move_shape",
    "moved_mesh",
    "paste_shape",
    "remove_node",
    "scale_shape",
    "spread_motion",
    "turn_bone",
    "with_takes_of",
]
