"""Readers of bytes that arrive from a network or a cable: messages, handshakes, pairings, OSC, panels."""

from __future__ import annotations

import contextlib
import struct
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random

import lz4.frame
import msgspec
import numpy as np
from curve_client import EDGE, VIEWER, Client
from fuzz_law import Target
from fuzz_messages import smallest
from fuzz_mutations import MOST_BYTES, mutated
from fuzz_seeds import (
    character,
    json_tree,
    msgpack_after,
    msgpack_tree,
    requests,
    stream_payloads,
    stream_tree,
)
from nacl.secret import SecretBox
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import build_msg

from enliven.errors import EnlivenError
from enliven.keys.curve import CurveError, CurveServer
from enliven.keys.key_files import KeyStore, PairedEdge, PairedViewer
from enliven.keys.pairing import EdgePairing, Introduction, PairingError, ViewerPairing
from enliven.person import body_from_human_pose
from enliven.wire import convert, convert_characters, envelope, streams, topics
from enliven.wire import requests as asks
from enliven.wire.characters import CharacterMessage
from enliven.wire.envelope import MalformedMessageError
from enliven.wire.matches import message_to_board
from enliven.wire.posecode import PoseCodec
from enliven.wire.zmtp import GREETING, ZmtpError, ZmtpSession, make_frame
from enliven_edge.controls.panel_protocol import PanelKeys
from enliven_edge.sensors.streams.osc_port import unpack_osc
from enliven_edge.sensors.streams.rokoko_sensor import LZ4_START, unpack_rokoko
from enliven_edge.sensors.streams.tracker_sensor import TrackerSensor
from enliven_edge.sensors.streams.vmc_sensor import VmcSensor
from enliven_viewer.render.materials.paint import paint_keys, paint_surface
from enliven_viewer.render.surface import split_creases

HEAD = bytes([envelope.VERSION])
"""The byte in front of a message's value."""
REFUSALS = (MalformedMessageError, EnlivenError, ValueError)
"""Exceptions that receivers of messages expect."""
MAX_FRAME_BYTES = 4096
"""Limit of a frame in the handshake targets. The edge's own limits are higher."""
COMMAND = 4
"""Flag of a ZMTP command."""
RAW, HELLO, INITIATE, MESSAGE = range(4)
"""Kinds of steps in a CURVE conversation: plain bytes, or contents that are encrypted correctly."""


def wire_targets() -> list[Target]:
    """Returns the readers of this module."""
    conversations = tuple(_conversation_seeds())
    return [
        Target("wire stream", 2800, _stream_seeds(), _stream, (mutated, stream_tree, stream_tree), REFUSALS),
        Target("wire control", 1500, _control_seeds(), _control, (mutated, msgpack_after(1)), REFUSALS),
        Target("zmtp", 300, tuple(_zmtp_seeds()), _zmtp, (mutated,), (ZmtpError,)),
        Target("curve", 200, conversations, _curve, (mutated, _conversation_step), (ZmtpError, CurveError)),
        Target("pairing", 60, _introductions(), _pairing, (mutated, msgpack_tree), (PairingError,)),
        Target("key files", 200, tuple(_key_files()), _keys),
        Target("osc", 300, tuple(_osc_packets()), _osc),
        Target("rokoko", 300, tuple(_rokoko_packets()), _rokoko, (mutated, _rokoko_tree)),
        Target("panel", 100, _PANEL_SEEDS, _panel),
    ]


# Messages ----------------------------------------------------------------------------------------------


@cache
def _stream_seeds() -> tuple[bytes, ...]:
    """Returns typical messages of every topic, and one of each with the smallest values."""
    payloads = stream_payloads()
    payloads["status"] = msgspec.msgpack.encode(streams.StatusMessage("edge", 1, 2, 3, note="fine", fps=30.0))
    typical = [topic.encode() + b"\0" + HEAD + p for topic, p in payloads.items() if topic in topics.STREAMS]
    return (*typical, *(envelope.pack_stream(smallest(topic.type)) for topic in topics.STREAMS.values()))


@cache
def _control_seeds() -> tuple[bytes, ...]:
    """Returns typical requests and replies, and one of every class with the smallest values."""
    body = msgspec.msgpack.decode(stream_payloads()["character"])
    answer = {"id": 1, "body": {"type": "CharacterMessage", **body} if isinstance(body, dict) else body}
    typical = [msgspec.msgpack.encode(message) for message in requests()]
    least = [msgspec.msgpack.encode(asks.Request(7, smallest(kind))) for kind in asks.REQUESTS]
    return tuple(HEAD + each for each in (*typical, msgspec.msgpack.encode(answer), *least))


@cache
def _codec() -> PoseCodec:
    return PoseCodec(character())


def _stream(data: bytes, folder: Path) -> None:
    """Reads a stream message like a viewer: unpacks it, then converts it."""
    _, message = envelope.unpack_stream(data)
    match message:
        case streams.PoseMessage():
            pose = convert.message_to_pose(message, _codec())
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


def _control(data: bytes, folder: Path) -> None:
    for topic in (topics.REQUEST, topics.REPLY):
        try:
            reply = envelope.unpack_control(data, topic)
        except MalformedMessageError:
            continue
        body = getattr(reply, "body", None)
        if isinstance(body, CharacterMessage):
            received = convert_characters.message_to_character(body)
            PoseCodec(received)
            surface = split_creases(received.vertices, received.faces, keys=paint_keys(received))
            assert len(paint_surface(received, surface).rows) == len(surface.source)


# Handshakes --------------------------------------------------------------------------------------------


def _zmtp_seeds() -> Iterator[bytes]:
    """Yields conversations of peers without keys: a viewer's commands, and subscriptions."""
    ready = make_frame(b"\x05READY\x0bSocket-Type\0\0\0\x06DEALER\x08Identity\0\0\0\0", COMMAND)
    ping = make_frame(b"\x04PING\0\x0acontext", COMMAND)
    asked = [make_frame(b"", 1) + make_frame(each[:200]) for each in _control_seeds()[:3]]
    yield GREETING + ready + ping + b"".join(asked)
    subscribed = make_frame(b"\x09SUBSCRIBEpose", COMMAND) + make_frame(b"\x06CANCELpose", COMMAND)
    yield GREETING + ready + subscribed + make_frame(b"\x01status") + make_frame(bytes(300))
    yield GREETING[:12] + b"CURVE".ljust(20, b"\0") + bytes(32) + make_frame(b"\x05HELLO\1\0", COMMAND)


def _zmtp(data: bytes, folder: Path) -> None:
    """Feeds the bytes to both kinds of listening sockets, with and without keys, in pieces of any length."""
    refused = 0
    for kind in ("ROUTER", "PUB"):
        for curve in (None, _server()):
            session = ZmtpSession(kind, MAX_FRAME_BYTES, curve)
            step = 1 + (len(data) * 7 % 97)
            try:
                for at in range(0, len(data), step):
                    session.feed(data[at : at + step])
                    _take_all(session)
            except ZmtpError:
                refused += 1
            assert session.channel is None or session.channel.client is None, "a stranger is admitted"
    if refused == 4:
        raise ZmtpError("refused by all")


def _take_all(session: ZmtpSession) -> None:
    while (parts := session.read_message()) is not None:
        assert len(parts) <= 8 and sum(map(len, parts)) <= 2 * MAX_FRAME_BYTES
        session.answers.clear()


@cache
def _server() -> CurveServer:
    return CurveServer(EDGE, lambda public: public == VIEWER.public)


def _step(kind: int, content: bytes) -> bytes:
    """Returns one step of a conversation: its kind, the length of its content, and the content."""
    return struct.pack("<BH", kind, len(content)) + content


def _steps(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yields kind and content of the steps of a conversation."""
    at = 0
    while at + 3 <= len(data):
        kind, length = struct.unpack_from("<BH", data, at)
        yield kind % 4, data[at + 3 : at + 3 + length]
        at += 3 + length


def _conversation_seeds() -> Iterator[bytes]:
    """Yields conversations of a viewer with keys."""
    properties = b"\x0bSocket-Type\0\0\0\x06DEALER"
    greeted = _step(HELLO, bytes(64)) + _step(INITIATE, properties)
    yield greeted + _step(MESSAGE, b"\0" + _control_seeds()[0]) + _step(MESSAGE, b"\2\4PING\0\1abc")
    yield greeted + _step(MESSAGE, b"\1part") + _step(MESSAGE, b"\0rest") + _step(RAW, b"\4\3abc")
    yield _step(HELLO, b"") + _step(RAW, make_frame(b"\x05HELLO\1\0" + bytes(192), COMMAND))


def _conversation_step(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns a conversation with one step mutated, doubled or left out, and correct lengths."""
    steps = list(_steps(data))
    if not steps:
        return mutated(data, other, dice)
    at = dice.randrange(len(steps))
    kind, content = steps[at]
    change = dice.randrange(4)
    steps[at : at + 1] = (
        [(kind, mutated(content, other, dice)[:60_000])],
        [(dice.randrange(4), content)],
        [(kind, content)] * 2,
        [],
    )[change]
    return b"".join(_step(*each) for each in steps)


def _curve(data: bytes, folder: Path) -> None:
    """Acts as a viewer with valid keys that sends arbitrary contents, so that only the encrypted contents can
    be wrong.
    """
    session, client = ZmtpSession("ROUTER", MAX_FRAME_BYTES, _server()), Client()
    client.shared, welcome = bytes(32), b""
    session.feed(GREETING[:12] + b"CURVE".ljust(20, b"\0") + bytes(32))
    for kind, content in _steps(data):
        _take_all(session)
        if kind == RAW:
            session.feed(content)
        elif kind == HELLO:
            session.feed(make_frame(client.hello(content), COMMAND))
            session.answers.clear()
            session.read_message()
            welcome = bytes(session.answers[2:]) if session.answers[2:10] == b"\x07WELCOME" else welcome
        elif kind == INITIATE and welcome:
            # After a "!", the content also replaces the proof. Otherwise a correct proof precedes the
            # content.
            proof = b"" if content[:1] == b"!" else VIEWER.public + bytes(16) + client.vouch(welcome)
            session.feed(make_frame(client.initiate(welcome, plain=proof + content), COMMAND))
        elif kind == MESSAGE:
            session.feed(make_frame(client.message(content[1:], content[0] if content else 0)))
    _take_all(session)
    if not session.is_ready:
        raise ZmtpError("not admitted")


# Pairing and keys --------------------------------------------------------------------------------------


def _introductions() -> tuple[bytes, ...]:
    """Returns introductions as a viewer packs them, and bytes that are not a SPAKE2 message."""
    named = msgspec.msgpack.encode((bytes(range(32)), "a viewer", "perform"))
    return named, msgspec.msgpack.encode((bytes(32), "", "operate")), b"A" + bytes(32)


@cache
def _exchange() -> tuple[EdgePairing, bytes]:
    """Returns the edge's side of a pairing, and the key of boxes to it."""
    from enliven.keys import pairing

    viewer = ViewerPairing("123456")
    edge = EdgePairing("123456", viewer.message)
    viewer.encrypt_introduction(edge.message, Introduction(bytes(32), "viewer", "watch"))
    return edge, pairing._side_key(viewer._key, pairing._VIEWER)


def _pairing(data: bytes, folder: Path) -> None:
    """Sends the bytes as the content of a correct box, as the box, and, if they fit, as the first message."""
    edge, key = _exchange()
    with contextlib.suppress(PairingError):
        edge.decrypt_introduction(data)
        raise AssertionError("a box of a stranger was opened")
    if len(data) == 33:
        EdgePairing("123456", data)
        return
    learnt = edge.decrypt_introduction(bytes(SecretBox(key).encrypt(data)))
    assert len(learnt.public) == 32 and learnt.name.isprintable()


def _key_files() -> Iterator[bytes]:
    """Yields the three kinds of files in the folder of keys."""
    with tempfile.TemporaryDirectory() as folder:
        store = KeyStore(Path(folder))
        store.store_own(VIEWER)
        store.add_viewer(PairedViewer(VIEWER.public, "laptop", "perform"))
        store.add_edge(PairedEdge(EDGE.public, "stage", "127.0.0.1", 9001, "watch"))
        yield from (path.read_bytes() for path in sorted(Path(folder).rglob("*.toml")))


def _keys(data: bytes, folder: Path) -> None:
    """Reads the bytes as each kind of file."""
    store, refusals = KeyStore(folder / "keys"), []
    for place, read in (
        ("own", store.load_own_pair),
        ("viewers/a", store.load_viewers),
        ("edges/a", store.load_edges),
    ):
        path = folder / "keys" / f"{place}.toml"
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        path.write_bytes(data)
        path.chmod(0o600)
        try:
            read()
        except EnlivenError as error:
            refusals.append(error)
    if len(refusals) == 3:
        raise refusals[0]


# Motion of other programs, and panels ------------------------------------------------------------------


def _osc_packets() -> Iterator[bytes]:
    """Yields packets of VMC and of trackers: bundles, a bundle in a bundle, single messages."""
    place = (0.1, 1.0, 0.2, 0.0, 0.0, 0.0, 1.0)
    bones = OscBundleBuilder(IMMEDIATELY)
    for name in ("Hips", "Spine", "LeftLowerArm"):
        bones.add_content(build_msg("/VMC/Ext/Bone/Pos", [name, *place]))
    bones.add_content(build_msg("/VMC/Ext/OK", [1]))
    yield bones.build().dgram
    nested = OscBundleBuilder(IMMEDIATELY)
    nested.add_content(build_msg("/VMC/Ext/Root/Pos", ["root", *place]))
    nested.add_content(bones.build())
    yield nested.build().dgram
    trackers = OscBundleBuilder(IMMEDIATELY)
    for number, height in ((1, 1.0), (2, 1.45), ("head", 1.7)):
        trackers.add_content(build_msg(f"/tracking/trackers/{number}/position", [0.0, height, 0.1]))
    yield trackers.build().dgram
    yield build_msg("/types", [True, False, None, 2**40, 0.5, b"blob", "text", [1, [2.0]]]).dgram


def _osc(data: bytes, folder: Path) -> None:
    """Gives a packet to both sensors, as their UDP port does."""
    messages = unpack_osc(data)
    for sensor in _sensors():
        if sensor._store_motion(messages):
            for body in sensor._bodies():
                assert np.isfinite(body.joints).all()


@cache
def _sensors() -> tuple[VmcSensor, TrackerSensor]:
    sensors = VmcSensor(port=0), TrackerSensor(port=0)
    for sensor in sensors:
        sensor.close()
    return sensors


def _rokoko_packets() -> Iterator[bytes]:
    """Yields packets of Rokoko Studio: two actors, plain and compressed, and one of JSON v2."""
    turn = {"x": -0.5, "y": -0.5, "z": 0.5, "w": -0.5}
    body = {
        joint: {"position": {"x": 0.1, "y": 1.0, "z": -2}, "rotation": turn}
        for joint in ("hip", "leftUpperArm", "rightToe")
    }
    actors = [{"name": name, "meta": {"hasBody": True}, "body": body} for name in ("A", "B")]
    data = msgspec.json.encode({"version": "3,0", "fps": 60, "scene": {"timestamp": 0.1, "actors": actors}})
    yield data
    yield lz4.frame.compress(data)
    yield b'{"version":"2,0","timestamp":1,"trackers":[],"actors":[]}'


def _rokoko_tree(data: bytes, other: bytes, dice: Random) -> bytes:
    """Returns a packet with a mutated tree, compressed as before."""
    if not data.startswith(LZ4_START):
        return json_tree(data, other, dice)
    try:
        text = lz4.frame.LZ4FrameDecompressor().decompress(data, MOST_BYTES)
    except (RuntimeError, EOFError, MemoryError):  # mutated before
        return mutated(data, other, dice)
    return lz4.frame.compress(json_tree(text, other, dice))


def _rokoko(data: bytes, folder: Path) -> None:
    """Computes the bodies of a packet, as the sensor does."""
    for number, human in enumerate(unpack_rokoko(data), 1):
        assert np.isfinite(body_from_human_pose(human, number).joints).all()


_PANEL_SEEDS = (b"$enliven 1 P*8A1F\n$0001 0000*0000\n", b"$0002 1000*31C3\n$")
"""Lines of a panel. Their checksums may be wrong, because :func:`_panel` adds correct ones."""


def _panel(data: bytes, folder: Path) -> None:
    """Feeds the bytes unchanged, and again as lines with correct checksums."""
    import binascii

    keys = PanelKeys()
    keys.feed(data)
    for line in data.split(b"\n"):
        body = line.lstrip(b"$").rpartition(b"*")[0]
        for key in keys.feed(b"$%s*%04X\n" % (body, binascii.crc_hqx(body, 0))):
            assert key.isdecimal()
