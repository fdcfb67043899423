"""Frames as bytes, for the process that sends them.

Encoding takes about 10 us, because each array is copied as its bytes. The constant parts of a character are
sent once, and without its surface, which no output uses.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np

from enliven.arrays import AnyArray
from enliven.document import Character, Pose, Props, SkinWeights
from enliven.frames import DepthFrame
from enliven.outputs.depth_memory import DepthReference
from enliven.outputs.live_frame import CharacterInfo, LiveEvent, LiveFrame
from enliven.person import Body


class FrameEncoder:
    """Turns frames into bytes for one :class:`FrameDecoder`, which must get all of them."""

    def __init__(self) -> None:
        self._sent: dict[str, CharacterInfo] = {}

    def encode(self, frame: LiveFrame, depth: DepthReference | None) -> bytes:
        """Returns a frame as bytes. Its depth image is in shared memory, or left out."""
        new_characters = {
            name: CharacterInfo(_without_surface(info.character), info.humanoid)
            for name, info in frame.characters.items()
            if self._sent.get(name) is not info
        }
        self._sent = dict(frame.characters)
        bodies = [
            (
                *(number, body.id, _bytes(body.joints), _bytes(body.confidence)),
                *(_bytes(body.orientations), _bytes(body.contacts), body.stature),
            )
            for number, body in frame.performers.items()
        ]
        poses = [
            (
                *(pose.character, pose.time_ns),
                *(_bytes(pose.linear, np.float32), _bytes(pose.positions, np.float32)),
            )
            for pose in frame.poses
        ]
        events = [(event.kind, event.performer, event.character) for event in frame.events]
        return pickle.dumps(
            (
                *(frame.time_ns, bodies, poses, tuple(frame.characters), new_characters, tuple(frame.held)),
                *(None if frame.props is None else _props_row(frame.props), events, depth),
                *(_bytes(frame.world_from_camera), frame.mirrored),
            ),
            pickle.HIGHEST_PROTOCOL,
        )


class FrameDecoder:
    """Turns the bytes of one :class:`FrameEncoder` into frames again.

    Args:
        read_depth: returns the depth image of a reference, or None if it was overwritten.
    """

    def __init__(self, read_depth: Callable[[DepthReference], DepthFrame | None]) -> None:
        self._characters: dict[str, CharacterInfo] = {}
        self._read_depth = read_depth

    def decode(self, data: bytes) -> LiveFrame:
        """Returns the frame."""
        time_ns, bodies, poses, names, new_characters, held, props, events, depth, place, mirrored = (
            pickle.loads(data)
        )
        known = self._characters | new_characters
        self._characters = {name: known[name] for name in names}
        return LiveFrame(
            time_ns,
            {number: _body_of(*row) for number, *row in bodies},
            [_pose_of(*row) for row in poses],
            self._characters,
            frozenset(held),
            None if props is None else _props_of(*props),
            [LiveEvent(*row) for row in events],
            depth=None if depth is None else self._read_depth(depth),
            world_from_camera=_array(place, np.float64, 4),
            mirrored=mirrored,
        )


def _bytes(array: AnyArray | None, kind: type[np.generic] = np.float64) -> bytes | None:
    """Returns the values of an array as bytes."""
    return None if array is None else np.asarray(array, kind).tobytes()


def _array(data: bytes | None, kind: type[np.generic], width: int = 0) -> Any:
    """Returns an array that may be changed, because kernels are compiled for such arrays."""
    if data is None:
        return None
    array = np.frombuffer(data, kind).copy()
    return array.reshape(-1, width) if width else array


def _body_of(
    body_id: int, joints: bytes, confidence: bytes, turns: bytes | None, contacts: bytes | None, stature: Any
) -> Body:
    real = np.float64
    return Body(
        *(body_id, _array(joints, real, 3), _array(confidence, real)),
        *(_array(turns, real, 4), _array(contacts, real), stature),
    )


def _pose_of(character: str, time_ns: int, linear: bytes, positions: bytes) -> Pose:
    transforms = _array(linear, np.float32, 3).reshape(-1, 3, 3)
    return Pose(character, time_ns, transforms, _array(positions, np.float32, 3))


def _props_row(props: Props) -> tuple[Any, ...]:
    return (
        *(props.time_ns, _bytes(props.ids, np.int64), _bytes(props.shapes, np.uint8)),
        *(_bytes(props.sizes, np.float32), _bytes(props.colours, np.uint8)),
        *(_bytes(props.positions), _bytes(props.turns), props.note),
    )


def _props_of(
    time_ns: int,
    ids: bytes,
    shapes: bytes,
    sizes: bytes,
    colours: bytes,
    positions: bytes,
    turns: bytes,
    note: str,
) -> Props:
    return Props(
        *(time_ns, _array(ids, np.int64), _array(shapes, np.uint8)),
        *(_array(sizes, np.float32, 3), _array(colours, np.uint8, 3)),
        *(_array(positions, np.float64, 3), _array(turns, np.float64, 4), note),
    )


def _without_surface(character: Character) -> Character:
    """Returns a character with the same pivots, lines and names, and one triangle as its surface."""
    corners, faces = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32)
    skin = SkinWeights(np.zeros((3, 4), np.uint16), np.tile(np.array([1, 0, 0, 0], np.float32), (3, 1)))
    # Handles on vertices ("points") need the vertices. Outputs treat them like bones.
    kind = "bones" if character.kind == "points" else character.kind
    pivots, edges = np.asarray(character.pivots), np.asarray(character.edges)
    return Character(character.id, corners, faces, skin, pivots, edges, kind, names=character.names)
