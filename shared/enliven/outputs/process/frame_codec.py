"""Converts frames to rows of plain values, which can be pickled quickly for the sending process.

Arrays become bytes, because pickling an array takes ten times as long. The constant parts of a character are
sent only once. Its surface is left out, because no output uses it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from enliven.arrays import AnyArray
from enliven.document import Character, Pose, Props, SkinWeights
from enliven.frames import DepthFrame
from enliven.outputs.depth_memory import DepthReference
from enliven.outputs.live_frame import CharacterInfo, LiveEvent, LiveFrame
from enliven.person import Body


class FrameEncoder:
    """An encoder that converts frames to rows of plain values. One :class:`FrameDecoder` must receive all
    rows."""

    def __init__(self) -> None:
        self._sent: dict[str, CharacterInfo] = {}

    def encode(self, frame: LiveFrame, depth: DepthReference | None) -> tuple[Any, ...]:
        """Returns a frame as a row that can be pickled. Its depth image is in shared memory at ``depth``, or
        left out if ``depth`` is None."""
        characters = None if self._sent == frame.characters else self._characters_row(frame.characters)
        return (
            frame.time_ns,
            [_body_row(number, body) for number, body in frame.performers.items()],
            [
                (pose.character, pose.time_ns, _bytes32(pose.linear), _bytes32(pose.positions))
                for pose in frame.poses
            ],
            characters,
            tuple(frame.held) if frame.held else (),
            None if frame.props is None else _props_row(frame.props),
            [(event.kind, event.performer, event.character) for event in frame.events],
            depth,
            None if frame.world_from_camera is None else _bytes64(frame.world_from_camera),
            frame.mirrored,
        )

    def _characters_row(self, characters: Mapping[str, CharacterInfo]) -> dict[str, CharacterInfo | None]:
        """Returns the constant parts of the new characters, and None for those that were sent before."""
        row = {
            name: None
            if self._sent.get(name) is info
            else CharacterInfo(_remove_surface(info.character), info.humanoid)
            for name, info in characters.items()
        }
        self._sent = dict(characters)
        return row


class FrameDecoder:
    """A decoder that converts the rows of one :class:`FrameEncoder` back to frames.

    Args:
        read_depth: a function that returns the depth image of a reference, or None if it was overwritten.
    """

    def __init__(self, read_depth: Callable[[DepthReference], DepthFrame | None]) -> None:
        self._characters: dict[str, CharacterInfo] = {}
        self._read_depth = read_depth

    def decode(self, row: tuple[Any, ...]) -> LiveFrame:
        """Returns the frame."""
        time_ns, bodies, poses, characters, held, props, events, depth, place, mirrored = row
        if characters is not None:
            earlier = self._characters
            self._characters = {
                name: earlier[name] if info is None else info for name, info in characters.items()
            }
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


def _bytes64(array: AnyArray) -> bytes:
    return np.asarray(array, np.float64).tobytes()


def _bytes32(array: AnyArray) -> bytes:
    return np.asarray(array, np.float32).tobytes()


def _body_row(number: int, body: Body) -> tuple[Any, ...]:
    turns, contacts = body.orientations, body.contacts
    return (
        *(number, body.id, _bytes64(body.joints), _bytes64(body.confidence)),
        *(None if turns is None else _bytes64(turns), None if contacts is None else _bytes64(contacts)),
        body.stature,
    )


def _array(data: bytes | None, kind: type[np.generic], width: int = 0) -> Any:
    """Returns the data as a writable array (N, ``width``), because kernels are compiled for writable
    arrays."""
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
        *(props.time_ns, np.asarray(props.ids, np.int64).tobytes()),
        *(np.asarray(props.shapes, np.uint8).tobytes(), _bytes32(props.sizes)),
        *(np.asarray(props.colours, np.uint8).tobytes(), _bytes64(props.positions)),
        *(_bytes64(props.turns), props.note),
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


def _remove_surface(character: Character) -> Character:
    """Returns a character with the same pivots, lines and names, and one triangle as its surface."""
    corners, faces = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32)
    skin = SkinWeights(np.zeros((3, 4), np.uint16), np.tile(np.array([1, 0, 0, 0], np.float32), (3, 1)))
    # Handles of kind "points" refer to vertices. Outputs treat them like bones, so the surface can be left
    # out.
    kind = "bones" if character.kind == "points" else character.kind
    pivots, edges = np.asarray(character.pivots), np.asarray(character.edges)
    return Character(character.id, corners, faces, skin, pivots, edges, kind, names=character.names)
