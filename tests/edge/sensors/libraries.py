"""The libraries that drivers need for their tests, and a skip if one is missing."""

import importlib.util

import pytest

LIBRARIES = {
    "oak": "depthai",
    "orbbec": "pyorbbecsdk",
    "realsense": "pyrealsense2",
    "tof": "ArducamDepthCamera",
}


def needs(driver: str) -> None:
    """Skips a test if the driver's library is missing."""
    if importlib.util.find_spec(LIBRARIES[driver]) is None:
        pytest.skip(f"{LIBRARIES[driver]} is not installed: docs/sensors.md")
