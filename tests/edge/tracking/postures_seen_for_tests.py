"""Renders a posture's capsules in front of a wall, and returns the observation."""

from __future__ import annotations

import numpy as np

from enliven_edge.tracking.body_model.posture import Posture
from enliven_edge.tracking.frame.observation import ImageView, Observation, nearest_columns, stack_rows

MOUNT = np.diag([1.0, -1.0, -1.0, 1.0])
MOUNT[1, 3] = 1.0
CAMERA = np.array([130.0, 130.0, 79.5, 59.5])


def picture(posture: Posture) -> tuple[np.ndarray, np.ndarray]:
    """Renders (h, w) depth and mask of the capsules in front of a wall at 4 m, testing each ray against each
    capsule.
    """
    ends, radii = posture.capsules()
    v, u = np.mgrid[:120, :160]
    ray = np.stack([(u - CAMERA[2]) / CAMERA[0], (v - CAMERA[3]) / CAMERA[1], np.ones(u.shape)], -1)
    direction = ray @ MOUNT[:3, :3].T
    depth = np.full(u.shape, 4.0)
    for (a, b), (ra, rb) in zip(ends, radii, strict=True):
        for t in np.linspace(0, 1, 25):
            centre, radius = a + t * (b - a) - MOUNT[:3, 3], ra + t * (rb - ra)
            along = direction @ centre
            square = (direction**2).sum(-1)
            inside = along**2 - square * (centre @ centre - radius**2)
            hit = (along - np.sqrt(np.maximum(inside, 0))) / square
            depth = np.where((inside > 0) & (hit < depth), hit, depth)
    return depth, depth < 4.0


def observed(posture: Posture, hide: int | None = None) -> Observation:
    """Returns the observation of a posture. Rows from ``hide`` downwards are behind a board at 1 m."""
    depth, mask = picture(posture)
    if hide is not None:
        depth[hide:], mask[hide:] = 1.0, False
    rows, columns = np.nonzero(mask)
    z = depth[mask]
    camera = np.stack([(columns - CAMERA[2]) / CAMERA[0] * z, (rows - CAMERA[3]) / CAMERA[1] * z, z], 1)
    points = camera @ MOUNT[:3, :3].T + MOUNT[:3, 3]
    towards = MOUNT[:3, 3] - points
    normals = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    view = ImageView(depth, mask, nearest_columns(mask), CAMERA, MOUNT)
    pixels = np.stack([rows, columns], 1)
    return Observation(points.astype(np.float32), stack_rows(points, normals), pixels, view, False)
