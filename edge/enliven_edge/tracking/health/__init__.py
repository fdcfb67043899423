"""The health of sensor and performance as the user reads it: states, what to do, and when to say so."""

from enliven_edge.tracking.health.health import HealthMonitor, HealthSettings, TrackerState
from enliven_edge.tracking.health.messages import COMPLAINTS

__all__ = ["COMPLAINTS", "HealthMonitor", "HealthSettings", "TrackerState"]
