"""Tests of the server side of ZMTP without sockets: messages do not depend on packet boundaries, noise is
refused.
"""

import itertools
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.wire.zmtp import GREETING, ZmtpError, ZmtpSession, make_frame

READY = make_frame(b"\x05READY\x0bSocket-Type" + struct.pack(">I", 6) + b"DEALER", 4)
TALK = (
    make_frame(b"one")
    + make_frame(b"two", 1)
    + make_frame(b"parts" * 100)
    + make_frame(b"\x04PING\0\0here", 4)
)
PUB_TALK = make_frame(b"\x09SUBSCRIBEpose", 4) + make_frame(b"\x01cues") + make_frame(b"\x06CANCELpose", 4)


def heard(session: ZmtpSession, chunks: list[bytes]) -> list[list[bytes]]:
    """Returns the messages in the bytes, which may arrive in any pieces."""
    messages = []
    for chunk in chunks:
        session.feed(chunk)
        while (parts := session.read_message()) is not None:
            if parts:
                messages.append(parts)
    return messages


def cut(data: bytes, places: list[int]) -> list[bytes]:
    edges = [0, *sorted(p % len(data) for p in places), len(data)]
    return [data[a:b] for a, b in itertools.pairwise(edges)]


@given(st.lists(st.integers(0, 10_000), max_size=40))
def test_bytes_say_the_same_however_they_are_cut(places):
    session = ZmtpSession("ROUTER", 1000)
    assert heard(session, cut(GREETING + READY + TALK, places)) == [[b"one"], [b"two", b"parts" * 100]]
    answer = bytes(session.answers)
    assert (
        answer.startswith(GREETING)
        and b"ROUTER" in answer
        and answer.endswith(make_frame(b"\x04PONGhere", 4))
    )


@given(st.lists(st.integers(0, 10_000), max_size=20))
def test_subscriptions_come_as_commands_or_as_messages(places):
    session = ZmtpSession("PUB", 64)
    assert heard(session, cut(GREETING + READY + PUB_TALK, places)) == [[b"\1pose"], [b"\1cues"], [b"\0pose"]]


@given(st.binary(max_size=300), st.sampled_from([b"", GREETING, GREETING + READY]))
def test_noise_is_refused_or_waited_for_and_nothing_else(noise, before):
    session = ZmtpSession("ROUTER", 100)
    try:
        messages = heard(session, [before + noise])
    except ZmtpError:
        return
    assert all(len(part) <= 100 for parts in messages for part in parts)


@pytest.mark.parametrize(
    "said",
    [
        b"GET / HTTP/1.1\r\n\r\n",
        GREETING[:10] + b"\x01" + GREETING[11:],
        GREETING.replace(b"NULL\0", b"CURVE"),
        GREETING + make_frame(b"a message first"),
        GREETING + make_frame(b"\x04PING\0\0", 4),
        GREETING + READY + struct.pack(">BQ", 2, 1 << 62),
        GREETING + READY + make_frame(bytes(101)),
        GREETING + READY + make_frame(b"x", 1) * 9,
        GREETING + READY + make_frame(b"x", 64),
    ],
)
def test_invalid_or_oversized_zmtp_closes_the_connection(said):
    with pytest.raises(ZmtpError):
        heard(ZmtpSession("ROUTER", 100), [said])
