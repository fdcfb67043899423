"""Converts frames to the bytes of a recording's messages, and back without loss."""

from __future__ import annotations

import struct
from typing import Any

import msgspec
import numpy as np
import zstandard

from enliven.arrays import AnyArray, Float, UInt8
from enliven.camera import Intrinsics
from enliven.errors import InputError, refuse_later_version
from enliven.frames import BodyFrame, DepthFrame
from enliven.person import Body, J
from enliven.recording.depth_codec import MAX_PIXELS, decode_depth, encode_depth

_DEPTH_HEADER = struct.Struct("<BBHIq9d")
_COLOUR_SIZE = struct.Struct("<II")
_SEQUENCE = struct.Struct("<q")
_VERSION = 1
"""First byte of a depth message: the version of its layout."""
_POSE_FLAG = 1
"""Flag of a depth message that contains the camera's pose."""
_COLOUR_FLAG = 2
"""Flag of a depth message that contains a colour image."""
_SEQUENCE_FLAG = 4
"""Flag of a depth message that contains a sequence number."""
_SEQUENCE_LIMIT = 1 << 63
"""Exclusive limit of the sequence number, a signed 64-bit integer in the layout. Larger numbers are not
stored.
"""


def pack_depth(frame: DepthFrame, level: int) -> bytes:
    """Encodes a depth frame as a message. ``level`` is the compression level of ``encode_depth``."""
    camera, sensor = frame.intrinsics, frame.sensor.encode()
    depth = encode_depth(frame.depth, level)
    count = frame.sequence
    counted = () if count is None or abs(count) >= _SEQUENCE_LIMIT else (_SEQUENCE.pack(count),)
    flags = _POSE_FLAG * (frame.world_from_camera is not None) | _COLOUR_FLAG * (frame.colour is not None)
    flags |= _SEQUENCE_FLAG * len(counted)
    lens = (camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion)
    parts = [_DEPTH_HEADER.pack(_VERSION, flags, len(sensor), len(depth), frame.time_ns, *lens), sensor]
    if frame.world_from_camera is not None:
        parts.append(np.asarray(frame.world_from_camera, "<f8").reshape(4, 4).tobytes())
    parts.append(depth)
    if frame.colour is not None:
        parts.append(_pack_colour(frame.colour, level))
    return b"".join((*parts, *counted))


def unpack_depth(data: bytes) -> DepthFrame:
    """Returns the depth frame of a message.

    Raises:
        InputError: if the bytes are not a depth frame, or have a later version.
    """
    if not data or data[0] < _VERSION:
        raise _damage_error("it does not begin with the header of a depth frame")
    refuse_later_version(data[0], _VERSION, "recording, a depth frame")
    if len(data) < _DEPTH_HEADER.size:
        raise _damage_error("it is too short")
    _, flags, name_size, depth_size, time_ns, *lens = _DEPTH_HEADER.unpack_from(data)
    offset = _DEPTH_HEADER.size + name_size
    pose_size = 128 if flags & _POSE_FLAG else 0
    end = len(data) - (_SEQUENCE.size if flags & _SEQUENCE_FLAG else 0)
    if offset + pose_size + depth_size > end:
        raise _damage_error("it ends too early")
    try:
        sensor = data[_DEPTH_HEADER.size : offset].decode()
    except UnicodeDecodeError:
        raise _damage_error("the sensor's identity is not UTF-8") from None
    pose: Float | None = None
    if pose_size:
        pose = np.frombuffer(data, "<f8", 16, offset).reshape(4, 4).astype(np.float64)
    offset += pose_size
    depth = decode_depth(data[offset : offset + depth_size])
    colour = _unpack_colour(data[offset + depth_size : end]) if flags & _COLOUR_FLAG else None
    sequence = _SEQUENCE.unpack_from(data, end)[0] if flags & _SEQUENCE_FLAG else None
    distortion = (lens[4], lens[5], lens[6], lens[7], lens[8])
    camera = Intrinsics(depth.shape[1], depth.shape[0], lens[0], lens[1], lens[2], lens[3], distortion)
    return DepthFrame(depth, camera, time_ns, sensor, colour, pose, sequence)


def _pack_colour(colour: UInt8, level: int) -> bytes:
    if colour.dtype != np.uint8 or colour.ndim != 3 or colour.shape[2] != 3 or not colour.size:
        raise InputError(
            f"the colour image is {colour.dtype} {colour.shape}, expected uint8 (h, w, 3)",
            where="depth frame",
        )
    difference = np.diff(colour, axis=1, prepend=np.uint8(0))
    compressed = zstandard.ZstdCompressor(level=level).compress(difference.tobytes())
    return _COLOUR_SIZE.pack(colour.shape[0], colour.shape[1]) + compressed


def _unpack_colour(data: bytes) -> UInt8:
    if len(data) < _COLOUR_SIZE.size:
        raise _damage_error("the colour image is missing")
    height, width = _COLOUR_SIZE.unpack_from(data)
    size = height * width * 3
    compressed = data[_COLOUR_SIZE.size :]
    try:
        if not 0 < size <= 3 * MAX_PIXELS or zstandard.frame_content_size(compressed) != size:
            raise _damage_error(f"the colour image states a wrong size, {width}x{height} pixels")
        content = zstandard.ZstdDecompressor().decompress(compressed, max_output_size=size)
    except zstandard.ZstdError:
        raise _damage_error("the colour image cannot be unpacked") from None
    if len(content) != size:
        raise _damage_error("the colour image ends too early")
    difference = np.frombuffer(content, np.uint8).reshape(height, width, 3)
    return np.cumsum(difference, axis=1, dtype=np.uint8)


class _BodyMessage(msgspec.Struct):
    id: int
    joints: list[list[float | None]]
    confidence: list[float | None]
    orientations: list[list[float | None]] | None = None
    contacts: list[float | None] | None = None
    stature: float | None = None


class _BodiesMessage(msgspec.Struct):
    time_ns: int
    sensor: str
    bodies: list[_BodyMessage]


_bodies_decoder = msgspec.json.Decoder(_BodiesMessage)


def pack_bodies(frame: BodyFrame) -> bytes:
    """Encodes a body frame as a JSON message. Numbers have the fewest digits that restore the float64
    exactly."""
    bodies = [_body_fields(body) for body in frame.bodies]
    return msgspec.json.encode({"time_ns": frame.time_ns, "sensor": frame.sensor, "bodies": bodies})


def _body_fields(body: Body) -> dict[str, Any]:
    """Returns the fields of a body as JSON types."""
    turns = body.orientations
    fields: dict[str, Any] = {
        "id": int(body.id),
        "joints": _shape_values(body.joints, (J, 3)).tolist(),
        "confidence": _shape_values(body.confidence, (J,)).tolist(),
        "orientations": None if turns is None else _shape_values(turns, (J, 4)).tolist(),
    }
    if body.contacts is not None:
        fields["contacts"] = _shape_values(body.contacts, (2,)).tolist()
    if body.stature is not None:
        fields["stature"] = float(body.stature)
    return fields


def unpack_bodies(data: bytes) -> BodyFrame:
    """Returns the body frame of a message.

    Raises:
        InputError: if the bytes are not a body frame.
    """
    try:
        message = _bodies_decoder.decode(data)
        bodies = [_decode_body(body) for body in message.bodies]
    except (msgspec.MsgspecError, ValueError, OverflowError, RecursionError):
        raise _damage_error("its entries are not tracked bodies") from None
    return BodyFrame(bodies, message.time_ns, message.sensor)


def _decode_body(message: _BodyMessage) -> Body:
    turns = message.orientations
    return Body(
        message.id,
        _shape_values(message.joints, (J, 3)),
        _shape_values(message.confidence, (J,)),
        None if turns is None else _shape_values(turns, (J, 4)),
        None if message.contacts is None else _shape_values(message.contacts, (2,)),
        message.stature,
    )


def _shape_values(values: AnyArray | list[Any], shape: tuple[int, ...]) -> Float:
    """Converts ``values`` to a float64 array of this shape. None becomes NaN."""
    array = np.asarray(values, np.float64)
    if array.shape != shape:
        raise InputError(
            f"an array of a body has the shape {array.shape}, expected {shape}", where="body frame"
        )
    return array


def _damage_error(damage: str) -> InputError:
    return InputError(
        f"the message cannot be read: {damage}",
        where="recording",
        remedy="Record or import the recording again.",
    )
