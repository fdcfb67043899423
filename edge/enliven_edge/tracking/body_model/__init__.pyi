from . import joint_limits as joint_limits, model as model
from .capsules import (
    FAST as FAST,
    clear_of_rays as clear_of_rays,
    misfits as misfits,
    nearest_capsules as nearest_capsules,
    standing_out as standing_out,
)
from .posture import (
    ahead_in_plan as ahead_in_plan,
    chest_axes as chest_axes,
    chest_axes_about as chest_axes_about,
    leaning_back as leaning_back,
)
from .joint_limits import RELAXED as RELAXED, mirror_rotations as mirror_rotations, standing as standing
from .kinematics import (
    capsules_into as capsules_into,
    deviation_into as deviation_into,
    forward_into as forward_into,
    pivots_by_length as pivots_by_length,
    turn as turn,
)
from .model import height_of as height_of, lengths_for_height as lengths_for_height
from .posture import (
    Posture as Posture,
    capsules_of as capsules_of,
    predict_next as predict_next,
    frames_of as frames_of,
    joints_into as joints_into,
    rotation as rotation,
)
