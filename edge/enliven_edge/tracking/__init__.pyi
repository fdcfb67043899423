from .settings import SceneSettings as SceneSettings, TrackerSettings as TrackerSettings
from .tracker import Tracker as Tracker
