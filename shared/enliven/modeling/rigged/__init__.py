"""Edits of rigged shapes: bones and nodes, cut, merged, copied, mirrored and posed with their motion kept
(AniMesh).
"""

from enliven.modeling.rigged.axes import Axes, moved_mesh
from enliven.modeling.rigged.copying import copy_shape, mirror_shape, paste_shape, scale_shape
from enliven.modeling.rigged.merging import merge
from enliven.modeling.rigged.nodes import insert_node, remove_node
from enliven.modeling.rigged.pasting import checked_motion, checked_shift, with_takes_of
from enliven.modeling.rigged.posing import drag_joint, move_shape, turn_bone
from enliven.modeling.rigged.spread import spread_motion
from enliven.modeling.rigged.stroke_cut import cut_stroke

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
