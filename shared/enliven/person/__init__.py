"""The performer's body as all programs know it: 20 joints, the limbs between them, and orientations of the
bones.
"""

from enliven.person.body import ANKLE_ABOVE_SOLE, HEAD_ABOVE_JOINT, Body
from enliven.person.joints import BONES, MIRROR, PARENTS, J, Joint
from enliven.person.limbs import Limb
from enliven.person.orientation import mirrored
from enliven.person.parts import parts_named

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
