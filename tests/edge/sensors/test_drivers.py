"""One contract for every driver of a depth camera, on its real library, with a recording for a device."""

import importlib.util
import os
import signal
import time
from dataclasses import replace

import numpy as np
import pytest
from test_isolation import helpers, next_frame, none_left  # noqa: F401 (a fixture)
from troubled import camera, picture

from enliven.errors import InputError, ResourceError
from enliven.frames import DepthFrame
from enliven.recording import Recorder
from enliven_edge.sensors.attached import attached
from enliven_edge.sensors.drivers.lens import known_or_typical
from enliven_edge.sensors.registry import open_sensor, sensor_opener
from enliven_edge.sensors.reopening import kept_open

LIBRARIES = {"oak": "depthai", "realsense": "pyrealsense2"}
FRAMES = 300
STEP = 11_111_111
"""Nanoseconds between two images, 90 a second: the fastest mode of the two."""


@pytest.fixture(params=LIBRARIES)
def driver(request) -> str:
    if importlib.util.find_spec(LIBRARIES[request.param]) is None:
        pytest.skip(f'{LIBRARIES[request.param]} is not installed: pip install "./edge[{request.param}]"')
    return request.param


@pytest.fixture
def take(tmp_path) -> str:
    path = tmp_path / "take.mcap"
    with Recorder(path) as recorder:
        for number in range(FRAMES):
            depth = picture(number, 96, 64)
            depth[0, 0] = number
            recorder.write_frame(DepthFrame(depth, camera(96, 64, 80.25), number * STEP, "test"))
    return str(path)


def test_every_image_comes_as_it_was_recorded(driver, take):
    with open_sensor(driver, rehearse=take) as sensor:
        assert sensor.fps == pytest.approx(1e9 / STEP, rel=0.02)
        frames = []
        while (frame := next_frame(sensor)) is not None:
            frames.append((frame.depth.copy(), frame.time_ns, frame.sequence, frame.intrinsics, frame.sensor))
        assert sensor.condition() is not None
    numbers = [int(depth[0, 0]) for depth, *_ in frames]
    assert numbers == list(range(FRAMES)), "a rehearsal leaves out none, however loaded the machine is"
    for number, (depth, time_ns, sequence, lens, name) in zip(numbers, frames, strict=True):
        expected = picture(number, 96, 64)
        expected[0, 0] = number
        np.testing.assert_array_equal(depth, expected)
        assert time_ns == number * STEP and sequence == number
        assert (lens.width, lens.height) == (96, 64) and name.startswith(driver)
        given = camera(96, 64, 80.25)
        np.testing.assert_allclose(
            (lens.fx, lens.fy, lens.cx, lens.cy), (given.fx, given.fy, given.cx, given.cy), rtol=1e-6
        )
        assert not any(lens.distortion)


def test_two_of_one_kind_run_side_by_side(driver, take):
    with open_sensor(driver, rehearse=take) as left, open_sensor(driver, rehearse=take) as right:
        for _ in range(20):
            assert next_frame(left) is not None and next_frame(right) is not None


def test_a_library_that_crashes_is_started_again(driver, take):
    with kept_open(sensor_opener(driver, rehearse=take)) as sensor:
        errors: list[Exception] = []
        last = next_frame(sensor, errors).time_ns
        (process,) = helpers()
        os.kill(process.pid, signal.SIGSEGV)
        while not errors:
            last = next_frame(sensor, errors).time_ns
        assert "crashed" in str(errors[0])
        assert next_frame(sensor, errors).time_ns > last


def test_closed_while_it_reads_it_is_gone(driver, take):
    sensor = open_sensor(driver, rehearse=take)
    next_frame(sensor)
    sensor.close()
    deadline = time.monotonic() + 60.0
    while helpers():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.mark.parametrize("options", [{"rehearse": "nothing.mcap"}, {"preset": "nice"}, {"widht": 640}])
def test_what_cannot_be_used_is_said(driver, options):
    with pytest.raises((InputError, ResourceError)) as raised:
        kept_open(sensor_opener(driver, **options))
    if "preset" not in options:
        assert isinstance(raised.value, InputError)


def test_without_a_camera_it_says_what_to_do(driver):
    """No camera of the kind is beside this machine, which the doctor would say."""
    if any(camera.kind.sensor == driver for camera in attached()):
        pytest.skip("there is one")
    with pytest.raises(ResourceError, match=r"Plug .* enliven doctor"):
        kept_open(sensor_opener(driver))


def test_a_camera_that_does_not_know_its_lens_gets_that_of_its_kind():
    told, known = known_or_typical(640, 400, (450.0, 451.0, 320.0, 200.0), "oak-d", "oak 1")
    assert known and (told.fx, told.fy) == (450.0, 451.0)
    typical, known = known_or_typical(320, 200, (1.0, 1.0, 0.0, 0.0), "oak-d", "oak 1")
    assert not known and typical.width == 320 and 200 < typical.fx < 240
    with pytest.raises(InputError, match="oak 1: it does not know its lens"):
        known_or_typical(640, 480, (1.0, 1.0, 0.0, 0.0), "oak-d", "oak 1")


def test_a_recording_that_is_not_rectified_is_none_of_an_oak(tmp_path):
    if importlib.util.find_spec("depthai") is None:
        pytest.skip('depthai is not installed: pip install "./edge[oak]"')
    lens = replace(camera(96, 64), distortion=(0.1, 0.0, 0.0, 0.0, 0.0))
    with Recorder(tmp_path / "bent.mcap") as recorder:
        recorder.write_frame(DepthFrame(picture(0, 96, 64), lens, 0, "test"))
    with pytest.raises(InputError, match="not rectified"):
        kept_open(sensor_opener("oak", rehearse=str(tmp_path / "bent.mcap")))
