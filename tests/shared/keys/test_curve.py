"""Tests of the server side of CURVE with a byte-level client: every deviation ends the connection.

Tests in tests/system use libzmq as the client.
"""

from __future__ import annotations

import contextlib
import itertools

import pytest
from curve_client import EDGE, STRANGER, VIEWER, Client
from hypothesis import given
from hypothesis import strategies as st

from enliven.keys.curve import OVERHEAD_BYTES, CurveChannel, CurveError, CurveServer
from enliven.wire.zmtp import CURVE_GREETING, GREETING, ZmtpError, ZmtpSession, make_frame

SERVER = CurveServer(EDGE, lambda public: public == VIEWER.public)
COMMAND = 4


def connected(client: Client, server: CurveServer = SERVER) -> CurveChannel:
    channel = CurveChannel(server)
    ready = channel.answer(client.initiate(channel.answer(client.hello(), b"")), b"props")
    assert ready.startswith(b"\x05READY")
    return channel


def test_messages_are_sealed_both_ways() -> None:
    client = Client()
    channel = connected(client)
    assert channel.is_ready and channel.client == VIEWER.public
    assert channel.decrypt(client.message(b"hello", 2)) == (2, b"hello")
    sealed = channel.encrypt(b"poses", 1)
    assert len(sealed) == len(b"poses") + OVERHEAD_BYTES and b"poses" not in sealed
    assert client.decrypt(sealed) == b"\x01poses"


def test_each_connection_has_its_own_key() -> None:
    client, channels = Client(), [CurveChannel(SERVER), CurveChannel(SERVER)]
    shared = []
    for channel in channels:
        channel.answer(client.initiate(channel.answer(client.hello(), b"")), b"")
        shared.append(client.shared)
    assert shared[0] != shared[1]


@pytest.mark.parametrize(
    ("client", "status"),
    [(Client(STRANGER), b"400"), (Client(VIEWER, STRANGER.public), b"500")],
    ids=["a stranger", "another edge"],
)
def test_strangers_and_viewers_of_another_edge_get_a_status(client: Client, status: bytes) -> None:
    channel = CurveChannel(SERVER)
    with pytest.raises(CurveError) as error:
        channel.answer(client.initiate(channel.answer(client.hello(), b"")), b"")
    assert error.value.status == status and not channel.is_ready


def test_a_vouch_for_another_connection_is_refused() -> None:
    client, channel = Client(), CurveChannel(SERVER)
    with pytest.raises(CurveError, match="vouch"):
        channel.answer(client.initiate(channel.answer(client.hello(), b""), vouched=b"x" * 32), b"")


def test_repeated_reordered_and_changed_messages_are_refused() -> None:
    client = Client()
    channel = connected(client)
    first, second = client.message(b"one"), client.message(b"two")
    assert channel.decrypt(second) == (0, b"two")
    for again in (first, second):
        with pytest.raises(CurveError, match="received twice"):
            channel.decrypt(again)
    three = bytearray(client.message(b"three"))
    three[-1] ^= 1
    with pytest.raises(CurveError, match="changed"):
        channel.decrypt(bytes(three))


@given(st.integers(0, 199), st.integers(1, 255))
def test_every_changed_byte_of_hello_is_noticed_or_harmless(place: int, change: int) -> None:
    client, channel = Client(), CurveChannel(SERVER)
    hello = bytearray(client.hello())
    hello[place] ^= change
    if 8 <= place < 80:  # padding
        assert channel.answer(bytes(hello), b"")
        return
    with pytest.raises(CurveError):
        channel.answer(bytes(hello), b"")


@given(st.data())
def test_every_changed_byte_of_initiate_is_noticed(data: st.DataObject) -> None:
    client, channel = Client(), CurveChannel(SERVER)
    initiate = bytearray(client.initiate(channel.answer(client.hello(), b"")))
    initiate[data.draw(st.integers(0, len(initiate) - 1))] ^= data.draw(st.integers(1, 255))
    with pytest.raises(CurveError):
        channel.answer(bytes(initiate), b"")
    assert not channel.is_ready


def session_of(client: Client, kind: str = "ROUTER", most: int = 100) -> ZmtpSession:
    """Returns a session after the handshake."""
    session = ZmtpSession(kind, most, SERVER)  # type: ignore[arg-type]
    take(session, CURVE_GREETING + make_frame(client.hello(), COMMAND))
    answers = bytes(session.answers)
    welcome = answers[answers.index(b"\x07WELCOME") :]
    take(session, make_frame(client.initiate(welcome), COMMAND))
    assert session.is_ready
    session.answers.clear()
    return session


def take(session: ZmtpSession, *chunks: bytes) -> list[list[bytes]]:
    messages = []
    for chunk in chunks:
        session.feed(chunk)
        while (parts := session.read_message()) is not None:
            if parts:
                messages.append(parts)
    return messages


@given(st.lists(st.integers(0, 10_000), max_size=20))
def test_sealed_talk_says_the_same_however_it_is_cut(places: list[int]) -> None:
    client = Client()
    session = session_of(client)
    talk = [
        client.message(b"one"),
        client.message(b"two", 1),
        client.message(b"p" * 90),
        client.message(b"\x04PING\0\0here", 2),
    ]
    data = b"".join(map(make_frame, talk))
    edges = [0, *sorted(p % len(data) for p in places), len(data)]
    chunks = [data[a:b] for a, b in itertools.pairwise(edges)]
    assert take(session, *chunks) == [[b"one"], [b"two", b"p" * 90]]
    assert client.decrypt(bytes(session.answers)[2:]) == b"\x02\x04PONGhere"


def test_sealed_subscriptions_come_as_commands_or_as_messages() -> None:
    client = Client()
    session = session_of(client, "PUB", 64)
    talk = [
        client.message(b"\x09SUBSCRIBEpose", 2),
        client.message(b"\x01cues"),
        client.message(b"\x06CANCELpose", 2),
    ]
    assert take(session, *map(make_frame, talk)) == [[b"\1pose"], [b"\1cues"], [b"\0pose"]]


def test_a_session_with_keys_refuses_plain_and_long_frames() -> None:
    for frame in (make_frame(b"plain text" * 5), make_frame(b"\x04PING\0\0", COMMAND)):
        with pytest.raises(ZmtpError):
            take(session_of(Client()), frame)
    client = Client()
    session = session_of(client)
    with pytest.raises(ZmtpError, match="the limit is 133"):
        take(session, make_frame(client.message(b"x" * 101)))


def test_streams_are_for_peers_with_keys_and_requests_also_for_those_that_want_to_pair() -> None:
    with pytest.raises(ZmtpError, match="another security mechanism"):
        take(ZmtpSession("PUB", 100, SERVER), GREETING)
    session = ZmtpSession("ROUTER", 100, SERVER)
    assert session.answers == GREETING[:12], "its mechanism follows that of the peer"
    ready = make_frame(b"\x05READY", COMMAND)
    assert take(session, GREETING + ready + make_frame(b"may I pair")) == [[b"may I pair"]]
    assert session.channel is None and bytes(session.answers).startswith(GREETING)
    with pytest.raises(ZmtpError, match="another security mechanism"):
        take(ZmtpSession("ROUTER", 100), CURVE_GREETING)


@given(st.binary(max_size=400), st.booleans())
def test_noise_after_the_greeting_is_refused_or_waited_for(noise: bytes, hello: bool) -> None:
    session = ZmtpSession("ROUTER", 100, SERVER)
    before = make_frame(Client().hello(), COMMAND) if hello else b""
    with contextlib.suppress(ZmtpError):
        assert take(session, CURVE_GREETING + before + noise) == []
    assert not session.is_ready
