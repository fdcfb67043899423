"""Soft constraints on a deformation graph: the floor, planes, the observed surface, and the mesh itself."""

from enliven.deformation.constraints.floor_contact import FloorContact, FloorSettings
from enliven.deformation.constraints.observed import ObservedSettings, ObservedSurface, Seen
from enliven.deformation.constraints.planes import PlaneConstraints
from enliven.deformation.constraints.self_contact import SelfContact, SelfContactSettings
from enliven.deformation.constraints.soft import joined_planes

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
