"""Tests of publisher and Link over real sockets: late viewers, restarts, duplicate edges, noise, other
versions.
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import zmq
from patience import wait_until
from zmq_contexts import make_context

from enliven.document.character import Character, SkinWeights
from enliven.errors import InputError
from enliven.person.body import Body
from enliven.wire import characters, requests, streams
from enliven.wire.convert import bodies_to_message, cues_to_message
from enliven.wire.envelope import pack_control, pack_stream
from enliven.wire.ports import free_ports
from enliven.wire.quantize import POSITION_ERROR
from enliven.wire.sockets import Endpoint
from enliven.wire.topics import BODIES, CUES, POSE
from enliven_edge.network.control_socket import Command
from enliven_edge.network.publisher import Publisher
from enliven_viewer.link.clock import ClockEstimate
from enliven_viewer.link.edge_client import EdgeClient


def unique() -> str:
    return f"test-{uuid.uuid4().hex[:10]}"


def character(name: str = "chair", count: int = 8) -> Character:
    pivots = np.random.default_rng(count).normal(size=(count, 3)).astype(np.float32)
    skin = SkinWeights(np.zeros((count, 4), np.uint16), np.full((count, 4), 0.25, np.float32))
    return Character(name, pivots, np.array([[0, 1, 2]], np.int32), skin, pivots, np.zeros((0, 2), np.int32))


def until(link: EdgeClient, done: Callable[[], Any], *publishers: Publisher) -> list[Command]:
    """Runs the loops of publisher and link until a condition holds. Returns the received commands."""
    commands: list[Command] = []

    def step() -> None:
        for publisher in publishers:
            commands.extend(publisher.poll())
        link.poll()

    step()
    wait_until(done, step=step, interval=0.002)
    return commands


@pytest.fixture
def publisher() -> Iterator[Publisher]:
    with Publisher(name=unique(), pose_port=0, control_port=0) as opened:
        opened.set_character(character())
        yield opened


@pytest.fixture
def link(publisher: Publisher) -> Iterator[EdgeClient]:
    opened = EdgeClient([publisher.endpoint])
    yield opened
    opened.close()


def pivots_of(link: EdgeClient) -> int:
    """Returns the number of the chair's pivots in the viewer, 0 if there is none."""
    chair = link.characters.get("chair")
    return len(chair.pivots) if chair else 0


def joined(link: EdgeClient, publisher: Publisher) -> None:
    """Runs both sides until the link has received everything."""
    until(link, lambda: "chair" in link.characters and publisher.viewers == 1, publisher)
    link.take(POSE)


def test_every_pose_arrives_once_in_order_with_its_times(link: EdgeClient, publisher: Publisher) -> None:
    joined(link, publisher)
    got: list[Any] = []
    for i in range(300):
        publisher.publish_pose(character().rest_pose(i), time.time_ns())
    until(link, lambda: (got.extend(link.take(POSE)), len(got) >= 300)[1], publisher)
    assert [g.sequence for g in got] == list(range(300)) == [g.pose.time_ns for g in got]
    assert np.abs(got[5].pose.positions - character().pivots).max() <= POSITION_ERROR + 1e-6
    assert all(g.captured_ns <= g.published_ns <= g.received_ns for g in got)
    assert got[0].sensor_to_pose_ms >= 0 and got[0].age_ms() >= got[0].sensor_to_pose_ms
    assert link.health[publisher.endpoint].state == "on rate"
    assert link.health[publisher.endpoint].lost == 0 and link.clock_offset_ns == 0


def test_late_viewer_gets_the_missed_messages(publisher: Publisher) -> None:
    publisher.set_character(character("lamp", 5))
    publisher.set_status(phase="tracking", note="on stage", sensor="kinect")
    publisher.publish(cues_to_message("lamp", "possessed", np.array([1, 2]), np.array([0.5, 1]), 3))
    for i in range(10):
        publisher.publish_pose(character("lamp", 5).rest_pose(i))
    late = EdgeClient([str(publisher.endpoint)])
    poses: list[Any] = []
    until(late, lambda: (poses.extend(late.take(POSE)), len(late.characters) == 2 and poses)[1], publisher)
    assert np.array_equal(late.characters["lamp"].vertices, character("lamp", 5).vertices)
    assert [(p.pose.character, p.pose.time_ns) for p in poses] == [("lamp", 9)]
    assert late.latest(CUES)["lamp"].nodes.tolist() == [1, 2] and late.latest(CUES)["lamp"].body == 3
    assert late.status is not None and (late.status.phase, late.status.sensor) == ("tracking", "kinect")
    until(late, lambda: publisher.viewers == 1, publisher)
    publisher.publish_pose(character("lamp", 5).rest_pose(10))
    until(late, lambda: (poses.extend(late.take(POSE)), len(poses) == 2)[1], publisher)
    assert late.edges[0].health().lost == 0, "what was before it joined is not lost"
    late.close()


def test_bodies_cues_and_status_arrive(link: EdgeClient, publisher: Publisher) -> None:
    joined(link, publisher)
    body = Body(4, np.full((20, 3), 1.25), np.ones(20))
    for i in range(5):
        publisher.publish(bodies_to_message([body], i, 77))
    publisher.publish(cues_to_message("chair", "free", np.array([7]), np.array([1.0]), 4))
    publisher.set_status(phase="tracking", performers=1)
    seen: list[Any] = []
    until(
        link, lambda: (seen.extend(link.take(BODIES)), len(seen) == 5 and link.status.phase == "tracking")[1]
    )
    assert [b.time_ns for b in seen] == list(range(5)) and link.latest(BODIES)
    (last,) = link.latest(BODIES)[""].bodies
    assert last.id == 4 and np.allclose(last.joints, 1.25, atol=5e-4)
    assert link.latest(CUES)["chair"].state == "preview" and link.status.performers == 1


def test_a_new_revision_is_fetched_and_no_pose_of_it_is_lost(link: EdgeClient, publisher: Publisher) -> None:
    joined(link, publisher)
    before = link.characters["chair"]
    publisher.publish_pose(character().rest_pose(0))
    publisher.set_character(character(count=12))
    for i in range(1, 6):
        publisher.publish_pose(character(count=12).rest_pose(i))
    got: list[Any] = []
    until(link, lambda: (got.extend(link.take(POSE)), len(got) == 6)[1], publisher)
    assert [len(g.pose.positions) for g in got] == [8] + [12] * 5
    assert len(before.pivots) == 8 and len(link.characters["chair"].pivots) == 12
    publisher.remove_character("chair")
    until(link, lambda: not link.characters, publisher)


def test_commands_and_their_replies(link: EdgeClient, publisher: Publisher) -> None:
    joined(link, publisher)
    replies: list[Any] = []
    link.ask(requests.Possess("chair", 3, "legs"), replies.append)
    commands: list[Command] = []
    until(link, lambda: (commands.extend(publisher.poll()), commands)[1])
    assert commands[0].request == requests.Possess("chair", 3, "legs")
    commands[0].reply(requests.Done())
    until(link, lambda: replies, publisher)
    link.ask(requests.Release("chair"), replies.append)
    commands.clear()
    until(link, lambda: (commands.extend(publisher.poll()), commands)[1])
    commands[0].reply(requests.Refused("it is bolted down"))
    until(link, lambda: len(replies) == 2, publisher)
    assert replies == [requests.Done(), requests.Refused("it is bolted down")]
    assert [n.text for n in link.take_notices()] == ["it is bolted down"]
    link.ask(requests.Possess("sofa"))
    (notice,) = link.take_notices()
    assert "sofa" in notice.text and "chair" in notice.text


def test_unanswered_command_ends_with_a_notice(
    link: EdgeClient, publisher: Publisher, monkeypatch: pytest.MonkeyPatch
) -> None:
    joined(link, publisher)
    monkeypatch.setattr("enliven_viewer.link.edge_connection._COMMAND_TIMEOUT_S", 0.1)
    replies: list[Any] = []
    link.ask(requests.Possess("chair"), replies.append)
    until(link, lambda: replies)
    assert isinstance(replies[0], requests.Refused) and "does not answer" in link.take_notices()[0].text


def test_a_viewer_that_is_first_waits_and_a_restarted_edge_is_picked_up() -> None:
    pose_port, control_port = free_ports()
    name = unique()
    link = EdgeClient([f"127.0.0.1:{pose_port}:{control_port}"])
    endpoint = Endpoint("127.0.0.1", pose_port, control_port)
    for _ in range(20):
        link.poll()
    assert link.health[endpoint].state == "waiting" and not link.characters
    ports = {"pose_port": pose_port, "control_port": control_port}
    for start in range(3):
        with Publisher(name=name, **ports) as edge:
            edge.set_character(character(count=8 + start))
            until(link, lambda e=edge: e.viewers == 1 and link.status.instance == e.instance, edge)
            until(link, lambda n=start: pivots_of(link) == 8 + n, edge)
            link.take(POSE)
            for i in range(5):
                edge.publish_pose(character(count=8 + start).rest_pose(i))
            got: list[Any] = []
            until(link, lambda g=got: (g.extend(link.take(POSE)), len(g) >= 5)[1], edge)
            assert [g.sequence for g in got] == list(range(5))
        assert "chair" in link.characters, "what was there stays on the screen"
    restarts = [n.text for n in link.take_notices() if "restarted" in n.text]
    assert len(restarts) == 2 and link.health[endpoint].lost == 0
    link.close()


def test_silence_and_end_of_the_edge_are_reported(
    link: EdgeClient, publisher: Publisher, monkeypatch: pytest.MonkeyPatch
) -> None:
    joined(link, publisher)
    assert link.health[publisher.endpoint].state == "connected"
    monkeypatch.setattr("enliven_viewer.link.edge_connection.SILENCE_TIMEOUT_S", 0.1)
    until(link, lambda: link.health[publisher.endpoint].state == "stale")
    assert "has sent nothing for" in link.health[publisher.endpoint].text
    publisher.set_status(phase="ended")
    until(link, lambda: link.health[publisher.endpoint].state == "ended", publisher)


class FakeEdge:
    """Raw sockets in place of an edge, which send given messages."""

    def __init__(self) -> None:
        self.context = make_context()
        self.pub, self.router = self.context.socket(zmq.PUB), self.context.socket(zmq.ROUTER)
        ports = [s.bind_to_random_port("tcp://127.0.0.1") for s in (self.pub, self.router)]
        self.endpoint = Endpoint("127.0.0.1", *ports)

    def answer(self, make: Callable[[int], bytes]) -> None:
        """Replies to every request with the bytes that ``make`` returns for its request number."""
        while self.router.poll(0):
            viewer, data = self.router.recv_multipart()
            number = 0
            for candidate in range(1, 200):
                if b"\xa2id" + bytes([candidate]) in data:
                    number = candidate
            self.router.send_multipart([viewer, make(number)])

    def close(self) -> None:
        self.context.destroy(linger=0)


@pytest.fixture
def fake() -> Iterator[FakeEdge]:
    started = FakeEdge()
    yield started
    started.close()


def test_noise_from_an_edge_is_counted_and_dropped(fake: FakeEdge) -> None:
    link, rng = EdgeClient([fake.endpoint]), np.random.default_rng(0)
    status = pack_stream(streams.StatusMessage("fake", 1, 0, time.time_ns()))

    def send_heartbeat() -> bool:
        fake.pub.send(status)
        return link.status is not None

    until(link, send_heartbeat)
    good = streams.PoseMessage("ghost", 1, 1, 0, 0, 0, 0, b"nothing of use")
    noise = [rng.bytes(int(n)) for n in rng.integers(0, 500, 200)]
    noise += [pack_stream(good)[: int(n)] for n in rng.integers(0, 20, 20)]
    for each in noise:
        fake.pub.send(each)
    fake.pub.send(pack_stream(good))
    until(link, lambda: link.edges[0].health().malformed == len(noise))
    fake.answer(lambda number: rng.bytes(50))
    fake.answer(lambda number: pack_control(requests.Request(1, requests.Hello("not a reply"))))
    for _ in range(20):
        link.poll()
    assert not link.take(POSE) and not link.characters
    link.close()


def test_contradictory_character_or_pose_is_dropped(fake: FakeEdge, caplog: pytest.LogCaptureFixture) -> None:
    link = EdgeClient([fake.endpoint])
    status = streams.StatusMessage("fake", 1, 1, time.time_ns())
    bad = characters.CharacterMessage(
        "chair", 1, "graph", 1, 1, 1, 0, bytes(12), b"\7\0\0\0" * 3, bytes(8), bytes(16), bytes(12), b""
    )
    welcome = requests.Welcome(status, [requests.Revision("chair", 1)], [b"noise"])

    def tick() -> bool:
        fake.pub.send(pack_stream(status))
        is_listed = bool(link.edges[0].characters.wanted)
        fake.answer(lambda n: pack_control(requests.Reply(n, bad if is_listed else welcome)))
        return caplog.text.count("dropped a malformed message") == 2

    until(link, tick)
    assert not link.characters and link.edges[0].health().malformed >= 2
    assert "unknown topic" in caplog.text and "a face refers to a vertex outside" in caplog.text
    link.close()


@pytest.mark.parametrize("way", ["stream", "reply"])
def test_another_version_is_reported_once(fake: FakeEdge, way: str) -> None:
    link = EdgeClient([fake.endpoint])
    status = streams.StatusMessage("fake", 1, 0, time.time_ns())
    theirs = pack_stream(status).replace(b"status\0\1", b"status\0\7")

    def tick() -> bool:
        if way == "stream":
            fake.pub.send(theirs)
        else:
            fake.answer(lambda n: b"\7" + pack_control(requests.Reply(n, requests.Refused("?")))[1:])
        return link.health[fake.endpoint].state == "version mismatch"

    until(link, tick)
    for _ in range(50):
        tick()
        link.poll()
    (notice,) = link.take_notices()
    assert "version 7" in notice.text and "same release" in notice.text and notice.level == "error"
    fake.pub.send(pack_stream(status))
    until(
        link, lambda: (fake.pub.send(pack_stream(status)), link.health[fake.endpoint].state == "connected")[1]
    )
    link.close()


def test_two_edges_of_one_name_are_reported(fake: FakeEdge) -> None:
    other = FakeEdge()
    link = EdgeClient([fake.endpoint, other.endpoint])

    def tick() -> bool:
        for instance, edge in enumerate((fake, other)):
            edge.pub.send(pack_stream(streams.StatusMessage("stage", instance, 0, time.time_ns())))
        return link.health[fake.endpoint].state == "name clash"

    until(link, tick)
    assert link.health[other.endpoint].state == "name clash"
    assert any("two edges are named 'stage'" in n.text and "--name" in n.text for n in link.take_notices())
    link.close()
    other.close()


def test_two_edges_keep_their_characters_apart() -> None:
    with (
        Publisher(name=unique(), pose_port=0, control_port=0) as a,
        Publisher(name=unique(), pose_port=0, control_port=0) as b,
    ):
        a.set_character(character(count=5))
        b.set_character(character(count=6))
        link = EdgeClient([a.endpoint, b.endpoint])
        until(link, lambda: len(link.characters) == 2 and a.viewers == b.viewers == 1, a, b)
        assert {n: len(c.pivots) for n, c in link.characters.items()} == {
            f"{a.name}/chair": 5,
            f"{b.name}/chair": 6,
        }
        b.publish_pose(character(count=6).rest_pose())
        got: list[Any] = []
        until(link, lambda: (got.extend(link.take(POSE)), got)[1], a, b)
        assert got[0].pose.character == f"{b.name}/chair" and got[0].edge == b.name
        link.ask(requests.Release(f"{b.name}/chair"))
        commands: list[Command] = []
        until(link, lambda: (commands.extend(b.poll()), commands)[1], a)
        assert commands[0].request == requests.Release("chair")
        link.close()


def test_lost_poses_are_counted(fake: FakeEdge) -> None:
    link = EdgeClient([fake.endpoint])
    until(
        link,
        lambda: (
            fake.pub.send(pack_stream(streams.StatusMessage("fake", 1, 0, 0))),
            link.status is not None,
        )[1],
    )
    for sequence in (5, 6, 9, 9, 7, 10):
        fake.pub.send(pack_stream(streams.PoseMessage("chair", 1, 1, sequence, 0, 0, 0, b"")))
    until(link, lambda: len(link.edges[0].characters.waiting) == 4)
    assert link.edges[0].health().lost == 2, "7 and 8; the second 9 and the late 7 are dropped"
    link.close()


def test_invalid_address_is_refused() -> None:
    with pytest.raises(InputError):
        EdgeClient([])
    with pytest.raises(InputError):
        EdgeClient(["not an address"])


SECOND = 1_000_000_000


def test_the_clock_is_found_between_its_bounds() -> None:
    """With random delays and one slow direction, the error is at most half of the fastest round trip, and the
    estimate is close at the end.
    """
    rng, offset, clock = np.random.default_rng(0), 5 * SECOND, ClockEstimate()
    assert clock.offset_ns == 0 and not clock.is_known
    now, fastest = 0, SECOND
    for _ in range(60):
        there, back = (int(d) for d in rng.uniform(1e5, [4e7, 1.6e7]))
        fastest = min(fastest, there + back)
        clock.add_ping(now, now + there + offset, now + there + back)
        now += SECOND
        clock.add_heartbeat(now + offset, now + int(rng.uniform(1e5, 1.6e7)))
        assert clock.is_known and abs(clock.offset_ns - offset) <= fastest / 2 + 1
    assert abs(clock.offset_ns - offset) < 2_000_000


def test_one_machine_has_one_clock_and_a_clock_that_is_set_is_noticed() -> None:
    clock = ClockEstimate()
    clock.add_ping(0, 30_000_000, 32_000_000)
    assert clock.offset_ns == 0, "nothing says that the clocks differ"
    clock.add_ping(SECOND, SECOND + 60 * SECOND, SECOND + 2_000_000)
    assert abs(clock.offset_ns - 60 * SECOND) <= 2_000_000
    clock.add_heartbeat(SECOND + 90 * SECOND, SECOND + 3_000_000)
    assert not clock.is_known, "bounds that exclude each other are forgotten"
    clock.add_ping(5, 3, 4)
    assert not clock.is_known, "an answer before its question says nothing"
