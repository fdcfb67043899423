from .fused_sensor import FusedSensors as FusedSensors
from .merge import transform_bodies as transform_bodies, settings_before_fusion as settings_before_fusion
from .sensor_thread import READ_TIMEOUT_S as READ_TIMEOUT_S, SensorThread as SensorThread
from .side_assignment import OTHER_SIDE as OTHER_SIDE, middle_weights as middle_weights, middles as middles
from .fuser import warm_up_fusion as warm_up_fusion
