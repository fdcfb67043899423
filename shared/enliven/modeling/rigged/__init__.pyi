from .axes import Axes as Axes, moved_mesh as moved_mesh
from .copying import (
    copy_shape as copy_shape,
    mirror_shape as mirror_shape,
    paste_shape as paste_shape,
    scale_shape as scale_shape,
)
from .merging import merge as merge
from .nodes import insert_node as insert_node, remove_node as remove_node
from .pasting import (
    checked_motion as checked_motion,
    checked_shift as checked_shift,
    with_takes_of as with_takes_of,
)
from .posing import drag_joint as drag_joint, move_shape as move_shape, turn_bone as turn_bone
from .spread import spread_motion as spread_motion
from .stroke_cut import cut_stroke as cut_stroke
