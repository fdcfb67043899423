from .anatomy import Anatomy as Anatomy, SkeletonLimb as SkeletonLimb, anatomy_of as anatomy_of
from .applying import apply_plan as apply_plan
from .automatic_mapping import (
    RetargetedShape as RetargetedShape,
    automatic as automatic,
    idle_limbs as idle_limbs,
    play_own_take as play_own_take,
    retarget as retarget,
    pin_all_feet as pin_all_feet,
)
from .human_names import (
    HumanJoints as HumanJoints,
    HumanLimb as HumanLimb,
    finger_joints as finger_joints,
    human_joints as human_joints,
)
from .facing import facing_of as facing_of, rotate_about_y as rotate_about_y
from .alternatives import NextBest as NextBest, next_best as next_best
from .model_clips import (
    clip_to_open as clip_to_open,
    is_looping as is_looping,
    is_own_take as is_own_take,
    loop_takes as loop_takes,
    own_clips as own_clips,
    play_own_clip as play_own_clip,
    played_clip as played_clip,
    mute_takes as mute_takes,
)
from .plan import Mode as Mode, Plan as Plan
from .plan_file import read_plan as read_plan, write_plan as write_plan
from .pose_error import LimbError as LimbError
from .quality import (
    MAX_STRETCH as MAX_STRETCH,
    MAX_FLOOR_DISTANCE as MAX_FLOOR_DISTANCE,
    MAX_POSE_DEGREES as MAX_POSE_DEGREES,
    MAX_SLIDE_CM_S as MAX_SLIDE_CM_S,
    MAX_INTERSECTION as MAX_INTERSECTION,
    MotionQuality as MotionQuality,
    quality_of as quality_of,
)
from .softening import limb_name as limb_name, soften_plan as soften_plan
