from .health import HealthMonitor, HealthSettings, TrackerState
from .messages import HEALTH_MESSAGES

__all__ = ["HEALTH_MESSAGES", "HealthMonitor", "HealthSettings", "TrackerState"]
