"""Elementary rotations (3, 3), and the rounding that makes synthetic recordings identical on all machines."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float

GRID_STEP = 2.0**-24
"""Grid to which postures are rounded, in metres (or direction cosines).

It is far below a sensor's resolution. It is far above the last bits, in which the sines of two maths
libraries differ."""


def rotation_about_x(angle: float) -> Float:
    """Returns the (3, 3) rotation by ``angle`` radians about +X."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rotation_about_y(angle: float) -> Float:
    """Returns the (3, 3) rotation by ``angle`` radians about +Y."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rotation_about_z(angle: float) -> Float:
    """Returns the (3, 3) rotation by ``angle`` radians about +Z."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def round_to_grid(values: Float) -> Float:
    """Returns ``values`` rounded to multiples of :data:`GRID_STEP`."""
    return np.asarray(np.rint(values / GRID_STEP) * GRID_STEP)
