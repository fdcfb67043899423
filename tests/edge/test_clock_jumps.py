"""Tests that a wall clock that is set back or forward neither stops the edge nor changes its statistics."""

import math
import time
import uuid

import pytest
from patience import TIMEOUT_S

from enliven.keys.pairing import PairingCodes
from enliven.wire import BodiesMessage, StatusMessage
from enliven_edge.liveness import ProgressReporter
from enliven_edge.network.outlet import Outlet
from enliven_edge.recording.parts import PartedRecorder
from enliven_edge.recording.settings import RecordingSettings
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.sensor.synthetic import SyntheticSensor

HOUR_S = 3600.0
JUMPS_S = [0.0, 6 * HOUR_S, -30 * HOUR_S, 400 * 24 * HOUR_S, -5 * HOUR_S]
"""Successive offsets of the wall clock, seconds."""


@pytest.fixture
def jumping_clock(monkeypatch):
    """A wall clock with an offset in seconds that tests set. The monotonic clock is the real one."""
    offset_s = [0.0]
    real, real_ns = time.time, time.time_ns
    monkeypatch.setattr(time, "time", lambda: real() + offset_s[0])
    monkeypatch.setattr(time, "time_ns", lambda: real_ns() + int(offset_s[0] * 1e9))
    local = time.localtime
    monkeypatch.setattr(time, "strftime", _strftime(local))
    return offset_s


def _strftime(local):
    """Returns a ``time.strftime`` that reads the patched clock."""
    real = time.strftime
    return lambda text, moment=None: real(text, local(time.time()) if moment is None else moment)


def test_frames_go_on_with_true_latency_and_rate(tmp_path, jumping_clock) -> None:
    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    sent: list[BodiesMessage | StatusMessage] = []
    with (
        SyntheticSensor(choreography="idle", width=160, realtime=False) as sensor,
        Outlet(wire, "synthetic", record=tmp_path / "take-{time}.mcap") as outlet,
    ):
        progress = ProgressReporter(None, wire.name, lambda: outlet.publisher.status, tmp_path)
        edge = Edge(sensor, Tracker(), Stage([]), outlet, progress=progress, stop_after=1.0)
        publish, step, heartbeats = outlet.publisher.publish, edge.step, [0]

        def listen(message):
            if isinstance(message, BodiesMessage | StatusMessage):
                sent.append(message)
            return publish(message)

        def jump(frame) -> None:
            jumping_clock[0] = JUMPS_S[edge.frames // 5 % len(JUMPS_S)]
            step(frame)

        outlet.publisher.publish, edge.step = listen, jump
        edge.run()
        progress.close()
        assert edge.frames == 30
        assert 0.0 < edge.pace.latency_ms(0) <= edge.pace.latency_ms(100) < 1e3 * TIMEOUT_S
        assert 0.0 < edge.pace.fps < math.inf
        assert 0.0 <= edge.tracker.output.latency < TIMEOUT_S
        heartbeats = [message for message in sent if isinstance(message, StatusMessage)]
        assert heartbeats and all(0.0 <= message.fps < 1e4 for message in heartbeats)
    offsets = {
        round((message.captured_ns * 1e-9 - time.time()) / HOUR_S)
        for message in sent[1:]
        if isinstance(message, BodiesMessage)
    }
    assert len(offsets) == len(JUMPS_S), "captured times follow the clock as it is set"
    assert len(list(tmp_path.glob("take-*.mcap"))) == 1


def test_parts_get_free_names_when_the_clock_is_set_back(tmp_path, jumping_clock) -> None:
    settings = RecordingSettings(part_mb=0.1)
    with PartedRecorder(tmp_path / "take-{time}.mcap", settings=settings) as recorder:
        for jump_s in JUMPS_S:
            jumping_clock[0] = jump_s
            recorder._size_checked_at = -math.inf
            for time_ns in range(40):
                recorder.write("topic", "kind", "", "", "bytes", bytes(8000), time_ns)
    assert recorder.lost == 0 and recorder.failure is None
    assert all(path.exists() for path in recorder.paths)


def test_pairing_code_does_not_expire_by_a_jump(jumping_clock) -> None:
    desk = PairingCodes()
    desk.open_for(1000.0)
    before = desk.seconds_left
    jumping_clock[0] = 400 * 24 * HOUR_S
    desk.poll()
    assert before - TIMEOUT_S < desk.seconds_left <= before
