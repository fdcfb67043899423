"""Takes: clips of motion captures, of recordings and of possessed meshes, read from files of any
known kind.
"""

from enliven.takes.capture_clip import BODY_NAMES, clip_of_bodies
from enliven.takes.capture_limbs import half_way, level_direction, limb_rotations, smoothstep
from enliven.takes.capture_roles import Roles, find_roles
from enliven.takes.files import read_take
from enliven.takes.positions import turns_of
from enliven.takes.possessed import read_possessed
from enliven.takes.recorded import clips_of_recording

__all__ = [
    "BODY_NAMES",
    "Roles",
    "clip_of_bodies",
    "clips_of_recording",
    "find_roles",
    "half_way",
    "level_direction",
    "limb_rotations",
    "read_possessed",
    "read_take",
    "smoothstep",
    "turns_of",
]
