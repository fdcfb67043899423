"""Tests of the edge's loop: effects of a frame, health on the wire, and dropping late frames."""

import contextlib
import dataclasses
import time
import uuid

import msgspec
import numpy as np
import pytest
from patience import TIMEOUT_S

from enliven.frames import BodyFrame, Frame
from enliven.health import HealthKind
from enliven.person.body import Body
from enliven.person.joints import Joint
from enliven.recording import Recording
from enliven.wire.convert import message_to_bodies
from enliven.wire.requests import Done, LearnRoom, Smooth
from enliven.wire.streams import BodiesMessage
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.base import Sensor
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.health.health import HealthMonitor, HealthSettings
from enliven_edge.tracking.settings import OutputSettings, SmoothingSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.sensor.synthetic import SyntheticSensor
from enliven_viewer.link.edge_client import EdgeClient

STEP = 33_333_333


class Frames(Sensor):
    """A sensor that delivers given frames, or None if no frame is due."""

    name = "given"

    def __init__(self, frames: list[Frame | None]) -> None:
        self._frames = list(frames)

    def read(self, timeout: float | None = None) -> Frame | None:
        if not self._frames:
            return None
        frame = self._frames.pop(0)
        if frame is None:
            raise TimeoutError
        return frame

    def close(self) -> None:
        self._frames.clear()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


@pytest.fixture
def outlet(tmp_path):
    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    with Outlet(wire, "given", record=tmp_path / "take.mcap") as opened:
        yield opened


def serve(frames, outlet, tracker=None, **health) -> list[set[str]]:
    """Runs an edge on the frames. Returns the problems in its heartbeat after each frame."""
    monitor = HealthMonitor(HealthSettings(**health), fps=30.0)
    edge = Edge(Frames(frames), Tracker(tracker), Stage([]), outlet, health=monitor)
    reported: list[set[str]] = []
    listen = edge.poll_requests

    def heard() -> None:
        reported.append({state.kind for state in outlet.publisher.status.health})
        listen()

    edge.poll_requests = heard
    edge.run()
    return reported


def published(outlet, tmp_path) -> list[tuple[int, list[Body]]]:
    """Returns (time, bodies) of the take."""
    outlet.close()
    return [
        (time_ns, message_to_bodies(msgspec.msgpack.decode(data, type=BodiesMessage)))
        for time_ns, data in Recording(tmp_path / "take.mcap").messages("bodies")
    ]


@pytest.mark.slow
def test_heartbeat_reports_problems_and_late_frames_are_dropped(outlet, tmp_path):
    with SyntheticSensor(choreography="idle", width=320, realtime=False) as sensor:
        frames = [sensor.read() for _ in range(90)]
    for i in range(30, 45):
        frames[i] = dataclasses.replace(frames[i], depth=np.zeros_like(frames[i].depth))
    late = [*frames[:60], frames[50], *frames[60:]]
    reported = serve(late, outlet)
    assert reported[29] <= {HealthKind.LEARNING_ROOM}
    assert HealthKind.COVERED in reported[44]
    assert HealthKind.OUT_OF_ORDER in reported[60] and HealthKind.COVERED not in reported[60]
    sent = published(outlet, tmp_path)
    assert [time_ns for time_ns, _ in sent] == [frame.time_ns for frame in frames]
    (body,) = sent[-1][1]
    assert body.orientations.shape == (20, 4) and body.contacts.min() > 0.5
    assert body.height == pytest.approx(1.75, abs=0.25)


def test_silent_sensor_is_reported_while_it_is_silent(outlet):
    with SyntheticSensor(choreography="idle", width=160, realtime=False) as sensor:
        frames = [sensor.read() for _ in range(3)]
    reported = serve([*frames[:2], *[None] * 3, frames[2]], outlet, silent=TIMEOUT_S)
    assert HealthKind.NO_FRAMES not in reported[1]
    assert HealthKind.NO_FRAMES not in reported[-1]

    class Slow(Frames):
        def read(self, timeout=None):
            time.sleep(0.04)
            return super().read(timeout)

    edge = Edge(
        Slow([None] * 4), Tracker(), Stage([]), outlet, health=HealthMonitor(HealthSettings(silent=0.05))
    )
    edge.run()
    (state,) = outlet.publisher.status.health
    assert state.kind == HealthKind.NO_FRAMES and state.severity == 2


@pytest.mark.slow
def test_request_makes_the_edge_learn_the_room_again(outlet):
    with SyntheticSensor(choreography="idle", width=160, realtime=False) as sensor:
        frames = [sensor.read() for _ in range(120)]
    edge = Edge(Frames(frames), Tracker(), Stage([]), outlet, health=HealthMonitor(fps=30.0))
    reported = []
    listen = edge.poll_requests

    def heard() -> None:
        reported.append(HealthKind.LEARNING_ROOM in {state.kind for state in edge.health.states})
        if len(reported) == 90:
            assert isinstance(edge.handlers[LearnRoom].apply(LearnRoom()), Done)
        listen()

    edge.poll_requests = heard
    edge.run()
    assert reported[10] and not any(reported[80:90]) and reported[100]


def test_bodies_of_a_body_sensor_are_smoothed_and_mirrored(outlet, tmp_path):
    random = np.random.default_rng(0)
    base = random.normal(size=(20, 3))
    frames = [
        BodyFrame([Body(1, base + random.normal(0, 0.01, (20, 3)), np.ones(20))], i * STEP, "given")
        for i in range(30)
    ]
    settings = TrackerSettings(smoothing=SmoothingSettings(amount=8.0), output=OutputSettings(mirror=True))
    serve(frames, outlet, settings)
    hands = np.array([bodies[0].joints[Joint.HAND_LEFT] for _, bodies in published(outlet, tmp_path)])
    raw = np.array([frame.bodies[0].joints[Joint.HAND_RIGHT] * [-1, 1, 1] for frame in frames])
    assert hands[10:].std(0).max() < 0.6 * raw[10:].std(0).min()
    np.testing.assert_allclose(hands[-1], raw.mean(0), atol=0.02)


def test_a_viewer_may_turn_a_performer_s_smoothing_off(outlet, tmp_path):
    """The request uses real sockets. Afterwards, the published joints are the sensor's."""
    random = np.random.default_rng(1)
    base = random.normal(size=(20, 3))
    frames = [
        BodyFrame([Body(1, base + random.normal(0, 0.02, (20, 3)), np.ones(20))], i * STEP, "given")
        for i in range(40)
    ]
    answers = []
    with contextlib.closing(EdgeClient([outlet.publisher.endpoint])) as link:
        deadline = time.monotonic() + TIMEOUT_S
        while link.status is None and time.monotonic() < deadline:
            link.poll()
            outlet.publisher.poll()

        class Asking(Frames):
            """Sends a request before the 21st frame, and waits for the answer."""

            def read(self, timeout=None):
                if len(self._frames) == 20 and not answers and time.monotonic() < deadline:
                    if not self.asked:
                        link.ask(Smooth(1, 0.0), answers.append)
                        self.asked = True
                    link.poll()
                    raise TimeoutError
                return super().read(timeout)

        sensor = Asking(frames)
        sensor.asked = False
        settings = TrackerSettings(smoothing=SmoothingSettings(amount=8.0))
        Edge(sensor, Tracker(settings), Stage([]), outlet).run()
    assert answers == [Done()]
    away = [
        np.linalg.norm(bodies[0].joints - frame.bodies[0].joints, axis=1).max()
        for (_, bodies), frame in zip(published(outlet, tmp_path), frames, strict=True)
    ]
    assert min(away[5:20]) > 0.01 and max(away[21:]) < 0.001
