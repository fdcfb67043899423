"""Tests that a malicious edge cannot fill a viewer's memory, stop its drawing, or write to the terminal."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterator

import msgspec
import numpy as np
import pytest
import zmq
from patience import TIMEOUT_S
from zmq_contexts import make_context

from enliven.health import Severity
from enliven.wire import Endpoint, Smooth, characters, requests, scans, streams, topics
from enliven.wire.envelope import pack_control, pack_stream
from enliven_viewer.link import edge_characters, edge_connection, received_values
from enliven_viewer.link import requests as link_requests
from enliven_viewer.link.bounded_containers import BoundedQueue, NewestValues
from enliven_viewer.link.edge_characters import MAX_UNKNOWN_CHARACTERS, MAX_UNREAD_BYTES
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.playback.document import Document

from ..shared.test_logs_escaped import EVIL, is_safe

NOISE = os.urandom(250_000)


class HostileEdge:
    """Raw sockets in place of an edge. It sends each viewer a list of characters, and then arbitrary
    messages.
    """

    def __init__(self) -> None:
        self.context = make_context()
        self.pub, self.router = self.context.socket(zmq.PUB), self.context.socket(zmq.ROUTER)
        self.pub.setsockopt(zmq.SNDHWM, 100_000)
        ports = [each.bind_to_random_port("tcp://127.0.0.1") for each in (self.pub, self.router)]
        self.link = EdgeClient([Endpoint("127.0.0.1", *ports)])
        self.status = streams.StatusMessage("hostile", 1, 1, time.time_ns())
        self.names = ["chair"]
        self.viewers: set[bytes] = set()
        self.answer: Callable[[requests.Ask], requests.Answer | None] = lambda body: None

    def turn(self) -> None:
        """Answers requests, announces itself, and lets the viewer poll."""
        while self.router.poll(0):
            viewer, data = self.router.recv_multipart()
            self.viewers.add(viewer)
            asked = msgspec.msgpack.decode(data[1:])
            revisions = [streams.Revision(name, 3) for name in self.names]
            own = self.answer(asked["body"])
            body = own or requests.Welcome(self.status, revisions)
            self.router.send_multipart([viewer, pack_control(requests.Reply(asked["id"], body))])
        self.pub.send(pack_stream(self.status))
        self.link.poll()

    def until(self, done: Callable[[], object]) -> None:
        deadline = time.monotonic() + TIMEOUT_S
        while not done():
            assert time.monotonic() < deadline, "it never came to be"
            self.turn()
            time.sleep(0.001)

    def close(self) -> None:
        self.link.close()
        self.context.destroy(linger=0)


@pytest.fixture
def edge() -> Iterator[HostileEdge]:
    started = HostileEdge()
    started.until(lambda: started.link.edges[0].characters.wanted)
    yield started
    started.close()


def held_bytes(edge: HostileEdge) -> int:
    """Returns the number of bytes that the viewer counts for all data it stores."""
    own = edge.link.edges[0]
    received = [*own.values.inbox.values(), *own.values.latest.values()]
    kept = [*received, own.characters.waiting, own._unsure]
    return sum(each.bytes for each in kept)


FLOODS: dict[str, Callable[[int], object]] = {
    "cue names": lambda k: streams.CuesMessage(f"name {k}", "possessed", bytes(200), bytes(100), 1, k),
    "size names": lambda k: streams.SizeMessage(f"name {k}", 1.5),
    "hold names": lambda k: streams.HoldMessage(f"name {k}", k, "join", settings="x" * 2000),
    "match names": lambda k: streams.MatchesMessage(f"name {k}", "off"),
    "pose names": lambda k: streams.PoseMessage(f"name {k}", 3, 1, k, k, 0, 0, NOISE[:500]),
}


@pytest.mark.parametrize("flood", FLOODS.values(), ids=FLOODS.keys())
def test_names_that_the_edge_does_not_list_are_kept_for_a_few_only(
    edge: HostileEdge, flood: Callable[[int], object]
) -> None:
    feed, document = EdgeFeed(edge.link), Document()
    for start in range(0, 3000, 300):
        for number in range(start, start + 300):
            edge.pub.send(pack_stream(flood(number)))
        edge.turn()
        feed.poll(document)
    edge.until(lambda: edge.link.edges[0].health().malformed > 1000)
    own = edge.link.edges[0]
    assert len(own.characters.unknown) <= MAX_UNKNOWN_CHARACTERS
    assert len(own._sequences) <= MAX_UNKNOWN_CHARACTERS
    assert max((len(each) for each in own.values.latest.values()), default=0) <= MAX_UNKNOWN_CHARACTERS
    document.timeline.add_bodies(1, [])
    moment = document.timeline.find_moment(1)
    assert moment is not None and len(moment.cues) <= MAX_UNKNOWN_CHARACTERS


def test_poses_of_noise_that_wait_for_their_character_are_bounded(edge: HostileEdge) -> None:
    for number in range(300):
        edge.pub.send(pack_stream(streams.PoseMessage("chair", 3, 1, number, number, 0, 0, NOISE)))
        if number % 20 == 0:
            edge.turn()
    waiting = edge.link.edges[0].characters.waiting
    edge.until(lambda: any(message.sequence == 299 for message, _ in waiting))
    assert MAX_UNREAD_BYTES / 2 < held_bytes(edge) < 1.2 * MAX_UNREAD_BYTES


def test_memory_of_an_endless_scan_is_bounded(edge: HostileEdge, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("_MAX_STORED_BYTES", "_MAX_NEWEST_BYTES"):
        monkeypatch.setattr(received_values, name, 1_000_000)
    for number in range(200):
        piece = scans.ScanPieceMessage(1, (number, 0, 0), 8, 0.01, NOISE[:18_000], NOISE[:3000])
        edge.pub.send(pack_stream(piece))
    edge.until(lambda: "199 0 0" in edge.link.latest(topics.SCAN_PIECE))
    assert len(edge.link.latest(topics.SCAN_PIECE)) < 60 and held_bytes(edge) < 2_200_000
    assert 0 < len(edge.link.take(topics.SCAN_PIECE)) < 60 and held_bytes(edge) < 1_100_000


def test_unrequested_replies_end_the_connection(edge: HostileEdge, monkeypatch: pytest.MonkeyPatch) -> None:
    decoded: list[int] = []
    real = link_requests.unpack_control
    monkeypatch.setattr(
        link_requests, "unpack_control", lambda data, topic: decoded.append(len(data)) or real(data, topic)
    )
    monkeypatch.setattr(link_requests, "_RECONNECT_DELAY_S", 0.2)
    big = pack_control(requests.Reply(99_999, requests.Welcome(edge.status, [], [NOISE] * 4)))
    (viewer,) = edge.viewers
    for _ in range(8):
        edge.router.send_multipart([viewer, big])
    replies: list[object] = []
    edge.answer = lambda body: requests.Done() if body["type"] == "Smooth" else None

    def ask_until(done: Callable[[object], bool]) -> None:
        def ask_again() -> bool:
            edge.link.ask(Smooth(1, 1.0), replies.append)
            return any(map(done, replies))

        edge.until(ask_again)

    ask_until(lambda reply: isinstance(reply, requests.Refused) and "no edge answers" in reply.reason)
    assert edge.link.edges[0].health().malformed >= 4 and max(decoded, default=0) < len(big)
    replies.clear()
    ask_until(lambda reply: reply == requests.Done())


@pytest.mark.parametrize("forgotten", ["timeout", "restart"])
def test_late_reply_is_not_a_fault(edge: HostileEdge, forgotten: str) -> None:
    own, replies = edge.link.edges[0], list[object]()
    edge.answer = lambda body: requests.Done() if body["type"] == "Smooth" else None
    before = own.health().malformed
    assert own.request(Smooth(1, 1.0), 0.0 if forgotten == "timeout" else TIMEOUT_S, replies.append)
    if forgotten == "restart":
        edge.status = msgspec.structs.replace(edge.status, instance=2)
        edge.pub.send(pack_stream(edge.status))
    deadline = time.monotonic() + TIMEOUT_S
    while not replies and time.monotonic() < deadline:
        edge.link.poll()
    assert replies == [None], "the viewer no longer waits for the reply"
    # The late reply arrives before the reply to the second request.
    assert own.request(Smooth(2, 1.0), TIMEOUT_S, replies.append)
    edge.until(lambda: len(replies) == 2)
    assert replies[1] == requests.Done() and own.health().malformed == before


@pytest.mark.slow
def test_a_poll_ends_in_bounded_time_under_a_flood(edge: HostileEdge) -> None:
    message = pack_stream(streams.BodiesMessage(1, 2, [streams.PackedBody(3, bytes(120), bytes(20))] * 20))
    longest = []
    for _ in range(40):
        for _ in range(400):
            edge.pub.send(message)
        start = time.thread_time()
        edge.link.poll()
        longest.append(time.thread_time() - start)
    assert sorted(longest)[-3] < 4 * (edge_connection.POLL_BUDGET_S + link_requests.POLL_BUDGET_S)


def test_a_character_that_was_not_asked_for_or_does_not_fit_is_not_kept(
    edge: HostileEdge, monkeypatch: pytest.MonkeyPatch
) -> None:
    def character(name: str) -> characters.CharacterMessage:
        corners = np.eye(3, dtype="<f4").tobytes()
        faces, skin = np.array([0, 1, 2], "<i4").tobytes(), np.tile(np.float32([1, 0, 0, 0]), (3, 1))
        return characters.CharacterMessage(
            *(name, 3, "graph", 3, 1, 1, 0, corners, faces, bytes(24), skin.tobytes(), bytes(12), b"")
        )

    edge.names = ["chair", "lamp", "sofa"]
    sizes = edge_characters.count_bytes(character("x"))
    monkeypatch.setattr(edge_characters, "_MAX_CHARACTER_BYTES", 2 * sizes)
    edge.status = msgspec.structs.replace(edge.status, revision=2)
    edge.answer = lambda body: character(body["character"]) if body["type"] == "GetState" else None
    notices: list[str] = []

    def told() -> bool:
        notices.extend(notice.text for notice in edge.link.take_notices())
        return any("some are not shown" in text for text in notices)

    edge.until(told)
    assert len(edge.link.characters) == 2
    monkeypatch.setattr(edge_characters, "_MAX_CHARACTER_BYTES", 10 * sizes)
    answered: list[str] = []

    def answer_with_stranger(body: requests.Ask) -> requests.Answer | None:
        if body["type"] != "GetState":
            return None
        answered.append(body["character"])
        return character("a stranger")

    edge.names.append("stool")
    edge.status = msgspec.structs.replace(edge.status, revision=3)
    edge.answer = answer_with_stranger
    # The viewer asks again after it has received the wrong character.
    edge.until(lambda: answered.count("stool") == 2)
    assert len(edge.link.characters) == 2


def test_containers_keep_the_newest_within_their_limits() -> None:
    queue, newest = BoundedQueue[int](4, 100), NewestValues(3, 100)
    for number in range(10):
        queue.append(number, 30)
        newest.set_newest(str(number % 5), number, 10)
    assert list(queue) == [7, 8, 9] and queue.bytes == 90 and dict(newest) == {"2": 7, "3": 8, "4": 9}
    queue.append(10, 1000)
    newest.set_newest("3", 11, 1000)
    assert queue.take_all() == [10] and not queue and queue.bytes == 0 and dict(newest) == {"3": 11}
    newest.forget("3")
    assert newest.bytes == 0 and not newest


@pytest.mark.parametrize("evil", EVIL.values(), ids=EVIL.keys())
def test_text_from_an_edge_is_escaped_in_log_and_window(evil: str, caplog: pytest.LogCaptureFixture) -> None:
    if "\ud800" in evil:
        pytest.skip("the wire does not carry lone surrogates")
    edge = HostileEdge()
    try:
        health = streams.HealthMessage("no frames", int(Severity.NOTE), 0, evil, evil)
        words = {"edge": evil, "phase": evil, "note": evil, "sensor": evil, "health": [health]}
        edge.status = msgspec.structs.replace(edge.status, **words)
        edge.names = [evil]
        edge.answer = lambda body: requests.Refused(evil) if body["type"] == "Smooth" else None
        feed, document, notices = EdgeFeed(edge.link), Document(), list[str]()
        edge.until(lambda: edge.link.edges[0].characters.wanted)
        edge.link.ask(Smooth(1, 1.0))
        for message in (
            streams.CuesMessage(evil, "possessed", bytes(2), bytes(1), 1, 1),
            streams.SizeMessage(evil, 1.5),
            streams.CallMessage("record", evil[:60]),
            scans.ScanMessage(1, "failed", note=evil, character=evil),
        ):
            edge.pub.send(pack_stream(message))
        edge.pub.send(evil.encode() + b"\0\1\x90")

        def told() -> bool:
            feed.poll(document)
            notices.append(document.edge.message)
            return any(notices) and bool(document.edge.health) and edge.link.edges[0].health().malformed > 0

        with caplog.at_level(logging.INFO):
            edge.until(told)
            logging.getLogger("enliven_viewer.link").warning("%s", evil)
        shown = [
            *notices,
            document.edge.phase,
            document.edge.address,
            next(iter(edge.link.health.values())).text,
        ]
        shown += [each.what + each.remedy for each in document.edge.health]
        shown += [record.getMessage() for record in caplog.records]
        assert all(map(is_safe, shown)) and any("\\" in text for text in shown)
    finally:
        edge.close()
