"""Tests that every message refuses values outside the declared ranges, and that accepted values are read
unchanged.
"""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from message_values import encode_unchecked, fields_of, invalid_values, reachable_messages, valid_values
from msgspec import inspect

from enliven.document import ArapSettings, Character, SkinWeights
from enliven.errors import InputError
from enliven.wire import REQUESTS, TOPICS, envelope, requests, scans, streams, topics
from enliven.wire.envelope import MalformedMessageError, check_character, check_request, pack_checked

STREAM_KINDS = [topic.type for topic in TOPICS if topic.pattern == "stream"]
ANSWERS = [*requests.Answer.__args__]
KINDS = reachable_messages([*STREAM_KINDS, *REQUESTS, *ANSWERS])
few = settings(max_examples=4, deadline=None, phases=[Phase.explicit, Phase.generate])


def strategy(kind: type) -> st.SearchStrategy:
    info = inspect.type_info(kind)
    return valid_values(info)


@pytest.mark.parametrize("name", KINDS)
@few
@given(st.data())
def test_accepted_values_survive_encoding(name: str, data: st.DataObject) -> None:
    kind = KINDS[name]
    message = data.draw(strategy(kind))
    back = msgspec.msgpack.decode(msgspec.msgpack.encode(message), type=kind)
    assert back == message and msgspec.msgpack.encode(back) == msgspec.msgpack.encode(message)
    if kind in STREAM_KINDS:
        try:
            packed = pack_checked(message)
        except MalformedMessageError as error:
            assert "are allowed" in error.why
        else:
            assert envelope.unpack_stream(packed)[1] == message
    elif kind in REQUESTS:
        check_request(message)
        asked = envelope.pack_control(requests.Request(1, message))
        assert envelope.unpack_control(asked, topics.REQUEST).body == message
    elif kind in ANSWERS:
        answer = envelope.pack_control(requests.Reply(1, message))
        assert envelope.unpack_control(answer, topics.REPLY).body == message
        assert envelope.reply_number(answer) == 1


@pytest.mark.parametrize("name", KINDS)
@settings(few, max_examples=1)
@given(st.data())
def test_each_field_out_of_its_range_is_refused_at_both_doors(name: str, data: st.DataObject) -> None:
    kind = KINDS[name]
    example = data.draw(strategy(kind))
    for field in fields_of(kind):
        for value in invalid_values(field.type):
            with pytest.raises(msgspec.MsgspecError):
                msgspec.msgpack.decode(encode_unchecked(example, **{field.name: value}), type=kind)
            try:
                wrong = msgspec.structs.replace(example, **{field.name: value})
            except (TypeError, ValueError):
                continue
            if kind in STREAM_KINDS:
                with pytest.raises(MalformedMessageError):
                    pack_checked(wrong)
            elif kind in REQUESTS:
                with pytest.raises(InputError) as error:
                    check_request(wrong)
                assert "Expected" not in error.value.what and "$" not in error.value.what


@pytest.mark.parametrize("number", [0, 1, 127, 128, 255, 256, 65_535, 65_536, 2**32 - 1, 2**32, 2**53])
def test_the_number_of_a_reply_is_read_without_the_rest(number: int) -> None:
    packed = envelope.pack_control(requests.Reply(number, requests.Done("x" * 300)))
    assert envelope.reply_number(packed) == number
    assert envelope.reply_number(packed[:20]) == number


@given(st.binary(max_size=24))
def test_noise_has_no_number(noise: bytes) -> None:
    for data in (noise, b"\1" + noise, b"\1\x82\xa2id" + noise):
        try:
            assert isinstance(envelope.reply_number(data), int)
        except MalformedMessageError as error:
            assert error.why


@pytest.mark.parametrize("name", ["a\ud800b", "\udcff"])
def test_text_that_cannot_be_encoded_is_refused(name: str) -> None:
    """Such characters occur in file names of other encodings."""
    with pytest.raises(MalformedMessageError):
        pack_checked(streams.SizeMessage(name, 1.0))
    with pytest.raises(InputError, match="cannot be sent"):
        check_request(requests.GetState(name))
    with pytest.raises(InputError, match="cannot be sent"):
        check_character(replace(soft(), id=name))
    with pytest.raises(MalformedMessageError):
        pack_checked(streams.SizeMessage("chair", 1.0, 2**70))


def soft(**surface: float) -> Character:
    """Returns a character with control points and the given settings of its surface."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    skin = SkinWeights(np.zeros((3, 4), np.uint16), np.tile(np.float32([1, 0, 0, 0]), (3, 1)))
    pivots, edges = vertices[:2], np.array([[0, 1]], np.int32)
    held, own = np.array([1], np.int32), replace(ArapSettings(), **surface)
    return Character(
        "soft",
        vertices,
        np.array([[0, 1, 2]], np.int32),
        skin,
        pivots,
        edges,
        "points",
        None,
        held,
        None,
        own,
    )


@pytest.mark.parametrize(
    ("surface", "why"),
    [
        ({"iterations": 0}, "surface.iterations is out of its range (>= 1)"),
        ({"hold": float("nan")}, "surface.hold is out of its range"),
        ({"coarse_above": 99}, "surface.coarse_above is out of its range (>= 100)"),
        ({"guide_vertices": 0}, "surface.guide_vertices is out of its range (>= 20)"),
        ({"follow": -0.1}, "surface.follow is out of its range (>= 0.0)"),
    ],
)
def test_a_character_below_its_minimum_is_refused_with_the_field_and_the_range(
    surface: dict, why: str
) -> None:
    check_character(soft())
    check_character(soft(most_stretch=float("inf")))  # an infinite limit is sent as the largest one
    with pytest.raises(InputError) as error:
        check_character(soft(**surface))
    assert why in error.value.what and error.value.where == "character 'soft'" and error.value.remedy


def test_ranges_between_fields_hold_too() -> None:
    box = [0.0, 1.0, 0.0, 1.0, 0.5, 1.0]
    with pytest.raises(InputError, match="lowest corner is larger"):
        check_request(_scan(box))
    piece = {
        "number": 1,
        "place": (0, 0, 0),
        "side": 8,
        "step": 0.01,
        "vertices": bytes(18),
        "seen": bytes(3),
    }
    assert scans.ScanPieceMessage(**piece, faces=bytes([0, 0, 1, 0, 2, 0])).faces
    with pytest.raises(ValueError, match="the block has 3 vertices"):
        scans.ScanPieceMessage(**piece, faces=bytes([0, 0, 1, 0, 3, 0]))
    with pytest.raises(MalformedMessageError):
        pack_checked(streams.SizeMessage("chair", 0.0))


def _scan(box: list[float]) -> requests.Scan:
    """Returns a request with a box that its class refuses, as sent by a program without these checks."""
    scan = requests.Scan("done", box=[0.0] * 6, stage_from_scan=[0.0] * 12)
    scan.box[:] = box
    return scan
