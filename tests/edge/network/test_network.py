"""Tests of untrusted connections to the edge over real sockets: admission, reading, and execution order."""

from __future__ import annotations

import contextlib
import gc
import os
import socket
import statistics
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import zmq
from patience import wait_until
from zmq_contexts import make_context

from enliven.errors import InputError, ResourceError
from enliven.wire import requests, streams, topics
from enliven.wire.envelope import pack_control, unpack_control
from enliven_edge.network.name_lock import NameLock
from enliven_edge.network.outlet import Outlet
from enliven_edge.network.publisher import Publisher
from enliven_edge.orders import create_handlers
from enliven_edge.settings import WireSettings

PATIENCE = 60.0
"""Timeout of a test in seconds, long enough for a loaded machine."""


def unique() -> str:
    return f"test-{uuid.uuid4().hex[:10]}"


def until(done: Callable[[], Any], *steps: Callable[[], Any]) -> None:
    """Repeats steps until a condition holds."""
    wait_until(done, step=lambda: [step() for step in steps], interval=0.001)


@pytest.fixture
def publisher() -> Iterator[Publisher]:
    with Publisher(name=unique(), pose_port=0, control_port=0) as opened:
        yield opened


class Stage:
    """An outlet, the requests that it received, and the duration of each request."""

    def __init__(self, outlet: Outlet) -> None:
        self.outlet, self.done, self.seconds = outlet, [], 0.0
        self.handlers = {kind: replace(how, do=self.do) for kind, how in create_handlers(self).items()}

    def hear(self) -> None:
        """Reads and executes requests for one frame."""
        self.outlet.poll_requests(self.handlers)

    def do(self, order: requests.Order) -> None:
        self.done.append(order)
        time.sleep(self.seconds)


@pytest.fixture
def stage() -> Iterator[Stage]:
    with Outlet(WireSettings(name=unique(), port=0, control_port=0), "given") as outlet:
        yield Stage(outlet)


class Peer:
    """A viewer made of raw sockets."""

    def __init__(self, publisher: Publisher) -> None:
        self.context = make_context()
        self.dealer = self.context.socket(zmq.DEALER)
        self.dealer.setsockopt(zmq.SNDHWM, 0)
        self.dealer.setsockopt(zmq.RCVHWM, 0)
        self.dealer.connect(publisher.endpoint.control_address)
        self.replies: list[requests.Reply] = []

    def send(self, *bodies: requests.Ask) -> None:
        for number, body in enumerate(bodies):
            self.dealer.send(pack_control(requests.Request(number, body)))

    def read(self) -> None:
        while self.dealer.poll(0):
            self.replies.append(unpack_control(self.dealer.recv(), topics.REPLY))

    def close(self) -> None:
        self.context.destroy(linger=0)


@pytest.fixture
def peers(request: pytest.FixtureRequest) -> Iterator[Callable[[Publisher], Peer]]:
    opened: list[Peer] = []

    def make(publisher: Publisher) -> Peer:
        opened.append(Peer(publisher))
        return opened[-1]

    yield make
    for each in opened:
        each.close()


def test_orders_that_take_long_wait_for_later_frames(stage: Stage, peers) -> None:
    """Two viewers send 100 requests of 20 ms each. The first frame runs a few, later frames mostly none."""
    stage.seconds = 0.02
    rude = [peers(stage.outlet.publisher) for _ in range(2)]
    for each in rude:
        each.send(*[requests.Possess("chair", mode="join")] * 50)
    counts: list[int] = []

    def frame() -> None:
        before = len(stage.done)
        stage.hear()
        counts.append(len(stage.done) - before)

    until(lambda: len(stage.done) > 10, frame)
    assert max(counts) <= 3 and len(counts) > 4 * len(stage.done)
    stage.seconds = 0.0
    until(lambda: all(len(r.replies) == 50 for r in rude), stage.hear, *[r.read for r in rude])
    assert len(stage.done) == 100, "nothing is lost"


def test_viewer_with_few_requests_is_served_first(stage: Stage, peers) -> None:
    """Its request runs after at most one request of the other viewers, not after their hundred."""
    rude = [peers(stage.outlet.publisher) for _ in range(2)]
    good = peers(stage.outlet.publisher)
    good.send(requests.Ping("good", 0))
    until(lambda: good.replies, stage.hear, good.read)
    stage.seconds = 0.01
    for each in rude:
        each.send(*[requests.Possess("chair", mode="join")] * 60)
    until(lambda: len(stage.done) > 2, stage.hear)
    before = len(stage.done)
    good.send(requests.Release("lamp"))
    until(lambda: requests.Release("lamp") in stage.done, stage.hear)
    assert stage.done.index(requests.Release("lamp")) - before <= 6


@pytest.mark.slow
def test_endless_new_viewers_do_not_delay_a_known_viewer(stage: Stage, peers) -> None:
    """Each new viewer sends forty requests and leaves, so it has used no budget when it sends."""
    good = peers(stage.outlet.publisher)
    good.send(requests.Ping("good", 0))
    until(lambda: good.replies, stage.hear, good.read)
    deadline = time.monotonic() + 1.5
    until(lambda: time.monotonic() > deadline, stage.hear)
    stage.seconds = 0.01

    def come() -> None:
        while len(crowd) > 6:
            crowd.pop(0).close()
        crowd.append(Peer(stage.outlet.publisher))
        crowd[-1].send(*[requests.Possess("chair", mode="join")] * 40)

    crowd: list[Peer] = []
    until(lambda: len(stage.done) > 10, come, stage.hear)
    waited = []
    for turn in range(9):
        before = len(stage.done)
        good.send(requests.Release(f"lamp {turn}"))
        until(lambda name=f"lamp {turn}": requests.Release(name) in stage.done, come, stage.hear)
        waited.append(len(stage.done) - before)
    for each in crowd:
        each.close()
    # The edge divides its time by cost. If a busy machine suspends the edge, that time counts as cost, and
    # some requests run after many others.
    assert statistics.median(waited) <= 4, waited


def test_superseded_requests_are_skipped_and_answered(stage: Stage, peers) -> None:
    viewer = peers(stage.outlet.publisher)
    looks = [requests.Look((0.0, 0.0, float(i + 1)), (0.0, 1.0, 0.0)) for i in range(60)]
    viewer.send(requests.Ping("v", 0))
    until(lambda: viewer.replies, stage.hear, viewer.read)
    viewer.replies.clear()
    # Each request takes longer than a frame allows, so later ones wait.
    stage.seconds = 0.02
    viewer.send(*looks)
    until(lambda: len(viewer.replies) == 60, stage.hear, viewer.read)
    assert stage.done[-1] == looks[-1] and len(stage.done) <= 30
    answers = [reply.body for reply in sorted(viewer.replies, key=lambda r: r.id)]
    assert answers[-1] == requests.Done()
    assert answers.count(requests.Refused(requests.SUPERSEDED)) == 60 - len(stage.done)


def test_every_step_request_is_executed(stage: Stage, peers) -> None:
    """A request that states an amount or advances a choice is not replaced by the next one."""
    viewer = peers(stage.outlet.publisher)
    viewer.send(*[requests.Browse("chair", 1)] * 20, *[requests.Possess("chair", mode="join")] * 3)
    until(lambda: len(viewer.replies) == 23, stage.hear, viewer.read)
    assert {type(reply.body) for reply in viewer.replies} == {requests.Done} and len(stage.done) == 23


def test_rate_limit_is_enforced_and_logged(peers, caplog: pytest.LogCaptureFixture) -> None:
    with Publisher(name=unique(), pose_port=0, control_port=0, rate=20.0) as publisher:
        greedy, good = peers(publisher), peers(publisher)
        greedy.send(*[requests.Ping("greedy", i) for i in range(2000)])
        until(lambda: len(greedy.replies) == 2000, publisher.poll, greedy.read)
        refused = [r.body for r in greedy.replies if isinstance(r.body, requests.Refused)]
        assert len(refused) >= 1000 and "20 requests a second" in refused[0].reason
        assert isinstance(min(greedy.replies, key=lambda r: r.id).body, requests.Pong)
        good.send(requests.Ping("good", 1))
        until(lambda: good.replies, publisher.poll, good.read)
        assert isinstance(good.replies[0].body, requests.Pong), "the rate is each viewer's own"
    assert sum("more than 20 requests a second" in record.getMessage() for record in caplog.records) == 1


def known_viewers() -> int:
    """Returns the viewers for which the edge stores state."""
    gc.collect()
    return sum(type(each).__name__ == "_Viewer" for each in gc.get_objects())


def test_viewers_that_have_gone_are_forgotten(publisher: Publisher) -> None:
    context = make_context()
    for number in range(100):
        dealer = context.socket(zmq.DEALER)
        dealer.setsockopt(zmq.IDENTITY, b"viewer %d" % number)
        dealer.connect(publisher.endpoint.control_address)
        dealer.send(pack_control(requests.Request(1, requests.Hello(f"v{number}", True))))
        until(lambda d=dealer: d.poll(0), publisher.poll)
        dealer.close(linger=0)
    context.destroy(linger=0)
    deadline = time.monotonic() + 5.0
    while known_viewers() > 0 and time.monotonic() < deadline:
        publisher.poll()
    assert known_viewers() == 0


def closed(connection: socket.socket) -> bool:
    """Returns True if the peer has closed the connection."""
    connection.setblocking(False)
    try:
        while connection.recv(4096):
            pass
    except BlockingIOError:
        return False
    except ConnectionError:
        pass
    return True


@pytest.mark.parametrize("port", ["pose_port", "control_port"])
def test_silent_connection_does_not_block(publisher: Publisher, port: str) -> None:
    idle = socket.create_connection(("127.0.0.1", getattr(publisher.endpoint, port)))
    start = time.monotonic()
    with idle:
        while not closed(idle):
            assert time.monotonic() - start < 20.0, "libzmq's own patience is 30 s"
            publisher.poll()
            time.sleep(0.01)


@pytest.mark.parametrize("port", ["pose_port", "control_port"])
def test_a_newcomer_finds_a_place_among_idle_connections(publisher: Publisher, peers, port: str) -> None:
    """There are more connections than the limit. The new one replaces an idle one, and the limit holds."""
    address = ("127.0.0.1", getattr(publisher.endpoint, port))
    idle = []
    for _ in range(300):
        idle.append(socket.create_connection(address))
        publisher.poll()
    until(lambda: sum(map(closed, idle)) >= 100, publisher.poll)
    context = make_context()
    subscriber = context.socket(zmq.SUB)
    subscriber.setsockopt(zmq.SUBSCRIBE, b"status")
    subscriber.connect(publisher.endpoint.stream_address)
    until(lambda: subscriber.poll(0), publisher.send_heartbeat)
    context.destroy(linger=0)
    good = peers(publisher)
    good.send(requests.Ping("good", 1))
    until(lambda: good.replies, publisher.poll, good.read)
    for each in idle:
        each.close()


def test_a_subscriber_gets_what_it_subscribed_to(publisher: Publisher) -> None:
    context = make_context()
    subscriber = context.socket(zmq.SUB)
    for topic in (b"status", b"bodies", b"nothing like it"):
        subscriber.setsockopt(zmq.SUBSCRIBE, topic)
    subscriber.connect(publisher.endpoint.stream_address)
    until(lambda: subscriber.poll(0), publisher.send_heartbeat)
    publisher.publish(streams.CuesMessage("lamp", "possessed", bytes(4), bytes(2), 1))
    publisher.publish(streams.BodiesMessage(7, 0, []))
    heard: set[bytes] = set()

    def take() -> None:
        while subscriber.poll(0):
            heard.add(subscriber.recv().partition(b"\0")[0])

    until(lambda: b"bodies" in heard, take)
    assert heard == {b"status", b"bodies"}
    subscriber.setsockopt(zmq.UNSUBSCRIBE, b"bodies")
    subscriber.setsockopt(zmq.SUBSCRIBE, b"cues")

    def publish() -> None:
        publisher.publish(streams.CuesMessage("lamp", "free"))
        publisher.send_heartbeat()

    until(lambda: b"cues" in heard, publish, take)
    heard.clear()
    publisher.publish(streams.BodiesMessage(8, 0, []))
    publisher.publish(streams.CuesMessage("lamp", "free"))
    until(lambda: b"cues" in heard, take)
    assert b"bodies" not in heard
    context.destroy(linger=0)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "*", "192.0.2.1"])
def test_other_machines_are_admitted_only_if_enabled(host: str) -> None:
    with pytest.raises(InputError, match=r"possess characters.*keys make.*--insecure.*insecure = true"):
        Publisher(name=unique(), host=host, pose_port=0, control_port=0)


@pytest.mark.parametrize(
    ("host", "is_open"), [("localhost", False), ("127.0.0.1", False), ("127.8.8.8", False), ("0.0.0.0", True)]
)
def test_local_and_opened_hosts_can_be_bound(host: str, is_open: bool) -> None:
    Publisher(name=unique(), host=host, pose_port=0, control_port=0, open_to_all=is_open).close()


@pytest.mark.slow
def test_the_command_line_refuses_other_machines_in_a_sentence(tmp_path: Path) -> None:
    asked = [sys.executable, "-m", "enliven", "edge", "--host", "0.0.0.0"]
    done = subprocess.run(asked, capture_output=True, text=True, timeout=2 * PATIENCE, cwd=tmp_path)
    assert done.returncode == 3 and "Traceback" not in done.stderr
    assert "--insecure" in done.stderr and "0.0.0.0" in done.stderr


@pytest.mark.skipif(os.name != "posix", reason="there are no such limits here")
def test_the_limit_of_descriptors_is_raised_and_leaves_some_for_the_rest() -> None:
    code = (
        "import resource as r; r.setrlimit(r.RLIMIT_NOFILE, (64, 300));"
        "from enliven_edge.network.tcp_listener import raise_descriptor_limit as up; print(up());"
        "from enliven_edge.network.tcp_listener import limit_connections as c;"
        "print(r.getrlimit(r.RLIMIT_NOFILE)[0], c(200))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    raised, limit, allowed = map(int, done.stdout.split())
    assert raised == limit == 300 and allowed >= 4 and 2 * allowed < 300


@pytest.fixture
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Uses a temporary folder for edge names instead of the user's."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    tmp_path.chmod(0o700)
    return tmp_path


@pytest.mark.skipif(os.name != "posix", reason="there are no such links here")
def test_a_link_in_the_place_of_a_name_is_not_followed(own_folder: Path) -> None:
    precious = own_folder / "precious"
    precious.write_text("years of work")
    (own_folder / "enliven-edge-stage.lock").symlink_to(precious)
    with pytest.raises(ResourceError, match="Remove the lock file"):
        NameLock("stage")
    assert precious.read_text() == "years of work"


@pytest.mark.skipif(os.name != "posix", reason="there are no such modes here")
def test_names_are_kept_in_a_folder_that_only_the_user_writes_to(
    own_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with contextlib.closing(NameLock("stage")):
        assert (own_folder / "enliven-edge-stage.lock").exists()
    assert list(own_folder.iterdir()) == []
    own_folder.chmod(0o777)
    lock = NameLock("stage")
    folder = own_folder / f"enliven-{os.getuid()}"
    assert (folder / "enliven-edge-stage.lock").exists() and folder.stat().st_mode & 0o777 == 0o700
    lock.close()
    folder.chmod(0o777)
    with pytest.raises(ResourceError, match=r"belongs to another user.*XDG_RUNTIME_DIR"):
        NameLock("stage")
