"""Handles of an ARAP solver, and the validation of handles and their targets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.deformation.arap.surface import PreparedSurface
from enliven.errors import InputError

ERROR_CONTEXT = "deformation"
_MAX_HANDLE_DISTANCE_RATIO = 1e3
"""Maximum distance of a handle from the mesh, as a multiple of the mesh's size."""


@dataclass(frozen=True)
class Handle:
    """A group of vertices that are moved to targets.

    Attributes:
        name: the handle's name, unique among the solver's handles.
        vertices: the mesh's vertices that belong to the handle.
        weight: weight of a soft handle, relative to the surface's cotangent weights of about 1. None for a
            hard handle, which reaches its targets exactly.
    """

    name: str
    vertices: tuple[int, ...]
    weight: float | None = None


def check_handle(handle: Handle, surface: PreparedSurface) -> None:
    """Raises InputError if the handle has no vertices, wrong vertices, or a weight that is not above 0."""
    location, count = f"handle {handle.name!r}", len(surface.place_of)
    if not handle.vertices:
        raise InputError(
            "the handle has no vertex", where=location, remedy="Choose at least one vertex of the mesh."
        )
    if handle.weight is not None and not (np.isfinite(handle.weight) and handle.weight > 0):
        raise InputError(
            f"the weight {handle.weight} of the handle is not valid",
            where=location,
            remedy="Pass a weight above 0.",
        )
    for vertex in handle.vertices:
        if not 0 <= vertex < count:
            raise InputError(
                f"vertex {vertex} does not exist: the mesh has {count} vertices, numbered from 0",
                where=location,
            )
        if surface.loose[vertex]:
            raise InputError(
                f"vertex {vertex} belongs to no face, so no surface would follow the handle",
                where=location,
                remedy="Choose a vertex that belongs to a face.",
            )


def check_target(name: str, value: Float, handles: Mapping[str, Handle], surface: PreparedSurface) -> Float:
    """Returns the checked targets (K, 3) of a handle, in metres."""
    if name not in handles:
        handle_names = ", ".join(handles) or "none"
        raise InputError(
            f"the mesh has no handle {name!r}", where=ERROR_CONTEXT, remedy=f"Known handles: {handle_names}."
        )
    handle = handles[name]
    target = np.array(value, np.float64)
    if target.shape == (3,) and len(handle.vertices) == 1:
        target = target[None]
    location = f"handle {name!r}"
    if target.shape != (len(handle.vertices), 3):
        raise InputError(
            f"the target positions have the shape {target.shape}, but the handle has "
            f"{len(handle.vertices)} vertices",
            where=location,
        )
    if not np.isfinite(target).all():
        raise InputError(
            "the target position is not finite",
            where=location,
            remedy="Pass finite positions. The mesh keeps its last valid pose.",
        )
    max_distance = float(np.abs(target - surface.centre).max())
    if max_distance > _MAX_HANDLE_DISTANCE_RATIO * surface.extent:
        raise InputError(
            f"the target position is {max_distance:.3g} m away from the centre of the mesh, but "
            f"the mesh has a size of {surface.extent:.3g} m",
            where=location,
            remedy="Check the units. All lengths must be in metres.",
        )
    return target
