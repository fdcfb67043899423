from .eye import (
    ColourPoseEstimator as ColourPoseEstimator,
    MonocularPoseEstimator as MonocularPoseEstimator,
    check_view as check_view,
)
from .mediapipe_source import MediaPipeSource as MediaPipeSource
from .settings import ColourSettings as ColourSettings
from .source import LandmarkSource as LandmarkSource
