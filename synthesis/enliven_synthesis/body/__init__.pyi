from .body_sdf import BETWEEN, BLEND, PIECES, BodyAnatomy, BodySdf
from .performer import Figure, Performer, Proportions
from .posture import ArmPose, FootPose, PerformerPosture
from .rotations import about_x, about_y, about_z, on_grid
from .sphere_tracing import DEPTH, END, LANES, LANES_SIZE, LENGTH, MET, SIDE, X, Y, sphere_trace
from .visibility import seen_joints

__all__ = [
    "BETWEEN",
    "BLEND",
    "DEPTH",
    "END",
    "LANES",
    "LANES_SIZE",
    "LENGTH",
    "MET",
    "PIECES",
    "SIDE",
    "ArmPose",
    "BodyAnatomy",
    "BodySdf",
    "Figure",
    "FootPose",
    "Performer",
    "PerformerPosture",
    "Proportions",
    "X",
    "Y",
    "about_x",
    "about_y",
    "about_z",
    "on_grid",
    "seen_joints",
    "sphere_trace",
]
