"""Merges the scans of an object into one surface. A rest is a scan in which the object does not move. Each
rest is aligned with the earlier rests, and all images are fused.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.arrays import Float
from enliven.meshes import Mesh
from enliven.scanning.ground_plane import find_largest_component
from enliven.scanning.marching_cubes import extract_surface
from enliven.scanning.objects.follower import ObjectFollower
from enliven.scanning.objects.registration import align_from_starts
from enliven.scanning.objects.rest import ObjectRest
from enliven.scanning.objects.surface_points import make_nearest_grid, sample_surface
from enliven.scanning.settings import ScanSettings
from enliven.scanning.tsdf_volume import TsdfVolume

_MAX_POINTS = 40_000
"""Maximum number of surface points for the alignment of a rest. On a chair, neighbouring points are some
millimetres apart."""
_PART_POINTS = 8000
"""Number of surface points of a rest that ICP aligns with the surface from the earlier rests."""
_CELL_M = 0.006
"""Cell size, metres, of the nearest-point grid."""
_SEARCH_RADIUS_M = 0.05
"""Maximum distance, metres, between a point and its nearest surface point in ICP. The remaining pose error of
a rest is smaller."""
_ICP_STEPS = 20
"""Number of ICP steps that align a rest with the earlier rests."""
_RESIDUAL_WIDTHS_M = 0.02, 0.003
"""Residuals (metres) that get a quarter of the full weight: in the first ICP step, and in the last."""
_ON_SURFACE_M = 0.01
"""Maximum distance, metres, at which a point counts as on the surface."""
_CLEANING_INTERVAL = 90
"""Number of images between removals of blocks without a surface."""


def merge_rests(
    rests: Sequence[ObjectRest], settings: ScanSettings, followers: Sequence[ObjectFollower] = ()
) -> Mesh:
    """Fuses all images of an object, at rests and between them. Returns the surface (metres) in the world of
    the first rest.
    """
    volume = TsdfVolume(settings.volume)
    for number, rest in enumerate(rests):
        if not rest.parts or rest.object_from_room is None:
            continue
        earlier_surface = extract_surface(volume) if number else None
        pose = rest.object_from_room
        if earlier_surface is not None and len(earlier_surface.faces):
            pose = _refine_pose(rest, pose, earlier_surface)
        for count, (view, room_from_camera) in enumerate(rest.read_views(rest.numbers)):
            volume.integrate(view, pose @ room_from_camera)
            if count % _CLEANING_INTERVAL == _CLEANING_INTERVAL - 1:
                volume.clean()
    for follower in followers:
        for count, (view, pose) in enumerate(follower.read_views()):
            volume.integrate(view, pose)
            if count % _CLEANING_INTERVAL == _CLEANING_INTERVAL - 1:
                volume.clean()
    return find_largest_component(extract_surface(volume))


def _refine_pose(rest: ObjectRest, pose: Float, earlier: Mesh) -> Float:
    """Returns object_from_room (4, 4) of a rest after its surface was aligned with that of the earlier
    rests.
    """
    grid = make_nearest_grid(
        sample_surface(find_largest_component(earlier), _MAX_POINTS), _CELL_M, _SEARCH_RADIUS_M
    )
    poses, _ = align_from_starts(
        grid,
        sample_surface(rest.parts[0], _PART_POINTS),
        pose[None],
        _ICP_STEPS,
        _ON_SURFACE_M,
        _RESIDUAL_WIDTHS_M,
    )
    return np.asarray(poses[0])
