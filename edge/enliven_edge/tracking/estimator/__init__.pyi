from .crop import CHANNELS, COLUMNS, ROWS, Crop, crop_person
from .estimator import Estimate, PoseEstimator, shipped_estimator
from .labels import FACINGS, MIRRORED, NOBODY, PARTS, Part, facing_in_plan, facing_of

__all__ = [
    "CHANNELS",
    "COLUMNS",
    "FACINGS",
    "MIRRORED",
    "NOBODY",
    "PARTS",
    "ROWS",
    "Crop",
    "Estimate",
    "Part",
    "PoseEstimator",
    "crop_person",
    "facing_in_plan",
    "facing_of",
    "shipped_estimator",
]
