"""Converts the joints or parts of a performance to coordinate frames for Foxglove (foxglove.FrameTransforms
in JSON).

Foxglove draws a line from each frame to its parent, so a skeleton appears as a stick figure.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np

from enliven.arrays import Float, Int
from enliven.exporters.performance import Performance
from enliven.recording import MessageKind
from enliven.rotation import conjugate, from_matrix, multiply, nearest_rotation, rotate
from enliven.wire import find_spanning_tree

FRAMES_TOPIC = "/tf"
_WORLD = "world"
_Z_UP = "enliven"
"""Name of the root frame, the parent of the world frame. It has +Z up, as Foxglove expects."""
_DIGITS = 5
"""Number of decimals of positions and rotations. They resolve hundredths of a millimetre, far below the
quantization error of a pose in network messages.
"""
_NANOSECONDS_PER_S = 1_000_000_000
"""Number of nanoseconds in a second."""


def _object_schema(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


_NUMBER = {"type": "number"}
_FRAME_SCHEMA = _object_schema(
    timestamp={"title": "time", **_object_schema(sec={"type": "integer"}, nsec={"type": "integer"})},
    parent_frame_id={"type": "string"},
    child_frame_id={"type": "string"},
    translation={"title": "foxglove.Vector3", **_object_schema(x=_NUMBER, y=_NUMBER, z=_NUMBER)},
    rotation={
        "title": "foxglove.Quaternion",
        **_object_schema(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER),
    },
)
_SCHEMA = {
    "title": "foxglove.FrameTransforms",
    **_object_schema(
        transforms={"type": "array", "items": {"title": "foxglove.FrameTransform", **_FRAME_SCHEMA}}
    ),
}
FRAMES = MessageKind("foxglove.FrameTransforms", "jsonschema", json.dumps(_SCHEMA), "json")


def encode_world_frame(time_ns: int) -> bytes:
    """Returns the message with the rotation from the world (+Y up) to Foxglove's axes (+Z up)."""
    sqrt_half = np.sqrt(0.5)
    return _encode(time_ns, [(_Z_UP, _WORLD)], np.zeros((1, 3)), np.array([[sqrt_half, sqrt_half, 0.0, 0.0]]))


def encode_frames(performance: Performance, name: str) -> Iterator[bytes]:
    """Yields the message of each frame.

    Args:
        name: the character's name, unique in the file.
    """
    poses = list(performance.poses())
    rotations = from_matrix(nearest_rotation(np.array([pose.linear for pose in poses], np.float64)))
    places: Float = np.array([pose.positions for pose in poses], np.float64)
    if performance.skeleton is not None and performance.joints is not None:
        places, parents = performance.joints, np.asarray(performance.skeleton.parents, np.int64)
        parts = list(performance.skeleton.names)
    else:
        parents = find_spanning_tree(performance.pivots, np.zeros((0, 2), np.int32))[1]
        parts = [f"part {number}" for number in range(len(parents))]
    ids = [f"{name}/{part}" for part in parts]
    pairs = [(_WORLD if above < 0 else ids[above], id) for id, above in zip(ids, parents, strict=True)]
    local_places, local_turns = _make_relative_to_parents(places, rotations, parents)
    for pose, frame_places, frame_turns in zip(poses, local_places, local_turns, strict=True):
        yield _encode(pose.time_ns, pairs, frame_places, frame_turns)


def _make_relative_to_parents(places: Float, turns: Float, parents: Int) -> tuple[Float, Float]:
    """Returns (T, J, 3) positions and (T, J, 4) rotations relative to the parents."""
    is_root, above = parents < 0, np.maximum(parents, 0)
    back = np.where(is_root[:, None], np.array([1.0, 0.0, 0.0, 0.0]), conjugate(turns[:, above]))
    offsets = places - np.where(is_root[:, None], 0.0, places[:, above])
    return rotate(back, offsets), multiply(back, turns)


def _encode(time_ns: int, pairs: list[tuple[str, str]], places: Float, turns: Float) -> bytes:
    """Returns the message of frames (parent, child) with (J, 3) positions and (J, 4) rotations."""
    seconds, nanoseconds = divmod(time_ns, _NANOSECONDS_PER_S)
    timestamp = {"sec": seconds, "nsec": nanoseconds}
    rows = np.round(np.concatenate([places, turns], 1), _DIGITS) + 0.0  # Adding zero converts -0.0 to 0.0.
    transforms = [
        {
            "timestamp": timestamp,
            "parent_frame_id": parent,
            "child_frame_id": child,
            "translation": {"x": x, "y": y, "z": z},
            "rotation": {"x": qx, "y": qy, "z": qz, "w": qw},
        }
        for (parent, child), (x, y, z, qw, qx, qy, qz) in zip(pairs, rows.tolist(), strict=True)
    ]
    return msgspec.json.encode({"transforms": transforms})
