from .body_sdf import (
    BETWEEN as BETWEEN,
    BLEND as BLEND,
    PIECES as PIECES,
    BodyAnatomy as BodyAnatomy,
    BodySdf as BodySdf,
)
from .performer import Figure as Figure, Performer as Performer, Proportions as Proportions
from .posture import ArmPose as ArmPose, FootPose as FootPose, PerformerPosture as PerformerPosture
from .arm_ik import solve_arm as solve_arm
from .rotations import (
    rotation_about_x as rotation_about_x,
    rotation_about_y as rotation_about_y,
    rotation_about_z as rotation_about_z,
    round_to_grid as round_to_grid,
)
from .sphere_tracing import (
    DEPTH as DEPTH,
    END as END,
    LANES as LANES,
    LANES_SIZE as LANES_SIZE,
    LENGTH as LENGTH,
    MET as MET,
    SIDE as SIDE,
    X as X,
    Y as Y,
    sphere_trace as sphere_trace,
)
from .visibility import find_visible_joints as find_visible_joints
