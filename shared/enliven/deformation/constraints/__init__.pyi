from .floor_contact import FloorContact as FloorContact, FloorSettings as FloorSettings
from .observed import (
    ObservedPoints as ObservedPoints,
    ObservedSettings as ObservedSettings,
    ObservedSurface as ObservedSurface,
)
from .planes import PlaneConstraints as PlaneConstraints, PointConstraints as PointConstraints
from .self_contact import SelfContact as SelfContact, SelfContactSettings as SelfContactSettings
from .soft import join_planes as join_planes
