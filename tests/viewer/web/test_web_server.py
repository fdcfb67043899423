"""Tests of the web server with real sockets: files, WebSockets, access, slow pages and restarts."""

from __future__ import annotations

import contextlib
import json
import threading
import time
import urllib.error
import urllib.request
import uuid
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest
from patience import TIMEOUT_S
from published_stage import PublishedStage
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from enliven.document import Character
from enliven.errors import ResourceError
from enliven.person import Body
from enliven.wire import CharacterMessage, PoseCodec, message_to_character, message_to_pose, unpack_stream
from enliven_viewer.web.access import WebAccess, load_access
from enliven_viewer.web.server import WebServer


@contextlib.contextmanager
def serving(edge: str, access: WebAccess | None = None, port: int = 0) -> Iterator[WebServer]:
    """Yields a running server."""
    server = WebServer(edge, access or load_access("127.0.0.1"), port)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield server
    finally:
        server.stop()
        thread.join(TIMEOUT_S)
        assert not thread.is_alive()


@pytest.fixture
def stage(box: Character) -> Iterator[PublishedStage]:
    body = Body(7, np.zeros((20, 3)), np.ones(20))
    name = f"web-{uuid.uuid4().hex[:8]}"
    with PublishedStage(name, {"box": (box, box.rest_pose())}, (body,), {"box": 7}) as stage:
        yield stage


def join(server: WebServer, query: str = "", **options: str) -> ClientConnection:
    return connect(
        f"ws://127.0.0.1:{server.port}/live{query}", max_size=None, open_timeout=TIMEOUT_S, **options
    )


def messages(page: ClientConnection, topics: set[str], answers: bool = True) -> dict[str, bytes]:
    """Returns the newest message of each topic once all have arrived. ``state`` is JSON."""
    received: dict[str, bytes] = {}
    deadline = time.monotonic() + TIMEOUT_S
    while not topics <= received.keys():
        # Messages of other topics may arrive at any time.
        assert time.monotonic() < deadline, f"only {sorted(received)} came, of {sorted(topics)}"
        data = page.recv(timeout=TIMEOUT_S)
        if isinstance(data, str):
            received["state"] = data.encode()
            continue
        number, batch = msgspec.msgpack.decode(data)
        received |= {message.partition(b"\0")[0].decode(): message for message in batch}
        if answers:
            page.send(str(number))
    return received


def test_page_gets_characters_and_the_unchanged_messages_of_the_edge(
    stage: PublishedStage, box: Character
) -> None:
    with serving(stage.address) as server, join(server) as page:
        received = messages(page, {"character", "pose", "bodies", "cues", "state"})
        payload = received["character"].partition(b"\0")[2][1:]
        character = message_to_character(msgspec.msgpack.decode(payload, type=CharacterMessage))
        np.testing.assert_array_equal(character.vertices, box.vertices)
        _, message = unpack_stream(received["pose"])
        pose = message_to_pose(message, PoseCodec(character))
        np.testing.assert_allclose(pose.positions, box.pivots, atol=1e-3)
        assert [body.id for body in unpack_stream(received["bodies"])[1].bodies] == [7]
        assert unpack_stream(received["cues"])[1].body == 7


def test_state_lists_the_characters_and_removed_ones_leave(stage: PublishedStage) -> None:
    with serving(stage.address) as server, join(server) as page:
        while json.loads(messages(page, {"state"})["state"])["characters"] != ["box"]:
            pass
        stage.poses.clear()
        while json.loads(messages(page, {"state"})["state"])["characters"]:
            pass
        with join(server) as late:
            # A page that connects later does not receive what has left.
            assert "character" not in messages(late, {"bodies"})


def test_page_that_does_not_answer_gets_two_batches_and_delays_no_other(stage: PublishedStage) -> None:
    with serving(stage.address) as server, join(server) as silent, join(server) as lively:
        for _ in range(20):
            messages(lively, {"pose"})
        batches = 0
        end = time.monotonic() + 1.0
        with contextlib.suppress(TimeoutError):
            while (rest := end - time.monotonic()) > 0.0:
                batches += isinstance(silent.recv(timeout=rest), bytes)
        assert batches == 2


def test_ten_pages_get_poses_at_the_same_time(stage: PublishedStage) -> None:
    with serving(stage.address) as server, contextlib.ExitStack() as stack:
        pages = [stack.enter_context(join(server)) for _ in range(10)]
        for _ in range(3):
            for page in pages:
                messages(page, {"pose"})


def test_page_follows_a_restart_of_the_edge(stage: PublishedStage, make_box, make_character) -> None:
    with serving(stage.address) as server, join(server) as page:
        messages(page, {"character", "pose"})
        ports = stage.ports
        stage.close()
        other = make_character(*make_box((-1.0, 0.0, -1.0), (1.0, 2.0, 1.0)), nodes=4)
        poses = {"box": (other, other.rest_pose())}
        with PublishedStage(f"web-{uuid.uuid4().hex[:8]}", poses, ports=ports):
            payload = messages(page, {"character"})["character"].partition(b"\0")[2][1:]
            assert msgspec.msgpack.decode(payload, type=CharacterMessage).pivot_count == 4
            messages(page, {"pose"})


def test_server_starts_before_its_edge(box: Character) -> None:
    with PublishedStage(f"web-{uuid.uuid4().hex[:8]}", {}) as stage:
        address, ports = stage.address, stage.ports
    with serving(address) as server, join(server) as page:
        assert json.loads(messages(page, {"state"})["state"])["state"] == "waiting"
        with PublishedStage(f"web-{uuid.uuid4().hex[:8]}", {"box": (box, box.rest_pose())}, ports=ports):
            messages(page, {"character", "pose"})


def closed_with(page: ClientConnection) -> int:
    """Returns the close code that the server sends."""
    with pytest.raises(ConnectionClosed) as caught:
        while True:
            page.recv(timeout=TIMEOUT_S)
    assert caught.value.rcvd is not None
    return caught.value.rcvd.code


@pytest.mark.parametrize("answer", ["-1", "1.5", "x", "²", "9" * 65])
def test_invalid_answer_ends_the_connection_of_one_page_only(stage: PublishedStage, answer: str) -> None:
    with serving(stage.address) as server, join(server) as page, join(server) as other:
        page.send(answer)
        assert closed_with(page) in (1003, 1009)
        messages(other, {"pose"})


def test_foreign_site_and_wrong_token_are_refused(stage: PublishedStage) -> None:
    with serving(stage.address) as server, join(server, origin="http://other.example") as page:
        assert closed_with(page) == 4401
    with serving(stage.address, WebAccess("127.0.0.1", token="secret")) as server:
        with join(server, "?token=guess") as page:
            assert closed_with(page) == 4401
        with join(server, "?token=secret") as page:
            messages(page, {"pose"})
        with pytest.raises(urllib.error.HTTPError, match="403"):
            fetch(server, "share.json")


def fetch(server: WebServer, path: str) -> tuple[bytes, str]:
    """Returns the body and the media type of a file."""
    with urllib.request.urlopen(f"http://127.0.0.1:{server.port}/{path}", timeout=TIMEOUT_S) as response:
        assert "default-src 'self'" in response.headers["Content-Security-Policy"]
        return response.read(), response.headers["Content-Type"]


def test_files_of_the_page_are_served_and_no_others(stage: PublishedStage) -> None:
    with serving(stage.address) as server:
        page, kind = fetch(server, "")
        assert b'<script src="page.js">' in page and kind.startswith("text/html")
        assert fetch(server, "page.js")[1].startswith("text/javascript")
        assert json.loads(fetch(server, "share.json")[0]) == {"address": "", "qr": ""}
        for path in ("LICENCES.txt", "..%2Fpage_files.py", "page_files.py"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                fetch(server, path)


def test_share_has_the_address_and_its_code(stage: PublishedStage) -> None:
    with serving(stage.address, WebAccess("0.0.0.0")) as server:
        share = json.loads(fetch(server, "share.json")[0])
        assert share["address"].startswith("http://") and share["address"].endswith(f":{server.port}/")
        assert share["qr"].startswith("data:image/svg+xml")


def test_port_in_use_is_reported_with_the_remedy(stage: PublishedStage) -> None:
    with serving(stage.address) as server, pytest.raises(ResourceError, match="Choose another --port"):
        WebServer(stage.address, load_access("127.0.0.1"), server.port)
