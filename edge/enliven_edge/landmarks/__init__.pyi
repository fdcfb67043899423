from .eye import ColourPoseEstimator, MonocularPoseEstimator, check_view
from .mediapipe_source import MediaPipeSource
from .settings import ColourSettings
from .source import LandmarkSource

__all__ = [
    "ColourPoseEstimator",
    "ColourSettings",
    "LandmarkSource",
    "MediaPipeSource",
    "MonocularPoseEstimator",
    "check_view",
]
