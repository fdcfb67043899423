from .follower import ObjectTrackingResult as ObjectTrackingResult, ObjectFollower as ObjectFollower
from .moved_scanner import MovedScanner as MovedScanner, object_tracking_settings as object_tracking_settings
from .moved_step import MovedStep as MovedStep, ObjectState as ObjectState
from .object_model import ObjectModel as ObjectModel
from .registration import (
    Registration as Registration,
    ScannedSurface as ScannedSurface,
    register_part as register_part,
)
from .rest import ObjectRest as ObjectRest
from .surface_points import SurfacePoints as SurfacePoints, sample_surface as sample_surface
