from .appearance import (
    EstimateAtPoints as EstimateAtPoints,
    estimate_at_points as estimate_at_points,
    facing as facing,
    flip_posture as flip_posture,
)
from .arm_starts import fullest_ball as fullest_ball
from .detection import (
    detect as detect,
    detect_another as detect_another,
    estimates_by_facing as estimates_by_facing,
)
from .fit_quality import Facing as Facing
from .fit_quality import cost as cost, quality as quality
from .hypotheses import align_to_estimate as align_to_estimate
from .recovery import PoseRecovery as PoseRecovery
