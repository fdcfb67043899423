from .health import (
    HealthMonitor as HealthMonitor,
    HealthSettings as HealthSettings,
    TrackerState as TrackerState,
)
from .messages import HEALTH_MESSAGES as HEALTH_MESSAGES
