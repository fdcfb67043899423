from .handled import (
    FollowingPath as FollowingPath,
    HandledScan as HandledScan,
    HandledWay as HandledWay,
    laid_on_its_back as laid_on_its_back,
)
from .handheld import HandheldPath as HandheldPath, HandheldScan as HandheldScan, looking_at as looking_at
from .noise import DepthNoise as DepthNoise
from .profile import SensorProfile as SensorProfile, load_profile as load_profile
from .render import DepthRenderer as DepthRenderer
from .studio import SyntheticSettings as SyntheticSettings, SyntheticStudio as SyntheticStudio
from .turntable import TurntableWay as TurntableWay
