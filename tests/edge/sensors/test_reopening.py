"""Tests of a live sensor that fails, hangs and returns while its stream continues."""

import itertools
import threading
import time
from typing import ClassVar

import pytest
from hypothesis import given
from hypothesis import strategies as st
from troubled import STEP, Troubled, camera, picture

from enliven.errors import InputError, ResourceError
from enliven.frames import DepthFrame
from enliven.recording import Recorder
from enliven_edge.sensors import reopening
from enliven_edge.sensors.base import SensorFault
from enliven_edge.sensors.reopening import ReopeningSensor, open_reopening
from enliven_edge.sensors.replay import ReplaySensor

DEADLINE = 60.0
"""Timeout in seconds for a loaded machine."""


@pytest.fixture(autouse=True)
def unplugged():
    Troubled.reset()


def until(condition) -> None:
    """Waits until the condition holds."""
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline, "it never came to that"
        time.sleep(0.005)


def stream(sensor) -> tuple[list, list[Exception]]:
    """Yields every frame, and every error between frames."""
    frames, errors = [], []
    deadline = time.monotonic() + DEADLINE
    while time.monotonic() < deadline:
        try:
            frame = sensor.read(0.1)
        except (SensorFault, InputError) as error:
            errors.append(error)
            continue
        except TimeoutError:
            continue
        if frame is None:
            return frames, errors
        frames.append(frame)
    raise AssertionError("the stream never ends")


def test_failed_device_is_closed_and_replaced():
    with ReopeningSensor(lambda: Troubled(30, "OSError,RuntimeError")) as sensor:
        frames, errors = stream(sensor)
    assert len(frames) == 30
    assert [type(error) for error in errors] == [SensorFault] * 2
    assert "No such device" in str(errors[0]) and "Communication exception" in str(errors[1])
    assert all(error.where == "troubled" and error.remedy and error.exit_code == 4 for error in errors)
    assert len(Troubled.devices) == 3
    until(lambda: all(device.closed for device in Troubled.devices))


def test_times_rise_although_every_device_counts_from_0():
    with ReopeningSensor(lambda: Troubled(30, "OSError,OSError")) as sensor:
        frames, _ = stream(sensor)
    steps = [b.time_ns - a.time_ns for a, b in itertools.pairwise(frames)]
    assert min(steps) > 0
    assert sum(step == STEP for step in steps) == 27, "but for the two gaps they are the device's"


def test_continuing_clock_is_not_shifted():
    """A device with the host's clock continues it after it is reopened."""

    class Host(Troubled):
        def read(self, timeout=None):
            frame = super().read(timeout)
            if frame is not None:
                object.__setattr__(frame, "time_ns", time.monotonic_ns())
                self.told.append(frame.time_ns)
            return frame

        told: ClassVar[list[int]] = []

    with ReopeningSensor(lambda: Host(20, "OSError,RuntimeError")) as sensor:
        frames, _ = stream(sensor)
    assert [frame.time_ns for frame in frames] == Host.told


@pytest.mark.parametrize("place", [4, 5, 6])
def test_one_wrong_time_next_to_a_failure_is_harmless(place):
    """The wrong time is the last before the failure, or the first after it."""

    class Wild(Troubled):
        def read(self, timeout=None):
            frame = super().read(timeout)
            if frame is not None and Troubled.number == place:
                object.__setattr__(frame, "time_ns", 1 << 70)
            return frame

    with ReopeningSensor(lambda: Wild(30, "OSError,OSError")) as sensor:
        frames, _ = stream(sensor)
    times = [frame.time_ns for frame in frames if frame.time_ns < 1 << 62]
    assert len(times) == 29 and times == sorted(set(times)) and times[-1] < DEADLINE * 1e9


SECOND = 10**9
steps = st.tuples(
    st.integers(1, 3 * SECOND), st.integers(1, SECOND), st.none() | st.integers(-SECOND, SECOND) | st.just(0)
)
"""Nanoseconds until a frame arrives, and nanoseconds since the previous frame by the device's clock.

For a reopened device, the third value is its clock's offset from the previous device's clock.
"""


@given(st.lists(steps, max_size=20))
def test_times_rise_whenever_frames_arrive_and_whatever_a_fresh_clock_says(arrivals):
    """As on a busy machine, with one late frame and the next ones at once."""
    now = own = SECOND
    times = []
    with pytest.MonkeyPatch.context() as patch, ReopeningSensor(lambda: Troubled(1)) as sensor:
        for late, step, fresh in arrivals:
            now, own = now + late, own + step
            if fresh is not None:
                sensor._fresh, own = True, own + fresh if fresh else 0
            patch.setattr(reopening.time, "monotonic_ns", lambda: now)  # noqa: B023
            times.append(sensor._adjust_time(DepthFrame(picture(0), camera(), own, "t")).time_ns)
            patch.undo()
    assert times == sorted(set(times))


def test_attempts_become_rarer_and_never_stop():
    opened: list[float] = []

    def open_device():
        opened.append(time.monotonic())
        if 1 < len(opened) < 8:
            raise OSError(16, "Device or resource busy")
        return Troubled(40, "OSError")

    with ReopeningSensor(open_device) as sensor:
        frames, errors = stream(sensor)
        assert sensor._wait == reopening.FIRST_WAIT_S, "a second's worth of good frames, and all is forgotten"
    waits = [b - a for a, b in itertools.pairwise(opened)]
    assert len(frames) == 40 and len(errors) == 7
    assert "busy" in str(errors[-1])
    for wait, least in zip(waits[1:], (0.2, 0.4, 0.5, 0.5, 0.5, 0.5), strict=True):
        assert wait > 0.99 * least


def test_only_the_unusable_frame_is_lost():
    with ReopeningSensor(lambda: Troubled(30, "focal length nan,wrong type,wrong shape")) as sensor:
        frames, errors = stream(sensor)
    assert len(frames) == 30 and len(Troubled.devices) == 1
    assert all(type(error) is InputError for error in errors) and len(errors) == 3


def test_device_with_only_bad_frames_is_reopened():
    class Blind(Troubled):
        def read(self, timeout=None):
            return self._fault("focal length zero") if self is Troubled.devices[0] else super().read(timeout)

    with ReopeningSensor(lambda: Blind(20)) as sensor:
        frames, errors = stream(sensor)
    assert len(frames) == 20
    assert [type(error) for error in errors] == [InputError] * reopening.BAD_FRAMES + [SensorFault]


def test_hanging_read_is_abandoned_for_a_new_device(monkeypatch):
    monkeypatch.setitem(reopening.CALL_TIMEOUTS_S, "read", 0.3)
    let_go = threading.Event()

    class Hanging(Troubled):
        def read(self, timeout=None):
            if len(Troubled.devices) == 1 and Troubled.number == 3:
                let_go.wait(DEADLINE)
            return super().read(timeout)

    with ReopeningSensor(lambda: Hanging(20)) as sensor:
        frames, errors = stream(sensor)
        assert len(frames) == 20 and "more than" in str(errors[0])
        first, second = Troubled.devices
        assert not first.closed
        let_go.set()
        until(lambda: first.closed)
    until(lambda: second.closed)


def test_closing_does_not_wait_for_a_read_that_hangs():
    let_go = threading.Event()

    class Hanging(Troubled):
        def read(self, timeout=None):
            let_go.wait(DEADLINE)
            return super().read(timeout)

    sensor = ReopeningSensor(lambda: Hanging(20))
    with pytest.raises(TimeoutError):
        sensor.read(0.05)
    sensor.close()
    assert sensor.read(0.05) is None
    assert not Troubled.devices[0].closed and not let_go.is_set()
    let_go.set()
    until(lambda: Troubled.devices[0].closed)


def test_no_frame_is_read_ahead():
    """The device is read when the edge requests a frame, so no frame is delayed in a queue."""
    with ReopeningSensor(lambda: Troubled(20)) as sensor:
        for count in range(1, 6):
            sensor.read(DEADLINE)
            time.sleep(0.02)
            assert Troubled.number == count


def test_the_first_opening_fails_as_the_device_says():
    def missing():
        raise ResourceError("there is none", where="oak", remedy="Plug it in.")

    with pytest.raises(ResourceError, match=r"oak: there is none\. Plug it in"):
        open_reopening(missing)


def test_recording_is_read_unchanged_and_ends(tmp_path):
    with Recorder(tmp_path / "a.mcap") as recorder:
        recorder.write_frame(Troubled(3).read())
    with open_reopening(lambda: ReplaySensor(tmp_path / "a.mcap", speed=0)) as sensor:
        assert isinstance(sensor, ReplaySensor)
        assert sensor.read() is not None and sensor.read() is None
