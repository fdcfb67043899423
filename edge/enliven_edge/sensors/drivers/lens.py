"""The typical lens and range of a camera model that does not report them: ``firmware_configs/sensors``."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

import numpy as np

from enliven.arrays import UInt16
from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven_edge.sensors.profile import typical_camera

_SHORTEST = 10.0
"""Pixels of focal length below which a camera has reported none: depth cameras have 150 to 1,000."""
_FARTHEST = 65535
"""Millimetres, the greatest depth of an image."""


def kind_of(name: str, kinds: Mapping[str, str], otherwise: str) -> str:
    """The profile of a camera that calls itself so.

    Args:
        kinds: the profile by a regular expression that the name contains; the first that does counts.
        otherwise: the profile of a camera that none of them fits.
    """
    fits = (profile for words, profile in kinds.items() if re.search(words, name, re.IGNORECASE))
    return next(fits, otherwise)


def known_or_typical(
    width: int,
    height: int,
    lens: tuple[float, float, float, float],
    profile: str,
    name: str,
    rehearsed: bool = False,
) -> tuple[Intrinsics, bool]:
    """The intrinsics that a device reports, or those of its model's profile where it reports none.

    Args:
        lens: (fx, fy, cx, cy) pixels, as the device says them.
        profile: a profile of ``firmware_configs/sensors``.
        rehearsed: it is a recording's, which cannot be asked for another size.

    Returns:
        the camera, and whether the device told it.

    Raises:
        InputError: where the profile's image has another shape.
    """
    fx, fy, cx, cy = lens
    if min(fx, fy) >= _SHORTEST:
        return Intrinsics(width, height, fx, fy, cx, cy), True
    full = typical_camera(profile).camera
    typical = full.scaled(width / full.width)
    if typical.height != height:
        size = f"{typical.width}x{typical.height}"
        what = f"it does not know its lens, and the profile {profile} has none for {width}x{height}"
        mend = f"Ask for {size}, or calibrate the camera with its maker's tool."
        if rehearsed:
            mend = f"Rehearse with a recording that knows its lens, or with one of {size}."
        raise InputError(what, where=name, mend=mend)
    return typical, False


def within(reach: tuple[float, float], profile: str, rehearsed: bool) -> Callable[[UInt16], UInt16]:
    """A function that removes depths out of a camera's range; arguments and errors as of :func:`limits`.

    Returns:
        takes (H, W) uint16 millimetres, and returns them with 0 outside the reach.
    """
    low, high = limits(reach, profile, rehearsed)
    if (low, high) == (0, _FARTHEST):
        return lambda depth: depth
    return lambda depth: np.where((depth >= low) & (depth <= high), depth, np.uint16(0))


def limits(reach: tuple[float, float], profile: str, rehearsed: bool) -> tuple[int, int]:
    """The least and the greatest depth that a camera can have measured, millimetres.

    Args:
        reach: (near, far) metres; 0 stands for the profile's, or in a rehearsal for any: a recording may be
            of another camera.

    Raises:
        InputError: where the reach is empty.
    """
    known = typical_camera(profile)
    typical = (0.0, 0.0) if rehearsed else (known.near, known.far)
    near, far = (given or other for given, other in zip(reach, typical, strict=True))
    if (far and near >= far) or near < 0 or far < 0:
        raise InputError(
            f"near is {near} m and far {far} m", where="sensor", mend="Give near below far, both above 0."
        )
    return round(1e3 * near), min(round(1e3 * far), _FARTHEST) if far else _FARTHEST
