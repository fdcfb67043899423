from .appearance import EstimateAtPoints, estimate_at_points, facing, turned_about
from .detection import detect, detect_another, estimates_by_facing
from .facing_side import Facing
from .fit_quality import cost, quality
from .posing import aligned_to
from .recovery import PoseRecovery

__all__ = [
    "EstimateAtPoints",
    "Facing",
    "PoseRecovery",
    "aligned_to",
    "cost",
    "detect",
    "detect_another",
    "estimate_at_points",
    "estimates_by_facing",
    "facing",
    "quality",
    "turned_about",
]
