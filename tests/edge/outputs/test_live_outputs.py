"""Tests that an edge passes its frames, attachments and health states to its live outputs."""

import logging
import socket
import time

import numpy as np
import pytest
from live_receivers import OscReceiver
from patience import wait_until
from posed_people import performer

from enliven.frames import BodyFrame
from enliven.health import HealthKind
from enliven.outputs.opening import open_outputs
from enliven.outputs.settings import collect_output_settings
from enliven.wire import HoldMessage
from enliven_edge.live_outputs import LiveOutputs
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.stage.tick import Tick
from enliven_edge.tracking.tracker import Tracker


@pytest.fixture
def port():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@pytest.mark.slow
def test_lost_packets_are_a_health_state_and_are_logged_once(caplog):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    stage = Stage()
    with (
        caplog.at_level(logging.WARNING),
        LiveOutputs(open_outputs(collect_output_settings([f"osc:127.0.0.1:{port}"], {}))) as outputs,
    ):

        def trouble():
            outputs.publish(Tick(BodyFrame([], 5, "made")), stage)
            return outputs.health_states

        (state,) = wait_until(trouble, "the health state")
        assert state.kind == HealthKind.OUTPUT_FAILS and state.since_ns == 5
        assert (
            f"osc:127.0.0.1:{port}" in state.what
            and "no program receives packets" in state.what
            and state.remedy
        )
        for _ in range(50):
            trouble()
            time.sleep(0.002)
        assert len([r for r in caplog.records if "no program receives packets" in r.getMessage()]) == 1
        with OscReceiver(port):
            wait_until(lambda: not trouble(), "the state is cleared")


@pytest.mark.slow
def test_many_outputs_get_the_same_frames():
    receivers = [OscReceiver() for _ in range(8)]
    try:
        words = [f"{'vmc' if k % 2 else 'osc'}:127.0.0.1:{r.port}" for k, r in enumerate(receivers)]
        with LiveOutputs(open_outputs(collect_output_settings(words, {}))) as outputs:
            stage = Stage()
            keys = ["/VMC/Ext/T" if k % 2 else "/enliven/time" for k in range(len(receivers))]

            def publish(number):
                frame = BodyFrame([performer()], 10**9 + number * 10**7, "made")
                outputs.publish(Tick(frame, frame.bodies), stage)
                time.sleep(0.01)

            def all_have(number):
                publish(number)  # again, because a busy machine drops unread packets
                times = [r.values.get(key, (None,))[0] for r, key in zip(receivers, keys, strict=True)]
                return None not in times and times == pytest.approx([0.01 * number] * len(times))

            # Late frames are dropped, and the first frame that is sent has time 0.
            wait_until(lambda: all_have(0), "the first frame")
            for number in range(1, 20):
                publish(number)
            wait_until(lambda: all_have(19), "the last frame")
    finally:
        for receiver in receivers:
            receiver.__exit__()


@pytest.mark.slow
def test_holds_become_events():
    with (
        OscReceiver() as receiver,
        LiveOutputs(open_outputs(collect_output_settings([f"osc:127.0.0.1:{receiver.port}"], {}))) as outputs,
    ):
        frame, stage = BodyFrame([performer(33)], 10**9, "made"), Stage()
        holds = [HoldMessage("lamp", 10**9, "alone", body=33), HoldMessage("chair", 10**9, "release")]
        outputs.publish(Tick(frame, frame.bodies, holds=holds), stage)
        wait_until(lambda: ("/enliven/event/release", "chair") in receiver.values)
        assert receiver.values["/enliven/event/possess", "lamp"] == (1,)
        assert receiver.values["/enliven/event/enter"] == (1,)


def test_an_edge_without_outputs_does_nothing():
    outputs = LiveOutputs()
    outputs.publish(Tick(BodyFrame([performer()], 0, "made"), [performer()]), Stage())
    assert outputs.health_states == [] and outputs.outputs.statuses == []
    outputs.close()


def ready_client(kind, outputs: LiveOutputs, port: int):
    """Returns a client of the output process as soon as the process listens."""
    wait_until(lambda: outputs.outputs.is_ready, "the process of the outputs")
    return kind(port, ["/health", "/stage"])


@pytest.mark.slow
def test_an_edge_reports_its_health_while_there_are_no_frames(port):
    pytest.importorskip("foxglove", reason="foxglove-sdk is not installed (the extra foxglove)")
    pytest.importorskip("google.protobuf", reason="protobuf is not installed")
    from foxglove_client import FoxgloveClient

    class Silent(Sensor):
        name = "silent"
        may_be_silent = False

        def read(self, timeout=None):
            raise TimeoutError

        def close(self):
            pass

    with (
        LiveOutputs(open_outputs(collect_output_settings([f"foxglove:127.0.0.1:{port}"], {}))) as outputs,
        Outlet(WireSettings(name="fox", port=0, control_port=0), "silent") as outlet,
        ready_client(FoxgloveClient, outputs, port) as client,
    ):
        edge = Edge(Silent(), Tracker(), Stage(), outlet, outputs=outputs)
        edge.step(BodyFrame([performer()], 10**9, "silent", np.eye(4)))
        edge._last_frame_at -= 60.0

        def reported():
            edge._wait()
            return client.newest("/health")

        assert wait_until(reported, "the health state").name == "no frames"
