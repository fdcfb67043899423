from .axes import axes_marks
from .colours import coloured, default_colour
from .overlay import Disc, Fill, Label, Line, Overlay, Point
from .picking import Hit, Lens, bone_at, crossings, joint_at, surface_at
from .playback import Players, length_of
from .pose_at_time import PosedShape, joints_of
from .possessed import Characters, Possessed, possessed_at, possessed_of, with_performance
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
    "joint_at",
    "joints_of",
    "length_of",
    "possessed_at",
    "possessed_of",
    "surface_at",
    "valid_selection",
    "with_performance",
]
