"""Exchanges left and right, because some drivers deliver mirrored images."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from enliven.frames import BodyFrame, DepthFrame, Frame
from enliven.person import Joint
from enliven.person import mirror_body as reflected

_MIRROR_NORMAL = np.array([1.0, 0.0, 0.0])
"""(3,) the normal of the mirror plane: the x axis of the bodies' world."""
OTHER_SIDE = [
    Joint[name.replace("LEFT", "?").replace("RIGHT", "LEFT").replace("?", "RIGHT")]
    for name in Joint.__members__
]
"""(20,) the joint on the other side of the body."""


def mirror_frames(frames: Iterator[Frame]) -> Iterator[Frame]:
    """Yields every frame mirrored. The pose of the sensor does not change."""
    for frame in frames:
        yield _mirror_depth(frame) if isinstance(frame, DepthFrame) else _mirror_bodies(frame)


def _mirror_depth(frame: DepthFrame) -> DepthFrame:
    camera = frame.intrinsics
    k1, k2, p1, p2, k3 = camera.distortion
    lens = dataclasses.replace(camera, cx=camera.width - 1 - camera.cx, distortion=(k1, k2, p1, -p2, k3))
    colour = None if frame.colour is None else np.ascontiguousarray(frame.colour[:, ::-1])
    depth = np.ascontiguousarray(frame.depth[:, ::-1])
    return dataclasses.replace(frame, depth=depth, intrinsics=lens, colour=colour)


def _mirror_bodies(frame: BodyFrame) -> BodyFrame:
    bodies = [reflected(body, np.zeros(3), _MIRROR_NORMAL) for body in frame.bodies]
    return dataclasses.replace(frame, bodies=bodies)
