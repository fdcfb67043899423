"""Typical intrinsics and range of camera models that do not report them, from
``firmware_configs/sensors``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

import numpy as np

from enliven.arrays import UInt16
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven_edge.sensors.profile import typical_camera

_MIN_FOCAL_LENGTH_PX = 10.0
"""Minimum focal length in pixels. A camera with a smaller value has reported none, because depth cameras have
150 to 1,000."""
_MAX_DEPTH_MM = 65535
"""Largest depth in an image, in millimetres."""


def profile_from_name(name: str, kinds: Mapping[str, str], otherwise: str) -> str:
    """Returns the profile of a camera with a given name.

    Args:
        kinds: the profile by a regular expression that matches part of the name. The first match is used.
        otherwise: the profile of a camera without a match.
    """
    fits = (profile for words, profile in kinds.items() if re.search(words, name, re.IGNORECASE))
    return next(fits, otherwise)


def choose_intrinsics(
    width: int,
    height: int,
    lens: tuple[float, float, float, float],
    profile: str,
    name: str,
    rehearsed: bool = False,
) -> tuple[Intrinsics, bool]:
    """Returns the intrinsics of a device, or those of its model's profile if it reports none.

    Args:
        lens: (fx, fy, cx, cy) pixels, as the device reports them.
        profile: a profile of ``firmware_configs/sensors``.
        rehearsed: True for a recording, which cannot deliver another size.

    Returns:
        the intrinsics, and whether the device reported them.

    Raises:
        InputError: if the profile's image has another shape.
    """
    fx, fy, cx, cy = lens
    if min(fx, fy) >= _MIN_FOCAL_LENGTH_PX:
        return Intrinsics(width, height, fx, fy, cx, cy), True
    full = typical_camera(profile).camera
    typical = full.scale(width / full.width)
    if typical.height != height:
        size = f"{typical.width}x{typical.height}"
        problem = (
            f"the lens of the camera is unknown, and the profile {profile} has none for {width}x{height} "
            "pixels"
        )
        remedy = f"Set the image size to {size}, or calibrate the camera with the tool of its maker."
        if rehearsed:
            remedy = (
                f"Rehearse with a recording that describes its lens, or with a recording of {size} pixels."
            )
        raise InputError(problem, where=name, remedy=remedy)
    return typical, False


def create_range_filter(
    reach: tuple[float, float], profile: str, rehearsed: bool
) -> Callable[[UInt16], UInt16]:
    """Returns a function that removes depths outside a camera's range.

    See :func:`depth_limits` for arguments and errors.

    Returns:
        takes (H, W) uint16 millimetres, and returns them with 0 outside the range.
    """
    low, high = depth_limits(reach, profile, rehearsed)
    if (low, high) == (0, _MAX_DEPTH_MM):
        return lambda depth: depth
    return lambda depth: np.where((depth >= low) & (depth <= high), depth, np.uint16(0))


def depth_limits(reach: tuple[float, float], profile: str, rehearsed: bool) -> tuple[int, int]:
    """Returns the minimum and maximum depth that a camera can measure, millimetres.

    Args:
        reach: (near, far) metres. 0 stands for the profile's value. In a rehearsal 0 means no limit, because
            the recording may come from another camera.

    Raises:
        InputError: if the range is empty.
    """
    camera = typical_camera(profile)
    typical = (0.0, 0.0) if rehearsed else (camera.near, camera.far)
    near, far = (stated or other for stated, other in zip(reach, typical, strict=True))
    if (far and near >= far) or near < 0 or far < 0:
        raise InputError(
            f"near is {near} m and far is {far} m",
            where="sensor",
            remedy="Set near below far, and both above 0.",
        )
    return round(1e3 * near), min(round(1e3 * far), _MAX_DEPTH_MM) if far else _MAX_DEPTH_MM
