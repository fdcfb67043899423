from .body import ANKLE_ABOVE_SOLE, HEAD_ABOVE_JOINT, Body
from .joints import BONES, MIRROR, PARENTS, J, Joint
from .limbs import Limb
from .orientation import mirrored
from .parts import parts_named

__all__ = [
    "ANKLE_ABOVE_SOLE",
    "BONES",
    "HEAD_ABOVE_JOINT",
    "MIRROR",
    "PARENTS",
    "Body",
    "J",
    "Joint",
    "Limb",
    "mirrored",
    "parts_named",
]
