from .colour_pose import (
    ColourPoseEstimator as ColourPoseEstimator,
    MonocularPoseEstimator as MonocularPoseEstimator,
    check_view as check_view,
)
from .source import MediaPipeSettings as MediaPipeSettings, MediaPipeSource as MediaPipeSource
from .colour_pose import ColourSettings as ColourSettings
from .source import LandmarkSource as LandmarkSource
