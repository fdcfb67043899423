from .composing import compose as compose, own_turns as own_turns, upright as upright
from .ik import two_bone as two_bone
from .quaternions import (
    between as between,
    conj as conj,
    load as load,
    mul as mul,
    store as store,
    turn as turn,
)
from .ranges import JointRange as JointRange, fit_joint_range as fit_joint_range, limit_turns as limit_turns
from .reaching import reach as reach
from .vectors import (
    about as about,
    cross as cross,
    dot as dot,
    length as length,
    minus as minus,
    row as row,
    swing_to as swing_to,
)
