from .axes import Axes as Axes, moved_mesh as moved_mesh
from .bones import bone_number as bone_number
from .merging import merge as merge
from .nodes import insert_node as insert_node, remove_node as remove_node
from .posing import drag_joint as drag_joint, turn_bone as turn_bone
from .rig import ShapeRig as ShapeRig
from .spread import spread_motion as spread_motion
from .stroke_cut import cut_stroke as cut_stroke
