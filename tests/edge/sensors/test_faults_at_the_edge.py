"""Tests that the real edge reports and survives every sensor fault, or ends if requested."""

import time
import uuid

import pytest
from troubled import FAULTS, Troubled, camera, picture

from enliven.errors import ResourceError
from enliven.frames import DepthFrame
from enliven.health import HealthKind
from enliven.recording import Recording
from enliven.space.space_file import Place, Space
from enliven_edge.fusion.live.fused_sensor import FusedSensors
from enliven_edge.fusion.live.sensor_view import SensorState
from enliven_edge.network.outlet import Outlet
from enliven_edge.sensors.reopening import open_reopening
from enliven_edge.service import Edge
from enliven_edge.settings import WireSettings
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.health.health import HealthMonitor
from enliven_edge.tracking.tracker import Tracker

FRAMES = 160
"""Number of frames by the sensor's clock after which a health state has been cleared."""
SAID = {
    "OSError": HealthKind.SENSOR_LOST,
    "RuntimeError": HealthKind.SENSOR_LOST,
    "another size": HealthKind.RESIZED,
    "negative time": HealthKind.OUT_OF_ORDER,
}


@pytest.fixture(autouse=True)
def unplugged():
    Troubled.reset()


@pytest.fixture
def outlet(tmp_path):
    wire = WireSettings(name=uuid.uuid4().hex[:12], port=0, control_port=0)
    with Outlet(wire, "troubled", record=tmp_path / "take.mcap") as opened:
        yield opened


def serve(edge: Edge) -> list[dict[str, str]]:
    """Runs the edge; yields the problems in its heartbeat after each step, by kind."""
    reported: list[dict[str, str]] = []
    listen = edge.poll_requests

    def heard() -> None:
        reported.append({state.kind: state.what for state in edge.outlet.publisher.status.health})
        listen()

    edge.poll_requests = heard
    edge.run()
    return reported


@pytest.mark.parametrize("fault", FAULTS)
def test_edge_continues_with_the_next_good_frame(outlet, tmp_path, fault):
    with open_reopening(lambda: Troubled(FRAMES, fault, every=20)) as sensor:
        edge = Edge(sensor, Tracker(), Stage([]), outlet, health=HealthMonitor(fps=30.0))
        reported = serve(edge)
    kind = SAID.get(fault, HealthKind.BAD_FRAME)
    assert any(kind in states for states in reported)
    assert kind not in reported[-1]
    assert edge.frames == FRAMES
    outlet.close()
    assert len(list(Recording(tmp_path / "take.mcap").messages("bodies"))) == FRAMES


@pytest.mark.parametrize("fault", ["OSError", "another size", "focal length nan", "endless time"])
def test_once_option_ends_edge_at_first_fault(outlet, fault):
    with open_reopening(lambda: Troubled(FRAMES, fault, every=20)) as sensor:
        edge = Edge(sensor, Tracker(), Stage([]), outlet, health=HealthMonitor(fps=30.0), once=True)
        with pytest.raises(ResourceError, match=r"troubled: .*without --once"):
            edge.run()
    assert edge.frames == 20


def test_another_size_that_stays_is_a_new_mode_of_the_sensor(outlet):
    class Mode(Troubled):
        def read(self, timeout=None):
            frame = super().read(timeout)
            if frame is not None and Troubled.number > 20:
                return DepthFrame(picture(Troubled.number, 96, 72), camera(96, 72), frame.time_ns, self.name)
            return frame

    tracker = Tracker()
    with open_reopening(lambda: Mode(FRAMES)) as sensor:
        edge = Edge(sensor, tracker, Stage([]), outlet, health=HealthMonitor(fps=30.0))
        reported = serve(edge)
    assert "96x72 pixels instead of 64x48" in reported[21][HealthKind.RESIZED]
    assert HealthKind.RESIZED not in reported[-1]
    assert edge.frames == FRAMES - 4, "all but those that may have been a slip"
    assert tracker._mounting.camera.full == camera(96, 72)


class Plugged(Troubled):
    """A live sensor with its own frame numbers that fails once for a while."""

    breaks_at = 10

    def __init__(self, name: str, outages: list[str]) -> None:
        super().__init__(0)
        self.name, self._outages, self._number = name, outages, 0

    def read(self, timeout=None):
        time.sleep(0.02)
        self._number += 1
        if self._number == self.breaks_at and self._outages:
            raise OSError(19, self._outages.pop())
        if self._number > 60:
            return None
        return DepthFrame(picture(self._number), camera(), time.monotonic_ns(), self.name)


def fused(once: bool) -> FusedSensors:
    """Fuses two sensors. The first fails once after ten frames."""
    outages = ["No such device"]
    sensors = {
        "a": open_reopening(lambda: Plugged("a", outages)),
        "b": open_reopening(lambda: Plugged("b", [])),
    }
    rows = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    space = Space({name: Place(rows, rows) for name in sensors})
    return FusedSensors(sensors, {name: Tracker() for name in sensors}, space, once=once)


def test_one_of_several_sensors_breaks_and_comes_back(outlet):
    with fused(once=False) as sensor:
        edge = Edge(sensor, Tracker(), Stage([]), outlet)
        reported = serve(edge)
        states = sensor.states
    assert any(HealthKind.SENSOR_LOST in states for states in reported)
    assert HealthKind.SENSOR_LOST not in reported[-1]
    assert edge.frames > 60 and set(states) == {"a", "b"}
    assert SensorState.LOST not in states.values()


def test_one_of_several_sensors_ends_all_where_asked_for(outlet):
    with fused(once=True) as sensor:
        edge = Edge(sensor, Tracker(), Stage([]), outlet, once=True)
        with pytest.raises(ResourceError, match="No such device"):
            edge.run()
