from .crop import CHANNELS, COLUMNS, ROWS, Crop, crop_person
from .estimator import Estimate, PoseEstimator, shipped_estimator
from .labels import FACINGS, MIRRORED, NOBODY, PARTS, BodyPart, facing_in_plan, facing_of

__all__ = [
    "CHANNELS",
    "COLUMNS",
    "FACINGS",
    "MIRRORED",
    "NOBODY",
    "PARTS",
    "ROWS",
    "BodyPart",
    "Crop",
    "Estimate",
    "PoseEstimator",
    "crop_person",
    "facing_in_plan",
    "facing_of",
    "shipped_estimator",
]
