from .axes import axes_marks as axes_marks
from .colours import DrawnMeshes as DrawnMeshes, default_colour as default_colour
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
from .project_length import length_of as length_of
from .ray import moved as moved, vertex_hit as vertex_hit
from .snapping import Snapping as Snapping
from .selection import Selection as Selection
from .stage_character import StageCharacter as StageCharacter, joints_of as joints_of
