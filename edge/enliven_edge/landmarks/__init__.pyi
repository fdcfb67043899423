from .eye import ColourEye, LevelEye, check_view
from .mediapipe_source import MediaPipeSource
from .settings import ColourSettings
from .source import LandmarkSource

__all__ = ["ColourEye", "ColourSettings", "LandmarkSource", "LevelEye", "MediaPipeSource", "check_view"]
