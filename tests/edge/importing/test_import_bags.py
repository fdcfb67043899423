"""Tests of importing recordings made by the manufacturers' libraries: contents are correct, damage is an
error.
"""

import contextlib
import importlib.util
import sqlite3
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_import_command import run
from test_import_depth import depth_image, read

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.recording import Recorder, Recording
from enliven_edge.importing.bags.images import undistortion_map
from enliven_edge.importing.bags.reader import BagReader
from enliven_edge.sensors.drivers import playback
from enliven_edge.sensors.drivers.playback import write_playback

OLD_BAG = Path(__file__).parent / "librealsense-2.56.bag"
"""Written by librealsense 2.56.5, the last version that writes ROS 1: five images of a software device."""
CAMERA = Intrinsics(64, 48, 60.25, 61.0, 31.5, 23.25, (0.125, 0.25, 0.5, -0.125, 0.0625))
SERIAL = "0123456789"
IMAGES = 6


def librealsense_writes(path: Path, packed: bool) -> None:
    """Records images of a software device with librealsense's own recorder."""
    from enliven_edge.sensors.drivers.realsense_library import realsense_library

    rs = realsense_library()
    device = rs.software_device()
    device.register_info(rs.camera_info.serial_number, SERIAL)
    sensor, stream, lens = device.add_sensor("Depth"), rs.video_stream(), rs.intrinsics()
    lens.width, lens.height, lens.fx, lens.fy = CAMERA.width, CAMERA.height, CAMERA.fx, CAMERA.fy
    lens.ppx, lens.ppy, lens.coeffs = CAMERA.cx, CAMERA.cy, list(CAMERA.distortion)
    lens.model = rs.distortion.brown_conrady
    stream.type, stream.index, stream.uid, stream.fmt = rs.stream.depth, 0, 0, rs.format.z16
    stream.width, stream.height, stream.bpp, stream.fps, stream.intrinsics = 64, 48, 2, 30, lens
    profile = sensor.add_video_stream(stream)
    sensor.add_read_only_option(rs.option.depth_units, 0.001)
    recorder = rs.recorder(str(path), device, packed)
    recorded, queue = recorder.query_sensors()[0], rs.frame_queue(IMAGES)
    recorded.open(recorded.get_stream_profiles()[0])
    recorded.start(queue)
    for number in range(IMAGES):
        image = rs.software_video_frame()
        image.pixels, image.bpp, image.stride = depth_image(number), 2, 128
        image.timestamp, image.frame_number = 2000.0 + 33.25 * number, 10 + number
        image.domain, image.depth_units = rs.timestamp_domain.hardware_clock, 0.001
        image.profile = profile.as_video_stream_profile()
        sensor.on_video_frame(image)
        queue.wait_for_frame(10_000)
    recorded.stop()
    recorded.close()


@pytest.mark.parametrize("packed", [False, True])
def test_librealsense_recording_is_imported_unchanged(tmp_path, packed):
    if importlib.util.find_spec("pyrealsense2") is None:
        pytest.skip('pyrealsense2 is not installed: pip install "./edge[realsense]"')
    librealsense_writes(tmp_path / "take.db3", packed)
    name, frames = read(tmp_path)
    assert name == "bag" and len(frames) == IMAGES
    for number, frame in enumerate(frames):
        np.testing.assert_array_equal(frame.depth, depth_image(number))
        assert frame.time_ns == 2_000_000_000 + 33_250_000 * number and frame.sequence == 10 + number
        assert frame.intrinsics == CAMERA and frame.sensor == f"realsense-{SERIAL}"
    run("import", tmp_path / "take.db3", "-o", tmp_path / "take.mcap")
    assert len(list(Recording(tmp_path / "take.mcap").frames())) == IMAGES


def test_one_of_two_cameras_is_chosen_by_its_number(tmp_path):
    """The second camera is a copy of the first one, with the next index and another serial number."""
    if importlib.util.find_spec("pyrealsense2") is None:
        pytest.skip('pyrealsense2 is not installed: pip install "./edge[realsense]"')
    path = tmp_path / "two.db3"
    librealsense_writes(path, False)
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute(
            "INSERT INTO topics SELECT id + 100, replace(name, 'device_0', 'device_1'), type, "
            "serialization_format, offered_qos_profiles FROM topics"
        )
        for topic, time_ns, data in database.execute(
            "SELECT topic_id, timestamp, data FROM messages"
        ).fetchall():
            other = data.replace(SERIAL.encode(), SERIAL[::-1].encode())
            row = (topic + 100, time_ns, other)
            database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", row)
        database.commit()
    with pytest.raises(
        InputError, match=f"2 depth cameras. Choose one camera: --device {SERIAL} or {SERIAL[::-1]}"
    ):
        read(path)
    _, frames = read(path, device=SERIAL[::-1])
    assert len(frames) == IMAGES and frames[0].sensor == f"realsense-{SERIAL[::-1]}"


def test_bag_of_an_older_librealsense_is_imported():
    name, frames = read(OLD_BAG)
    assert name == "bag" and [frame.sequence for frame in frames] == [100, 101, 102, 103, 104]
    for number, frame in enumerate(frames):
        steps = 2000 * (np.arange(32 * 24).reshape(24, 32) % 7) + number
        np.testing.assert_array_equal(frame.depth, np.rint(steps * 0.5))
        assert abs(frame.time_ns - 5_000_000_000 - 33_250_000 * number) < 1000
    lens = frames[0].intrinsics
    assert (lens.fx, lens.fy, lens.cx, lens.cy) == (26.5, 26.75, 15.5, 11.25)
    np.testing.assert_allclose(lens.distortion, (0.1, 0.02, 0.001, 0.002, 0.003), rtol=1e-6)


@pytest.fixture(scope="module")
def orbbec(tmp_path_factory) -> Path:
    """Returns a recording in Orbbec's format. tests/edge/sensors/test_contract.py reads it with Orbbec's
    library.
    """
    folder = tmp_path_factory.mktemp("orbbec")
    with Recorder(folder / "take.mcap") as recorder:
        for number in range(IMAGES):
            depth = depth_image(number)
            recorder.write_frame(DepthFrame(depth, CAMERA, 7_000_000_000 + 33_000_000 * number, "t"))
    (written,) = write_playback(str(folder / "take.mcap"), folder / "take.bag")
    assert written.images == IMAGES and written.shift_ns == 6_000_000_000
    return folder / "take.bag"


def test_orbbec_recording_is_imported_unchanged(orbbec):
    name, frames = read(orbbec)
    assert name == "bag" and len(frames) == IMAGES
    for number, frame in enumerate(frames):
        np.testing.assert_array_equal(frame.depth, depth_image(number))
        assert frame.time_ns == 1_000_000_000 + 33_000_000 * number and frame.sequence == number
        assert frame.intrinsics == CAMERA and frame.sensor == "orbbec-rehearsal"
    assert read(orbbec, device="left")[1][0].sensor == "left"


@pytest.mark.parametrize(
    ("number", "value", "millimetres"),
    [(75, struct.pack("<i", 2), 0.4), (176, struct.pack("<f", 0.25), 0.25), (3, b"\0" * 4, 1.0)],
)
def test_depth_steps_of_orbbec_cameras_are_applied(tmp_path, orbbec, monkeypatch, number, value, millimetres):
    """The depth step is recorded as a precision level or in millimetres, depending on the camera."""
    about = {0: struct.pack("<d", 2.0), number: value}
    frames = with_properties(tmp_path, orbbec, monkeypatch, about)
    np.testing.assert_array_equal(frames[0].depth, np.rint(depth_image(0) * np.float64(millimetres)))


@pytest.mark.parametrize(
    ("about", "words"),
    [
        ({0: struct.pack("<d", 1.0)}, "only version 2"),
        ({0: struct.pack("<d", 2.0), 85: b"\0\0\0\0"}, "disparities instead of depth"),
        ({0: struct.pack("<d", 2.0), 176: struct.pack("<f", float("nan"))}, "depth unit of nan mm"),
    ],
)
def test_unsupported_orbbec_recording_is_refused(tmp_path, orbbec, monkeypatch, about, words):
    with pytest.raises(InputError, match=words):
        with_properties(tmp_path, orbbec, monkeypatch, about)


@pytest.mark.parametrize(
    ("name", "product", "made", "known"),
    [
        (b"Femto Bolt", 0x066B, None, True),
        (b"Orbbec Gemini 335", 0x0800, 1, True),
        (b"Orbbec Gemini 335", 0x0800, None, False),
        (b"Orbbec Gemini 2", 0x0670, 1, False),
        (b"Orbbec DaBai", 0x060E, 1, False),
    ],
)
def test_images_that_only_the_library_understands_are_refused(
    tmp_path, orbbec, monkeypatch, name, product, made, known
):
    """Disparities are refused if the camera does not state that it computes depth from them. A Femto has
    none.
    """
    monkeypatch.setattr(playback, "CLAIMED_CAMERA", (0x2BC5, product, name))
    about = {0: struct.pack("<d", 2.0)} | ({} if made is None else {85: struct.pack("<i", made)})
    if known:
        assert with_properties(tmp_path, orbbec, monkeypatch, about)
    else:
        with pytest.raises(
            InputError, match=r"only Orbbec's library can decode .*\. Use Orbbec's library instead"
        ):
            with_properties(tmp_path, orbbec, monkeypatch, about)


def with_properties(folder, orbbec, monkeypatch, about):
    """Returns the frames of a recording with changed camera properties."""
    write_bag = playback.PlaybackBag.write

    def write(bag, messages):
        others = [each for each in messages if each[0] != "property"]
        if len(others) < len(messages):
            others += [
                ("property", 1_000_000, playback.make_property_message(*each)) for each in about.items()
            ]
        write_bag(bag, others)

    monkeypatch.setattr(playback.PlaybackBag, "write", write)
    write_playback(str(orbbec.with_suffix(".mcap")), folder / "other.bag")
    return read(folder / "other.bag")[1]


def test_images_of_a_rational_lens_are_straightened():
    """A straight line is distorted by a slow version of OpenCV's model, and must become straight to within a
    pixel.
    """
    camera = Intrinsics(48, 40, 40.0, 41.0, 23.5, 19.25)
    k1, k2, p1, p2, k3, k4, k5, k6 = bent = (0.3, 0.1, 0.002, -0.001, 0.01, 0.4, 0.05, 0.02)
    places = undistortion_map(camera, bent)
    for row in range(40):
        for column in range(48):
            x, y = (column - 23.5) / 40.0, (row - 19.25) / 41.0
            r2 = x**2 + y**2
            far = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
            u = 40.0 * (x * far + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)) + 23.5
            v = 41.0 * (y * far + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y) + 19.25
            place = places[row * 48 + column]
            if place == 48 * 40:
                assert not (0 <= u <= 47 and 0 <= v <= 39)
            else:
                assert abs(place % 48 - u) < 0.501 and abs(place // 48 - v) < 0.501


@given(st.data())
def test_damage_is_a_sentence_or_harmless(orbbec, tmp_path_factory, data):
    """Truncated or changed at any byte: an InputError or frames, and nothing else."""
    source = data.draw(st.sampled_from([orbbec, OLD_BAG]))
    content = bytearray(source.read_bytes())
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    for _ in range(data.draw(st.integers(0, 4))):
        if content:
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.mktemp("damaged", numbered=True) / "take.bag"
    path.write_bytes(content)
    try:
        assert len(list(BagReader().read([path]))) <= IMAGES
    except InputError as error:
        assert str(path) in str(error) or error.where


@pytest.mark.parametrize("share", [0.3, 0.6, 0.97])
@pytest.mark.parametrize("which", ["orbbec", "realsense"])
def test_truncated_recording_leaves_no_output(orbbec, tmp_path, share, which):
    content = (orbbec if which == "orbbec" else OLD_BAG).read_bytes()
    cut = tmp_path / "cut.bag"
    cut.write_bytes(content[: round(share * len(content))])
    with pytest.raises(InputError, match=r"ends in the middle|description of the depth camera is missing"):
        run("import", cut, "-o", tmp_path / "cut.mcap")
    assert not list(tmp_path.glob("*.mcap*"))


def test_several_recordings_are_imported_one_by_one(orbbec):
    with pytest.raises(InputError, match="the 2 files are separate recordings"):
        list(BagReader().read([orbbec, OLD_BAG]))
