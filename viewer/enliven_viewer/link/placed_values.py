"""Transforms received values from the world of one edge into the world of another, by a rigid transform."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np

from enliven.arrays import Float
from enliven.document import Pose, Props
from enliven.matching.match_list import MatchList, MatchRow
from enliven.person import Body
from enliven.rotation import from_matrix, multiply
from enliven.space.rigid_transform import transform_points
from enliven.wire import CameraMessage
from enliven_viewer.link.received_data import ReceivedBodies, ReceivedPose


def place_value(value: Any, transform: Float) -> Any:
    """Returns a received value with transformed positions and directions.

    Args:
        value: a value of any topic. Values without positions stay unchanged.
        transform: (4, 4) rigid transform from the edge's world to the viewer's world.
    """
    match value:
        case ReceivedPose():
            return replace(value, pose=place_pose(value.pose, transform))
        case ReceivedBodies():
            return replace(value, bodies=tuple(place_body(body, transform) for body in value.bodies))
        case Props():
            return replace(
                value,
                positions=transform_points(transform, value.positions),
                turns=multiply(from_matrix(transform[:3, :3]), value.turns),
            )
        case MatchList():
            return replace(value, rows=tuple(_place_row(row, transform) for row in value.rows))
        case CameraMessage():
            return place_camera(value, transform)
    return value


def place_pose(pose: Pose, transform: Float) -> Pose:
    """Returns a pose transformed by a (4, 4) rigid transform."""
    rotation = transform[:3, :3].astype(np.float32)
    return replace(
        pose,
        linear=np.ascontiguousarray(rotation @ pose.linear),
        positions=transform_points(transform, pose.positions.astype(np.float64)).astype(np.float32),
    )


def place_body(body: Body, transform: Float) -> Body:
    """Returns a body transformed by a (4, 4) rigid transform."""
    orientations = body.orientations
    if orientations is not None:
        orientations = multiply(from_matrix(transform[:3, :3]), orientations)
    return replace(body, joints=transform_points(transform, body.joints), orientations=orientations)


def place_camera(camera: CameraMessage, transform: Float) -> CameraMessage:
    """Returns a camera message with its camera pose transformed by a (4, 4) rigid transform."""
    world_from_camera = np.vstack([np.reshape(camera.place, (3, 4)), [0.0, 0.0, 0.0, 1.0]])
    rows = (transform @ world_from_camera)[:3].reshape(-1)
    return msgspec.structs.replace(camera, place=[float(number) for number in rows])


def _place_row(row: MatchRow, transform: Float) -> MatchRow:
    return replace(
        row, lines=tuple(transform_points(transform, line) if len(line) else line for line in row.lines)
    )
