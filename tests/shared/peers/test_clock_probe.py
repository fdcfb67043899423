"""Tests of the probe thread over real sockets: the true offset of one machine's two clocks is known."""

from __future__ import annotations

import contextlib
import threading
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
from patience import wait_until

from enliven.keys.key_files import KeyStore
from enliven.peers.clock_probe import ClockProbe
from enliven.wire import Endpoint, free_ports
from enliven_edge.network.access import Access
from enliven_edge.network.publisher import Publisher


@contextlib.contextmanager
def running(publisher: Publisher) -> Iterator[None]:
    """Polls an edge in another thread, as often as it processes frames."""
    stop = threading.Event()

    def poll() -> None:
        while not stop.is_set():
            publisher.poll()
            stop.wait(1 / 30)

    thread = threading.Thread(target=poll)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def true_offset_ns() -> int:
    return time.time_ns() - time.monotonic_ns()


@pytest.mark.parametrize("locked", [False, True])
def test_offset_of_an_edge_on_this_machine_is_known(
    locked: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    access = None
    if locked:
        store = KeyStore()
        access = Access("edge", store.create_own_pair(), store)
    with Publisher(name=uuid.uuid4().hex, pose_port=0, control_port=0, access=access) as publisher:
        probe = ClockProbe(publisher.endpoint, "test")
        with running(publisher), contextlib.closing(probe):
            wait_until(lambda: probe.is_known, "the offset")
            # The round trips do not include the edge's frame time, and bound the error.
            bound_ns = probe.sync.round_trip_ns + 1_000_000
            assert abs(probe.offset_ns() - true_offset_ns()) < bound_ns
            assert abs(probe.wall_offset_ns()) < bound_ns
            assert publisher.viewers == 0, "a probe is not a viewer"


def test_an_edge_that_starts_later_is_found() -> None:
    pose, control = free_ports()[:2]
    with contextlib.closing(ClockProbe(Endpoint("127.0.0.1", pose, control), "test")) as probe:
        time.sleep(0.3)
        assert not probe.is_known
        publisher = Publisher(name=uuid.uuid4().hex, pose_port=pose, control_port=control)
        with publisher, running(publisher):
            wait_until(lambda: probe.is_known, "the offset")
