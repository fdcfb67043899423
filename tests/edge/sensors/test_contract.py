"""Tests the same requirements for every live sensor, with its real library and a recording as device."""

import itertools
import os
import signal
import threading
import time

import numpy as np
import pytest
from contract import (
    CLOCK,
    DRIVERS,
    FRAMES,
    FULL,
    LONG,
    OTHER,
    PAUSE,
    SIZE,
    STEP,
    TIMEOUT_S,
    Live,
    helper_of,
    helpers,
    lens,
    next_frame,
    number_of,
    numbered,
    processor_seconds,
    recorded,
    usable,
)
from garbled import is_garbage
from patience import wait_until

from enliven.errors import InputError
from enliven.recording import Recorder
from enliven_edge.sensors.base import SensorFault
from enliven_edge.sensors.isolation import isolated
from enliven_edge.sensors.registry import open_sensor
from enliven_edge.sensors.reopening import open_reopening
from enliven_edge.tracking.tracker import Tracker
from enliven_synthesis.sensor.profile import load_profile
from enliven_synthesis.sensor.studio import SyntheticSettings, SyntheticStudio

LOAD = 0.5
"""Maximum fraction of the waiting time that is spent computing.

Busy waiting uses all of it. A helper's threads, decoding and reading 90 images per second use less than a
tenth.
"""
TURN = 0.1
"""Timeout of each wait of the edge for a frame, seconds."""


@pytest.fixture(scope="module")
def takes(tmp_path_factory):
    """Writes a long recording, and one in which the image size changes after 120 images."""
    folder = tmp_path_factory.mktemp("takes")
    return recorded(folder / "long.mcap", LONG), recorded(folder / "changing.mcap", LONG // 2, change_at=120)


@pytest.fixture(scope="module", params=DRIVERS, ids=lambda driver: driver.name)
def driver(request):
    return usable(request.param)


@pytest.fixture(scope="module")
def kept(driver, takes, tmp_path_factory):
    """Returns one sensor for all tests, which has to survive each of them."""
    rehearsed = Live(driver, takes[0], tmp_path_factory.mktemp("rehearsed"))
    yield rehearsed
    rehearsed.close()
    wait_until(lambda: not helpers(), "an end without a helper process")


@pytest.fixture
def live(kept):
    return kept.awake()


@pytest.mark.slow
def test_images_arrive_unchanged_and_gaps_are_reported(live):
    """Frames are compared by time and number. On a loaded machine some frames are skipped, as with a
    camera.
    """
    seen = []
    for _ in range(FRAMES):
        frame = live.frame()
        number = number_of(frame.depth)
        np.testing.assert_array_equal(frame.depth, numbered(number))
        seen.append((number, frame.sequence, frame.time_ns))
        assert frame.sensor == live.sensor.name and frame.sensor.startswith(live.driver.name)
        given, camera = frame.intrinsics, lens(SIZE)
        assert (given.width, given.height) == SIZE and not any(given.distortion)
        wanted = (camera.fx, camera.fy, camera.cx, camera.cy)
        np.testing.assert_allclose((given.fx, given.fy, given.cx, given.cy), wanted, rtol=1e-6)
    for (a, count, at), (b, next_count, next_at) in itertools.pairwise(seen):
        assert b > a and next_count - count == b - a
        assert abs(next_at - at - (b - a) * STEP) <= 2 * CLOCK
    assert live.sensor.fps == pytest.approx(1e9 / STEP, rel=0.02)


@pytest.mark.slow
def test_a_call_that_hangs_is_noticed_by_the_edge_s_own_timer(live):
    """The timeout is counted in waits of minimum duration. The edge does nothing else meanwhile."""
    before, at = time.process_time(), time.monotonic()
    live.signal(signal.SIGSTOP)
    waits, last = 0, live.last.time_ns
    with pytest.raises(SensorFault, match="no image arrived for 1 s"):
        while True:
            try:
                live.last, waits = live.sensor.read(TURN), 0
                before, at, last = time.process_time(), time.monotonic(), live.last.time_ns
            except TimeoutError:
                waits += 1
    assert waits <= isolated.SILENCE_TIMEOUT_S / TURN + 1
    assert time.process_time() - before < LOAD * (time.monotonic() - at)
    assert live.frame().time_ns - last > 0.5e9, "the sensor's clock knows of the silence"


@pytest.mark.slow
def test_device_is_reopened_after_every_loss(live):
    """The helper process is killed, and the device is absent for two attempts. Each time, a new process opens
    it.
    """
    for _ in range(live.driver.rounds):
        live.gone()
        assert "signal 9" in str(live.lose())
        errors: list[Exception] = []
        live.until(lambda: len(errors) >= 2, errors)  # noqa: B023
        assert len(helpers()) <= 2, "one for all vain attempts; that of the lost device may still end"
        live.gone(False)
        live.frame()


@pytest.mark.slow
def test_image_size_may_change_during_the_stream(live, takes):
    """Image and lens always match. While the mode changes, the helper is idle."""
    live.play(takes[1])
    shapes: list[tuple[int, ...]] = []
    errors: list[Exception] = []
    while not shapes or shapes[-1] == SIZE:
        before, at = processor_seconds(helper_of(live.sensor)), time.monotonic()
        frame = live.frame(errors)
        waited = time.monotonic() - at
        assert not errors
        spent = processor_seconds(helper_of(live.sensor)) - before
        size = frame.depth.shape[::-1]
        np.testing.assert_array_equal(frame.depth, numbered(number_of(frame.depth), size))
        np.testing.assert_allclose(frame.intrinsics.fx, lens(size).fx, rtol=1e-6)
        shapes.append(size)
    assert shapes[0] == SIZE and shapes[-1] == OTHER
    assert spent < LOAD * max(waited, PAUSE * STEP * 1e-9)


@pytest.mark.slow
def test_garbage_and_closing_of_one_sensor_do_not_affect_another(live, takes, monkeypatch, request):
    """A garbage image is reported and skipped, and the other sensor is not affected.

    Finally the library hangs for ever. Neither closing nor the reader waits for it.
    """
    other = open_reopening(live.driver.opener(takes[0], live.driver.garbled))
    request.addfinalizer(other.close)
    errors: list[Exception] = []
    numbers = []
    garbage = 8 if live.driver.garbled else 0
    while len(errors) < garbage or not numbers:
        live.frame()
        depth = next_frame(other, errors).depth
        np.testing.assert_array_equal(depth, numbered(number_of(depth)))
        numbers.append(number_of(depth))
    assert all(type(error) is InputError for error in errors), errors
    assert not any(is_garbage(number) for number in numbers)
    assert numbers == sorted(set(numbers)), "it is the same device"
    monkeypatch.setattr(isolated, "SILENCE_TIMEOUT_S", 1e6)
    next_frame(other)
    os.kill(helper_of(other), signal.SIGSTOP)
    reader = threading.Thread(target=read_to_the_end, args=(other,), daemon=True)
    reader.start()
    wait_until(lambda: other._errands.is_busy)
    other.close()
    reader.join(TIMEOUT_S)
    assert not reader.is_alive() and other.read(TURN) is None
    live.frame()


def read_to_the_end(sensor):
    """Reads for ever, and holds each frame for its duration."""
    while True:
        try:
            if sensor.read() is None:
                return
        except InputError:
            continue


@pytest.fixture(scope="module")
def rooms(tmp_path_factory):
    """Renders an empty room for a camera, and for the same camera after rotation and lifting."""
    folder = tmp_path_factory.mktemp("rooms")
    for name, tilt, height in (("here", 6.0, 1.2), ("there", 20.0, 1.6)):
        more = {"choreography": "idle", "width": 160, "camera_height": height, "camera_tilt": tilt}
        studio = SyntheticStudio(load_profile("kinect1"), SyntheticSettings(**more))
        with Recorder(folder / f"{name}.mcap") as recorder:
            for index in range(150):
                recorder.write_frame(studio.frame(index))
    return folder


@pytest.mark.skipif(not FULL, reason="15 s of tracking: make test-devices")
def test_only_a_camera_moved_while_absent_is_reported_as_moved(rooms, live):
    tracker = Tracker()

    def moved(name: str, frames: int) -> bool:
        live.play(rooms / f"{name}.mcap")
        seen = False
        for _ in range(frames):
            tracker.track(live.frame())
            seen |= tracker.state.moved
        return seen

    assert not moved("here", 60)
    assert not moved("here", 30)
    assert moved("there", 60)


class Nobody:
    """A landmark source that finds no landmarks."""

    def find(self, colour, time_ns):
        return []

    def close(self):
        pass


def filmed(path):
    """Writes a video of one second with 12 images."""
    av = pytest.importorskip("av")
    with av.open(path, "w") as container:
        stream = container.add_stream("libx264", rate=12)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for number in range(12):
            grey = np.full((48, 64, 3), 20 * number, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(grey, format="rgb24")))
        container.mux(stream.encode())
    return str(path)


IN_THE_EDGE = {
    "replay": lambda takes, folder: {"path": takes[0]},
    "synthetic": lambda takes, folder: {"width": 64},
    "webcam": lambda takes, folder: {"device": filmed(folder / "film.mp4"), "source": Nobody()},
}
"""Options of the sensors that run without their own process."""


@pytest.mark.parametrize("name", IN_THE_EDGE)
def test_sensors_inside_the_edge_fulfil_their_contract(name, takes, tmp_path):
    """Times increase, waiting uses no processor time, and a closed sensor has ended."""
    with open_sensor(name, **IN_THE_EDGE[name](takes, tmp_path)) as sensor:
        times = [next_frame(sensor).time_ns]
        before, at = time.process_time(), time.monotonic()
        times += [next_frame(sensor).time_ns for _ in range(8)]
        assert time.process_time() - before < LOAD * (time.monotonic() - at)
    assert times == sorted(set(times))
    assert sensor.read(TURN) is None
