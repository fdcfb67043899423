"""Tests of encoding and decoding messages, and that all other bytes are refused."""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enliven.document.character import Character, SkinWeights
from enliven.errors import InputError
from enliven.person.body import Body
from enliven.rotation import conjugate, multiply, normalized, to_rotation_vector
from enliven.wire import convert, convert_characters, envelope, quaternions, requests, scans, streams, topics
from enliven.wire.envelope import MalformedMessageError, OtherVersionError
from enliven.wire.posecode import PoseCodec
from enliven.wire.sockets import Endpoint, parse_endpoint

few = settings(max_examples=60, deadline=None)
EXAMPLES = [
    streams.PoseMessage("chair", 1, 2, 3, 4, 5, 6, b"abc"),
    streams.BodiesMessage(
        1,
        2,
        [
            streams.PackedBody(3, bytes(120), bytes(20)),
            streams.PackedBody(4, bytes(120), bytes(20), bytes(80), bytes(2), 1805),
        ],
    ),
    streams.CuesMessage("chair", "possessed", bytes(4), bytes(2), 1),
    streams.StatusMessage(
        "edge",
        1,
        2,
        3,
        note="fine",
        fps=30.0,
        health=[streams.HealthMessage("no frames", 2, 4, "No.", "Do.")],
    ),
    streams.CuesMessage("chair", "possessed", bytes(4), bytes(2), 7, 0, 1, [7, 9], b"\0\1"),
    streams.MatchesMessage(
        "spider", "choosing", 3, 7, 0, [streams.PackedMatch("2-1", 4, 1.5, b"\2\1", bytes(18))], 45, 0.5
    ),
    scans.ScanMessage(
        3, "scanning", "lost", 7, 30, 1.5, False, 2.5, 0.4, view=[0.0, 1.0, 2.0, 0.0, 0.5, 0.0]
    ),
    scans.ScanPieceMessage(3, (-1, 0, 2), 64, 0.008, bytes(18), b"\0\1\2", bytes(6), bytes(9)),
    streams.CallMessage("again", "left pedal"),
    streams.HeardMessage("voice", "puppet take it", True, "possess", "nobody is in view"),
    streams.VoiceMessage("missing", "no microphone", "Plug one in.", ["puppet take it"], ["possess"]),
    streams.PhysicsMessage("boxes", "missing", "mujoco is not installed", "Install it."),
    streams.CameraMessage([1.0, 0, 0, 0, 0, -1, 0, 1, 0, 0, 1, 0], [1.2, 1.2, 0.7, 0.5], 2, 1, b"\0\7"),
    streams.SizeMessage("chair", 1.5, 1),
    streams.StageMessage(5, [streams.Revision("chair", 2), streams.Revision("lamp", 1)]),
    streams.PropsMessage(5, bytes(4), b"\0\1", bytes(12), bytes(6), bytes(12), bytes(8), "2 of 2 down"),
    streams.HoldMessage(
        "chair", 5, "take over", 2, 4, "legs + hip", 3, [4, 7], '{"fade": 0.5}', [1, 0, 0, 2, 0], 0.9
    ),
]
ASKS = [
    requests.Hello("v", True),
    requests.GetState("chair"),
    requests.Possess("chair", None),
    requests.Possess("chair", 3, "legs"),
    requests.Possess("chair", 3, "left leg + hip + head", "extend"),
    requests.Release("chair"),
    requests.Release("chair", 3),
    requests.Smooth(3, 0.0),
    requests.Smooth(3),
    requests.Lock(True),
    requests.LearnRoom(),
    requests.Look((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    requests.Look((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (0.0, 1.0, 3.0)),
    requests.Browse("spider", -1),
    requests.Ping("v", 1),
    requests.PutCharacter("chair", 2, bytes(32), 5, True),
    requests.CharacterPart("chair", bytes(32), 3, b"abc"),
    requests.RemoveCharacter("chair"),
]
ANSWERS = [
    requests.Welcome(EXAMPLES[3], [streams.Revision("chair", 2)], [b"x"]),
    requests.Done("ok"),
    requests.Awaited(7),
    requests.Refused("no"),
    requests.Pong(1, 2),
]


def test_a_joints_name_is_carried_and_one_that_is_there_twice_is_refused() -> None:
    named = replace(chair(), names=("hip", "left knee", "\u9996"))
    message = convert_characters.character_to_message(named, 1)
    assert convert_characters.message_to_character(message).names == named.names
    long = convert_characters.character_to_message(replace(named, names=("hip", "knee", "x" * 200)), 1)
    assert long.names is None, "what receivers refuse is not sent"
    with pytest.raises(InputError, match="3 bones, but 2 different bone names"):
        convert_characters.message_to_character(msgspec.structs.replace(message, names=["a", "b", "b"]))


def chair(colours: bool = False) -> Character:
    rng = np.random.default_rng(0)
    weights = rng.uniform(size=(5, 4)).astype(np.float32)
    return Character(
        "chair",
        rng.normal(size=(5, 3)).astype(np.float32),
        np.array([[0, 1, 2], [2, 3, 4]], np.int32),
        SkinWeights(rng.integers(0, 3, (5, 4)).astype(np.uint16), weights),
        rng.normal(size=(3, 3)).astype(np.float32),
        np.array([[0, 1], [1, 2]], np.int32),
        "bones",
        rng.integers(0, 256, (5, 3)).astype(np.uint8) if colours else None,
    )


@pytest.mark.parametrize("message", EXAMPLES, ids=lambda m: type(m).__name__)
def test_streams_survive(message: object) -> None:
    topic, back = envelope.unpack_stream(envelope.pack_stream(message))
    assert back == message and topic.type is type(message)


@pytest.mark.parametrize("body", ASKS, ids=lambda m: type(m).__name__)
def test_requests_survive(body: object) -> None:
    request = requests.Request(7, body)
    assert envelope.unpack_control(envelope.pack_control(request), topics.REQUEST) == request


@pytest.mark.parametrize("body", ANSWERS, ids=lambda m: type(m).__name__)
def test_replies_survive(body: object) -> None:
    reply = requests.Reply(7, body)
    assert envelope.unpack_control(envelope.pack_control(reply), topics.REPLY) == reply


def test_message_table_is_complete() -> None:
    assert len({t.name for t in topics.TOPICS}) == len(topics.TOPICS)
    assert all(t.max_bytes < topics.MAX_STREAM_BYTES for t in topics.STREAMS.values())
    assert {type(m) for m in EXAMPLES} == {t.type for t in topics.STREAMS.values()}
    assert all(t.name.isascii() and "\0" not in t.name for t in topics.TOPICS)


def test_a_newer_program_may_append_fields() -> None:
    data = msgspec.msgpack.encode([*msgspec.to_builtins(EXAMPLES[3], builtin_types=(bytes,)), "later", 1])
    head = b"status\0" + bytes([envelope.VERSION])
    assert envelope.unpack_stream(head + data)[1] == EXAMPLES[3]
    request = {"id": 1, "body": {"type": "Hello", "viewer": "v", "colour": "red"}, "more": 1}
    data = bytes([envelope.VERSION]) + msgspec.msgpack.encode(request)
    assert envelope.unpack_control(data, topics.REQUEST).body == requests.Hello("v")


@pytest.mark.parametrize("colours", [False, True])
def test_a_character_survives(colours: bool) -> None:
    original = chair(colours)
    reply = requests.Reply(1, convert_characters.character_to_message(original, 4))
    back = envelope.unpack_control(envelope.pack_control(reply), topics.REPLY).body
    assert back.revision == 4
    read = convert_characters.message_to_character(back)
    for name in ("vertices", "faces", "pivots", "edges", "colours"):
        assert np.array_equal(getattr(read, name), getattr(original, name)), name
    assert np.array_equal(read.skin.indices, original.skin.indices)
    assert np.array_equal(read.skin.weights, original.skin.weights)
    assert (read.id, read.kind) == (original.id, original.kind)
    assert PoseCodec(read).decode(PoseCodec(original).encode(original.rest_pose()).data)[0].shape == (3, 3, 3)


def test_bodies_survive_within_half_a_millimetre() -> None:
    rng = np.random.default_rng(1)
    bodies = [Body(i, rng.uniform(-8, 8, (20, 3)), rng.uniform(size=20)) for i in range(3)]
    back = convert.message_to_bodies(convert.bodies_to_message(bodies, 5, 6))
    for a, b in zip(bodies, back, strict=True):
        assert a.id == b.id
        assert np.linalg.norm(a.joints - b.joints, axis=1).max() <= 0.5e-3
        assert np.abs(a.confidence - b.confidence).max() <= 0.5 / 255 + 1e-12


def test_body_survives_encoding() -> None:
    rng = np.random.default_rng(2)
    turns = normalized(rng.normal(size=(20, 4)))
    body = Body(1, np.zeros((20, 3)), np.ones(20), turns, np.array([0.25, 1.0]), 1.8042)
    bare = Body(2, np.zeros((20, 3)), np.ones(20))
    data = envelope.pack_stream(convert.bodies_to_message([body, bare], 0))
    back, empty = convert.message_to_bodies(envelope.unpack_stream(data)[1])
    away = np.linalg.norm(to_rotation_vector(multiply(conjugate(turns), back.orientations)), axis=1)
    assert away.max() <= quaternions.MAX_ROTATION_ERROR
    assert np.abs(back.contacts - body.contacts).max() <= 0.5 / 255 + 1e-12
    assert back.stature == pytest.approx(1.8042, abs=0.0005)
    assert (empty.orientations, empty.contacts, empty.stature) == (None, None, None)


def test_messages_of_older_programs_are_read() -> None:
    """The bytes were sent and recorded by version 0.1: arrays without the fields that were added later."""
    joints = np.arange(60).astype("<i2").tobytes()
    packed = b"\x93\x07\xc4\x78" + joints + b"\xc4\x14" + bytes(range(20))
    old = b"bodies\0\x01" + b"\x93\x05\x06\x91" + packed
    (body,) = convert.message_to_bodies(envelope.unpack_stream(old)[1])
    assert body.id == 7 and body.joints[19, 2] == 59 * convert.JOINT_STEP and body.confidence[2] == 2 / 255
    assert (body.orientations, body.contacts, body.stature) == (None, None, None)
    status = b"status\0\x01\x9c\xa4edge\x01\x02\x03\xa3oak\xa8tracking\xa0" + b"\xcb" + bytes(8)
    status += b"\xcb" + bytes(8) + b"\xcb" + bytes(8) + b"\x02\x00"
    read = envelope.unpack_stream(status)[1]
    assert (read.edge, read.phase, read.performers, read.health) == ("edge", "tracking", 2, [])


@pytest.mark.parametrize(
    "changes",
    [{"orientations": bytes(79)}, {"contacts": bytes(1)}, {"stature_mm": -1}, {"stature_mm": 10_001}],
)
def test_a_body_of_the_wrong_length_is_refused(changes) -> None:
    packed = msgspec.structs.replace(streams.PackedBody(3, bytes(120), bytes(20)))
    fields = {**msgspec.structs.asdict(packed), **changes}
    data = b"bodies\0\x01" + msgspec.msgpack.encode([1, 2, [list(fields.values())]])
    with pytest.raises(MalformedMessageError):
        envelope.unpack_stream(data)


def test_bodies_with_holes_go_with_no_confidence() -> None:
    body = Body(1, np.zeros((20, 3)), np.ones(20))
    body.joints[4, 1], body.joints[5, 0], body.confidence[6] = np.nan, 1e9, np.nan
    (back,) = convert.message_to_bodies(convert.bodies_to_message([body], 0))
    assert back.confidence[4] == 0 and back.confidence[6] == 0 and np.isfinite(back.joints).all()
    assert back.joints[5, 0] <= 16.0


def test_cues_survive_and_free_with_nodes_is_a_preview() -> None:
    message = convert.cues_to_message("chair", "free", np.array([3, 500]), np.array([0.5, 2.0]), None)
    nodes, strengths = convert.message_to_cues(message)
    assert message.state == "preview" and message.body == -1
    assert nodes.tolist() == [3, 500] and np.allclose(strengths, [0.5, 1.0], atol=1 / 255)
    with pytest.raises(InputError, match="flying"):
        convert.cues_to_message("chair", "flying", np.empty(0), np.empty(0))


@pytest.mark.parametrize(
    "change",
    [
        {"vertices": np.full((5, 3), np.nan, np.float32)},
        {"pivots": np.full((3, 3), np.inf, np.float32)},
        {"skin": SkinWeights(np.zeros((5, 4), np.uint16), np.full((5, 4), np.nan, np.float32))},
    ],
    ids=lambda c: next(iter(c)),
)
def test_a_character_with_bad_numbers_is_refused(change: dict) -> None:
    with pytest.raises(InputError, match="finite"):
        convert_characters.message_to_character(
            convert_characters.character_to_message(replace(chair(), **change), 1)
        )


def test_a_character_whose_indices_point_outside_is_refused() -> None:
    message = convert_characters.character_to_message(chair(), 1)
    for name in ("faces", "edges", "indices"):
        data = b"\xff\x7f" + getattr(message, name)[2:]
        with pytest.raises(InputError):
            convert_characters.message_to_character(msgspec.structs.replace(message, **{name: data}))


def test_a_character_too_large_for_the_wire_is_refused_before_it_is_sent() -> None:
    with pytest.raises(InputError, match="65 characters"):
        convert_characters.character_to_message(replace(chair(), id="x" * 65), 1)


@pytest.mark.parametrize("name", ["vertices", "faces", "indices", "weights", "pivots", "edges", "colours"])
@pytest.mark.parametrize("cut", [1, 4])
def test_array_lengths_must_match_the_counts(name: str, cut: int) -> None:
    values = msgspec.structs.asdict(convert_characters.character_to_message(chair(True), 1))
    values[name] = values[name][:-cut]
    data = {"id": 1, "body": {"type": "CharacterMessage", **values}}
    with pytest.raises(MalformedMessageError, match=name):
        envelope.unpack_control(bytes([envelope.VERSION]) + msgspec.msgpack.encode(data), topics.REPLY)


HEADS = {t.name: t.name.encode() + b"\0" + bytes([envelope.VERSION]) for t in topics.STREAMS.values()}
BAD = {
    "empty": b"",
    "no topic": b"\0\1\x90",
    "unknown topic": b"poses\0\1\x90",
    "no payload": b"pose\0",
    "no message": HEADS["pose"],
    "a topic without end": b"a" * 100,
    "not msgpack": HEADS["pose"] + b"\xc1",
    "huge array": HEADS["pose"] + b"\xdd\xff\xff\xff\xff",
    "huge bytes": HEADS["bodies"] + b"\x93\1\2\xdd\xff\xff\xff\xff",
    "huge string": HEADS["status"] + b"\x94\xdb\xff\xff\xff\xff",
    "deep": HEADS["pose"] + b"\x91" * 100_000,
    "deep map": HEADS["pose"] + b"\x98" + b"\x81\xa1a" * 60_000,
    "too long": HEADS["status"] + msgspec.msgpack.encode(["e", 1, 2, 3, "x" * 5000]),
    "not utf-8": HEADS["status"] + b"\x94\xa2\xff\xfe\1\2\3",
    "wrong type": HEADS["pose"] + msgspec.msgpack.encode(["chair", "1", 2, 3, 4, 5, 6, b""]),
    "empty id": HEADS["pose"] + msgspec.msgpack.encode(["", 1, 2, 3, 4, 5, 6, b""]),
    "long id": HEADS["pose"] + msgspec.msgpack.encode(["x" * 65, 1, 2, 3, 4, 5, 6, b""]),
    "negative": HEADS["pose"] + msgspec.msgpack.encode(["chair", -1, 2, 3, 4, 5, 6, b""]),
    "beyond 63 bits": HEADS["pose"] + msgspec.msgpack.encode(["chair", 1, 2, 3, 2**64 - 1, 5, 6, b""]),
    "short joints": HEADS["bodies"] + msgspec.msgpack.encode([1, 2, [[1, bytes(119), bytes(20)]]]),
    "many bodies": HEADS["bodies"] + msgspec.msgpack.encode([1, 2, [[1, bytes(120), bytes(20)]] * 33]),
    "cues of two lengths": HEADS["cues"] + msgspec.msgpack.encode(["chair", "free", bytes(4), bytes(3), 1]),
    "unknown state": HEADS["cues"] + msgspec.msgpack.encode(["chair", "flying", b"", b"", 1]),
    "nan": HEADS["status"] + msgspec.msgpack.encode(["e", 1, 2, 3, "", "w", "", math.nan]),
    "infinite": HEADS["status"] + msgspec.msgpack.encode(["e", 1, 2, 3, "", "w", "", math.inf]),
    "trailing bytes": HEADS["status"] + msgspec.msgpack.encode(["e", 1, 2, 3]) + b"\0",
}


@pytest.mark.parametrize("data", BAD.values(), ids=BAD.keys())
def test_malformed_streams_are_refused(data: bytes) -> None:
    with pytest.raises(MalformedMessageError):
        envelope.unpack_stream(data)


@few
@given(st.sampled_from(sorted(HEADS)), st.binary(max_size=200))
def test_noise_is_refused_or_is_a_message(topic: str, noise: bytes) -> None:
    for data in (noise, HEADS[topic] + noise):
        try:
            topic_found, message = envelope.unpack_stream(data)
        except MalformedMessageError:
            continue
        assert isinstance(message, topic_found.type)


@few
@given(st.sampled_from(EXAMPLES), st.data())
def test_cut_and_flipped_messages_never_raise_anything_else(message: object, data: st.DataObject) -> None:
    packed = bytearray(envelope.pack_stream(message))
    at = data.draw(st.integers(0, len(packed) - 1))
    with pytest.raises(MalformedMessageError):
        envelope.unpack_stream(bytes(packed[:at]))
    packed[at] ^= data.draw(st.integers(1, 255))
    try:
        envelope.unpack_stream(bytes(packed))
    except MalformedMessageError as error:
        assert error.kind and error.why


def test_other_version_is_distinguished_from_noise() -> None:
    data = envelope.pack_stream(EXAMPLES[3]).replace(b"status\0\1", b"status\0\7")
    with pytest.raises(OtherVersionError, match="version 7") as caught:
        envelope.unpack_stream(data)
    assert caught.value.version == 7


def test_each_kind_of_malformed_message_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    rejects = envelope.RejectCounter("a test")
    with caplog.at_level(logging.WARNING):
        for _ in range(50):
            rejects.add(MalformedMessageError("pose", "noise"))
            rejects.add(MalformedMessageError("status", "noise"))
    assert rejects.total == 100 and rejects.counts["pose"] == 50
    assert len(caplog.records) == 2


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("kiosk", Endpoint("kiosk", 5580, 5581)),
        ("10.0.0.2:6000", Endpoint("10.0.0.2", 6000, 6001)),
        ("tcp://10.0.0.2:6000:7000", Endpoint("10.0.0.2", 6000, 7000)),
        ("[::1]:6000", Endpoint("::1", 6000, 6001)),
        ("[::1]", Endpoint("::1", 5580, 5581)),
    ],
)
def test_addresses_are_parsed(text: str, expected: Endpoint) -> None:
    assert parse_endpoint(text) == expected
    assert parse_endpoint(str(expected)) == expected


@pytest.mark.parametrize("text", ["", ":5", "a:b", "a:0", "a:70000", "a:1:2:3", "a b", "a/b", "a:65535"])
def test_invalid_address_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="address"):
        parse_endpoint(text)


def test_cues_of_several_performers_come_through() -> None:
    nodes, strengths, owners = np.array([4, 2, 9]), np.array([1.0, 0.5, 0.2]), np.array([7, -1, 7])
    message = convert.cues_to_message("chair", "possessed", nodes, strengths, 7, 0, owners, 2)
    assert convert.message_to_owners(message).tolist() == [7, -1, 7] and message.held == 2
    plain = convert.cues_to_message("chair", "possessed", nodes, strengths, 7)
    assert convert.message_to_owners(plain).tolist() == [7, 7, 7] and plain.held is None


def test_more_performers_than_the_wire_names_do_no_harm() -> None:
    many = np.arange(100)
    message = convert.cues_to_message("chair", "possessed", many, np.ones(100), 0, 0, many, 100)
    topics_bytes = envelope.pack_stream(message)
    assert len(convert.message_to_owners(envelope.unpack_stream(topics_bytes)[1])) == 100


def test_messages_of_older_programs_keep_their_meaning() -> None:
    """Fields that were added later are missing: Possess took over by one performer, Release released
    everybody.
    """
    old = {"type": "Possess", "character": "chair", "body": 3, "parts": "legs"}
    asked = msgspec.convert(old, requests.Possess)
    assert asked == requests.Possess("chair", 3, "legs", "alone")
    assert msgspec.convert({"type": "Release", "character": "chair"}, requests.Release).body is None
    cues = msgspec.convert(["chair", "possessed", bytes(2), bytes(1), 3, 9], streams.CuesMessage)
    assert cues.held is None and cues.owners == b""


def test_cues_of_unknown_owner_are_refused() -> None:
    with pytest.raises(msgspec.ValidationError, match="owner"):
        msgspec.convert(["chair", "possessed", bytes(2), bytes(1), 3, 9, 1, [3], b"\1"], streams.CuesMessage)


@given(st.integers(0, 2**32 - 1))
def test_bodies_as_sent_are_those_that_arrive_and_are_sent_again_alike(seed: int) -> None:
    """A joint that is not finite arrives as the origin without confidence; at the edge it stays unknown."""
    random = np.random.default_rng(seed)
    joints, confidence = random.normal(0.0, 12.0, (20, 3)), random.uniform(-0.2, 1.2, 20)
    joints[random.integers(20)], confidence[random.integers(20)] = np.nan, np.nan
    sent = convert.round_to_wire([Body(3, joints, confidence, stature=float(random.uniform(0.5, 2.2)))])
    (arrived,) = convert.message_to_bodies(convert.bodies_to_message(sent, 1))
    is_known = np.isfinite(joints).all(1)
    assert (arrived.joints[is_known] == sent[0].joints[is_known]).all() and np.isnan(
        sent[0].joints[~is_known]
    ).all()
    assert (arrived.confidence[is_known] == sent[0].confidence[is_known]).all() and arrived.stature == sent[
        0
    ].stature
    resent = convert.round_to_wire([arrived])[0]
    assert (resent.joints == arrived.joints).all() and (resent.confidence == arrived.confidence).all()


@pytest.mark.parametrize(
    ("flags", "mode"),
    [
        ({}, "around"),
        ({"moved": True}, "moved"),
        ({"turned": True}, "turned"),
        ({"turned": True, "moved": True}, "turned"),
        ({"within": 1.5}, "near"),
        ({"person": True}, "person"),
    ],
)
def test_scan_flags_and_mode_mean_the_same(flags, mode) -> None:
    """An older viewer sends flags instead of a mode, and an older edge reads the flags."""
    old_request = {"type": "Scan", "do": "start", **flags}
    read = msgspec.convert(old_request, requests.Scan)
    assert read.mode == mode
    sent = requests.Scan("start", within=flags.get("within"), mode=requests.ScanMode(mode))
    decoded = msgspec.to_builtins(sent)
    assert decoded["mode"] == mode
    assert [name for name in ("moved", "turned", "person") if decoded[name]] == [mode] * (
        mode in ("moved", "turned", "person")
    )
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(sent), type=requests.Scan) == sent


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"person": True, "moved": True}, "only one mode, but moved and person"),
        ({"turned": True, "within": 1.5}, "only one mode, but near and turned"),
        ({"mode": "moved", "person": True}, "only one mode, but moved and person"),
        ({"mode": "near"}, "set within"),
        ({"mode": "sideways"}, "sideways"),
    ],
)
def test_contradictory_scan_modes_are_refused(fields, problem) -> None:
    with pytest.raises(msgspec.ValidationError, match=problem):
        msgspec.convert({"type": "Scan", "do": "start", **fields}, requests.Scan)
