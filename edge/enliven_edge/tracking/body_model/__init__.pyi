from . import joint_limits, model
from .capsules import FAST, misfits, nearest_capsules
from .chest import ahead_in_plan, chest_axes, chest_axes_about, leaning_back
from .joint_limits import RELAXED, mirrored, standing
from .kinematics import capsules_into, deviation_into, forward_into, pivots_by_length, turn
from .model import height_of, lengths_for_height
from .posture import Posture, continued, frames_of, joints_into, rotation

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
