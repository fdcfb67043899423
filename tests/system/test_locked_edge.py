"""Tests of an edge with keys over real sockets.

Unpaired clients can neither read nor change anything, and watchers cannot change anything. The tests iterate
over the complete table of messages, so they also cover future messages.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import socket as sockets
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pytest
import zmq
from message_values import message
from msgspec import inspect
from patience import TIMEOUT_S
from real_edge import RealEdge
from zmq_contexts import make_context

from enliven import cli
from enliven.commands.learn_room import learn_room
from enliven.document import Character, SkinWeights
from enliven.errors import InputError, ResourceError
from enliven.keys.client import ClientKeys
from enliven.keys.key_files import KeyPair, KeyStore, PairedViewer, fingerprint
from enliven.keys.pairing import (
    CODE_LIFETIME_S,
    MAX_TRIES_PER_CODE,
    Introduction,
    PairingCodes,
    ViewerPairing,
)
from enliven.keys.roles import ROLES, Role, role_includes
from enliven.wire import (
    MAX_STREAM_BYTES,
    NEEDED_ROLES,
    REPLY,
    REQUESTS,
    STREAMS,
    Ask,
    Awaited,
    CharacterMessage,
    Done,
    Endpoint,
    FinishPairing,
    GetState,
    Hello,
    LearnRoom,
    Listen,
    Order,
    Paired,
    PairingStarted,
    Ping,
    Possess,
    Refused,
    RemoveCharacter,
    Request,
    ShowCode,
    ShownCode,
    StartPairing,
    Welcome,
    make_socket,
    pack_control,
    pack_stream,
    pair_with_edge,
    receive_heartbeat,
    unpack_control,
)
from enliven_edge.network.access import Access, open_access
from enliven_edge.network.permissions import refusal_reason
from enliven_edge.network.publisher import Publisher
from enliven_edge.network.server import ZmtpServer
from enliven_edge.settings import WireSettings
from enliven_viewer.link.edge_client import EdgeClient

from .exposed_edge import BOX_DATA, ExposedEdge, Visitor

HEARD_S = 0.25
"""Time for which an unpaired client listens, seconds. A message would arrive within 0.05 s."""
SECRET = "secretchair"
"""Name of the character on the stage, which an unpaired client must not read."""


class Locked:
    """A locked edge, and the keys of viewers with each role."""

    def __init__(self, folder: Path) -> None:
        self.store = KeyStore(folder / "edge")
        self.own = self.store.create_own_pair()
        self.keys: dict[str, KeyPair] = {}
        for role in (*ROLES, "unpaired"):
            self.keys[role] = KeyStore(folder / role).create_own_pair()
            if role in ROLES:
                self.store.add_viewer(PairedViewer(self.keys[role].public, role, role))  # type: ignore[arg-type]
        self.access = Access("stage", self.own, self.store, open_s=600.0)
        self.exposed = ExposedEdge(access=self.access)
        self.done: list[Order] = []
        for kind, handler in list(self.exposed.edge.handlers.items()):
            self.exposed.edge.handlers[kind] = handler.__class__(self.note)

    def note(self, order: Order) -> None:
        self.done.append(order)

    def client_keys(self, role: str) -> ClientKeys | None:
        """Returns the keys of a viewer with a role, None for "without keys"."""
        return ClientKeys(self.own.public, self.keys[role]) if role in self.keys else None

    @property
    def endpoint(self) -> Endpoint:
        return self.exposed.outlet.publisher.endpoint


@pytest.fixture
def locked(tmp_path: Path) -> Iterator[Locked]:
    started = Locked(tmp_path)
    started.exposed.until(lambda: True)
    yield started
    started.exposed.close()


def value(kind: type[Any]) -> Any:
    """Returns a message of a class with simple valid fields."""
    info = inspect.type_info(kind)
    assert isinstance(info, inspect.StructType)
    steady = hypothesis.settings(database=None, max_examples=20, phases=[hypothesis.Phase.generate])
    return hypothesis.find(message(info), lambda each: True, settings=steady)


def exchange(locked: Locked, keys: ClientKeys | None, body: Ask, seconds: float = TIMEOUT_S) -> Any:
    """Returns the answer to a request, or None if none arrives within ``seconds``."""
    visitor = locked.exposed.visitor(keys)
    try:
        visitor.number += 1
        visitor.socket.send(pack_control(Request(visitor.number, body)))
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            locked.exposed.frame()
            if visitor.socket.poll(0):
                return unpack_control(visitor.socket.recv(), REPLY).body
            time.sleep(0.001)
        return None
    finally:
        locked.exposed.visitors.remove(visitor)
        visitor.close()


def test_every_request_has_a_role_in_the_table() -> None:
    assert set(NEEDED_ROLES) == set(REQUESTS)
    without_role = {kind for kind, role in NEEDED_ROLES.items() if role is None}
    assert without_role == {StartPairing, FinishPairing}


def test_a_request_that_the_table_lacks_needs_the_highest_role() -> None:
    class Explode(Order, frozen=True):
        pass

    assert refusal_reason(Explode, "edit", "127.0.0.1") and not refusal_reason(
        Explode, "operate", "127.0.0.1"
    )


@pytest.mark.parametrize("kind", REQUESTS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("peer", ["without keys", "unpaired"])
def test_strangers_read_and_change_nothing_by_any_request(locked: Locked, kind: type[Ask], peer: str) -> None:
    seconds = HEARD_S if peer == "unpaired" else TIMEOUT_S
    answer = exchange(locked, locked.client_keys(peer), value(kind), seconds)
    assert locked.done == [] and locked.exposed.outlet.viewers == 0
    if peer == "unpaired":
        assert answer is None
    else:
        assert isinstance(answer, Refused) and (
            "only paired viewers" in answer.reason if NEEDED_ROLES[kind] else "pairing" in answer.reason
        )


@pytest.mark.parametrize("kind", REQUESTS, ids=lambda kind: kind.__name__)
def test_watchers_change_nothing_by_any_request(locked: Locked, kind: type[Ask]) -> None:
    answer = exchange(locked, locked.client_keys("watch"), value(kind))
    assert locked.done == [] and answer is not None
    if NEEDED_ROLES[kind] not in (None, "watch"):
        assert isinstance(answer, Refused) and "role 'watch'" in answer.reason


@pytest.mark.parametrize("kind", REQUESTS, ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("role", ROLES)
def test_each_role_may_send_its_requests_and_no_others(role: Role, kind: type[Ask]) -> None:
    may = role_includes(role, NEEDED_ROLES[kind])
    assert bool(refusal_reason(kind, role, "127.0.0.1")) == (not may)
    assert bool(refusal_reason(kind, None, "127.0.0.1")) == (NEEDED_ROLES[kind] is not None)


def test_roles_have_the_rights_that_the_page_states() -> None:
    assert role_includes(NEEDED_ROLES[Possess], "perform") and role_includes(
        NEEDED_ROLES[RemoveCharacter], "edit"
    )
    assert NEEDED_ROLES[Listen] == "operate" and NEEDED_ROLES[Hello] == "watch"


@pytest.mark.parametrize("peer", ["without keys", "unpaired", "watch"])
def test_only_paired_viewers_receive_any_stream(locked: Locked, peer: str) -> None:
    context: zmq.Context[Any] = make_context()
    socket = make_socket(context, zmq.SUB, MAX_STREAM_BYTES, 100, locked.client_keys(peer))
    for topic in STREAMS.values():
        socket.setsockopt(zmq.SUBSCRIBE, topic.name.encode() + b"\0")
    socket.connect(locked.endpoint.stream_address)
    messages = {topic.name: value(topic.type) for topic in STREAMS.values()}
    heard: set[bytes] = set()
    deadline = time.monotonic() + (TIMEOUT_S if peer == "watch" else HEARD_S)
    while time.monotonic() < deadline and len(heard) < len(messages):
        locked.exposed.frame()
        for sent in messages.values():
            locked.exposed.outlet.publisher.publish(sent)
        with contextlib.suppress(zmq.Again):
            while True:
                heard.add(socket.recv(zmq.DONTWAIT).split(b"\0")[0])
    context.destroy(linger=0)
    assert heard == ({name.encode() for name in messages} if peer == "watch" else set())


def test_bytes_on_the_wire_are_not_readable(locked: Locked) -> None:
    """A relay between a viewer and the edge finds neither names nor messages in the bytes."""
    listener = sockets.create_server(("127.0.0.1", 0))
    listener.setblocking(False)
    keys = locked.client_keys("operate")
    context: zmq.Context[Any] = make_context()
    viewer = context.socket(zmq.DEALER)
    assert keys is not None
    keys.encrypt_socket(viewer)
    viewer.connect(f"tcp://127.0.0.1:{listener.getsockname()[1]}")
    viewer.send(pack_control(Request(1, Hello("a telling name"))))
    inner: sockets.socket | None = None
    outer = sockets.create_connection(("127.0.0.1", locked.endpoint.control_port))
    outer.setblocking(False)
    seen = bytearray()

    def relay() -> None:
        nonlocal inner
        with contextlib.suppress(BlockingIOError):
            if inner is None:
                inner, _ = listener.accept()
                inner.setblocking(False)
        for source, target in ((inner, outer), (outer, inner)):
            if source is not None and target is not None:
                with contextlib.suppress(BlockingIOError):
                    data = source.recv(65536)
                    seen.extend(data)
                    target.sendall(data)

    locked.exposed.until(lambda: viewer.poll(0), relay)
    reply = viewer.recv()
    assert b"Welcome" in reply and b"Welcome" not in seen and b"telling" not in seen
    context.destroy(linger=0)
    for each in (listener, outer, inner):
        if each is not None:
            each.close()


def test_a_long_character_arrives_although_another_thread_encrypts_it(locked: Locked) -> None:
    exposed, count = locked.exposed, 100_000
    vertices = np.random.default_rng(0).random((count, 3), np.float32)
    skin = SkinWeights(np.zeros((count, 4), np.uint16), np.tile(np.float32([1, 0, 0, 0]), (count, 1)))
    face, pivot = np.array([[0, 1, 2]], np.int32), np.zeros((1, 3), np.float32)
    exposed.outlet.publisher.set_character(Character(SECRET, vertices, face, skin, pivot, face[:0, :2]))
    watcher = exposed.visitor(locked.client_keys("watch"))
    for number in (1, 2, 3):
        watcher.socket.send(pack_control(Request(number, GetState(SECRET) if number != 2 else Ping("x", 0))))
    replies: list[bytes] = []

    def hear() -> None:
        if watcher.socket.poll(0):
            replies.append(watcher.socket.recv())

    exposed.until(lambda: len(replies) == 3, hear)
    assert [len(reply) > 3_000_000 for reply in replies] == [True, False, True]
    body = unpack_control(replies[0], REPLY).body
    assert isinstance(body, CharacterMessage) and body.vertices == vertices.tobytes()
    assert REPLY.max_bytes > 3_000_000


# The viewer, and pairing ---------------------------------------------------------------------------------


@pytest.fixture
def viewer_config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> KeyStore:
    """Sets the configuration folder of this process to that of a viewer's user."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "viewer"))
    monkeypatch.setattr("enliven_viewer.link.stream_socket._REOPEN_INTERVAL_S", 0.05)
    return KeyStore()


def visit(locked: Locked, until: Any) -> EdgeClient:
    """Starts a viewer and polls it until a condition holds."""
    client = EdgeClient([locked.endpoint])
    locked.exposed.until(lambda: until(client), client.poll)
    return client


def state_of(client: EdgeClient) -> str:
    return next(iter(client.health.values())).state


def text_of(client: EdgeClient) -> str:
    return next(iter(client.health.values())).text


def run_beside(locked: Locked, function: Any) -> Any:
    """Runs a blocking function in another thread while the edge answers, and returns its result."""
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(function)
        locked.exposed.until(future.done)
        return future.result()


def test_a_viewer_pairs_and_is_connected_without_a_restart(
    locked: Locked, viewer_config: KeyStore, capsys: pytest.CaptureFixture[str]
) -> None:
    client = visit(locked, lambda client: state_of(client) == "no access")
    assert "only paired viewers" in text_of(client) and "enliven pair 127.0.0.1" in text_of(client)
    assert any("only paired viewers" in notice.text for notice in client.take_notices())
    locked.access.open_pairing()
    code = locked.access.desk.code
    words = ["pair", str(locked.endpoint), code[:3], code[3:], "--role", "watch", "--name", "lap\ntop"]
    assert run_beside(locked, lambda: cli.run(words)) == 0
    output = capsys.readouterr().out
    assert "paired with stage in the role watch" in output and fingerprint(locked.own.public) in output
    locked.exposed.until(lambda: state_of(client) == "connected", client.poll)
    locked.exposed.until(lambda: client.edges[0].role == "watch", client.poll)
    own = viewer_config.load_own_pair()
    assert own is not None and locked.store.load_viewers()[own.public].role == "watch"
    answers: list[Any] = []
    client.ask(RemoveCharacter(SECRET))
    client.ask(Possess(), answers.append)
    locked.exposed.until(lambda: answers, client.poll)
    assert isinstance(answers[0], Refused) and "role 'perform'" in answers[0].reason and locked.done == []
    client.close()


def test_forgotten_viewer_is_disconnected_and_notified(
    locked: Locked, viewer_config: KeyStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("enliven_edge.network.access._REFRESH_INTERVAL_S", 0.05)
    locked.access.open_pairing()
    code = locked.access.desk.code
    run_beside(locked, lambda: pair_with_edge(locked.endpoint, code, "edit", "laptop", viewer_config))
    client = visit(locked, lambda client: state_of(client) == "connected")
    locked.store.forget("laptop")
    locked.exposed.until(lambda: state_of(client) == "no access", client.poll)
    assert "does not know this viewer's key" in text_of(client)
    client.close()


@pytest.mark.parametrize("code", ["12345", "no code", "000000"])
def test_a_failed_pairing_stores_nothing(
    locked: Locked, viewer_config: KeyStore, monkeypatch: pytest.MonkeyPatch, code: str
) -> None:
    """Stored keys would lock the next edge of this user."""
    monkeypatch.setattr("enliven.keys.pairing.secrets.randbelow", lambda limit: 7)
    locked.access.open_pairing()
    with pytest.raises(InputError):
        run_beside(locked, lambda: pair_with_edge(locked.endpoint, code, "edit", "laptop", viewer_config))
    assert viewer_config.load_own_pair() is None and viewer_config.load_edges() == []


def test_viewer_reports_a_changed_edge_key(locked: Locked, viewer_config: KeyStore) -> None:
    viewer_config.create_own_pair()
    client = visit(locked, lambda client: state_of(client) == "no access")
    assert "has another key" in text_of(client) and "pair again" in text_of(client)
    client.close()
    with pytest.raises(ResourceError, match="has another key"):
        run_beside(locked, lambda: receive_heartbeat(locked.endpoint, 5.0))


def test_viewer_reports_an_edge_without_keys(viewer_config: KeyStore) -> None:
    viewer_config.create_own_pair()
    with Publisher(name=f"plain-{time.time_ns()}", pose_port=0, control_port=0) as publisher:
        client, deadline = EdgeClient([publisher.endpoint]), time.monotonic() + TIMEOUT_S
        while state_of(client) != "no access" and time.monotonic() < deadline:
            publisher.poll()
            client.poll()
        assert "uses no keys" in text_of(client)
        client.close()


def test_viewers_of_the_edges_own_user_operate_it(locked: Locked, viewer_config: KeyStore) -> None:
    viewer_config.folder.parent.mkdir(parents=True)
    locked.store.folder.rename(viewer_config.folder)
    client = visit(locked, lambda client: client.edges[0].role == "operate")
    answers: list[Any] = []
    client.ask(Listen(False), answers.append)
    locked.exposed.until(lambda: answers, client.poll)
    assert answers == [Done()] and locked.done == [Listen(False)]
    client.close()


def test_only_operators_make_the_edge_learn_the_room(
    locked: Locked, viewer_config: KeyStore, capsys: pytest.CaptureFixture[str]
) -> None:
    locked.access.open_pairing()
    code = locked.access.desk.code
    run_beside(locked, lambda: pair_with_edge(locked.endpoint, code, "edit", "laptop", viewer_config))
    with pytest.raises(InputError, match="'operate'"):
        run_beside(locked, lambda: learn_room(str(locked.endpoint)))
    assert locked.done == []
    shutil.rmtree(viewer_config.folder)
    locked.store.folder.rename(viewer_config.folder)
    run_beside(locked, lambda: learn_room(str(locked.endpoint)))
    assert locked.done == [LearnRoom()] and capsys.readouterr().out.startswith("127.0.0.1: ")


def test_damaged_keys_stop_a_viewer_with_a_sentence(viewer_config: KeyStore) -> None:
    viewer_config.create_own_pair()
    viewer_config.own_path.chmod(0o644)
    with pytest.raises(InputError, match="chmod 600"):
        EdgeClient()


def wrong(code: str) -> str:
    return f"{(int(code) + 1) % 1_000_000:06}"


def try_code(visitor: Visitor, code: str, public: bytes = b"x" * 32) -> Any:
    """Tries a code over the network. Returns the last answer."""
    viewer = ViewerPairing(code)
    answer = visitor.ask(StartPairing(viewer.message))
    if not isinstance(answer, PairingStarted):
        return answer
    box = viewer.encrypt_introduction(answer.message, Introduction(public, "thief", "operate"))
    return visitor.ask(FinishPairing(box))


def test_a_code_tried_ten_times_over_the_network_pairs_nobody(locked: Locked) -> None:
    locked.access.open_pairing()
    code, before = locked.access.desk.code, locked.store.load_viewers()
    reasons = [try_code(locked.exposed.visitor(), wrong(code)).reason for _ in range(9)]
    assert reasons[:MAX_TRIES_PER_CODE] == ["the pairing code is wrong"] * MAX_TRIES_PER_CODE
    assert all("too many tries" in reason for reason in reasons[MAX_TRIES_PER_CODE:])
    assert "too many tries" in try_code(locked.exposed.visitor(), code).reason, (
        "also the right one, the tenth"
    )
    assert locked.store.load_viewers() == before


def test_an_expired_code_and_a_closed_edge_pair_nobody(locked: Locked) -> None:
    assert "pairing is closed" in try_code(locked.exposed.visitor(), "123456").reason
    clock = [1000.0]
    locked.access.desk = PairingCodes(clock=lambda: clock[0])
    locked.access.open_pairing()
    code = locked.access.desk.code
    clock[0] += CODE_LIFETIME_S
    assert locked.access.desk.code not in ("", code)
    assert "wrong" in try_code(locked.exposed.visitor(), code).reason
    clock[0] += 10 * CODE_LIFETIME_S
    assert "pairing is closed" in try_code(locked.exposed.visitor(), code).reason


def test_pairing_box_is_bound_to_its_connection(locked: Locked) -> None:
    locked.access.open_pairing()
    viewer = ViewerPairing(locked.access.desk.code)
    started = locked.exposed.visitor().ask(StartPairing(viewer.message))
    box = viewer.encrypt_introduction(started.message, Introduction(b"x" * 32, "me", "watch"))
    answer = locked.exposed.visitor().ask(FinishPairing(box))
    assert isinstance(answer, Refused) and "not started on this connection" in answer.reason


def test_the_edge_grants_at_most_its_highest_role(tmp_path: Path) -> None:
    store = KeyStore(tmp_path / "keys")
    access = Access("stage", store.create_own_pair(), store, highest="perform", open_s=600)
    exposed = ExposedEdge(access=access)
    try:
        access.open_pairing()
        assert isinstance(try_code(exposed.visitor(), access.desk.code), Paired)
        assert [viewer.role for viewer in store.load_viewers().values()] == ["perform"]
    finally:
        exposed.close()


def test_only_operators_see_the_code_and_the_heartbeat_does_not_tell_it(locked: Locked) -> None:
    operator = locked.exposed.visitor(locked.client_keys("operate"))
    shown = operator.ask(ShowCode())
    assert isinstance(shown, ShownCode) and shown.code == locked.access.desk.code and shown.seconds > 0
    publisher = locked.exposed.outlet.publisher
    publisher.send_heartbeat()
    assert publisher.status.pairing_s > 0 and shown.code.encode() not in pack_stream(publisher.status)
    welcome = locked.exposed.visitor(locked.client_keys("watch")).ask(Hello("me"))
    assert isinstance(welcome, Welcome) and welcome.role == "watch"
    assert shown.code not in repr(welcome)


def test_an_edge_without_keys_answers_everyone_and_needs_no_pairing() -> None:
    exposed = ExposedEdge()
    try:
        visitor = exposed.visitor()
        welcome = visitor.ask(Hello("me"))
        assert isinstance(welcome, Welcome) and welcome.role == "operate"
        assert "no pairing" in visitor.ask(StartPairing(b"x")).reason
        order, answer = visitor.announce("box", data=BOX_DATA)
        assert isinstance(answer, Awaited) and order.id == "box"
    finally:
        exposed.close()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has all addresses of 127.0.0.0/8")
def test_strangers_at_many_addresses_keep_no_paired_viewer_out(
    locked: Locked, request: pytest.FixtureRequest
) -> None:
    server = ZmtpServer("127.0.0.1", 0, "--port", "ROUTER", 1000, 4, locked.access.curve)
    context: zmq.Context[Any] = make_context()
    request.addfinalizer(lambda: context.destroy(linger=0))

    def connect(keys: ClientKeys | None, address: str) -> Any:
        socket = make_socket(context, zmq.DEALER, 1000, 10, keys)
        # A rejected client must not connect again in the slot of the next one, which this test waits for.
        socket.setsockopt(zmq.RECONNECT_IVL, -1)
        socket.connect(f"tcp://{address}:0;127.0.0.1:{server.port}")
        socket.send(b"here")
        # The slot of a silent client would become free after 10 s in any case.
        deadline, heard = time.monotonic() + 8.0, False
        while not heard:
            assert time.monotonic() < deadline, "the server does not answer"
            for peer, _ in server.messages(time.monotonic() + 0.01):
                peer.introduced = heard = True
        return socket

    strangers = [connect(None, f"127.0.0.{10 + number}") for number in range(4)]
    assert len(list(server.connections)) == 4
    viewer = connect(locked.client_keys("watch"), "127.0.0.1")
    (paired,) = (peer for peer in server.connections if peer.session.channel is not None)
    strangers += [connect(None, f"127.0.0.{20 + number}") for number in range(12)]
    assert paired.is_open and len(list(server.connections)) <= 4
    viewer.send(b"still here")
    deadline, heard = time.monotonic() + TIMEOUT_S, list[bytes]()
    while b"still here" not in heard and time.monotonic() < deadline:
        heard += [parts[0] for _, parts in server.messages(time.monotonic() + 0.01)]
    assert b"still here" in heard
    server.close()


# Starting an edge ----------------------------------------------------------------------------------------


def test_other_machines_need_keys_or_insecure(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    store = KeyStore(tmp_path / "keys")
    with pytest.raises(InputError, match=r"has no keys.*enliven keys make.*--insecure"):
        open_access(WireSettings(host="0.0.0.0"), store)
    assert open_access(WireSettings(), store) is None, "a laptop needs no keys"
    assert open_access(WireSettings(host="0.0.0.0", insecure=True), store) is None
    for word in ("everyone", "watch", "possess", "remove", "scan", "encrypted"):
        assert word in caplog.text
    keys = store.create_own_pair()
    for host, is_open in (("127.0.0.1", False), ("0.0.0.0", True)):
        access = open_access(WireSettings(host=host), store)
        assert access is not None and access.curve.keys == keys and bool(access.open_s) == is_open
    store.own_path.chmod(0o666)
    with pytest.raises(InputError, match="chmod 600"):
        open_access(WireSettings(), store)


def test_a_damaged_file_of_a_viewer_locks_out_that_viewer_only(
    locked: Locked, caplog: pytest.LogCaptureFixture
) -> None:
    path = locked.store.folder / "viewers" / f"{fingerprint(locked.keys['edit'].public)}.toml"
    path.write_text(path.read_text().replace("edit", "king"))
    locked.access.refresh(immediately=True)
    assert locked.access.viewer_role(locked.keys["edit"].public) is None and "cannot connect" in caplog.text
    assert locked.access.viewer_role(locked.keys["watch"].public) == "watch"


@pytest.mark.slow
@pytest.mark.system
def test_real_programs_pair_by_the_code_in_the_edges_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "edge"))
    assert cli.run(["keys", "make"]) == 0
    edge = RealEdge("--sensor", "synthetic", "--host", "0.0.0.0")
    try:
        code, deadline = None, time.monotonic() + 300.0
        while code is None and time.monotonic() < deadline:
            code = re.search(r"enliven pair HOST (\d{3}) (\d{3})", Path(edge.log.name).read_text())
            time.sleep(0.1)
        assert code is not None, Path(edge.log.name).read_text()
        monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "viewer"))
        assert cli.run(["doctor", "--remote", edge.address]) == 4
        assert "only paired viewers" in " ".join(capsys.readouterr().out.split())
        assert cli.run(["pair", edge.address, *code.groups(), "--role", "watch"]) == 0
        edge.wait()
        assert cli.run(["doctor", "--remote", edge.address]) in (0, 4)
        assert "performer" in capsys.readouterr().out
        assert cli.run(["pair", edge.address, "--show-code"]) == 3
        assert "role 'operate'" in capsys.readouterr().err
    finally:
        edge.close()
