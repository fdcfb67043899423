"""Tests of the notifications of a supervised program, read from a real datagram socket."""

from __future__ import annotations

import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from enliven.supervision.notify import Notifier, read_notification

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="datagram sockets with a path are POSIX")


@pytest.fixture
def supervisor(tmp_path: Path) -> Iterator[socket.socket]:
    """Returns a supervisor's non-blocking socket."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.setblocking(False)
        yield listener


def test_ready_and_progress_reach_the_supervisor(supervisor: socket.socket) -> None:
    notifier = Notifier(supervisor.getsockname())
    notifier.report_ready("waiting\nfor visitors")
    notifier.report_progress("30 frames/s")
    assert read_notification(supervisor.recv(4096)) == {"READY": "1", "STATUS": "waiting for visitors"}
    assert read_notification(supervisor.recv(4096)) == {"WATCHDOG": "1", "STATUS": "30 frames/s"}


def test_progress_is_reported_rarely(supervisor: socket.socket) -> None:
    notifier = Notifier(supervisor.getsockname())
    for _ in range(100):
        notifier.report_progress()
    assert supervisor.recv(4096) == b"WATCHDOG=1"
    with pytest.raises(BlockingIOError):
        supervisor.recv(4096)


def test_a_supervisor_that_is_gone_or_does_not_read_delays_nothing(
    supervisor: socket.socket, tmp_path: Path
) -> None:
    notifier = Notifier(supervisor.getsockname())
    for number in range(10_000):
        notifier.report_status(str(number))
    gone = Notifier(str(tmp_path / "gone"))
    gone.report_ready()
    assert gone.is_supervised


def test_without_a_supervisor_nothing_is_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    notifier = Notifier()
    notifier.report_ready()
    notifier.report_progress()
    assert not notifier.is_supervised


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="abstract names exist on Linux")
def test_an_abstract_address_is_reached() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind("\0enliven-test-notify")
        Notifier("@enliven-test-notify").report_stopping()
        assert listener.recv(100) == b"STOPPING=1"


def test_lines_without_a_value_are_left_out() -> None:
    assert read_notification(b"READY=1\nnonsense\nSTATUS=a=b\n\xff=1") == {
        "READY": "1",
        "STATUS": "a=b",
        "\ufffd": "1",
    }
