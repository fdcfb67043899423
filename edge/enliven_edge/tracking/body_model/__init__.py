"""The articulated body that is fitted: capsules on 20 joints with 30 degrees of freedom, and their limits."""

from enliven_edge.tracking.body_model import joint_limits, model
from enliven_edge.tracking.body_model.capsules import FAST, misfits, nearest_capsules
from enliven_edge.tracking.body_model.chest import ahead_in_plan, chest_axes, chest_axes_about, leaning_back
from enliven_edge.tracking.body_model.joint_limits import RELAXED, mirrored, standing
from enliven_edge.tracking.body_model.kinematics import (
    capsules_into,
    deviation_into,
    forward_into,
    pivots_by_length,
    turn,
)
from enliven_edge.tracking.body_model.model import height_of, lengths_for_height
from enliven_edge.tracking.body_model.posture import Posture, continued, frames_of, joints_into, rotation

__all__ = [
    "FAST",
    "RELAXED",
    "Posture",
    "ahead_in_plan",
    "capsules_into",
    "chest_axes",
    "chest_axes_about",
    "continued",
    "deviation_into",
    "forward_into",
    "frames_of",
    "height_of",
    "joint_limits",
    "joints_into",
    "leaning_back",
    "lengths_for_height",
    "mirrored",
    "misfits",
    "model",
    "nearest_capsules",
    "pivots_by_length",
    "rotation",
    "standing",
    "turn",
]
