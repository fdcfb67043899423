"""The lens of a camera that does not know its own."""

from __future__ import annotations

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven_edge.sensors.profile import load_profile

_SHORTEST = 10.0
"""Pixels of focal length below which a camera has told nothing: those of depth cameras are 150 to 1,000."""


def known_or_typical(
    width: int, height: int, lens: tuple[float, float, float, float], profile: str, name: str
) -> tuple[Intrinsics, bool]:
    """The camera that a device tells of, or that of its kind's profile where it tells nothing.

    Args:
        lens: (fx, fy, cx, cy) pixels, as the device says them.
        profile: a profile of ``firmware_configs/sensors``.

    Returns:
        the camera, and whether the device told it.

    Raises:
        InputError: where the profile's image has another shape.
    """
    fx, fy, cx, cy = lens
    if min(fx, fy) >= _SHORTEST:
        return Intrinsics(width, height, fx, fy, cx, cy), True
    typical = load_profile(profile).intrinsics(width)
    if typical.height != height:
        raise InputError(
            f"it does not know its lens, and the profile {profile} has none for {width}x{height}",
            where=name,
            mend=f"Ask for {typical.width}x{typical.height}, or calibrate the camera with its maker's tool.",
        )
    return typical, False
