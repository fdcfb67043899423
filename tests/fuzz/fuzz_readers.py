"""All readers of untrusted bytes, and the mutated files for each."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import fuzz_models as models
import fuzz_seeds as seeds
import fuzz_texts as texts
import msgspec
import numpy as np
from fuzz_law import Target

from enliven.document.example_settings import ExampleSettings
from enliven.errors import EnlivenError
from enliven.example_sessions.session import read_session
from enliven.files import decode_text
from enliven.formats.gltf.read import read_gltf
from enliven.formats.motion.bvh import parse_bvh
from enliven.formats.motion.expmap import read_expmap
from enliven.formats.project.file import project_of
from enliven.mapping.plan_file import read_plan
from enliven.meshes.files import load_mesh
from enliven.recording import Recording
from enliven.recording.depth_codec import decode_depth
from enliven.recording.messages import pack_bodies, pack_depth, unpack_bodies, unpack_depth
from enliven.settings import load_settings
from enliven.takes import turn_upright
from enliven.takes.possessed import read_possessed
from enliven.wire import characters, convert, convert_characters, envelope, streams, topics
from enliven.wire.envelope import MalformedMessageError
from enliven.wire.matches import message_to_board
from enliven.wire.posecode import PoseCodec
from enliven_edge.importing.bags.reader import BagReader
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.playback.document import Document
from enliven_viewer.render.materials import paint_keys, paint_surface
from enliven_viewer.render.surface import split_creases


def _stream(data: bytes, folder: Path) -> None:
    """Reads like a viewer: unpack, then convert."""
    _, message = envelope.unpack_stream(data)
    codec = _codec()
    match message:
        case streams.PoseMessage():
            pose = convert.message_to_pose(message, codec)
            assert pose.linear.shape == (8, 3, 3)
        case streams.BodiesMessage():
            for body in convert.message_to_bodies(message):
                assert np.isfinite(body.joints).all()
        case streams.CuesMessage():
            convert.message_to_cues(message), convert.message_to_owners(message)
        case streams.PropsMessage():
            convert.message_to_props(message)
        case streams.MatchesMessage():
            message_to_board(message)
        case streams.StatusMessage():
            convert.messages_to_health(message.health)


_CODEC: list[PoseCodec] = []


def _codec() -> PoseCodec:
    if not _CODEC:
        _CODEC.append(PoseCodec(seeds.character()))
    return _CODEC[0]


def _control(data: bytes, folder: Path) -> None:
    for topic in (topics.REQUEST, topics.REPLY):
        try:
            reply = envelope.unpack_control(data, topic)
        except MalformedMessageError:
            continue
        body = getattr(reply, "body", None)
        if isinstance(body, characters.CharacterMessage):
            character = convert_characters.message_to_character(body)
            PoseCodec(character)
            surface = split_creases(character.vertices, character.faces, keys=paint_keys(character))
            assert len(paint_surface(character, surface).rows) == len(surface.source)


def _recording(data: bytes, folder: Path) -> None:
    path = _file(folder, "a.mcap", data)
    recording = Recording(path)
    for topic in recording.info.topics:
        for time_ns, _ in recording.messages(topic):
            assert 0 <= time_ns < 1 << 64
    for read in (recording.frames, recording.truth):
        for frame in read():
            assert isinstance(frame.time_ns, int)


def _depth(data: bytes, folder: Path) -> None:
    decode_depth(data, max_pixels=1 << 16)


def _depth_frame(data: bytes, folder: Path) -> None:
    unpack_depth(data)


def _take(data: bytes, folder: Path) -> None:
    path = _file(folder, "a.mcap", data)
    take, document = TakeFeed(path), Document()
    while take.poll(document):
        pass
    read_possessed(path)


def _gltf(suffix: str) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        rig = read_gltf(_file(folder, f"a{suffix}", data))
        assert np.isfinite(rig.shape.skeleton.positions).all()

    return read


def _mesh(suffix: str) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        mesh = load_mesh(_file(folder, f"a{suffix}", data)).mesh
        assert np.isfinite(mesh.vertices).all() and len(mesh.faces)
        assert 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices)

    return read


def _bvh(data: bytes, folder: Path) -> None:
    capture = turn_upright(parse_bvh(decode_text(data)))
    assert capture.positions.shape == (capture.frames, len(capture.names), 3)


def _bag(name: str) -> Callable[[bytes, Path], None]:
    def read(data: bytes, folder: Path) -> None:
        for frame in BagReader().read([_file(folder, name, data)]):
            assert frame.depth.shape == (frame.intrinsics.height, frame.intrinsics.width)

    return read


def _file(folder: Path, name: str, data: bytes) -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


def _settings(data: bytes, folder: Path) -> None:
    load_settings(ExampleSettings, _file(folder, "a.toml", data))


def _session(data: bytes, folder: Path) -> None:
    for name, seed in (("seed.ply", models.mesh(".ply")), ("seed.enliven", models.project())):
        if not (folder / name).exists():
            _file(folder, name, seed)
    read_session(_file(folder, "a.toml", data))


def _mixed(*makers: seeds.Maker) -> seeds.Maker:
    return lambda dice: dice.choice(makers)(dice)


def _wire(payload: bytes, topic: str) -> seeds.Maker:
    return seeds.of_msgpack(topic.encode() + b"\0" + bytes([envelope.VERSION]), payload)


def targets() -> list[Target]:
    """Returns all readers. Their counts add up to the number stated for `make test`."""
    payloads = seeds.stream_payloads()
    payloads["status"] = msgspec.msgpack.encode(streams.StatusMessage("edge", 1, 2, 3, note="fine", fps=30.0))
    streamed = {topic: data for topic, data in payloads.items() if topic in topics.STREAMS}
    packed = [topic.encode() + b"\0" + bytes([envelope.VERSION]) + data for topic, data in streamed.items()]
    character = msgspec.msgpack.encode({"id": 1, "body": _with_type(payloads["character"])})
    head = bytes([envelope.VERSION])
    controls = [msgspec.msgpack.encode(message) for message in seeds.requests()] + [character]
    wire = (MalformedMessageError, EnlivenError, ValueError)
    mesh_seeds = {
        ".obj": (texts.OBJ, texts.CONCAVE_OBJ, models.mesh(".obj")),
        ".ply": (texts.PLY, texts.MIXED_PLY, models.mesh(".ply")),
        ".stl": (texts.STL, models.mesh(".stl")),
        ".off": (texts.OFF, texts.WRAPPED_OFF, models.mesh(".off")),
        ".mesh": (texts.MEDIT,),
        ".pcd": texts.PCDS,
        ".gltf": (models.gltf(),),
    }
    listed = [
        Target("wire stream bytes", 1000, seeds.of_bytes(*packed), _stream, wire),
        Target("wire stream", 1800, _mixed(*(_wire(d, t) for t, d in streamed.items())), _stream, wire),
        Target("wire control bytes", 500, seeds.of_bytes(*(head + c for c in controls)), _control, wire),
        Target("wire control", 1000, _mixed(*(seeds.of_msgpack(head, c) for c in controls)), _control, wire),
        Target(
            "depth payload", 500, seeds.depth_anew, lambda data, _: decode_depth(data, max_pixels=1 << 16)
        ),
        Target(
            "depth message", 400, seeds.of_bytes(pack_depth(seeds.depth(), 1)), lambda d, _: unpack_depth(d)
        ),
        Target(
            "bodies message",
            400,
            _mixed(seeds.of_bytes(pack_bodies(seeds.bodies())), seeds.of_json(pack_bodies(seeds.bodies()))),
            lambda data, _: unpack_bodies(data),
        ),
        Target("recording bytes", 600, seeds.of_bytes(seeds.recording()), _recording),
        Target("recording index", 400, seeds.recording_anew, _recording),
        Target("recording chunk", 400, seeds.chunk_anew, _recording),
        Target("take", 200, seeds.take_anew, _take),
        Target("project bytes", 400, seeds.of_bytes(models.project()), lambda data, _: project_of(data)),
        Target("project", 400, models.project_anew, lambda data, _: project_of(data)),
        Target("gltf", 400, seeds.of_json(models.gltf()), _gltf(".gltf")),
        Target("glb", 300, models.glb_anew, _gltf(".glb")),
        Target("mesh glb", 150, models.glb_anew, _mesh(".glb")),
        Target("bvh", 500, seeds.of_bytes(texts.BVH, texts.WRAPPED_BVH), _bvh),
        Target("expmap", 50, seeds.of_bytes(texts.EXPMAP), lambda d, f: read_expmap(_file(f, "a.txt", d))),
        Target("orbbec bag", 250, seeds.of_bytes(models.orbbec_bag()), _bag("a.bag")),
        Target("realsense database", 250, seeds.of_bytes(models.realsense_database()), _bag("a.db3")),
        Target("mapping", 150, seeds.of_bytes(texts.PLAN), lambda d, f: read_plan(_file(f, "a.toml", d))),
        Target("settings", 50, seeds.of_bytes(texts.SETTINGS, texts.PLAN), _settings),
        Target("session", 100, seeds.of_bytes(texts.SESSION), _session),
    ]
    listed += [
        Target(f"mesh {s[1:]}", 100 if s == ".gltf" else 150, seeds.of_bytes(*all_of), _mesh(s))
        for s, all_of in mesh_seeds.items()
    ]
    return listed


def _with_type(payload: bytes) -> Any:
    """Returns a character's payload as the body of a reply."""
    decoded = msgspec.msgpack.decode(payload)
    return {"type": "CharacterMessage", **decoded} if isinstance(decoded, dict) else decoded
