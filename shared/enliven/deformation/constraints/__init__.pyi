from .floor_contact import FloorContact, FloorSettings
from .observed import ObservedSettings, ObservedSurface, Seen
from .planes import PlaneConstraints
from .self_contact import SelfContact, SelfContactSettings
from .soft import joined_planes

__all__ = [
    "FloorContact",
    "FloorSettings",
    "ObservedSettings",
    "ObservedSurface",
    "PlaneConstraints",
    "Seen",
    "SelfContact",
    "SelfContactSettings",
    "joined_planes",
]
