"""Fusion while people perform: the sensors' bodies are aligned in time, grouped by person and blended joint
by joint.

The fused set is read like one sensor that tracks bodies itself.
"""

from enliven_edge.fusion.live.fused_sensor import FusedFrame, FusedSensors
from enliven_edge.fusion.live.merge import in_world, untouched
from enliven_edge.fusion.live.reading import PATIENCE, SensorThread
from enliven_edge.fusion.live.sides import OTHER_SIDE, middle_weights, middles
from enliven_edge.fusion.live.warmup import warm_up_fusion

__all__ = [
    "OTHER_SIDE",
    "PATIENCE",
    "FusedFrame",
    "FusedSensors",
    "SensorThread",
    "in_world",
    "middle_weights",
    "middles",
    "untouched",
    "warm_up_fusion",
]
