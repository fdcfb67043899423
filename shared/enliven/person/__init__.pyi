from .body import ANKLE_ABOVE_SOLE as ANKLE_ABOVE_SOLE, HEAD_ABOVE_JOINT as HEAD_ABOVE_JOINT, Body as Body
from .joints import BONES as BONES, J as J, MIRROR as MIRROR, PARENTS as PARENTS, Joint as Joint
from .limbs import Limb as Limb
from .orientation import mirror_body as mirror_body
from .parts import parse_parts as parse_parts
