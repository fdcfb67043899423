from .coverage import coverage_of as coverage_of, unposed as unposed
from .live import LiveExamples as LiveExamples
from .mapping import ExampleMap as ExampleMap
from .pairing import (
    JointMotion as JointMotion,
    foot_joints as foot_joints,
    guess_joints as guess_joints,
    joint_motion as joint_motion,
    mirror_joint as mirror_joint,
    one_a_hand as one_a_hand,
)
from .performer import performed as performed, yaw_of as yaw_of
from .puppet_examples import (
    Weak as Weak,
    examples_of as examples_of,
    frame_at as frame_at,
    material_of as material_of,
    missing as missing,
    reference_of as reference_of,
)
from .puppet_motion import (
    State as State,
    clock as clock,
    in_world as in_world,
    motion_of as motion_of,
    pose_of_state as pose_of_state,
    state_of as state_of,
)
from .puppet_solve import check_layer as check_layer, seen_by as seen_by
from .suggest import (
    SuggestedPoses as SuggestedPoses,
    distance_to as distance_to,
    further_poses as further_poses,
    suggest_poses as suggest_poses,
)
from .symmetric import mirrored_places as mirrored_places, partners_of as partners_of, reflected as reflected
from .travel import (
    PuppetTravel as PuppetTravel,
    travel_of as travel_of,
)
