"""Tests of the webcam driver on the kernel's virtual V4L2 camera vivid: images, loss and return."""

from __future__ import annotations

import itertools
import os
import statistics
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from as_user import SEATED, SLOW, answer
from frames import bind, lost, read
from image_log import ImageLog

from enliven.errors import ResourceError
from enliven_edge.sensors.registry import open_sensor, sensor_opener
from enliven_edge.sensors.reopening import open_reopening

CAMERA = "/dev/video0"
TIMES = 5


def appeared(there: bool) -> None:
    deadline = time.monotonic() + SLOW
    while Path(CAMERA).exists() is not there:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    subprocess.run(["udevadm", "settle", "--timeout=30"], check=True)


@pytest.fixture(scope="module", autouse=True)
def vivid():
    # One device with a webcam input only, and without multiplanar formats, like a real webcam.
    subprocess.run(
        ["modprobe", "vivid", "n_devs=1", "node_types=0x1", "num_inputs=1", "input_types=0x0"], check=True
    )
    appeared(True)
    yield
    subprocess.run(["modprobe", "-r", "vivid"], check=True)


@pytest.fixture
def seen(tmp_path):
    return ImageLog(str(tmp_path / "seen"))


def test_logged_in_user_may_open_a_webcam():
    assert answer(SEATED, f"import os; print(int(os.access({CAMERA!r}, os.R_OK | os.W_OK)))") == 1


def test_sixty_images_have_the_cameras_size_and_rate(seen):
    with open_sensor("webcam", device=CAMERA, source=seen) as sensor:
        frames = read(sensor, 60)
    shapes = {tuple(shape) for shape, *_ in seen.images()}
    times = [frame.time_ns for frame in frames]
    step = statistics.median(b - a for a, b in itertools.pairwise(times)) * 1e-9
    print(f"60 images of {shapes}, one each {1e3 * step:.1f} ms")
    assert len(shapes) == 1 and all(b > a for a, b in itertools.pairwise(times))
    (shape,) = shapes
    assert shape[2] == 3 and shape[0] * 16 == shape[1] * 9, "vivid's webcam is 16:9"


def test_camera_in_use_is_refused(seen):
    with open_sensor("webcam", device=CAMERA, source=seen) as sensor:
        read(sensor, 1)
        with pytest.raises(ResourceError, match="cannot be opened"):
            open_sensor("webcam", device=CAMERA, source=seen)


def test_unplugged_webcam_is_lost_and_returns(seen):
    files, threads = [], []
    with open_reopening(sensor_opener("webcam", device=CAMERA, source=seen)) as sensor:
        for _ in range(TIMES):
            last = read(sensor, 10)[-1]
            bind("vivid", "vivid.0", there=False)
            seconds, error = lost(sensor)
            appeared(False)
            bind("vivid", "vivid.0", there=True)
            appeared(True)
            back = time.monotonic()
            frame = read(sensor, 1)[0]
            print(f"lost after {seconds:.2f} s ({error}), back {time.monotonic() - back:.2f} s after udev")
            assert frame.time_ns > last.time_ns
            read(sensor, 5)
            files.append(len(os.listdir("/proc/self/fd")))
            threads.append(threading.active_count())
    assert files[-1] <= files[0] and threads[-1] <= threads[0]
