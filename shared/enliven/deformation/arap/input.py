"""Handles, and validation of handles and their targets."""

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
    """Vertices that are moved to targets.

    Attributes:
        name: unique among the solver's handles.
        vertices: its vertices of the mesh.
        weight: weight of a soft handle, relative to the surface's cotangent weights of about 1. None means
            hard.
    """

    name: str
    vertices: tuple[int, ...]
    weight: float | None = None


def check_handle(handle: Handle, surface: PreparedSurface) -> None:
    """Raises InputError if the handle's vertices cannot be held."""
    who, count = f"handle {handle.name!r}", len(surface.place_of)
    if not handle.vertices:
        raise InputError("it holds no vertex", where=who, mend="Choose a vertex of the mesh.")
    if handle.weight is not None and not (np.isfinite(handle.weight) and handle.weight > 0):
        raise InputError(f"its weight is {handle.weight}", where=who, mend="Give a number above 0.")
    for vertex in handle.vertices:
        if not 0 <= vertex < count:
            raise InputError(f"vertex {vertex} does not exist; the mesh has {count}", where=who)
        if surface.loose[vertex]:
            raise InputError(
                f"vertex {vertex} is loose: no face uses it, so that nothing would follow it",
                where=who,
                mend="Choose a vertex of the surface.",
            )


def checked_target(name: str, value: Float, handles: Mapping[str, Handle], surface: PreparedSurface) -> Float:
    """Returns (K, 3) the checked target of a handle."""
    if name not in handles:
        handle_names = ", ".join(handles) or "none"
        raise InputError(
            f"the handle {name!r} does not exist", where=ERROR_CONTEXT, mend=f"Known: {handle_names}."
        )
    handle = handles[name]
    target = np.array(value, np.float64)
    if target.shape == (3,) and len(handle.vertices) == 1:
        target = target[None]
    who = f"handle {name!r}"
    if target.shape != (len(handle.vertices), 3):
        raise InputError(f"targets {target.shape} for {len(handle.vertices)} vertices", where=who)
    if not np.isfinite(target).all():
        raise InputError("its target is not finite", where=who, mend="The last valid pose is kept.")
    farthest = float(np.abs(target - surface.centre).max())
    if farthest > _MAX_HANDLE_DISTANCE_RATIO * surface.extent:
        raise InputError(
            f"its target is {farthest:.3g} m away from a mesh of {surface.extent:.3g} m",
            where=who,
            mend="Check the units.",
        )
    return target
