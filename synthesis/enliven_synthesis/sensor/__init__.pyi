from .moved_object import (
    FollowingPath as FollowingPath,
    MovedObjectScan as MovedObjectScan,
    MovedObjectPath as MovedObjectPath,
    MovingObject as MovingObject,
    lie_on_back_pose as lie_on_back_pose,
)
from .handheld import HandheldPath as HandheldPath, HandheldScan as HandheldScan, look_at_pose as look_at_pose
from .hand_turned_object import HandTurnedPath as HandTurnedPath
from .noise import DepthNoise as DepthNoise
from .profile import SensorProfile as SensorProfile, load_profile as load_profile
from .render import DepthRenderer as DepthRenderer
from .studio import SyntheticSettings as SyntheticSettings, SyntheticStudio as SyntheticStudio
from .turntable_object import TurntablePath as TurntablePath
