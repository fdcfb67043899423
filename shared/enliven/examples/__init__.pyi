from .coverage import measure_coverage as measure_coverage, describe_unposed as describe_unposed
from .live import LiveExamples as LiveExamples
from .mapping import ExampleMap as ExampleMap
from .pairing import (
    JointMotion as JointMotion,
    foot_joints as foot_joints,
    guess_joints as guess_joints,
    joint_motion as joint_motion,
    mirror_joint as mirror_joint,
    keep_one_point_per_hand as keep_one_point_per_hand,
)
from .performer import performed as performed, yaw_of as yaw_of
from .puppet_examples import (
    IdentityKey as IdentityKey,
    examples_of as examples_of,
    frame_at as frame_at,
    collect_material as collect_material,
    missing as missing,
    reference_performer as reference_performer,
)
from .puppet_motion import (
    State as State,
    loop_position as loop_position,
    in_world as in_world,
    motion_of as motion_of,
    pose_of_state as pose_of_state,
    state_of as state_of,
)
from .puppet_solve import check_layer as check_layer, convert_to_reference as convert_to_reference
from .suggest import (
    SuggestedPoses as SuggestedPoses,
    distance_to as distance_to,
    further_poses as further_poses,
    suggest_poses as suggest_poses,
)
from .symmetric import (
    mirror_places as mirror_places,
    find_partners as find_partners,
    reflect_points as reflect_points,
)
from .travel import (
    PuppetTravel as PuppetTravel,
    travel_of as travel_of,
)
