"""Tests of the libcamera driver, with recorded pairs in its own process, and without a camera."""

import os
import re
import signal

import body_driver
import numpy as np
import pytest
from body_driver import BodyDriver
from contract import helpers, next_frame
from hypothesis import given, settings
from hypothesis import strategies as st
from isolated_sensors import none_left  # noqa: F401 (a fixture)
from PIL import Image

pytest.importorskip("cv2", reason='OpenCV is not installed: pip install "./edge[libcamera]"')
from stereo_rig import calibration_of, create_lenses, rectified_left
from stereo_scene import Plane, Renderer

from enliven import cli
from enliven.errors import EnlivenError, InputError, ResourceError
from enliven.frames import BodyFrame
from enliven_edge.sensors.drivers.libcamera import LibcameraSensor
from enliven_edge.sensors.drivers.libcamera_library import COLOUR, GREY, copy_image
from enliven_edge.sensors.isolation.isolated import IsolatedOpener
from enliven_edge.sensors.registry import open_sensor, sensor_opener
from enliven_edge.sensors.reopening import open_reopening
from enliven_edge.sensors.stereo.calibration import save_calibration
from enliven_edge.sensors.stereo.rectification import Rectification

FRAMES = 12


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Returns (driver options, true depth): pairs of a slanted wall, and the calibration."""
    folder = tmp_path_factory.mktemp("recorded")
    lenses = create_lenses(192, 120)
    calibration = calibration_of(*lenses)
    photographer = Renderer([Plane((0, 0, 1.2), (0.3, 0.1, -1))])
    for name, lens in zip(("left", "right"), lenses, strict=True):
        (folder / name).mkdir()
        image = Image.fromarray(photographer.render_image(lens, noise=1.0))
        for number in range(FRAMES):
            image.save(folder / name / f"{number:03}.png")
    save_calibration(folder / "stereo.toml", calibration, [])
    truth = photographer.render_depth(rectified_left(Rectification(calibration)))
    return {"calibration": str(folder / "stereo.toml"), "rehearse": str(folder)}, truth


@pytest.mark.slow
def test_recorded_pairs_become_depth_images_in_its_own_process(recorded, none_left):  # noqa: F811
    options, truth = recorded
    with open_sensor("libcamera", fps=60.0, **options) as sensor:
        assert sensor.fps == 60.0 and sensor.name == "libcamera rehearsal"
        frames = []
        while (frame := next_frame(sensor)) is not None:
            has_depth = frame.depth > 0
            assert has_depth[:, 60:-8].mean() > 0.85
            assert np.median(np.abs(1e-3 * frame.depth - truth)[has_depth] / truth[has_depth]) < 0.02
            frames.append((frame.sequence, frame.time_ns, frame.intrinsics))
        assert "ms apart" in sensor.condition().link
    numbers, times, cameras = zip(*frames, strict=True)
    assert list(numbers) == sorted(set(numbers)) and numbers[-1] == FRAMES - 1
    assert times == tuple(n * round(1e9 / 60) for n in numbers)
    assert len(set(cameras)) == 1 and (cameras[0].width, cameras[0].height) == (192, 120)
    assert cameras[0].fx == cameras[0].fy and not any(cameras[0].distortion)


@pytest.mark.slow
def test_a_process_that_crashes_is_started_again(recorded, none_left):  # noqa: F811
    with open_reopening(sensor_opener("libcamera", **recorded[0])) as sensor:
        errors: list[Exception] = []
        last = next_frame(sensor, errors).time_ns
        (process,) = helpers()
        os.kill(process.pid, signal.SIGSEGV)
        while not errors:
            last = next_frame(sensor, errors).time_ns
        assert "crashed" in str(errors[0])
        assert next_frame(sensor, errors).time_ns > last


def test_a_damaged_image_costs_its_pair_only(recorded, tmp_path):
    for name in ("left", "right"):
        image = Image.open(f"{recorded[0]['rehearse']}/{name}/000.png")
        for number in range(3):
            image.save(tmp_path / f"{name}-{number}.png")
    (tmp_path / "right-1.png").write_bytes(b"\x89PNG\r\n\x1a\nno image")
    options = {**recorded[0], "rehearse": str(tmp_path)}
    with LibcameraSensor(fps=240.0, **options) as sensor:
        assert sensor.read(1.0).sequence == 0
        with pytest.raises(InputError, match=r"right-1\.png: the image is damaged"):
            sensor.read(1.0)
        assert sensor.read(1.0).sequence == 2
        assert sensor.read(1.0) is None


def test_bodies_cross_the_process_boundary_unchanged(none_left):  # noqa: F811
    """A single camera with landmarks also creates bodies in the driver."""
    with IsolatedOpener("telling", BodyDriver, {})() as sensor:
        for number in range(body_driver.FRAMES):
            frame = next_frame(sensor)
            assert isinstance(frame, BodyFrame) and frame.sensor == "telling"
            assert frame.time_ns == number * body_driver.STEP
            for body, true in zip(frame.bodies, body_driver.bodies(number), strict=True):
                assert (body.id, body.stature) == (true.id, true.stature)
                np.testing.assert_array_equal(body.joints, true.joints)
                np.testing.assert_array_equal(body.confidence, true.confidence)
        assert next_frame(sensor) is None


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"calibration": "missing.toml"}, "enliven calibrate-stereo"),
        ({"rehearse": "."}, "calibration"),
        ({"fps": 0.0}, "rate is 0.0"),
        ({"view": 500.0}, "view is 500.0 degrees"),
    ],
)
def test_unusable_libcamera_options_are_refused(options, what):
    with pytest.raises(InputError, match=re.escape(what)):
        LibcameraSensor(**options)


def test_missing_libcamera_camera_gives_advice(capsys, tmp_path):
    try:
        LibcameraSensor().close()
    except ResourceError as error:
        message = str(error)
    except EnlivenError as error:
        pytest.skip(f"there is a camera: {error}")
    else:
        pytest.skip("there is a camera")
    assert "apt install python3-libcamera" in message or "ribbon cable" in message
    assert cli.run(["calibrate-stereo", "--live", str(tmp_path)]) == 4
    assert message.partition(".")[0] in capsys.readouterr().err


@settings(max_examples=40)
@given(
    st.sampled_from([(table, name) for table in (GREY, COLOUR) for name in table]),
    st.integers(2, 9),
    st.integers(1, 5),
    st.integers(0, 7),
)
def test_an_image_is_read_out_of_its_buffer(which, width, height, spare):
    """Compared with libcamera's format names, pixel by pixel: the first letter is the highest byte."""
    table, name = which
    layout = table[name]
    stride = width * layout.bytes + spare
    plane = np.random.default_rng(width).integers(0, 256, height * stride + 3).astype(np.uint8)
    image = copy_image(plane, (width, height), stride, layout)
    assert image.flags.c_contiguous and not np.shares_memory(image, plane)
    for row in range(height):
        for column in range(width):
            at = row * stride + column * layout.bytes
            letters = name.rstrip("0123456789")[::-1]
            if table is COLOUR:
                expected = [plane[at + letters.index(letter)] for letter in "RGB"]
                assert image[row, column].tolist() == expected
            else:
                offset = letters.index("G") if "G" in letters else 0
                assert image[row, column] == plane[at + offset]
    assert copy_image(plane[: height * stride - 1], (width, height), stride, layout) is None
