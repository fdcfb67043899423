"""All rests of an object become one surface: each is laid onto those before it, and all images are fused."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from enliven.arrays import Bool, Float
from enliven.meshes import Mesh
from enliven.scanning.depth_view import DepthView, only
from enliven.scanning.ground import largest
from enliven.scanning.marching_cubes import surface_of
from enliven.scanning.objects.region import region_about, shown_in
from enliven.scanning.objects.registration import laid
from enliven.scanning.objects.rest import ObjectRest
from enliven.scanning.objects.surface_points import nearest_grid, sampled
from enliven.scanning.settings import ScanSettings
from enliven.scanning.volume import DistanceVolume

_ABOUT = 0.02
"""Metres about an object's surface in which an image's points are its own: what the tracking may be off."""
_POINTS = 40_000
"""Points of the surface that a rest is laid onto: some millimetres apart on a chair."""
_PART_POINTS = 8000
"""Points that are laid onto it."""
_CELL = 0.006
"""Metres of the cells that know their nearest point."""
_REACH = 0.05
"""Metres about the surface in which points find it: what a rest may still be off is less."""
_STEPS = 20
"""Steps of the laying."""
_WIDTHS = 0.02, 0.003
"""Metres at which a residual counts a quarter, in the first step and in the last."""
_NEAR = 0.01
"""Metres within which a point lies on the surface."""
_CLEANED = 90
"""Images after which blocks without a surface are given back."""


def joined_object(rests: Sequence[ObjectRest], settings: ScanSettings) -> Mesh:
    """Returns the surface of an object that was scanned at several rests, metres, the first one's world."""
    whole = DistanceVolume(settings.volume)
    for number, rest in enumerate(rests):
        if not rest.parts or rest.object_from_room is None:
            continue
        pose = _bettered(rest, rest.object_from_room, surface_of(whole)) if number else rest.object_from_room
        for count, (view, object_from_camera) in enumerate(_views(rest, pose)):
            whole.integrate(view, object_from_camera)
            if count % _CLEANED == _CLEANED - 1:
                whole.clean()
    return largest(surface_of(whole))


def _views(rest: ObjectRest, object_from_room: Float) -> Iterator[tuple[DepthView, Float]]:
    """Yields each image of a rest, of which only the object's own pixels make a surface; and its pose."""
    if rest.ground is None:
        return
    clearance = rest.settings.cut_out.clearance
    region = region_about(rest.parts[0], rest.ground, clearance, _ABOUT)
    for number, frame in rest.scanner.history.frames():
        if rest.images is not None and number >= rest.images:
            return
        view, pose = rest.scanner.prepared(frame), rest.scanner.poses[number][1]
        own: Bool = shown_in(region, view, pose)
        yield only(view, own), object_from_room @ pose


def _bettered(rest: ObjectRest, pose: Float, whole: Mesh) -> Float:
    """Returns object_from_room (4, 4) of a rest after its surface was laid onto that of the ones before."""
    grid = nearest_grid(sampled(largest(whole), _POINTS), _CELL, _REACH)
    poses, _ = laid(grid, sampled(rest.parts[0], _PART_POINTS), pose[None], _STEPS, _NEAR, _WIDTHS)
    return np.asarray(poses[0])
