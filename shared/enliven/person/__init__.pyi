from .body import ANKLE_ABOVE_SOLE as ANKLE_ABOVE_SOLE, HEAD_ABOVE_JOINT as HEAD_ABOVE_JOINT, Body as Body
from .joints import BONES as BONES, J as J, MIRROR as MIRROR, PARENTS as PARENTS, Joint as Joint
from .limbs import Limb as Limb
from .orientation import mirrored as mirrored
from .parts import parts_named as parts_named
