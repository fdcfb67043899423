from .axes import make_axes_marks as make_axes_marks
from .colours import DrawnMeshes as DrawnMeshes, choose_default_colour as choose_default_colour
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
    find_crossings as find_crossings,
    joint_at as joint_at,
    surface_at as surface_at,
)
from .project_length import length_of as length_of
from .ray import moved as moved, vertex_hit as vertex_hit
from .snapping import Snapping as Snapping
from .selection import Selection as Selection
from .stage_character import StageCharacter as StageCharacter, find_joints as find_joints
