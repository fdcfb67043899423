from .fused_sensor import FusedSensors as FusedSensors
from .merge import in_world as in_world, settings_before_fusion as settings_before_fusion
from .sensor_thread import PATIENCE as PATIENCE, SensorThread as SensorThread
from .side_assignment import OTHER_SIDE as OTHER_SIDE, middle_weights as middle_weights, middles as middles
from .fuser import warm_up_fusion as warm_up_fusion
