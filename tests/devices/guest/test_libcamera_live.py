"""Tests of the libcamera driver with the real libcamera: a camera of the kernel's vimc, two virtual ones of
libcamera."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from frames import bind, lost, read
from image_log import ImageLog

from enliven import cli
from enliven_edge.sensors.drivers.libcamera_library import list_cameras
from enliven_edge.sensors.registry import open_sensor, sensor_opener
from enliven_edge.sensors.reopening import open_reopening

MODULE = Path("/opt/vimc.ko")
VIRTUAL = Path("/usr/share/libcamera/pipeline/virtual/virtual.yaml")
"""Path of libcamera's description of its virtual cameras."""
TIMES = 5
BASELINE = 0.1
"""Distance between the two virtual cameras, metres."""
HALF_A_PIXEL = 0.5
"""Matching accuracy of a small JPEG-compressed image, pixels of disparity."""


@pytest.fixture(scope="module")
def vimc():
    if not MODULE.exists():
        pytest.skip("vimc.ko could not be built: what test_guest.sh said at its beginning")
    for needed in (
        "v4l2-tpg",
        "videobuf2-vmalloc",
        "videobuf2-dma-contig",
        "videobuf2-v4l2",
        "mc",
        "videodev",
    ):
        subprocess.run(["modprobe", needed], check=True)
    subprocess.run(["insmod", str(MODULE)], check=True)
    subprocess.run(["udevadm", "settle", "--timeout=30"], check=True)
    yield [camera.name for camera in list_cameras()]
    subprocess.run(["rmmod", "vimc"], check=False)


@pytest.fixture
def seen(tmp_path):
    return ImageLog(str(tmp_path / "seen"))


def test_libcamera_lists_the_kernels_camera(vimc, capsys):
    assert cli.run(["sensors"]) == 0
    output = capsys.readouterr().out
    print(vimc, output)
    words = " ".join(output.split())
    for number, name in enumerate(vimc):
        assert f"{name}: --sensor libcamera --set left={number}" in words
    assert any("vimc" in name.lower() or "sensor" in name.lower() for name in vimc)


def test_colour_arrives_through_the_helper_process_after_each_reopening(vimc, seen):
    helpers = set()
    for _ in range(TIMES):
        with open_sensor("libcamera", left=vimc[0], width=640, height=480, source=seen) as sensor:
            frames = read(sensor, 12)
        times = [frame.time_ns for frame in frames]
        assert all(b > a for a, b in itertools.pairwise(times))
        images = seen.images()
        assert {tuple(shape) for shape, *_ in images} == {(480, 640, 3)}
        helpers |= {process for *_, process in images}
    print(f"{sensor.name}: means of red, green and blue {images[-1][1]}")
    assert len(helpers) == TIMES and os.getpid() not in helpers, "each opening has a process of its own"


def test_removed_camera_is_lost_and_returns(vimc, seen):
    with open_reopening(
        sensor_opener("libcamera", left=vimc[0], width=640, height=480, source=seen)
    ) as sensor:
        last = read(sensor, 5)[-1]
        bind("vimc", "vimc.0", there=False)
        seconds, error = lost(sensor)
        bind("vimc", "vimc.0", there=True)
        back = time.monotonic()
        frame = read(sensor, 1)[0]
        print(f"lost after {seconds:.2f} s ({error}), back after {time.monotonic() - back:.2f} s")
        assert frame.time_ns > last.time_ns


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Returns the calibration of two virtual cameras that show a synthetic room, and the true depth."""
    pytest.importorskip("cv2", reason="OpenCV is not in the guest: the lock does not have it")
    from PIL import Image
    from stereo_rig import calibration_of, create_lenses, rectified_left
    from stereo_scene import Renderer, person, room

    from enliven_edge.sensors.stereo.calibration import save_calibration
    from enliven_edge.sensors.stereo.rectification import Rectification

    folder = tmp_path_factory.mktemp("pair")
    left, right = create_lenses(320, 200, BASELINE)
    photographer = Renderer([*room(), *person(0.1, 2.2)])
    VIRTUAL.parent.mkdir(parents=True, exist_ok=True)
    lines = []
    for number, lens in enumerate((left, right)):
        picture = folder / f"{number}.jpg"
        Image.fromarray(photographer.render_image(lens, samples=2)).convert("RGB").save(picture, quality=95)
        lines.append(
            f'"Virtual{number}":\n  supported_formats:\n  - width: 320\n    height: 200\n    frame_rates:\n'
            f'    - 10\n    - 10\n  frames:\n    path: "{picture}"\n  model: "Virtual{number}"\n'
        )
    VIRTUAL.write_text("".join(lines))
    calibration = calibration_of(left, right)
    save_calibration(folder / "pair.toml", calibration, [])
    yield folder / "pair.toml", photographer.render_depth(rectified_left(Rectification(calibration)))
    VIRTUAL.unlink()


def test_two_libcamera_cameras_measure_depth(pair):
    calibration, truth = pair
    print(list_cameras())
    # Virtual cameras are not synchronised, but the room does not move.
    options = {
        "calibration": str(calibration),
        "left": "Virtual0",
        "right": "Virtual1",
        "fps": 10,
        "apart_ms": 100.0,
    }
    for _ in range(TIMES):
        with open_sensor("libcamera", **options) as sensor:
            frame = read(sensor, 3)[-1]
    is_known = (frame.depth > 0) & np.isfinite(truth)
    errors = BASELINE * frame.intrinsics.fx * np.abs(1e3 / frame.depth[is_known] - 1 / truth[is_known])
    print(f"{sensor.name}: known in {100 * is_known.mean():.0f} %, median error {np.median(errors):.2f} px")
    assert is_known.mean() > 0.5 and np.median(errors) < HALF_A_PIXEL
