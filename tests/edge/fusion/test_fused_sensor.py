"""Tests of several sensors fused into one, with threads: recordings in parallel, live clocks, failing
sensors.
"""

import contextlib
import time

import numpy as np
import pytest
from fusion_measures import fuse_streams
from patience import TIMEOUT_S, wait_until
from tolerances import are_alike
from walkers import Walker, stand, told

from enliven.errors import ResourceError
from enliven.frames import BodyFrame
from enliven.health import HealthKind
from enliven.space.space_file import Place, Space, convert_to_nested_tuples
from enliven_edge.fusion.calibration.tracks import Collector
from enliven_edge.fusion.live.fused_sensor import FusedSensors
from enliven_edge.fusion.live.fuser import Fuser
from enliven_edge.fusion.live.merge import ArrivalClocks, sensor_positions, settings_before_fusion
from enliven_edge.fusion.live.sensor_view import SensorState
from enliven_edge.sensors.base import Sensor
from enliven_edge.tracking.settings import SceneSettings, TrackerSettings
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.sensor.synthetic import SyntheticSensor

A, B = stand(0.0, 0.0, 0.0), stand(2.4, -1.8, 70.0)
TIMES = np.arange(0.0, 3.0, 1 / 30)
SPACE = Space(
    {"a": Place(convert_to_nested_tuples(A)), "b": Place(convert_to_nested_tuples(B), None, -7_000_000_000)}
)
"""Sensor b's clock is 7 s ahead of sensor a's."""


class Reel(Sensor):
    """Body frames from memory. They are delivered like a recording that waits for its reader, or live at
    their times.

    Args:
        live: speed factor at which frames arrive, None for a recording.
        breaks: number of frames after which the sensor fails.
    """

    def __init__(self, name, frames, live=None, breaks=None):
        self.name, self.recorded = name, live is None
        self._frames, self._live, self._breaks = list(frames), live, breaks
        self._start = None
        self.closed = False

    def read(self, timeout=None):
        if self._breaks is not None:
            self._breaks -= 1
            if self._breaks < 0:
                raise ResourceError("it was unplugged", where=self.name)
        if not self._frames:
            return None
        if self._live:
            now = time.monotonic()
            self._start = self._start or (now, self._frames[0].time_ns)
            due = self._start[0] + (self._frames[0].time_ns - self._start[1]) * 1e-9 / self._live
            if timeout is not None and due - now > timeout:
                time.sleep(timeout)
                raise TimeoutError
            time.sleep(max(0.0, due - now))
        return self._frames.pop(0)

    def close(self):
        self.closed = True


def seen(walker=None, times=TIMES):
    people = [walker or Walker()]
    return {
        "a": told(people, A, times, sensor="a"),
        "b": told(people, B, times + 0.012, clock=7.0, sensor="b", ids=[5]),
    }


def watched(reels, space=SPACE):
    """Returns all frames of the fused sensor, and the sensor."""
    frames = []
    with FusedSensors(reels, {name: Tracker() for name in reels}, space) as sensor:
        while (frame := sensor.read(TIMEOUT_S)) is not None:
            frames.append(frame)
    assert all(reel.closed for reel in reels.values())
    return frames, sensor


@pytest.mark.slow
def test_recordings_run_side_by_side_whatever_their_threads_do():
    """The result equals the same streams merged without threads, frame by frame and bit by bit."""
    streams = seen()
    frames, sensor = watched({name: Reel(name, stream) for name, stream in streams.items()})
    expected = list(fuse_streams(streams, SPACE, Fuser(sensor_positions(SPACE))))
    assert [f.time_ns for f in frames] == [f.time_ns for f in expected]
    for frame, wanted in zip(frames, expected, strict=True):
        assert [b.id for b in frame.bodies] == [b.id for b in wanted.bodies]
        assert all(are_alike(x.joints, y.joints) for x, y in zip(frame.bodies, wanted.bodies, strict=True))
    assert set(sensor.states.values()) == {SensorState.ENDED}


def test_fused_body_is_at_the_persons_position():
    walker = Walker()
    frames, _ = watched({name: Reel(name, stream) for name, stream in seen(walker).items()})
    for frame in frames[6:]:
        (body,) = frame.bodies
        assert np.abs(body.joints - walker.joints(frame.time_ns * 1e-9)).max() < 0.03
        assert frame.read_ns > 0


def test_unplugged_sensor_is_reported_and_the_other_continues():
    streams = seen()
    frames, sensor = watched({"a": Reel("a", streams["a"], breaks=30), "b": Reel("b", streams["b"])})
    assert sensor.states == {"a": SensorState.LOST, "b": SensorState.ENDED}
    lost = next(w for w in sensor.warnings if w.state is SensorState.LOST)
    assert lost.sensor == "a" and "the other sensors continue" in lost.what
    assert frames[-1].time_ns > 2.8e9
    assert all(len(frame.bodies) == 1 for frame in frames[6:])
    assert any(ail.kind == HealthKind.NO_FRAMES for ail in sensor.health_states)


def test_losing_all_sensors_is_an_error():
    streams = seen()
    reels = {name: Reel(name, stream, breaks=5) for name, stream in streams.items()}
    with pytest.raises(ResourceError, match=r"the connections to all sensors were lost.*unplugged"):
        watched(reels)


def test_live_sensors_do_not_wait_for_a_silent_one():
    """Sensor a delivers frames for a second and then stops. Sensor b continues at its own pace."""
    streams = seen()

    class Mute(Reel):
        def read(self, timeout=None):
            if not self._frames:
                time.sleep(timeout)
                raise TimeoutError
            return super().read(timeout)

    a = Mute("a", streams["a"][:30], live=1.0)
    with FusedSensors(
        {"a": a, "b": Reel("b", streams["b"], live=1.0)}, {n: Tracker() for n in "ab"}, SPACE
    ) as sensor:
        last, states = None, set()
        while sensor.states["b"] is not SensorState.ENDED:
            with contextlib.suppress(TimeoutError):
                last = sensor.read(0.2) or last
            states.add(sensor.states["a"])
    assert last is not None and last.time_ns > 2.8e9
    assert SensorState.SILENT in states


def test_restarted_live_clock_is_aligned_by_arrival(caplog):
    """The file states an offset of 7 s. After a reconnection, sensor b counts from 1000 s."""
    walker = Walker()
    streams = seen(walker)
    late = [BodyFrame(f.bodies, f.time_ns + 1000 * 10**9, "b") for f in streams["b"]]
    frames, _ = watched({"a": Reel("a", streams["a"], live=1.0), "b": Reel("b", late, live=1.0)})
    assert "set by the arrival times" in caplog.text
    counts = [len(frame.bodies) for frame in frames[-30:]]
    assert counts == [1] * 30


def test_clocks_that_drift_are_kept_together():
    """A day at 40 ppm is 3.5 s. Latencies are 20 and 50 ms, and occasionally far longer."""
    random, clocks = np.random.default_rng(0), ArrivalClocks()
    for hour in np.linspace(0, 24, 40):
        for moment in np.arange(0, 25, 0.1) + 3600 * hour:
            for name, latency, drift in (("a", 0.02, 0.0), ("b", 0.05, 4e-5)):
                late = latency + random.exponential(0.005) + 0.2 * (random.uniform() < 0.05)
                clocks.record_arrival(name, round((moment * (1 + drift)) * 1e9), round((moment + late) * 1e9))
        if hour > 0:
            assert clocks.shift("a") == 0
            assert abs(clocks.shift("b") * 1e-9 + 3600 * hour * 4e-5) < 0.008


def test_read_timeout_is_reported():
    streams = seen()
    reels = {name: Reel(name, stream, live=0.001) for name, stream in streams.items()}
    with FusedSensors(reels, {n: Tracker() for n in "ab"}, SPACE) as sensor:
        sensor.read(TIMEOUT_S)
        with pytest.raises(TimeoutError):
            for _ in range(5):
                sensor.read(0.05)


def test_a_collector_keeps_everything_and_stops_in_time():
    streams = seen()
    collector = Collector("a", Reel("a", streams["a"]), Tracker(), seconds=1.0)
    collector.start()
    wait_until(lambda: collector.ended, "the end of the collector")
    assert not collector.failure
    assert collector.frames == 31
    assert collector.level_from_camera is None
    (track,) = collector.stream().tracks
    assert are_alike(track.joints[10], streams["a"][10].bodies[0].joints)


def test_failed_collector_gives_the_reason():
    collector = Collector("a", Reel("a", seen()["a"], breaks=4), Tracker())
    collector.start()
    collector.stop()
    wait_until(lambda: collector.ended, "the end of the collector")


@pytest.mark.parametrize(("stated", "kept"), [(0.0, 1.0), (1.7, 1.7)])
def test_sensors_without_a_floor_keep_a_fixed_height(stated, kept):
    """A height estimated from people would differ from the height used in calibration."""
    settings = settings_before_fusion(TrackerSettings(scene=SceneSettings(height=stated)))
    assert settings.scene.height == kept


@pytest.mark.slow
def test_all_depth_sensors_learn_the_room_again():
    """Each sensor has its own background model. The model's age restarts at zero."""
    with SyntheticSensor(choreography="idle", width=160, realtime=False) as sensor:
        frames = [sensor.read() for _ in range(40)]
    pose = convert_to_nested_tuples(frames[0].world_from_camera)
    space = Space({name: Place(convert_to_nested_tuples(np.eye(4)), pose) for name in "ab"})
    trackers = {name: Tracker() for name in "ab"}
    reels = {name: Reel(name, frames) for name in "ab"}
    with contextlib.closing(FusedSensors(reels, trackers, space)) as fused_sensors:
        for _ in range(10):
            fused_sensors.read()
        fused_sensors.learn_room()
        while fused_sensors.read() is not None:
            pass
    for tracker in trackers.values():
        assert 0.5 < tracker.state.room_age < 1.05, "of 1.3 s"
