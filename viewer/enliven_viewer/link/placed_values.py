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
    """Returns a received value, transformed.

    Args:
        value: a value of any topic. Values without positions stay unchanged.
        transform: (4, 4) rigid, world of the viewer from world of the edge.
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
    """Returns a transformed pose."""
    rotation = transform[:3, :3].astype(np.float32)
    return replace(
        pose,
        linear=np.ascontiguousarray(rotation @ pose.linear),
        positions=transform_points(transform, pose.positions.astype(np.float64)).astype(np.float32),
    )


def place_body(body: Body, transform: Float) -> Body:
    """Returns a transformed body."""
    orientations = body.orientations
    if orientations is not None:
        orientations = multiply(from_matrix(transform[:3, :3]), orientations)
    return replace(body, joints=transform_points(transform, body.joints), orientations=orientations)


def place_camera(camera: CameraMessage, transform: Float) -> CameraMessage:
    """Returns a camera with a transformed pose."""
    world_from_camera = np.vstack([np.reshape(camera.place, (3, 4)), [0.0, 0.0, 0.0, 1.0]])
    rows = (transform @ world_from_camera)[:3].reshape(-1)
    return msgspec.structs.replace(camera, place=[float(number) for number in rows])


def _place_row(row: MatchRow, transform: Float) -> MatchRow:
    return replace(
        row, lines=tuple(transform_points(transform, line) if len(line) else line for line in row.lines)
    )
