"""Tests that messages of an edge over real sockets reach the timeline."""

from __future__ import annotations

import time

import numpy as np
import pytest
from patience import TIMEOUT_S

from enliven.document.character import Pose
from enliven.person.body import Body
from enliven.wire import BODIES, BodiesMessage, pack_stream
from enliven.wire.convert import bodies_to_message, cues_to_message
from enliven.wire.requests import Possess
from enliven.wire.sockets import Endpoint
from enliven.wire.streams import StatusMessage
from enliven_edge.network.publisher import Publisher
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.timeline import NS_PER_S


@pytest.fixture
def publisher():
    opened = Publisher(name="test-feed", host="127.0.0.1", pose_port=0, control_port=0)
    yield opened
    opened.close()


def until(condition, *steps, seconds: float = TIMEOUT_S) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it never came"
        for step in steps:
            step()
        time.sleep(0.005)


def test_silent_and_dead_edges_are_not_live(publisher, box, monkeypatch) -> None:
    monkeypatch.setattr("enliven_viewer.link.topic_health.RATE_WINDOW_S", 0.3)
    for module in ("topic_health", "edge_connection"):
        monkeypatch.setattr(f"enliven_viewer.link.{module}.SILENCE_TIMEOUT_S", 0.6)
    publisher.set_character(box)
    feed, document, count = EdgeFeed(EdgeClient([publisher.endpoint])), Document(), iter(range(10**6))

    def turn() -> None:
        list(publisher.poll())
        feed.poll(document)

    def frame() -> None:
        turn()
        publisher.publish_pose(box.rest_pose(next(count) * NS_PER_S // 30))

    try:
        until(lambda: document.edge.connected and document.edge.signal == "live", frame)
        until(lambda: document.edge.signal == "silent", turn)
        assert document.edge.connected, "its heart still beats"
        until(lambda: document.edge.signal == "live", frame)
        until(
            lambda: not document.edge.connected and document.edge.signal == "silent",
            lambda: feed.poll(document),
        )
    finally:
        feed.close()


def test_published_messages_reach_the_timeline(publisher, box) -> None:
    publisher.set_character(box)
    feed, document = EdgeFeed(EdgeClient([publisher.endpoint])), Document()

    def turn() -> None:
        list(publisher.poll())
        feed.poll(document)

    try:
        until(lambda: document.edge.connected and "box" in document.characters, turn)
        nodes = (np.array([1, 2]), np.array([1.0, 0.5]))
        publisher.publish(bodies_to_message([Body(7, np.zeros((20, 3)), np.ones(20))], NS_PER_S))
        publisher.publish(cues_to_message("box", "possessed", *nodes, 7))
        rest = box.rest_pose(NS_PER_S)
        publisher.publish_pose(
            Pose("box", NS_PER_S, rest.linear, rest.positions + 0.25), time.time_ns() - 20_000_000
        )
        until(lambda: len(document.timeline) and document.timeline.find_moment(NS_PER_S).possessed, turn)
        until(lambda: document.timeline.find_moment(NS_PER_S).poses, turn)
        moment = document.timeline.find_moment(NS_PER_S)
        assert np.abs(moment.poses["box"].positions - box.pivots - 0.25).max() < 5e-3
        assert moment.bodies[0].id == 7 and list(moment.cues["box"].nodes) == [1, 2]
        assert document.edge.sensor_to_pose_ms >= 20
        assert document.edge.pose_to_screen_ms >= 0
    finally:
        feed.close()


def test_document_without_an_edge_names_the_address() -> None:
    feed, document = EdgeFeed(EdgeClient([Endpoint("127.0.0.1", 9, 10)])), Document()
    try:
        assert feed.poll(document) == 0
        assert not document.edge.connected and document.edge.address == "tcp://127.0.0.1:9"
        feed.ask(Possess("box"))
        feed.poll(document)
        assert "no edge has the character 'box'" in document.edge.message
    finally:
        feed.close()


def test_restart_is_reported_before_the_new_edges_messages(box, monkeypatch) -> None:
    """The new edge's first message may be about performers. Such messages do not identify their process."""
    monkeypatch.setattr("enliven_viewer.link.edge_connection.SILENCE_TIMEOUT_S", 0.3)

    def edge(pose_port: int = 0, control_port: int = 0) -> Publisher:
        return Publisher(name="again", host="127.0.0.1", pose_port=pose_port, control_port=control_port)

    first = edge()
    feed, document, heard = EdgeFeed(EdgeClient([first.endpoint])), Document(), list[object]()
    feed.restarted = lambda: heard.append("restarted")
    feed.on_message = lambda topic, value: heard.append(value.time_ns) if topic is BODIES else None

    def performer(time_ns: int) -> BodiesMessage:
        return bodies_to_message([Body(7, np.zeros((20, 3)), np.ones(20))], time_ns)

    def turn(publisher: Publisher, time_ns: int) -> None:
        publisher.publish(performer(time_ns))
        feed.poll(document)

    try:
        until(lambda: 5 in heard, lambda: list(first.poll()), lambda: turn(first, 5))
        first.close()
        until(lambda: not document.edge.connected, lambda: feed.poll(document))
        second = edge(first.endpoint.pose_port, first.endpoint.control_port)
        try:
            # This may be the new edge's first message, before any that identifies its process.
            feed.link.edges[0].receive(pack_stream(performer(6)), latched=False)
            feed.poll(document)
            assert 6 not in heard and not document.edge.connected
            until(lambda: 7 in heard, lambda: list(second.poll()), lambda: turn(second, 7))
        finally:
            second.close()
    finally:
        feed.close()
        first.close()
    assert heard.count("restarted") == 1 and heard.index(5) < heard.index("restarted") < heard.index(6)


def test_messages_during_a_slow_frame_are_sorted_by_time(publisher, box) -> None:
    """Ten seconds of poses arrive, and then ten seconds of performers. Neither may count as a restart of the
    clock.
    """
    publisher.set_character(box)
    feed, document, heard = EdgeFeed(EdgeClient([publisher.endpoint])), Document(), list[int]()
    feed.on_message = lambda topic, value: heard.append(getattr(value, "pose", value).time_ns)

    def turn() -> None:
        list(publisher.poll())
        feed.poll(document)

    try:
        until(lambda: document.edge.connected and "box" in document.characters, turn)
        generation = document.timeline.generation
        heard.clear()
        for second in range(1, 11):
            publisher.publish(bodies_to_message([Body(7, np.zeros((20, 3)), np.ones(20))], second * NS_PER_S))
            publisher.publish_pose(box.rest_pose(second * NS_PER_S))
        until(lambda: len(feed.link.edges[0].values.inbox.get("pose", ())) == 10, lambda: feed.link.poll())
        feed.poll(document)
        assert heard == [second * NS_PER_S for second in range(1, 11) for _ in range(2)]
        assert document.timeline.generation == generation and len(document.timeline) >= 10
    finally:
        feed.close()


def test_pauses_of_the_viewer_itself_do_not_lose_held_back_messages(monkeypatch) -> None:
    """A suspended laptop or a busy machine may stop the viewer between any two messages."""
    link = EdgeClient([Endpoint("127.0.0.1", 9, 10)])
    edge, now = link.edges[0], iter(range(0, 10**6, 10))
    performers = [bodies_to_message([Body(7, np.zeros((20, 3)), np.ones(20))], time) for time in range(3)]
    status = pack_stream(StatusMessage("paused", 1, 0, 0))
    try:
        with monkeypatch.context() as patch:
            # Each reading of the clock is ten seconds later than the previous one, so each message ends a
            # silence.
            patch.setattr("enliven_viewer.link.edge_connection.time.monotonic", lambda: float(next(now)))
            for message in performers:
                edge.receive(pack_stream(message), latched=False)
            edge.receive(status, latched=False)
            assert not link.take(BODIES), "none is shown before its edge is known"
        edge.receive(status, latched=False)
        assert [value.time_ns for value in link.take(BODIES)] == [0, 1, 2]
    finally:
        link.close()
