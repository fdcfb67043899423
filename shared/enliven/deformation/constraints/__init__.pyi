from .floor_contact import FloorContact, FloorSettings
from .observed import ObservedPoints, ObservedSettings, ObservedSurface
from .planes import PlaneConstraints
from .self_contact import SelfContact, SelfContactSettings
from .soft import joined_planes

__all__ = [
    "FloorContact",
    "FloorSettings",
    "ObservedPoints",
    "ObservedSettings",
    "ObservedSurface",
    "PlaneConstraints",
    "SelfContact",
    "SelfContactSettings",
    "joined_planes",
]
