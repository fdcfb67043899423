"""Tests that viewers receive heartbeats with the current problems during every camera failure."""

import contextlib
import os
import signal
import threading
import uuid

import pytest
from contract import TIMEOUT_S, helper_of, helpers
from patience import wait_until
from wild import Wild

from enliven.health import HealthKind
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.isolation import helper_process, isolated
from enliven_edge.sensors.isolation.isolated import IsolatedOpener
from enliven_edge.sensors.reopening import open_reopening
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.settings import TrackerSettings
from enliven_edge.tracking.tracker import Tracker
from enliven_edge.warmup import warm_up_tracking
from enliven_viewer.link.edge_client import EdgeClient

BEATS = 3
"""Number of heartbeats to wait for during a problem. A blocked edge would send none."""


class Viewer:
    """A real viewer's link that stores every heartbeat."""

    def __init__(self, endpoint) -> None:
        self.link, self.beats = EdgeClient([endpoint]), []

    def hear(self) -> dict[str, str]:
        """Returns the problems in the newest heartbeat, by kind."""
        self.link.poll()
        status = self.link.status
        if status is None:
            return {}
        if not self.beats or self.beats[-1] != status.published_ns:
            self.beats.append(status.published_ns)
        return {state.kind: state.what for state in status.health}

    def until(self, kind: HealthKind | None, words: str = "") -> None:
        """Waits until a problem (or none) is reported, and then for some heartbeats with the same report."""

        def holds() -> bool:
            health = self.hear()
            lost = {HealthKind.SENSOR_LOST, HealthKind.NO_FRAMES} & set(health)
            if kind is None:
                return bool(self.beats) and not lost
            return kind in lost and words in health[kind]

        wait_until(holds, f"{kind}: {words}")
        heard = len(self.beats)
        wait_until(lambda: holds() and len(self.beats) >= heard + BEATS, f"heartbeats with {kind}")


@pytest.fixture
def edge(tmp_path, monkeypatch):
    """Starts an edge in a thread, which waits for a missing camera, and a viewer."""
    # A hanging call stays hanging.
    monkeypatch.setattr(isolated, "SILENCE_TIMEOUT_S", 10 * TIMEOUT_S)
    monkeypatch.setattr(helper_process, "OPEN_TIMEOUT_S", 10 * TIMEOUT_S)
    (tmp_path / "gone").touch()
    warm_up_tracking(TrackerSettings())
    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    opener = IsolatedOpener("wild", Wild, {"folder": str(tmp_path), "pace": 0.02})
    with open_reopening(opener, awaited="the camera") as sensor, Outlet(wire, sensor.name) as outlet:
        served = Edge(sensor, Tracker(), Stage([]), outlet)
        thread = threading.Thread(target=served.run, daemon=True)
        thread.start()
        viewer = Viewer(outlet.publisher.endpoint)
        with contextlib.closing(viewer.link):
            yield sensor, viewer
        served.stop()
        thread.join(TIMEOUT_S)
        assert not thread.is_alive()
    wait_until(lambda: not helpers(), "an end without a helper process")


@pytest.mark.slow
def test_heartbeats_continue_during_every_camera_failure(edge, tmp_path):
    sensor, viewer = edge
    viewer.until(HealthKind.SENSOR_LOST, "no device")
    assert viewer.link.status.sensor == "the camera"
    (tmp_path / "slow").touch()
    (tmp_path / "gone").unlink()
    heard = len(viewer.beats)
    wait_until(lambda: viewer.hear() and len(viewer.beats) >= heard + BEATS, "heartbeats while it is opened")
    assert sensor._device is None, "it still was"
    (tmp_path / "slow").unlink()
    viewer.until(None)
    wait_until(lambda: viewer.hear() is not None and viewer.link.status.sensor == "wild", "its own name")
    os.kill(helper_of(sensor), signal.SIGSTOP)
    viewer.until(HealthKind.NO_FRAMES, "no frame for")
    os.kill(helper_of(sensor), signal.SIGKILL)
    wait_until(lambda: HealthKind.SENSOR_LOST in viewer.hear(), "the crash noticed")
    viewer.until(None)
    (tmp_path / "gone").touch()
    viewer.until(HealthKind.SENSOR_LOST)
    (tmp_path / "gone").unlink()
    viewer.until(None)
    apart = [1e-9 * (b - a) for a, b in zip(viewer.beats, viewer.beats[1:], strict=False)]
    print(f"{len(apart)} heartbeats in {sum(apart):.1f} s, {max(apart):.2f} s apart at most")
    assert len(apart) > sum(apart), "one a second, twice as many as must be"
