from .follower import ObjectTrackingResult as ObjectTrackingResult, ObjectFollower as ObjectFollower
from .moved_scanner import MovedScanner as MovedScanner, following as following
from .moved_step import MovedStep as MovedStep, ObjectState as ObjectState
from .object_model import ObjectModel as ObjectModel
from .registration import (
    Registration as Registration,
    ScannedSurface as ScannedSurface,
    registered as registered,
)
from .rest import ObjectRest as ObjectRest
from .surface_points import SurfacePoints as SurfacePoints, sampled as sampled
