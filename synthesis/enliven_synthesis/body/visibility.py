"""Visibility of joints in a depth image: only the body's own surface may be in front of a visible joint."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Bool, Float, Int32
from enliven.camera import Intrinsics, project
from enliven_synthesis.body.performer import Performer

MAX_COVER_M = np.array(
    [
        0.17, 0.17, 0.15, 0.14,  # hip centre, spine, shoulder centre, head
        0.105, 0.075, 0.065, 0.065,  # shoulder, elbow, wrist, hand
        0.105, 0.075, 0.065, 0.065,
        0.15, 0.095, 0.085, 0.075,  # hip, knee, ankle, foot
        0.15, 0.095, 0.085, 0.075,
    ]
)  # fmt: skip
"""(20,) Maximum thickness in metres of body and clothes in front of each joint, for an average build."""
_JOINT_RADIUS_M = 0.03
"""Radius in metres around a joint in which the body must be visible: about the radius of a fist."""
_MIN_VISIBLE = 0.5
"""Minimum fraction of the pixels around a joint that must show the joint's own body."""


def find_visible_joints(
    joints: Float,
    performer: Performer,
    number: int,
    depth: Float,
    owner: Int32,
    intrinsics: Intrinsics,
    camera_from_world: Float,
    reach: tuple[float, float],
) -> Bool:
    """Returns (20,) True for each joint that is in the image, in range, and only covered by its own body.

    Args:
        joints: (20, 3) metres, world frame.
        number: this performer's number in ``owner``.
        depth: (H, W) depth in metres, without noise.
        owner: (H, W) number of the performer who is visible at each pixel; -1 for the room.
        reach: (near, far) range of the sensor along the optical axis in metres.
    """
    camera = joints @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
    thick = MAX_COVER_M * performer.scale * max(1.0, performer.proportions.girth)
    is_visible = np.zeros(len(joints), bool)
    for j, point in enumerate(camera):
        if not reach[0] <= point[2] <= reach[1]:
            continue
        u, v = project(point, intrinsics)
        radius = max(_JOINT_RADIUS_M * intrinsics.fx / point[2], 1.0)
        if not (0 <= u < intrinsics.width and 0 <= v < intrinsics.height):
            continue
        rows = slice(max(int(v - radius + 0.5), 0), int(v + radius + 0.5) + 1)
        columns = slice(max(int(u - radius + 0.5), 0), int(u + radius + 0.5) + 1)
        is_own = owner[rows, columns] == number
        behind_surface = is_own & (depth[rows, columns] > point[2] - thick[j])
        is_visible[j] = behind_surface.mean() >= _MIN_VISIBLE
    return is_visible
