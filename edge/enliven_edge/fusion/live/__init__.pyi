from .fused_sensor import FusedSensors
from .merge import in_world, settings_before_fusion
from .reading import PATIENCE, SensorThread
from .sides import OTHER_SIDE, middle_weights, middles
from .warmup import warm_up_fusion

__all__ = [
    "OTHER_SIDE",
    "PATIENCE",
    "FusedSensors",
    "SensorThread",
    "in_world",
    "middle_weights",
    "middles",
    "settings_before_fusion",
    "warm_up_fusion",
]
