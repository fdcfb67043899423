"""Computes the projections of the key light's shadow map and of the floor's contact map around the shadow
casters.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven_viewer.render.camera import Box, look_at, make_orthographic
from enliven_viewer.render.scene import find_corners


def light_from_world(box: Box, to_key: Float) -> Float:
    """Returns the (4, 4) projection from the world to the key light's square shadow map around a box.

    It includes a margin for the blur.

    Args:
        to_key: (3,) unit direction towards the light.
    """
    centre = (box[0] + box[1]) / 2
    camera = look_at(centre + to_key, centre)
    corners = find_corners(box) @ camera[:3, :3].T + camera[:3, 3]
    middle, half_size = (corners.min(0) + corners.max(0)) / 2, (corners.max(0) - corners.min(0)) / 2
    side = 1.12 * max(half_size[0], half_size[1]) + 0.05
    extent = np.array([side, side, half_size[2] + 0.05])
    return np.asarray(make_orthographic(middle - extent, middle + extent) @ camera)


def contact_from_world(box: Box) -> Float:
    """Returns the (4, 4) projection from the world to a map of the floor, seen from below. x and z are the
    map's axes, and the height y is the depth.
    """
    centre = (box[0] + box[1]) / 2
    side = float((box[1] - box[0])[[0, 2]].max()) / 2 + 0.5
    low, high = -1.0, 4.0
    clip = np.zeros((4, 4))
    clip[0, [0, 3]] = 1 / side, -centre[0] / side
    clip[1, [2, 3]] = 1 / side, -centre[2] / side
    clip[2, [1, 3]] = 2 / (high - low), -(high + low) / (high - low)
    clip[3, 3] = 1.0
    return clip
