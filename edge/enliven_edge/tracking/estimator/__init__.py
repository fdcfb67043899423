"""The network that finds joints, body parts and facing in one depth image of a person, and its input and
output.
"""

from enliven_edge.tracking.estimator.crop import CHANNELS, COLUMNS, ROWS, Crop, crop_person
from enliven_edge.tracking.estimator.estimator import Estimate, PoseEstimator, shipped_estimator
from enliven_edge.tracking.estimator.labels import (
    FACINGS,
    MIRRORED,
    NOBODY,
    PARTS,
    Part,
    facing_in_plan,
    facing_of,
)

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
