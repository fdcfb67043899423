from .body_takes import body_take_of, body_take_of_frames
from .capture_clip import BODY_NAMES, clip_of_bodies
from .capture_limbs import half_way, level_direction, limb_rotations, smoothstep
from .capture_roles import Roles, find_roles
from .exportable import Exportable, exportables_of
from .files import read_take
from .positions import turns_of
from .possessed import read_possessed
from .recorded import clips_of_recording

__all__ = [
    "BODY_NAMES",
    "Exportable",
    "Roles",
    "body_take_of",
    "body_take_of_frames",
    "clip_of_bodies",
    "clips_of_recording",
    "exportables_of",
    "find_roles",
    "half_way",
    "level_direction",
    "limb_rotations",
    "read_possessed",
    "read_take",
    "smoothstep",
    "turns_of",
]
