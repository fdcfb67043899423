from .health import (
    HealthMonitor as HealthMonitor,
    HealthSettings as HealthSettings,
    TrackerState as TrackerState,
)
from .alarm import HEALTH_MESSAGES as HEALTH_MESSAGES
