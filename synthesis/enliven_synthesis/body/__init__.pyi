from .body_sdf import BETWEEN, BLEND, PIECES, Anatomy, Flesh
from .performer import Figure, Performer, Proportions
from .posture import Arm, Foot, Posture
from .rotations import about_x, about_y, about_z, on_grid
from .sphere_tracing import DEPTH, END, LANES, LANES_SIZE, LENGTH, MET, SIDE, X, Y, march
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
    "Anatomy",
    "Arm",
    "Figure",
    "Flesh",
    "Foot",
    "Performer",
    "Posture",
    "Proportions",
    "X",
    "Y",
    "about_x",
    "about_y",
    "about_z",
    "march",
    "on_grid",
    "seen_joints",
]
