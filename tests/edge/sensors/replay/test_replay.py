"""Tests of replay: every frame, in order, at the requested speed."""

import itertools
import os

import numpy as np
import pytest

from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.person.joints import J
from enliven.recording import Recorder, RecordingWarning
from enliven_edge.sensors import event_log, replay
from enliven_edge.sensors.base import SensorFault
from enliven_edge.sensors.registry import open_sensor, sensor_names
from enliven_edge.sensors.replay import ReplaySensor


def bodies_at(time_ns: int) -> BodyFrame:
    return BodyFrame([Body(0, np.zeros((J, 3)), np.ones(J))], time_ns, "kinect2")


def write(path, times):
    with Recorder(path) as recorder:
        for time_ns in times:
            recorder.write_frame(bodies_at(time_ns))
    return path


class FakeClock:
    """A clock that advances only by sleeping. It replaces the module ``time``."""

    def __init__(self) -> None:
        self.now = 100.0
        self.slept: list[float] = []

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0
        self.now += seconds
        self.slept.append(seconds)


@pytest.fixture
def clock(monkeypatch):
    fake = FakeClock()
    monkeypatch.setattr(replay, "time", fake)
    return fake


def test_frames_are_due_at_the_recorded_pace(tmp_path, clock):
    times = [5_000_000_000, 5_100_000_000, 5_130_000_000, 7_000_000_000]
    with ReplaySensor(write(tmp_path / "a.mcap", times)) as sensor:
        assert sensor.name == "kinect2"
        due = [(sensor.read().time_ns, round(clock.now - 100, 6)) for _ in times]
        assert sensor.read() is None
    assert due == list(zip(times, [0, 0.1, 0.13, 2.0], strict=True))


@pytest.mark.parametrize(("speed", "seconds"), [(2.0, 0.5), (0.25, 4.0), (0.0, 0.0)])
def test_speed_scales_the_pace_and_zero_does_not_wait(tmp_path, clock, speed, seconds):
    times = range(0, 1_000_000_001, 100_000_000)
    with ReplaySensor(write(tmp_path / "a.mcap", times), speed=speed) as sensor:
        read = [frame.time_ns for frame in iter(sensor.read, None)]
    assert read == list(times)
    assert clock.now - 100 == pytest.approx(seconds)


def test_a_late_reader_gets_every_frame_and_catches_up(tmp_path, clock):
    times = list(range(0, 1_000_000_000, 100_000_000))
    with ReplaySensor(write(tmp_path / "a.mcap", times)) as sensor:
        read = [sensor.read().time_ns]
        clock.now += 0.45
        before = clock.now
        read += [sensor.read().time_ns for _ in range(4)]
        assert clock.now == before
        read += [frame.time_ns for frame in iter(sensor.read, None)]
    assert read == times
    assert clock.now - 100 == pytest.approx(0.9)


def test_a_frame_that_is_not_due_in_time_comes_later(tmp_path, clock):
    with ReplaySensor(write(tmp_path / "a.mcap", [0, 1_000_000_000])) as sensor:
        sensor.read(timeout=0.0)
        for _ in range(3):
            with pytest.raises(TimeoutError):
                sensor.read(timeout=0.3)
        assert sensor.read(timeout=0.3).time_ns == 1_000_000_000
        assert sensor.read(timeout=0.3) is None


def test_times_rise_for_ever_when_looping(tmp_path, clock):
    times = [10_000_000, 20_000_000, 40_000_000]
    with ReplaySensor(write(tmp_path / "a.mcap", times), speed=0, loop=True) as sensor:
        read = [sensor.read().time_ns for _ in range(9)]
    steps = [b - a for a, b in itertools.pairwise(read)]
    once_around = [10_000_000, 20_000_000, 20_000_000]
    assert steps == (once_around * 3)[:8]


def test_one_frame_loops_too(tmp_path, clock):
    with ReplaySensor(write(tmp_path / "a.mcap", [0]), loop=True) as sensor:
        read = [sensor.read().time_ns for _ in range(3)]
    assert read[0] < read[1] < read[2]


def test_frames_written_out_of_order_come_in_order(tmp_path, clock):
    with ReplaySensor(write(tmp_path / "a.mcap", [30, 10, 20]), speed=0) as sensor:
        assert [frame.time_ns for frame in iter(sensor.read, None)] == [10, 20, 30]


@pytest.mark.parametrize(("longest", "due"), [(float("inf"), [0, 0.1, 1.4, 4.1]), (0.5, [0, 0.1, 0.6, 1.1])])
def test_a_loss_comes_when_it_came_and_long_silences_can_be_cut(tmp_path, clock, monkeypatch, longest, due):
    monkeypatch.setattr(event_log, "time", clock)
    with Recorder(tmp_path / "a.mcap") as recorder:
        wrote = event_log.EventLog(recorder)
        wrote.write_frame(bodies_at(7_000_000_000), None)
        wrote.write_frame(bodies_at(7_100_000_000), None)
        clock.now += 1.3
        wrote.write_error(SensorFault("it is gone", where="kinect2"))
        wrote.write_frame(bodies_at(11_100_000_000), None)
    began = clock.now
    with ReplaySensor(tmp_path / "a.mcap", longest_pause=longest) as sensor:
        times = []
        for _ in due:
            try:
                assert sensor.read() is not None
            except SensorFault as error:
                assert error.what == "it is gone" and len(times) == 2
            times.append(round(clock.now - began, 6))
        assert times == pytest.approx(due)
        assert sensor.read() is None


def test_after_closing_the_stream_has_ended(tmp_path, clock):
    sensor = ReplaySensor(write(tmp_path / "a.mcap", [0, 1]))
    sensor.close()
    sensor.close()
    assert sensor.read() is None


def test_a_cut_recording_is_replayed_with_a_warning(tmp_path, clock):
    path = write(tmp_path / "a.mcap", range(5))
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.warns(RecordingWarning), ReplaySensor(path, speed=0) as sensor:
        assert len(list(iter(sensor.read, None))) == 5


@pytest.mark.parametrize("speed", [-1.0, float("nan"), float("inf")])
def test_an_impossible_speed_is_refused(tmp_path, speed):
    with pytest.raises(InputError, match="speed"):
        ReplaySensor(write(tmp_path / "a.mcap", [0]), speed=speed)


def test_a_recording_without_frames_is_refused(tmp_path):
    with pytest.raises(InputError, match="no frames"):
        ReplaySensor(write(tmp_path / "a.mcap", []))


def test_sensors_are_found_by_name(tmp_path):
    assert {"replay", "synthetic"} <= set(sensor_names())
    with open_sensor("replay", path=write(tmp_path / "a.mcap", [0]), speed=0.0) as sensor:
        assert sensor.read().time_ns == 0


@pytest.mark.parametrize(
    ("name", "options", "hint"),
    [
        ("repaly", {}, "Did you mean replay"),
        ("xyz", {}, "Known: "),
        ("replay", {"path": "x", "sped": 1}, "Did you mean speed"),
        ("replay", {}, "'path' is missing"),
    ],
)
def test_an_unknown_sensor_or_option_names_the_nearest(name, options, hint):
    with pytest.raises(InputError, match=hint):
        open_sensor(name, **options)


def test_other_packages_add_sensors(monkeypatch, tmp_path):
    class Mine(ReplaySensor):
        def __init__(self, speed=1):
            super().__init__(write(tmp_path / "b.mcap", [0]), speed=speed)

    class Entry:
        name = "mine"

        def load(self):
            return Mine

    monkeypatch.setattr("enliven_edge.sensors.registry.entry_points", lambda group: [Entry()])
    assert "mine" in sensor_names()
    assert open_sensor("mine", speed=0).read().time_ns == 0
    with pytest.raises(InputError, match="pip install enliven-synthesis"):
        open_sensor("synthetic")


@pytest.mark.skipif(os.name != "posix", reason="an open file cannot be removed here")
def test_a_loop_needs_its_file_only_once(tmp_path, clock):
    """The file stays open, so neither missing descriptors nor the removal of the file can end a loop."""
    path = write(tmp_path / "a.mcap", [0, 33_000_000, 66_000_000])
    with ReplaySensor(path, loop=True) as sensor:
        path.unlink()
        times = [sensor.read().time_ns for _ in range(12)]
    assert times == sorted(times) and len(set(times)) == 12
