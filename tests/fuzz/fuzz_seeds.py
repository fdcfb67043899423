"""Small valid files of every format, written by enliven itself, and containers rebuilt around mutations.

If a byte is mutated in a file with a checksum, the checksum test refuses the file and no other code is
tested. Containers are therefore also rebuilt around mutated contents, with correct checksums and lengths.
"""

from __future__ import annotations

import functools
import io
import json
import struct
import tempfile
import zlib
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import numpy as np
import zstandard
from archived_depth import encode_archived
from fuzz_law import Mutator
from fuzz_mutations import MOST_BYTES, mutated, mutated_tree
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.records import Chunk
from mcap.writer import CompressionType, Writer
from PIL import Image

from enliven.camera import Intrinsics
from enliven.document.character import Character, Pose, SkinWeights
from enliven.frames import BodyFrame, DepthFrame
from enliven.meshes import MeshMaterials, Texture
from enliven.person.body import Body
from enliven.person.joints import J
from enliven.recording import Recorder
from enliven.recording.depth_codec import encode_depth
from enliven.wire import requests as asks
from enliven.wire import streams
from enliven.wire.convert import bodies_to_message, cues_to_message, pose_to_message
from enliven.wire.convert_characters import character_to_message
from enliven.wire.posecode import PoseCodec


def json_tree(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns a JSON text with a mutated tree, which is sometimes nested deeper than in any real file."""
    if dice.random() < 0.01:
        return patched(data, dice.choice((b"[", b'{"a":')) * 20_000, dice)
    try:
        return json.dumps(mutated_tree(json.loads(data), dice)).encode()
    except (ValueError, RecursionError):  # it was mutated before and is no longer JSON
        return mutated(data, other, dice)


def msgpack_after(head: int) -> Mutator:
    """Returns a mutator of the tree of a MessagePack value that follows ``head`` bytes."""

    def mutate(data: bytes, other: bytes, dice: Random) -> bytes:
        return data[:head] + msgpack_tree(data[head:], other[head:], dice)

    return mutate


def stream_tree(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns a stream message with a mutated tree, which follows the topic, a zero byte and a version."""
    return msgpack_after(data.find(b"\0") + 2)(data, other, dice)


def msgpack_tree(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns a MessagePack value with a mutated tree, which is sometimes nested deeper than in any real
    file.
    """
    if dice.random() < 0.01:
        return patched(data, dice.choice((b"\x91", b"\x81\xa1a")) * 20_000, dice)
    try:
        return msgspec.msgpack.encode(mutated_tree(msgspec.msgpack.decode(data), dice))
    except (OverflowError, RecursionError, TypeError, ValueError, msgspec.MsgspecError):
        return mutated(data, other, dice)  # it was mutated before and is no longer a value


def patched(data: bytes, piece: bytes, dice: Random) -> bytes:
    """Returns the bytes with a piece inserted."""
    at = dice.randrange(len(data) + 1)
    return data[:at] + piece + data[at:]


@functools.cache
def character(kind: str = "graph") -> Character:
    """Returns a box of eight nodes."""
    corners = np.array([[x, y, z] for x in (0, 1.0) for y in (0, 1.0) for z in (0, 1.0)], np.float32)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])], np.int32)
    skin = SkinWeights(
        np.array([[k, 0, 0, 0] for k in range(8)], np.uint16), np.eye(4, dtype=np.float32)[[0] * 8]
    )
    edges = np.array([[0, 1], [0, 2], [0, 4], [1, 3], [2, 6], [4, 5], [5, 7]], np.int32)
    colours = np.full((8, 3), 90, np.uint8)
    return Character(
        "box", corners, faces, skin, corners, edges, kind, colours, materials=_materials(len(faces))
    )


def _materials(faces: int) -> MeshMaterials:
    """Returns a material with a texture of one pixel."""
    data = io.BytesIO()
    Image.new("RGB", (1, 1), (200, 90, 40)).save(data, "PNG")
    moved = {"KHR_texture_transform": {"offset": [0.5, 0.0], "scale": [2.0, 1.0], "rotation": 0.3}}
    base = {"baseColorTexture": {"index": 0, "extensions": moved}, "baseColorFactor": [1, 0.5, 0.2, 0.7]}
    definition = json.dumps({"pbrMetallicRoughness": base, "alphaMode": "MASK", "alphaCutoff": 0.3})
    picture = Texture(np.frombuffer(data.getvalue(), np.uint8), '{"wrapS": 33648}')
    uvs = np.linspace(0, 1, 6 * faces).reshape(faces, 3, 1, 2).astype(np.float32)
    return MeshMaterials((definition,), (picture,), np.zeros(faces, np.int32), uvs)


def poses() -> list[Pose]:
    """Returns four poses of the box."""
    box = character()
    turns = np.tile(np.eye(3, dtype=np.float32), (8, 1, 1))
    return [Pose("box", 33_000_000 * k, turns, box.pivots + np.float32(0.1 * k)) for k in range(4)]


def bodies() -> BodyFrame:
    """Returns two people."""
    random = np.random.default_rng(0)
    first = Body(0, random.normal(size=(J, 3)), random.random(J))
    second = Body(
        1, random.normal(size=(J, 3)), random.random(J), random.normal(size=(J, 4)), random.random(2)
    )
    return BodyFrame([first, second], 33_000_000, "seed")


def depth(colour: bool = True) -> DepthFrame:
    """Returns a depth frame of 8 x 6 pixels."""
    random = np.random.default_rng(0)
    picture = random.integers(0, 255, (6, 8, 3)).astype(np.uint8) if colour else None
    camera = Intrinsics(8, 6, 5.0, 5.0, 3.5, 2.5)
    return DepthFrame(
        random.integers(0, 4000, (6, 8)).astype(np.uint16), camera, 1, "seed", picture, np.eye(4)
    )


def stream_payloads() -> dict[str, bytes]:
    """Returns a MessagePack payload for each topic of a take."""
    box, codec = character(), PoseCodec(character())
    messages = {
        "character": character_to_message(box, 1),
        "pose": pose_to_message(poses()[1], codec, revision=1),
        "bodies": bodies_to_message(bodies().bodies, 5),
        "cues": cues_to_message("box", "possessed", np.array([1, 2]), np.array([0.5, 1.0]), 3),
    }
    return {topic: msgspec.msgpack.encode(message) for topic, message in messages.items()}


def mcap(said: list[tuple[str, str, bytes, int]], compressed: bool = True) -> bytes:
    """Returns a recording of (topic, encoding, bytes, time) with correct checksums."""
    out = io.BytesIO()
    kind = CompressionType.ZSTD if compressed else CompressionType.NONE
    writer = Writer(out, chunk_size=600, compression=kind)
    writer.start("enliven", "enliven fuzz")
    channels: dict[str, int] = {}
    for topic, encoding, data, time_ns in said:
        if topic not in channels:
            schema = writer.register_schema(f"s{len(channels)}", "jsonschema", b"{}")
            channels[topic] = writer.register_channel(topic, encoding, schema, {"sensor": "seed"})
        writer.add_message(channels[topic], time_ns, data, time_ns)
    writer.finish()
    return out.getvalue()


@functools.cache
def recording() -> bytes:
    """Returns depth, bodies and ground truth as our recorder writes them."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "seed.mcap"
        with Recorder(path) as recorder:
            recorder.write_frame(depth())
            recorder.write_frame(bodies())
            recorder.sync()
            recorder.write_truth(bodies())
        return path.read_bytes()


def recording_index(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns a recording with a mutated index and a correct summary checksum."""
    size = len(data) - 37
    start = struct.unpack_from("<Q", data, len(data) - 28)[0] if size > 0 else 0
    if not 0 < start < size:
        return mutated(data, other, dice)
    summary = mutated(data[start:size], data, dice)
    tail = data[size : size + 25]
    check = zlib.crc32(tail, zlib.crc32(summary))
    return data[:start] + summary + tail + struct.pack("<I", check) + data[-8:]


def recording_chunk(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns a recording without an index. Its first chunk is repacked with mutated content."""
    try:
        first = _read_first_chunk(data)
        chunk = Chunk.read(ReadDataStream(io.BytesIO(data[first + 9 :])))
        content = chunk.data
        if chunk.compression:
            size = min(chunk.uncompressed_size, MOST_BYTES)
            content = zstandard.ZstdDecompressor().decompress(content, size)
    except (struct.error, IndexError, ValueError, MemoryError, OverflowError, zstandard.ZstdError, EndOfFile):
        return mutated(data, other, dice)
    records = mutated(content, content, dice)
    crc = zlib.crc32(records) if dice.random() < 0.7 else 0
    size = len(records) if dice.random() < 0.7 else dice.choice((0, 2**20, 2**40, 2**64 - 1))
    packed, kind = records, b""
    if dice.random() < 0.5:
        packed, kind = zstandard.ZstdCompressor().compress(records), b"zstd"
    body = struct.pack("<QQQII", 0, 10, size, crc, len(kind)) + kind + struct.pack("<Q", len(packed)) + packed
    return data[:first] + struct.pack("<BQ", 6, len(body)) + body


def _read_first_chunk(data: bytes) -> int:
    """Returns the position of the first chunk record."""
    at = 8
    while data[at] != 6:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    return at


def take() -> bytes:
    """Returns a take of a character, its poses, people and cues."""
    return mcap(list(_take_records()))


def take_message(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns a take with one to three mutated messages. It always starts from :func:`take`, and ignores
    ``data``.
    """
    records = list(_take_records())
    for _ in range(dice.choice((1, 1, 3))):
        at = dice.randrange(len(records))
        topic, encoding, payload, time_ns = records[at]
        payload = dice.choice((msgpack_tree, msgpack_tree, msgpack_tree, mutated))(payload, payload, dice)
        if dice.random() < 0.3:
            time_ns = dice.choice((0, 1, 2**62, 2**63 - 1))
        records[at] = (topic, encoding, payload, time_ns)
    return mcap(records, dice.random() < 0.5)


@functools.cache
def _take_records() -> tuple[tuple[str, str, bytes, int], ...]:
    """Returns (topic, encoding, payload, time) of each message of a take."""
    payloads = stream_payloads()
    moved = [msgspec.msgpack.encode(pose_to_message(p, PoseCodec(character()), revision=1)) for p in poses()]
    records = [("character", "msgpack", payloads["character"], 0)]
    records += [("pose", "msgpack", data, 33_000_000 * k) for k, data in enumerate(moved)]
    return (*records, *((topic, "msgpack", payloads[topic], 5) for topic in ("bodies", "cues")))


def depth_payloads() -> tuple[bytes, ...]:
    """Returns the depth image in both codecs: the current one and that of older recordings."""
    return encode_depth(depth().depth), encode_archived(depth().depth)


def depth_payload(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns a mutated depth payload with a correct checksum."""
    head, packed = data[:10], data[14:]
    if dice.random() < 0.5:
        head = (mutated(head, packed, dice) + bytes(10))[:10]
    else:
        packed = mutated(packed, packed, dice)
    return head + struct.pack("<I", zlib.crc32(packed, zlib.crc32(head))) + packed


def requests() -> list[Any]:
    """Returns a viewer's requests and an edge's replies."""
    status = streams.StatusMessage("edge", 1, 2, 3, note="fine", fps=30.0)
    bodies = [
        asks.Hello("v", True),
        asks.Possess("chair", 3, "legs"),
        asks.Smooth(3),
        asks.Look((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
        asks.Browse("spider", -1),
    ]
    answers = [asks.Welcome(status, [asks.Revision("chair", 2)], [b"x"]), asks.Done("ok")]
    return [asks.Request(7, ask) for ask in bodies] + [asks.Reply(7, answer) for answer in answers]
