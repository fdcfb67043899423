"""Tests that a supervisor is notified of visible progress only, and that the health page reads the edge's
state.
"""

import os
import socket
import sys
import threading
import time
import uuid

import pytest
from patience import wait_until

from enliven.frames import BodyFrame
from enliven.supervision.notify import Notifier, read_notification
from enliven.supervision.records import read_services
from enliven.wire import StatusMessage
from enliven_edge.liveness import ProgressReporter, extend_start_timeout, resident_mb
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor, SensorFault
from enliven_edge.sensors.reopening import ReopeningSensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker

pytestmark = pytest.mark.skipif(not hasattr(socket, "AF_UNIX"), reason="sd_notify needs Unix sockets")


class Supervisor:
    """The receiving end of a notifier."""

    def __init__(self, folder) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(folder / "notify"))
        self._socket.setblocking(False)
        self.address = str(folder / "notify")
        self.notifier = Notifier(self.address)

    def take(self) -> list[str]:
        """Returns the kinds of notifications since the last call."""
        kinds = []
        while True:
            try:
                kinds += [key for key in read_notification(self._socket.recv(4096)) if key != "STATUS"]
            except BlockingIOError:
                return kinds

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def supervisor(tmp_path):
    opened = Supervisor(tmp_path)
    yield opened
    opened.close()


class Script(Sensor):
    """A scripted sensor. Each step is a frame's time, "silent", "fault", or "end"."""

    name, fps = "script", 30.0

    def __init__(self, *steps: object, waiting: bool = False) -> None:
        self._steps = list(steps)
        self._waiting = waiting

    @property
    def is_waiting(self) -> bool:
        return self._waiting

    def read(self, timeout=None):
        step = self._steps.pop(0) if self._steps else "end"
        if step == "silent":
            raise TimeoutError
        if step == "fault":
            raise SensorFault("it is gone", where="script")
        return None if step == "end" else BodyFrame([], step, "script")


def run(supervisor, sensor) -> list[str]:
    """Returns the notifications of an edge that reads the sensor to its end."""
    with Outlet(WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0), "script") as outlet:
        # In this test, every report counts, even if it closely follows another.
        supervisor.notifier._reported_at = -1e9
        progress = ProgressReporter(supervisor.notifier)
        Edge(sensor, Tracker(), Stage([]), outlet, progress=progress).run()
        progress.close()
        supervisor.notifier = Notifier(supervisor.address)
        return sorted(supervisor.take())


def test_ready_comes_with_the_first_turn_and_progress_with_a_published_frame(supervisor) -> None:
    assert run(supervisor, Script(1_000, 2_000)) == ["READY", "STOPPING", "WATCHDOG"]
    assert run(supervisor, Script("silent", "fault", "silent")) == ["READY", "STOPPING"]


def test_loop_that_hangs_is_not_reported(supervisor, monkeypatch) -> None:
    monkeypatch.setattr("enliven_edge.liveness._REPORT_INTERVAL_S", 0.005)
    monkeypatch.setattr("enliven.supervision.notify._MIN_INTERVAL_S", 0.0)
    with ProgressReporter(supervisor.notifier) as progress:
        progress.publish_frame()
        wait_until(lambda: "WATCHDOG" in supervisor.take(), "the report")
        time.sleep(0.1)
        assert supervisor.take() == [], "no frame has come since"
        progress.publish_frame()
        wait_until(lambda: "WATCHDOG" in supervisor.take(), "the next report")


def test_frame_that_is_not_published_is_no_progress(supervisor, monkeypatch) -> None:
    monkeypatch.setattr(Edge, "step", lambda self, frame: None)
    assert run(supervisor, Script(50_000, 60_000)) == ["READY", "STOPPING"]


def test_waiting_sensor_keeps_the_edge_alive(supervisor) -> None:
    assert run(supervisor, Script("silent", "silent", waiting=True)) == ["READY", "STOPPING", "WATCHDOG"]


class Driver(Sensor):
    """A driver that blocks in :meth:`read` while the event ``hangs`` is set."""

    name, fps = "driver", 30.0

    def __init__(self) -> None:
        self.opens, self.hangs = threading.Event(), threading.Event()
        self.released = threading.Event()

    def __call__(self):
        if not self.opens.is_set():
            raise OSError("no such device")
        return self

    def read(self, timeout=None):
        if self.hangs.is_set():
            self.released.wait()
        time.sleep(0.001)
        return BodyFrame([], time.monotonic_ns(), "driver")

    def close(self) -> None:
        return None


def test_lost_camera_waits_and_a_hanging_driver_does_not() -> None:
    driver = Driver()

    def read() -> bool:
        try:
            return sensor.read(0.05) is not None
        except (SensorFault, TimeoutError):
            return False

    with ReopeningSensor(driver, awaited="driver") as sensor:
        for _ in range(20):
            assert not read() and sensor.is_waiting
        driver.opens.set()
        wait_until(read, "a frame")
        assert not sensor.is_waiting, "frames come"
        driver.hangs.set()
        wait_until(lambda: not read() and not sensor.is_waiting, "the call that hangs")
        driver.released.set()


def test_start_is_extended_while_a_step_runs_and_not_after(supervisor, monkeypatch) -> None:
    monkeypatch.setattr("enliven_edge.liveness._EXTENSION_INTERVAL_S", 0.01)
    with extend_start_timeout(supervisor.notifier, 60.0):
        wait_until(lambda: supervisor.take().count("EXTEND_TIMEOUT_USEC"), "the first request")
        wait_until(lambda: supervisor.take().count("EXTEND_TIMEOUT_USEC"), "another request")
    supervisor.take()
    time.sleep(0.05)
    assert supervisor.take() == []
    with extend_start_timeout(supervisor.notifier, 0.0):
        time.sleep(0.1)
        assert len(supervisor.take()) <= 2, "a step that takes too long is not extended for ever"


def test_state_for_the_health_page_is_written(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("enliven_edge.liveness._RECORD_INTERVAL_S", 0.01)
    monkeypatch.setattr("enliven_edge.liveness._REPORT_INTERVAL_S", 0.01)
    status = StatusMessage("floor", 1, 1, 0, "oak", "tracking", fps=29.5, latency_p99_ms=12.0, performers=2)
    progress = ProgressReporter(None, "floor", lambda: status, tmp_path)
    progress.publish_frame(61.5)
    wait_until(lambda: [r for r in read_services(tmp_path) if r.figures["frames"]], "the state")
    progress.close()
    (record,) = read_services(tmp_path)
    assert (record.name, record.pid, record.status) == ("edge floor", os.getpid(), "tracking, oak")
    assert abs(record.progress_s - time.time()) < 60.0 and record.started_s <= record.progress_s
    expected = {"fps": 29.5, "latency_p99_ms": 12.0, "performers": 2.0, "temperature_c": 61.5}
    assert expected.items() <= record.figures.items()
    if sys.platform == "linux":
        assert 10.0 < record.figures["rss_mb"] == pytest.approx(resident_mb(), rel=0.5)


def test_first_frame_is_recorded_at_once(tmp_path, monkeypatch) -> None:
    # The next regular report and record would be a day later.
    monkeypatch.setattr("enliven_edge.liveness._REPORT_INTERVAL_S", 86400.0)
    monkeypatch.setattr("enliven_edge.liveness._RECORD_INTERVAL_S", 86400.0)
    status = StatusMessage("edge", 1, 1, 0, "oak", "tracking")
    progress = ProgressReporter(None, "edge", lambda: status, tmp_path)
    progress.publish_frame()
    wait_until(lambda: [r for r in read_services(tmp_path) if r.progress_s], "the state")
    progress.close()


def test_folder_that_cannot_be_written_is_reported_once(tmp_path, caplog, monkeypatch) -> None:
    monkeypatch.setattr("enliven_edge.liveness._RECORD_INTERVAL_S", 0.005)
    monkeypatch.setattr("enliven_edge.liveness._REPORT_INTERVAL_S", 0.005)
    (tmp_path / "file").write_text("")
    status = StatusMessage("floor", 1, 1, 0)
    with ProgressReporter(None, "floor", lambda: status, tmp_path / "file"):
        wait_until(lambda: caplog.records, "the warning")
        time.sleep(0.1)
    assert len(caplog.records) == 1 and "cannot be written" in caplog.text
