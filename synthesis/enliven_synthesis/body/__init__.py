"""The made-up performer: proportions, kinematics, and a surface as a signed distance that rays meet."""

from enliven_synthesis.body.body_sdf import BETWEEN, BLEND, PIECES, Anatomy, Flesh
from enliven_synthesis.body.performer import Figure, Performer, Proportions
from enliven_synthesis.body.posture import Arm, Foot, Posture
from enliven_synthesis.body.rotations import about_x, about_y, about_z, on_grid
from enliven_synthesis.body.sphere_tracing import (
    DEPTH,
    END,
    LANES,
    LANES_SIZE,
    LENGTH,
    MET,
    SIDE,
    X,
    Y,
    march,
)
from enliven_synthesis.body.visibility import seen_joints

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
