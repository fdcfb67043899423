from .settings import (
    SceneSettings as SceneSettings,
    TrackerSettings as TrackerSettings,
    without_deadline as without_deadline,
)
from .tracker import Tracker as Tracker
