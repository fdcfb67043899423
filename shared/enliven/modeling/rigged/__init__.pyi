from .axes import Axes, moved_mesh
from .merging import merge
from .nodes import insert_node, remove_node
from .posing import drag_joint, turn_bone
from .rig import ShapeRig
from .spread import spread_motion
from .stroke_cut import cut_stroke

__all__ = [
    "Axes",
    "ShapeRig",
    "cut_stroke",
    "drag_joint",
    "insert_node",
    "merge",
    "moved_mesh",
    "remove_node",
    "spread_motion",
    "turn_bone",
]
