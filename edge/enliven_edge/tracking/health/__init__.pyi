from .health import HealthMonitor, HealthSettings, TrackerState
from .messages import COMPLAINTS

__all__ = ["COMPLAINTS", "HealthMonitor", "HealthSettings", "TrackerState"]
