"""Elementary rotations (3, 3), and the rounding that makes a synthetic recording equal on all machines."""

from __future__ import annotations

import math

import numpy as np

from enliven.arrays import Float

GRID = 2.0**-24
"""Metres (or direction cosines) to which postures are rounded: far below what a sensor resolves, far above
the last bits, in which the sines of two mathematics libraries differ."""


def about_x(angle: float) -> Float:
    """(3, 3) a rotation by ``angle`` radians about +X."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def about_y(angle: float) -> Float:
    """(3, 3) a rotation by ``angle`` radians about +Y."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def about_z(angle: float) -> Float:
    """(3, 3) a rotation by ``angle`` radians about +Z."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def on_grid(values: Float) -> Float:
    """Returns ``values`` rounded to multiples of :data:`GRID`."""
    return np.asarray(np.rint(values / GRID) * GRID)
