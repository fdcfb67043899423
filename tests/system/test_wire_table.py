"""Tests of the wire's table: a new message and request, the health of each topic, and a stored take.

A new stream message changes four files: its class in ``wire/streams.py``, its row in ``wire/topics.py``, its
public name in ``wire``, and the line in ``network/outlet.py`` that makes it from a frame's result. A new
request changes four: its class and entry in ``wire/requests.py``, its public name, its handler in
``enliven_edge/orders.py``, and the key or button that sends it. The registrations in these tests replace
those lines.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest
from patience import wait_until

from enliven.document.character import Character, Pose, SkinWeights
from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.motion_clips.recorded_characters import read_possessed
from enliven.recording import Recording
from enliven.wire import BODIES, BY_TYPE, POSE, REQUESTS, STREAMS, TOPICS, Order, Topic, pack_stream, register
from enliven.wire.requests import Done, Listen, Lock, Refused
from enliven.wire.streams import BodiesMessage
from enliven_edge.network.handlers import Handler, execute
from enliven_edge.network.outlet import Outlet
from enliven_edge.network.permissions import refusal_reason
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.stage.tick import Tick
from enliven_edge.tracking.tracker import Tracker
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.link.edge_feed import EdgeFeed
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.playback.document import Document

STORED = Path(__file__).parent / "references" / "two_characters.mcap"
"""A take of two characters in format version 1, written by the first edge that supported several."""
STEP = 33_333_333


class WindMessage(msgspec.Struct, array_like=True, frozen=True):
    """A message that no current program knows."""

    time_ns: int
    metres_a_second: float


class Blow(Order, frozen=True):
    """A request that no current edge knows."""

    metres_a_second: float


@pytest.fixture
def wind() -> Iterator[Topic]:
    topic = register(Topic("wind", WindMessage, "stream", 1024, 30, "every", latched=True, recorded=True))
    REQUESTS.append(Blow)
    yield topic
    TOPICS.remove(topic)
    del STREAMS["wind"], BY_TYPE[WindMessage]
    REQUESTS.remove(Blow)


class Nobody(Sensor):
    """A sensor without frames."""

    name, fps = "nobody", 30.0

    def read(self, timeout: float | None = None) -> None:
        return None


def block(name: str) -> Character:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (0, 2) for z in (-1, 1)], np.float32)
    faces = np.array([[0, 1, 2], [1, 3, 2], [4, 6, 5], [5, 6, 7]], np.int32)
    skin = SkinWeights(np.zeros((8, 4), np.uint16), np.tile(np.float32([1, 0, 0, 0]), (8, 1)))
    pivots = np.array([[0, 0, 0], [0, 1, 0]], np.float32)
    return Character(name, corners, faces, skin, pivots, np.array([[0, 1]], np.int32))


def outlet_of(path: Path) -> Outlet:
    return Outlet(WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0), "nobody", record=path)


def until(done: Callable[[], object], *polled: Callable[[], object]) -> None:
    """Calls functions until a condition holds."""
    wait_until(done, step=lambda: [poll() for poll in polled], interval=0.001)


def test_new_message_is_sent_recorded_latched_and_on_the_timeline(wind: Topic, tmp_path: Path) -> None:
    with outlet_of(tmp_path / "wind.mcap") as outlet:
        outlet.introduce(block("box"))
        outlet.publish(Tick(BodyFrame([], STEP, "x"), poses=[block("box").rest_pose(STEP)]))
        outlet.send(WindMessage(STEP, 3.5), STEP)
        feed, document = EdgeFeed(EdgeClient([outlet.publisher.endpoint])), Document()

        def shown() -> object:
            moment = document.timeline.find_moment(STEP)
            return moment is not None and moment.others.get("wind")

        until(shown, lambda: feed.poll(document), outlet.publisher.poll)
        assert shown() == {"": WindMessage(STEP, 3.5)}, "it was sent before this viewer came"
        feed.close()
    assert "wind" in Recording(tmp_path / "wind.mcap").info.topics
    replayed, take = Document(), TakeFeed(tmp_path / "wind.mcap")
    while take.poll(replayed):
        pass
    moment = replayed.timeline.find_moment(STEP)
    assert moment is not None and moment.others["wind"] == {"": WindMessage(STEP, 3.5)}
    assert take.unreadable == 0 and list(moment.poses) == ["box"]


def test_a_new_request_reaches_its_handler_and_without_one_it_is_refused(wind: Topic, tmp_path: Path) -> None:
    with outlet_of(tmp_path / "take.mcap") as outlet:
        edge, asked, replies = Edge(Nobody(), Tracker(), Stage([]), outlet), [], []
        link = EdgeClient([outlet.publisher.endpoint])
        until(lambda: link.status, link.poll, edge.poll_requests)
        link.ask(Blow(1.0), replies.append)
        until(lambda: replies, link.poll, edge.poll_requests)
        assert isinstance(replies.pop(), Refused) and not asked
        edge.handlers[Blow] = Handler(asked.append, newest=lambda order: "wind")
        for speed in range(5):
            link.ask(Blow(float(speed)), replies.append)
        until(lambda: len(replies) == 5, link.poll, edge.poll_requests)
        assert asked[-1] == Blow(4.0) and replies.count(Done()) == len(asked)
        link.close()


@pytest.mark.parametrize(
    ("address", "kind", "told"),
    [
        ("10.0.0.7", Lock, ""),
        ("10.0.0.7", Listen, "own computer"),
        ("127.0.0.1", Listen, ""),
        ("::1", Listen, ""),
        ("fe80::1%eth0", Listen, "own computer"),
    ],
)
def test_some_requests_are_for_viewers_of_the_same_machine(
    address: str, kind: type[Order], told: str
) -> None:
    reason = refusal_reason(kind, "operate", address)
    assert told in reason if told else not reason


def test_handler_error_and_ended_stream_are_refusals() -> None:
    def refuse(order: Order) -> None:
        raise InputError("it is bolted down", where="the chair", remedy="Unscrew it.")

    assert "bolted down" in execute({Lock: Handler(refuse)}, Lock(True)).reason
    assert execute({}, Lock(True)) == Refused("the stream has ended")


def test_health_of_each_topic_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("enliven_viewer.link.topic_health.RATE_WINDOW_S", 0.3)
    monkeypatch.setattr("enliven_viewer.link.topic_health.SILENCE_TIMEOUT_S", 0.3)
    with outlet_of(tmp_path / "take.mcap") as outlet:
        link = EdgeClient([outlet.publisher.endpoint])
        of = lambda topic: link.topics[outlet.publisher.endpoint][topic.name]  # noqa: E731
        assert not of(POSE).alive and of(POSE).valid
        for name in "ab":
            outlet.introduce(block(name))
        count = iter(range(10**6))

        def frame() -> None:
            at = next(count) * STEP
            poses = [block(name).rest_pose(at) for name in "ab"]
            outlet.publish(Tick(BodyFrame([], at, "x"), poses=poses))
            outlet.publisher.poll()
            link.poll()

        until(lambda: of(POSE).on_rate and of(BODIES).on_rate, frame)
        assert of(POSE).alive and of(POSE).hz < 1.5 * of(BODIES).hz, "the rate is that of each character"
        assert not of(STREAMS["props"]).alive
        broken = b"bodies\0\1" + msgspec.msgpack.encode(["no time"])
        outlet.publisher._streams.send(broken)
        until(lambda: not of(BODIES).valid, link.poll)
        assert of(POSE).valid and of(BODIES).malformed == 1
        until(lambda: not of(POSE).alive and not of(POSE).on_rate, link.poll, outlet.publisher.poll)
        until(lambda: of(BODIES).valid, link.poll)
        link.close()


def placed(name: str, frame: int) -> Pose:
    """Returns the pose of a character of the stored take in a frame."""
    rest = block(name).rest_pose(frame * STEP)
    away = np.float32([0.01 * frame * (1 if name == "left" else -1), 0, 0])
    return Pose(name, rest.time_ns, rest.linear, rest.positions + away)


def write_stored(path: Path) -> None:
    """Writes a stored take of 30 frames again. The second character appears at the tenth."""
    with outlet_of(path) as outlet:
        blocks = {name: block(name) for name in ("left", "right")}
        for frame in range(30):
            names = ["left", "right"][: 1 + (frame >= 10)]
            outlet.show({name: blocks[name] for name in names})
            poses = [placed(name, frame) for name in names]
            outlet.publish(Tick(BodyFrame([], frame * STEP, "x"), poses=poses))


def test_a_stored_take_of_two_characters_is_read(tmp_path: Path) -> None:
    again = tmp_path / "again.mcap"
    write_stored(again)
    for path in (STORED, again):
        document, take = Document(), TakeFeed(path)
        while take.poll(document):
            pass
        assert list(document.characters) == ["left", "right"] and len(document.timeline) == 30
        for frame in range(30):
            moment = document.timeline.find_moment(frame * STEP)
            assert moment is not None and set(moment.poses) == ({"left"} if frame < 10 else {"left", "right"})
            for name, pose in moment.poses.items():
                np.testing.assert_allclose(pose.positions, placed(name, frame).positions, atol=5e-4)
        assert set(read_possessed(path).graphs) == {"left", "right"}


def test_body_messages_are_bitwise_unchanged() -> None:
    """The row in the table has changed since the reference was stored, but the bytes must not change."""

    assert pack_stream(BodiesMessage(7, 8, [])) == b"bodies\0\1\x93\x07\x08\x90"
