"""Runs the real health page on loopback, with edges that send heartbeats and records of programs."""

from __future__ import annotations

import base64
import contextlib
import http.client
import os
import ssl
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import zmq

from enliven.health_page.server import serve_health
from enliven.kiosk.profile import KioskEdge, KioskProfile
from enliven.wire import BodiesMessage, StatusMessage, free_ports, pack_stream

PATIENCE_S = 60.0
"""Timeout for the page or for a state, in seconds. An idle machine needs two seconds."""
BODIES = pack_stream(BodiesMessage(0, 0, []))
"""The result of a frame without people."""
FINE = StatusMessage(
    "stage",
    7,
    1,
    0,
    "camera 1",
    "tracking",
    fps=29.7,
    latency_p50_ms=12.4,
    latency_p99_ms=21.0,
    performers=1,
)
"""The heartbeat of an edge that is well."""


class HeartbeatEdge:
    """A socket that publishes heartbeats and frames, as an edge does.

    Attributes:
        messages: the published messages. They may be replaced at any time.
    """

    def __init__(self, *messages: bytes) -> None:
        self.messages = messages
        self.port = free_ports(1)[0]
        self._socket, self._ended = zmq.Context.instance().socket(zmq.PUB), threading.Event()
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.bind(f"tcp://127.0.0.1:{self.port}")
        self._thread = threading.Thread(target=self._publish)
        self._thread.start()

    @property
    def address(self) -> str:
        """Returns HOST:PORT of the edge."""
        return f"127.0.0.1:{self.port}"

    def close(self) -> None:
        """Closes the socket, so that the edge becomes silent."""
        self._ended.set()
        self._thread.join()
        self._socket.close()

    def _publish(self) -> None:
        while not self._ended.wait(0.05):
            for message in self.messages:
                self._socket.send(message)


@dataclass
class Page:
    """A running health page.

    Attributes:
        port: its port.
        password: password sent with requests, empty for none.
        context: a TLS context that trusts its certificate, None if the page does not use TLS.
    """

    port: int
    password: str = ""
    context: ssl.SSLContext | None = None
    errors: list[BaseException] = field(default_factory=list)

    def request(
        self, method: str, path: str, headers: Mapping[str, str] | None = None, body: str = ""
    ) -> tuple[int, dict[str, str], bytes]:
        """Returns status, headers (names in lower case) and body of an answer."""
        headers = dict(headers or {})
        if self.password:
            credentials = base64.b64encode(f"operator:{self.password}".encode()).decode()
            headers.setdefault("Authorization", f"Basic {credentials}")
        if body:
            headers.setdefault("Content-Type", "application/x-www-form-urlencoded")
        connection = (
            http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
            if self.context is None
            else http.client.HTTPSConnection("localhost", self.port, timeout=PATIENCE_S, context=self.context)
        )
        with contextlib.closing(connection):
            connection.request(method, path, body or None, headers)
            answer = connection.getresponse()
            return answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read()

    def get(self, path: str) -> str:
        """Returns the text of the response for a path."""
        return self.request("GET", path)[2].decode()

    def wait_for(self, text: str, path: str = "/") -> str:
        """Polls a path until the response contains ``text``, and returns the response.

        Raises:
            TimeoutError: if it does not appear in time.
        """
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            answer = self.get(path)
            if text in answer:
                return answer
            time.sleep(0.1)
        raise TimeoutError(f"{path} does not show {text!r}")


@contextlib.contextmanager
def health_page(
    profile: KioskProfile, password: str = "", context: ssl.SSLContext | None = None
) -> Iterator[Page]:
    """Runs the health page of a profile on a free port, and ends it."""
    page = Page(free_ports(1)[0], password, context)
    profile = replace(profile, health=replace(profile.health, port=page.port))
    ended = threading.Event()

    def serve() -> None:
        try:
            serve_health(profile, ended.is_set)
        except BaseException as error:
            page.errors.append(error)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        _wait_until_open(page)
        yield page
    finally:
        ended.set()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()
    assert not page.errors, page.errors


def _wait_until_open(page: Page) -> None:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end and not page.errors:
        with contextlib.suppress(OSError):
            page.request("GET", "/static/health.css")
            return
        time.sleep(0.05)
    raise TimeoutError(f"the page did not open: {page.errors}")


def profile_of(edges: Mapping[str, HeartbeatEdge], name: str = "lobby") -> KioskProfile:
    """Returns a profile that watches edges."""
    return KioskProfile(
        name=name, edges={key: KioskEdge(address=edge.address) for key, edge in edges.items()}
    )


def use_own_folders(folder: Path) -> None:
    """Makes this process keep its records and data below a folder. Use it in programs, not in tests."""
    os.environ["ENLIVEN_RUNTIME"] = str(folder / "run")
    os.environ["XDG_STATE_HOME"] = str(folder / "state")
    os.environ["XDG_CONFIG_HOME"] = str(folder / "config")
