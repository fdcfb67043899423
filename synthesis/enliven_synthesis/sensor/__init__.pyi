from .handled import (
    FollowingPath as FollowingPath,
    HandledScan as HandledScan,
    HandledWay as HandledWay,
    MovingThing as MovingThing,
    laid_on_its_back as laid_on_its_back,
)
from .handheld import HandheldPath as HandheldPath, HandheldScan as HandheldScan, looking_at as looking_at
from .in_hands import InHandsWay as InHandsWay
from .noise import DepthNoise as DepthNoise
from .profile import SensorProfile as SensorProfile, load_profile as load_profile
from .render import DepthRenderer as DepthRenderer
from .studio import SyntheticSettings as SyntheticSettings, SyntheticStudio as SyntheticStudio
from .turntable import TurntableWay as TurntableWay
