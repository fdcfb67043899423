"""Tests of the edge's sockets: names, ports, requests, noise, and viewers that do not read."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest
import zmq
from zmq_contexts import make_context

from enliven.document.character import Character, Pose, SkinWeights
from enliven.errors import InputError, ResourceError
from enliven.wire import characters, envelope, requests, streams, topics
from enliven.wire.envelope import pack_control, unpack_control, unpack_stream
from enliven_edge.network.name_lock import NameLock
from enliven_edge.network.publisher import Publisher

ROUNDS = 12_000
"""Number of polls of 5 ms. They take a minute in total, which is enough for a loaded machine."""


def unique() -> str:
    return f"test-{uuid.uuid4().hex[:10]}"


def character(name: str = "chair", count: int = 8) -> Character:
    pivots = np.random.default_rng(0).normal(size=(count, 3)).astype(np.float32)
    skin = SkinWeights(np.zeros((count, 4), np.uint16), np.full((count, 4), 0.25, np.float32))
    return Character(name, pivots, np.array([[0, 1, 2]], np.int32), skin, pivots, np.zeros((0, 2), np.int32))


@pytest.fixture
def publisher() -> Iterator[Publisher]:
    with Publisher(name=unique(), pose_port=0, control_port=0) as opened:
        yield opened


class Peer:
    """A viewer made of raw sockets."""

    def __init__(self, publisher: Publisher) -> None:
        self.publisher = publisher
        self.context = make_context()
        self.dealer = self.context.socket(zmq.DEALER)
        self.dealer.connect(publisher.endpoint.control_address)
        self.sub = self.context.socket(zmq.SUB)
        self.sub.setsockopt(zmq.SUBSCRIBE, b"")
        self.sub.connect(publisher.endpoint.stream_address)

    def ask(self, body: requests.Ask, number: int = 1) -> requests.Answer:
        self.dealer.send(pack_control(requests.Request(number, body)))
        return self.reply(number).body

    def reply(self, number: int) -> requests.Reply:
        reply: requests.Reply = unpack_control(self.raw_reply(), topics.REPLY)
        assert reply.id == number
        return reply

    def raw_reply(self) -> bytes:
        for _ in range(ROUNDS):
            assert not self.publisher.poll()
            if self.dealer.poll(5):
                return self.dealer.recv()
        raise AssertionError("no reply")

    def commands(self) -> list:
        for _ in range(ROUNDS):
            commands = self.publisher.poll()
            if commands:
                return commands
            time.sleep(0.005)
        raise AssertionError("no command")

    def listen(self) -> None:
        """Waits until messages of the streams arrive."""
        for _ in range(ROUNDS):
            self.publisher.send_heartbeat()
            if self.sub.poll(5):
                return
        raise AssertionError("no heartbeat")

    def received(self, count: int) -> list:
        """Returns the next ``count`` messages except heartbeats."""
        messages = []
        while len(messages) < count and self.sub.poll(5000):
            topic, message = unpack_stream(self.sub.recv())
            if topic is not topics.STATUS:
                messages.append(message)
        return messages

    def close(self) -> None:
        self.context.destroy(linger=0)


@pytest.fixture
def peer(publisher: Publisher) -> Iterator[Peer]:
    connected = Peer(publisher)
    yield connected
    connected.close()


def test_poses_arrive_in_order_with_their_times(publisher: Publisher, peer: Peer) -> None:
    thing = character()
    assert publisher.set_character(thing) == 1
    peer.listen()
    sent = [publisher.publish_pose(thing.rest_pose(i), 1000 + i) for i in range(20)]
    got = peer.received(20)
    assert got == sent
    assert [m.sequence for m in got] == list(range(20))
    assert [m.time_ns for m in got] == list(range(20))
    assert {m.instance for m in got} == {publisher.instance} and {m.revision for m in got} == {1}


def test_late_viewer_receives_the_complete_state(publisher: Publisher, peer: Peer) -> None:
    for name in ("chair", "lamp"):
        publisher.set_character(character(name))
    publisher.set_character(character("lamp"))
    publisher.set_status(phase="tracking", note="hello", sensor="kinect")
    publisher.publish(streams.CuesMessage("lamp", "possessed", bytes(4), bytes(2), 1))
    for i in range(5):
        publisher.publish_pose(character("lamp").rest_pose(i))
    welcome = peer.ask(requests.Hello("late"))
    assert isinstance(welcome, requests.Welcome)
    assert welcome.characters == [requests.Revision("chair", 1), requests.Revision("lamp", 2)]
    assert (welcome.status.phase, welcome.status.note, welcome.status.edge) == (
        "tracking", "hello", publisher.name,
    )  # fmt: skip
    latest = [unpack_stream(each)[1] for each in welcome.latest]
    assert {type(m) for m in latest} == {streams.PoseMessage, streams.CuesMessage}
    assert [m.time_ns for m in latest if isinstance(m, streams.PoseMessage)] == [4]
    lamp = peer.ask(requests.GetState("lamp"), 2)
    assert isinstance(lamp, characters.CharacterMessage) and lamp.revision == 2 and lamp.vertex_count == 8
    assert isinstance(peer.ask(requests.GetState("sofa"), 3), requests.Refused)


def test_a_removed_character_is_gone_from_the_welcome(publisher: Publisher, peer: Peer) -> None:
    publisher.set_character(character())
    publisher.publish_pose(character().rest_pose())
    before = publisher.status.revision
    publisher.remove_character("chair")
    welcome = peer.ask(requests.Hello("v"))
    assert isinstance(welcome, requests.Welcome) and not welcome.characters and not welcome.latest
    assert welcome.status.revision > before


def test_commands_come_from_poll_and_are_answered(publisher: Publisher, peer: Peer) -> None:
    peer.ask(requests.Hello("Ada", True))
    assert publisher.viewers == 1
    peer.dealer.send(pack_control(requests.Request(5, requests.Possess("chair", 2, "legs"))))
    (command,) = peer.commands()
    assert command.request == requests.Possess("chair", 2, "legs") and command.viewer == "Ada"
    command.reply(requests.Refused("nobody is in view"))
    refused = peer.reply(5).body
    assert refused == requests.Refused("nobody is in view")
    peer.dealer.send(pack_control(requests.Request(6, requests.Release("chair"))))
    peer.commands()[0].reply(requests.Done())
    assert peer.reply(6).body == requests.Done()


def test_only_viewers_that_the_streams_reach_are_counted(publisher: Publisher, peer: Peer) -> None:
    peer.ask(requests.Hello("v", False))
    assert publisher.viewers == 0
    peer.ask(requests.Ping("v", 1, True))
    assert publisher.viewers == 1


def test_a_ping_is_answered_with_the_edges_clock(publisher: Publisher, peer: Peer) -> None:
    before = time.time_ns()
    pong = peer.ask(requests.Ping("v", 77))
    assert isinstance(pong, requests.Pong)
    assert pong.sent_ns == 77 and before <= pong.edge_ns <= time.time_ns()


def test_request_of_another_version_is_refused(publisher: Publisher, peer: Peer) -> None:
    peer.dealer.send(b"\x63" + pack_control(requests.Request(1, requests.Hello("v")))[1:])
    refused = unpack_control(peer.raw_reply(), topics.REPLY).body
    assert "version 99" in refused.reason
    assert publisher.malformed == 1


def test_noise_on_the_control_socket_is_counted_and_harmless(publisher: Publisher, peer: Peer) -> None:
    rng = np.random.default_rng(0)
    noise = [b"", b"\0", bytes([envelope.VERSION]), b"\x01\xdd\xff\xff\xff\xff"]
    noise += [rng.bytes(int(n)) for n in rng.integers(0, 2000, 100)]
    noise += [pack_control(requests.Reply(1, requests.Done()))]
    for each in noise:
        peer.dealer.send(each)
    peer.dealer.send_multipart([b"two", b"parts"])
    while publisher.malformed < len(noise) + 1:
        assert not publisher.poll()
    while peer.dealer.poll(200):
        assert isinstance(unpack_control(peer.dealer.recv(), topics.REPLY).body, requests.Refused)
    assert isinstance(peer.ask(requests.Ping("v", 1)), requests.Pong)


def test_a_message_beyond_the_limit_costs_only_its_sender_the_connection(
    publisher: Publisher, peer: Peer
) -> None:
    rude = Peer(publisher)
    rude.dealer.send(bytes(1_000_000))
    assert isinstance(peer.ask(requests.Ping("v", 1)), requests.Pong)
    rude.close()
    raw = socket.create_connection(("127.0.0.1", publisher.endpoint.control_port))
    raw.sendall(b"GET / HTTP/1.1\r\n\r\n" * 50)
    raw.close()
    assert isinstance(peer.ask(requests.Ping("v", 1), 2), requests.Pong)


@pytest.mark.slow
def test_subscriber_that_never_reads_blocks_no_other(publisher: Publisher, peer: Peer) -> None:
    """The messages exceed all buffers, so a publisher that blocks would never finish."""
    thing = character(count=64)
    publisher.set_character(thing)
    peer.sub.setsockopt(zmq.RCVHWM, 1)
    stuck = Peer(publisher)
    stuck.listen()
    rng = np.random.default_rng(0)
    linear = rng.normal(size=(64, 3, 3)).astype(np.float32)
    positions = rng.normal(size=(64, 3)).astype(np.float32)
    sent = sum(
        len(publisher.publish_pose(Pose("chair", i, linear, positions)).transforms) for i in range(8000)
    )
    assert sent > 6_000_000
    fresh = Peer(publisher)
    fresh.listen()
    last = publisher.publish_pose(Pose("chair", 9000, linear, positions))
    assert fresh.received(1) == [last]
    fresh.close()
    stuck.close()


def test_a_vanished_subscriber_is_forgotten(publisher: Publisher) -> None:
    thing = character()
    publisher.set_character(thing)
    for _ in range(5):
        gone = Peer(publisher)
        gone.listen()
        gone.close()
        publisher.publish_pose(thing.rest_pose())
    assert not publisher.poll()


def test_bad_transforms_are_counted_and_reported_once(
    publisher: Publisher, caplog: pytest.LogCaptureFixture
) -> None:
    publisher.set_character(character())
    pose = character().rest_pose()
    pose.linear[2] = np.nan
    for _ in range(3):
        publisher.publish_pose(pose)
    assert publisher.clamped == 3 and len(caplog.records) == 1


def test_invalid_character_keeps_the_current_one(publisher: Publisher) -> None:
    publisher.set_character(character())
    with pytest.raises(InputError):
        publisher.set_character(character("x" * 65))
    with pytest.raises(InputError):
        publisher.set_character(character(count=5000))
    assert publisher.revision("chair") == 1 and publisher.revision("x" * 65) == 0
    publisher.publish_pose(character().rest_pose())


def test_status_fields_are_clamped_for_the_wire(publisher: Publisher) -> None:
    publisher.set_status(fps=float("nan"), note="x" * 1000, latency_p50_ms=float("inf"))
    data = msgspec.msgpack.encode(publisher.status)
    back = msgspec.msgpack.decode(data, type=streams.StatusMessage)
    assert back.fps == 0 and back.latency_p50_ms == 0 and len(back.note) <= 400
    with pytest.raises(TypeError):
        publisher.set_status(colour="red")


def test_a_port_in_use_is_named_and_nothing_stays_taken() -> None:
    name = unique()
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ResourceError, match=rf"{port}.*in use.*--port"):
            Publisher(name=name, pose_port=port, control_port=0)
        with pytest.raises(ResourceError, match=rf"{port}.*in use.*--control-port"):
            Publisher(name=name, pose_port=0, control_port=port)
    Publisher(name=name, pose_port=port, control_port=0).close()


@pytest.mark.parametrize("host", ["192.0.2.1", "no such host"])
def test_an_address_that_is_not_ours_is_named(host: str) -> None:
    with pytest.raises(ResourceError, match="--host"):
        Publisher(name=unique(), host=host, pose_port=0, control_port=0, open_to_all=True)


def test_a_name_is_taken_once_and_free_again_after() -> None:
    name = unique()
    with (
        Publisher(name=name, pose_port=0, control_port=0),
        pytest.raises(ResourceError, match=rf"{name}.*process {os.getpid()}.*--name"),
    ):
        Publisher(name=name, pose_port=0, control_port=0)
    Publisher(name=name, pose_port=0, control_port=0).close()


@pytest.mark.parametrize("name", ["a/b", "../up", "ünï", "a b", "con\0"])
def test_any_name_makes_a_lock_of_its_own(name: str) -> None:
    name += uuid.uuid4().hex[:6]
    lock, other = NameLock(name), NameLock(name.replace("/", "_") + "x")
    with pytest.raises(ResourceError):
        NameLock(name)
    lock.close()
    other.close()
    NameLock(name).close()


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="there is no kill -9 here")
def test_a_killed_edge_does_not_keep_its_name() -> None:
    name = unique()
    code = f"import time; from enliven_edge.network.name_lock import NameLock; k = NameLock({name!r})"
    holder = subprocess.Popen(
        [sys.executable, "-c", code + "; print('held', flush=True); time.sleep(60)"], stdout=subprocess.PIPE
    )
    try:
        assert holder.stdout is not None and holder.stdout.readline().strip() == b"held"
        with pytest.raises(ResourceError, match=f"process {holder.pid}"):
            NameLock(name)
        holder.send_signal(signal.SIGKILL)
    finally:
        holder.kill()
        holder.wait()
    NameLock(name).close()
