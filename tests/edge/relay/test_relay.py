"""Tests of a relay over real sockets: late viewers, characters, clocks, restarts, keys, and requests."""

from __future__ import annotations

import contextlib
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pytest
import zmq
from message_values import message
from msgspec import inspect
from patience import TIMEOUT_S, wait_until

from enliven.document.character import Character, SkinWeights
from enliven.errors import InputError, ResourceError
from enliven.keys.client import ClientKeys
from enliven.keys.key_files import KeyStore, PairedEdge, PairedViewer
from enliven.wire import (
    POSE,
    REPLY,
    REQUESTS,
    SCAN,
    SCAN_PIECE,
    STAGE,
    Ask,
    CharacterMessage,
    Endpoint,
    GetState,
    Order,
    Refused,
    Release,
    Request,
    Revision,
    ScanMessage,
    ScanPieceMessage,
    StageMessage,
    StatusMessage,
    free_ports,
    make_socket,
    pack_control,
    pack_stream,
    unpack_control,
)
from enliven_edge.network.access import Access
from enliven_edge.network.publisher import Publisher
from enliven_edge.network.subscribers import Subscribers
from enliven_edge.relay.relay import Relay, relay_settings
from enliven_edge.relay.relayed_state import RelayedState
from enliven_viewer.link.edge_client import EdgeClient

STEADY = hypothesis.settings(database=None, derandomize=True)


def make_character(name: str = "chair", count: int = 8) -> Character:
    pivots = np.random.default_rng(count).normal(size=(count, 3)).astype(np.float32)
    skin = SkinWeights(np.zeros((count, 4), np.uint16), np.full((count, 4), 0.25, np.float32))
    return Character(name, pivots, np.array([[0, 1, 2]], np.int32), skin, pivots, np.zeros((0, 2), np.int32))


def open_edge(**options: Any) -> Publisher:
    return Publisher(**{"name": uuid.uuid4().hex[:10], "pose_port": 0, "control_port": 0, **options})


def open_relay(edge: Endpoint, access: Access | None = None, viewers: int = 100) -> Relay:
    return Relay(edge, relay_settings("relay", "127.0.0.1", 0, None, False), access, viewers)


def until(done: Callable[[], Any], *parts: Publisher | Relay | EdgeClient) -> None:
    """Runs the loops of all programs until a condition holds."""

    def step() -> None:
        for part in parts:
            part.poll(0) if isinstance(part, Relay) else part.poll()

    wait_until(done, step=step, interval=0.001)


@pytest.fixture
def edge() -> Iterator[Publisher]:
    with open_edge() as opened:
        opened.set_character(make_character())
        yield opened


@pytest.fixture
def relay(edge: Publisher) -> Iterator[Relay]:
    with open_relay(edge.endpoint) as opened:
        yield opened


@pytest.fixture
def viewer(relay: Relay) -> Iterator[EdgeClient]:
    opened = EdgeClient([relay.endpoint])
    yield opened
    opened.close()


def test_viewer_gets_characters_and_poses(edge: Publisher, relay: Relay, viewer: EdgeClient) -> None:
    until(lambda: "chair" in viewer.characters, edge, relay, viewer)
    rest = viewer.characters["chair"].rest_pose()
    edge.publish_pose(rest)
    until(lambda: viewer.latest(POSE), edge, relay, viewer)
    assert viewer.status is not None and viewer.status.edge == edge.name
    assert np.allclose(viewer.latest(POSE)["chair"].pose.positions, rest.positions, atol=1e-3)
    assert viewer.edges[0].role == "watch"


def test_late_viewer_gets_the_newest_message_of_each_latched_topic(
    edge: Publisher, relay: Relay, viewer: EdgeClient
) -> None:
    until(lambda: "chair" in viewer.characters, edge, relay, viewer)
    edge.publish(StageMessage(5, [Revision("chair", 1)]))
    edge.publish(ScanMessage(1, "scanning"))
    until(lambda: viewer.latest(STAGE) and viewer.latest(SCAN), edge, relay, viewer)
    late = EdgeClient([relay.endpoint])
    with contextlib.closing(late):
        until(lambda: late.latest(STAGE) and late.latest(SCAN), edge, relay, late)
        assert next(iter(late.latest(STAGE).values())).time_ns == 5


def test_pieces_of_an_ended_scan_are_not_kept() -> None:
    state, piece = RelayedState(), ScanPieceMessage(1, (1, 2, 3), 16, 0.01)
    state.status = StatusMessage("edge", 1, 0, 0)

    def latest() -> list[bytes]:
        answer = state.welcome("watch")
        assert answer is not None
        return answer.latest

    state.store_latched(SCAN_PIECE, piece, b"piece")
    state.store_latched(SCAN, ScanMessage(1, "scanning"), b"scan")
    assert latest() == [b"scan"], "another scan has begun"
    state.store_latched(SCAN_PIECE, piece, b"piece")
    state.store_latched(SCAN, ScanMessage(1, "paused"), b"scan")
    assert latest() == [b"piece", b"scan"]
    state.store_latched(SCAN, ScanMessage(1, "done"), b"scan")
    assert latest() == [b"scan"]


def test_added_changed_and_removed_characters_follow(
    edge: Publisher, relay: Relay, viewer: EdgeClient
) -> None:
    until(lambda: "chair" in viewer.characters, edge, relay, viewer)
    edge.set_character(make_character("lamp"))
    edge.set_character(make_character("chair", 12))
    until(
        lambda: "lamp" in viewer.characters and len(viewer.characters["chair"].pivots) == 12,
        *(edge, relay, viewer),
    )
    edge.remove_character("chair")
    until(lambda: set(viewer.characters) == {"lamp"}, edge, relay, viewer)
    replies = replies_to([GetState("chair"), GetState("lamp")], edge, relay)
    assert [type(reply.body) for reply in replies] == [Refused, CharacterMessage]


@pytest.mark.slow
def test_every_order_is_refused_with_a_clear_sentence(edge: Publisher, relay: Relay) -> None:
    until(lambda: relay.status is not None, edge, relay)
    orders = []
    for kind in REQUESTS:
        if issubclass(kind, Order):
            info = inspect.type_info(kind)
            assert isinstance(info, inspect.StructType)
            orders.append(hypothesis.find(message(info), lambda each: True, settings=STEADY))
    for reply in replies_to(orders, edge, relay):
        assert isinstance(reply.body, Refused)
        assert edge.name in reply.body.reason and "only watch" in reply.body.reason
        assert str(edge.endpoint) in reply.body.reason
    assert not edge.poll()


def replies_to(requests: Sequence[Ask], edge: Publisher, relay: Relay) -> list[Any]:
    """Sends requests to a relay over a new connection. Returns the replies in the same order."""
    replies: list[Any] = []
    socket = make_socket(zmq.Context.instance(), zmq.DEALER, 1 << 20, 64)
    with contextlib.closing(socket):
        socket.connect(relay.endpoint.control_address)
        for number, request in enumerate(requests, 1):
            socket.send(pack_control(Request(number, request)))
        until(lambda: [*_drain(socket, replies)] and len(replies) == len(requests), edge, relay)
    return sorted(replies, key=lambda reply: reply.id)


def _drain(socket: zmq.Socket[bytes], replies: list[Any]) -> list[Any]:
    while socket.poll(0):
        replies.append(unpack_control(socket.recv(), REPLY))
    return replies


def test_viewer_sees_the_refusal_of_its_order(edge: Publisher, relay: Relay, viewer: EdgeClient) -> None:
    until(lambda: "chair" in viewer.characters, edge, relay, viewer)
    answers: list[Any] = []
    viewer.ask(Release("chair"), answers.append)
    until(lambda: answers, edge, relay, viewer)
    assert "only watch" in answers[0].reason
    assert any("only watch" in notice.text for notice in viewer.take_notices())


def test_restarted_edge_is_followed(edge: Publisher) -> None:
    pose, control = free_ports()[:2]
    relay = open_relay(Endpoint("127.0.0.1", pose, control))
    viewer = EdgeClient([relay.endpoint])
    with relay, contextlib.closing(viewer):
        with open_edge(pose_port=pose, control_port=control) as first:
            first.set_character(make_character("first"))
            until(lambda: "first" in viewer.characters, first, relay, viewer)
        with open_edge(pose_port=pose, control_port=control) as second:
            second.set_character(make_character("second"))
            until(lambda: set(viewer.characters) == {"second"}, second, relay, viewer)


def test_relay_of_a_relay(edge: Publisher, relay: Relay) -> None:
    with open_relay(relay.endpoint) as outer:
        viewer = EdgeClient([outer.endpoint])
        with contextlib.closing(viewer):
            until(lambda: "chair" in viewer.characters, edge, relay, outer, viewer)


def test_damaged_messages_are_not_passed_on() -> None:
    intact = pack_stream(StageMessage(5, []))
    sent = [b"pose\0\1nonsense", b"unknown\0\1nonsense", intact]
    received: list[bytes] = []
    context: zmq.Context[Any] = zmq.Context.instance()
    socket = make_socket(context, zmq.SUB, 4096, 64)
    socket.subscribe(b"")
    streams = Subscribers("127.0.0.1", 0, "--port")
    relay = open_relay(Endpoint("127.0.0.1", streams.port, free_ports()[0]))
    with contextlib.closing(streams), relay, contextlib.closing(socket):
        socket.connect(relay.endpoint.stream_address)
        deadline = time.monotonic() + TIMEOUT_S
        while len(received) < 3:
            assert time.monotonic() < deadline, "the intact messages do not arrive"
            streams.poll()
            streams.send_all(sent)
            relay.poll()
            while socket.poll(0):
                received.append(socket.recv())
    assert set(received) == {intact}


def test_more_viewers_than_an_edge_accepts(edge: Publisher, relay: Relay) -> None:
    viewers = [EdgeClient([relay.endpoint]) for _ in range(20)]
    with contextlib.ExitStack() as stack:
        for viewer in viewers:
            stack.callback(viewer.close)
        until(lambda: all("chair" in v.characters for v in viewers), edge, relay, *viewers)
        until(lambda: relay.viewers == 20, edge, relay, *viewers)
        assert edge.viewers == 1, "the edge has one viewer: the relay"


def test_edge_and_relay_with_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The relay is a paired client of the edge, and a server with its own keys for its viewers."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "relay"))
    edge_store, relay_store = KeyStore(tmp_path / "edge"), KeyStore()
    edge_keys, relay_keys = edge_store.create_own_pair(), relay_store.create_own_pair()
    edge_store.add_viewer(PairedViewer(relay_keys.public, "relay", "watch"))
    edge = open_edge(access=Access("edge", edge_keys, edge_store))
    edge.set_character(make_character())
    relay_store.add_edge(
        PairedEdge(edge_keys.public, "edge", "127.0.0.1", edge.endpoint.control_port, "watch")
    )
    access = Access("relay", relay_keys, relay_store, highest="watch")
    with edge, open_relay(edge.endpoint, access) as relay:
        viewer = EdgeClient([relay.endpoint])
        with contextlib.closing(viewer):
            until(lambda: "chair" in viewer.characters, edge, relay, viewer)
            edge.publish_pose(viewer.characters["chair"].rest_pose())
            until(lambda: viewer.latest(POSE), edge, relay, viewer)
        stranger = make_socket(
            zmq.Context.instance(), zmq.SUB, 1 << 20, 10, ClientKeys(relay_keys.public, edge_keys)
        )
        with contextlib.closing(stranger):
            stranger.setsockopt(zmq.SUBSCRIBE, b"")
            stranger.connect(relay.endpoint.stream_address)
            end = time.monotonic() + 0.7
            while time.monotonic() < end:
                edge.poll()
                relay.poll(1)
            assert not stranger.poll(0), "a viewer that is not paired with the relay receives nothing"


def test_mistaken_addresses_are_refused(edge: Publisher) -> None:
    with pytest.raises(InputError, match="relay itself"):
        Relay(Endpoint("127.0.0.1", 5590, 5591), relay_settings("r", "127.0.0.1", 5590, None, False))
    with pytest.raises(InputError, match="no keys"):
        Relay(edge.endpoint, relay_settings("r", "0.0.0.0", 0, None, False))
    with pytest.raises(ResourceError, match="in use"):
        Relay(edge.endpoint, relay_settings("r", "127.0.0.1", edge.endpoint.pose_port, 0, False))
