from .body_sdf import (
    BETWEEN as BETWEEN,
    BLEND as BLEND,
    PIECES as PIECES,
    BodyAnatomy as BodyAnatomy,
    BodySdf as BodySdf,
)
from .performer import Figure as Figure, Performer as Performer, Proportions as Proportions
from .posture import ArmPose as ArmPose, FootPose as FootPose, PerformerPosture as PerformerPosture
from .arm_ik import reach as reach
from .rotations import about_x as about_x, about_y as about_y, about_z as about_z, on_grid as on_grid
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
from .visibility import seen_joints as seen_joints
