from .axes import axes_marks
from .colours import coloured, default_colour
from .overlay import Disc, Fill, Label, Line, Overlay, Point
from .picking import Hit, Lens, bone_at, crossings, joint_at, surface_at
from .playback import Players, end_of, layers_of, length_of, used_layers
from .pose_at_time import PosedShape, joints_of
from .possessed import Characters, Possessed, end_of_streams, possessed_at, possessed_of, with_performance
from .selection import Selection, valid_selection

__all__ = [
    "Characters",
    "Disc",
    "Fill",
    "Hit",
    "Label",
    "Lens",
    "Line",
    "Overlay",
    "Players",
    "Point",
    "PosedShape",
    "Possessed",
    "Selection",
    "axes_marks",
    "bone_at",
    "coloured",
    "crossings",
    "default_colour",
    "end_of",
    "end_of_streams",
    "joint_at",
    "joints_of",
    "layers_of",
    "length_of",
    "possessed_at",
    "possessed_of",
    "surface_at",
    "used_layers",
    "valid_selection",
    "with_performance",
]
