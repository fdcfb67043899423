from .crop import (
    CHANNELS as CHANNELS,
    COLUMNS as COLUMNS,
    ROWS as ROWS,
    Crop as Crop,
    crop_person as crop_person,
)
from .estimator import (
    Estimate as Estimate,
    PoseEstimator as PoseEstimator,
    shipped_estimator as shipped_estimator,
)
from .labels import (
    FACINGS as FACINGS,
    MIRRORED as MIRRORED,
    NOBODY as NOBODY,
    PARTS as PARTS,
    BodyPart as BodyPart,
    facing_in_plan as facing_in_plan,
)
from .part_map import parts_at_rays as parts_at_rays
