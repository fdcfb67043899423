from .axes import axes_marks as axes_marks
from .colours import coloured as coloured, default_colour as default_colour
from .overlay import (
    Disc as Disc,
    Fill as Fill,
    Label as Label,
    Line as Line,
    Overlay as Overlay,
    Point as Point,
)
from .picking import (
    Hit as Hit,
    Lens as Lens,
    bone_at as bone_at,
    crossings as crossings,
    joint_at as joint_at,
    surface_at as surface_at,
)
from .playback import Players as Players, length_of as length_of
from .pose_at_time import PosedShape as PosedShape, joints_of as joints_of
from .possessed import (
    Characters as Characters,
    Possessed as Possessed,
    possessed_at as possessed_at,
    possessed_of as possessed_of,
    with_performance as with_performance,
)
from .selection import Selection as Selection, valid_selection as valid_selection
