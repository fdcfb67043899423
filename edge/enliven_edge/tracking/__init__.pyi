from .settings import SceneSettings, TrackerSettings
from .tracker import Tracker

__all__ = ["SceneSettings", "Tracker", "TrackerSettings"]
