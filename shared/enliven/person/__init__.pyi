from .body import ANKLE_ABOVE_SOLE as ANKLE_ABOVE_SOLE, HEAD_ABOVE_JOINT as HEAD_ABOVE_JOINT, Body as Body
from .joints import (
    BODY_NAMES as BODY_NAMES,
    BONES as BONES,
    J as J,
    MIRROR as MIRROR,
    PARENTS as PARENTS,
    Joint as Joint,
)
from .limbs import Limb as Limb
from .orientation import mirror_body as mirror_body
from .parts import parse_parts as parse_parts
from .human_pose import (
    BODY_BONE_NAMES as BODY_BONE_NAMES,
    FINGER_BONES as FINGER_BONES,
    FINGERS as FINGERS,
    HumanPose as HumanPose,
    body_from_human_pose as body_from_human_pose,
    human_of_body as human_of_body,
    orientations_of_joints as orientations_of_joints,
    parent_name as parent_name,
    compute_standing_offset as compute_standing_offset,
)
from .unity_axes import (
    from_unity_position as from_unity_position,
    from_unity_rotation as from_unity_rotation,
    unity_euler as unity_euler,
    unity_position as unity_position,
    unity_rotation as unity_rotation,
)
from .rokoko_skeleton import (
    ROKOKO_BONES as ROKOKO_BONES,
    ROKOKO_JOINTS as ROKOKO_JOINTS,
    ROKOKO_PORT as ROKOKO_PORT,
    ROKOKO_T_POSE as ROKOKO_T_POSE,
    ROKOKO_VERSION as ROKOKO_VERSION,
    placements_from_rokoko as placements_from_rokoko,
    rokoko_placements as rokoko_placements,
    rokoko_rotations as rokoko_rotations,
    rotations_from_rokoko as rotations_from_rokoko,
)
