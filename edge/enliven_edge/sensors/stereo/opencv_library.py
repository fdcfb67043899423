"""OpenCV, an optional library."""

from __future__ import annotations

from typing import Any

from enliven_edge.sensors.attached_cameras import library


def opencv() -> Any:
    """The module cv2.

    Raises:
        ResourceError: where it is not installed.
    """
    return library("cv2", "libcamera")
