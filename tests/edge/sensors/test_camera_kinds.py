"""What is known of each kind of camera is used by its driver, and what only some drivers do."""

import importlib.util
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_drivers import needs
from test_isolation import next_frame, none_left  # noqa: F401 (a fixture)
from troubled import camera, picture

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven.recording import Recorder
from enliven_edge.importing.bags.reader import BagReader
from enliven_edge.sensors.drivers import oak, orbbec, playback, realsense
from enliven_edge.sensors.drivers.lens import kind_of, within
from enliven_edge.sensors.drivers.playback import write_playback
from enliven_edge.sensors.drivers.tof import TofSensor
from enliven_edge.sensors.profile import load_profile
from enliven_edge.sensors.registry import open_sensor, sensor_opener
from enliven_edge.sensors.reopening import kept_open

NAMES = [
    (oak._KINDS, "oak-d", "OAK-D-LITE", "OAK-D Lite"),
    (oak._KINDS, "oak-d", "OAK-D-POE", "OAK-D"),
    (realsense._KINDS, "realsense-d435", "Intel RealSense D415", "RealSense D415"),
    (realsense._KINDS, "realsense-d435", "Intel RealSense D435I", "RealSense D435"),
    (realsense._KINDS, "realsense-d435", "Intel RealSense D455", "RealSense D455"),
    (realsense._KINDS, "realsense-d435", "Intel RealSense D405", "RealSense D405"),
    (orbbec._KINDS, "orbbec-gemini335", "Orbbec Gemini 2", "Orbbec Gemini 2"),
    (orbbec._KINDS, "orbbec-gemini335", "Orbbec Gemini 335Lg", "Orbbec Gemini 335"),
    (orbbec._KINDS, "orbbec-gemini335", "Orbbec Astra 2", "Orbbec Astra 2"),
    (orbbec._KINDS, "orbbec-gemini335", "Orbbec Femto Bolt", "Orbbec Femto Mega, Femto Bolt"),
]


@pytest.mark.parametrize(("kinds", "otherwise", "called", "profile"), NAMES)
def test_a_camera_gets_the_profile_of_its_kind(kinds, otherwise, called, profile):
    assert load_profile(kind_of(called, kinds, otherwise)).name == profile


EDGES = [each + by for each in (500, 700, 1000, 2000, 3100, 5460) for by in (-1, 0, 1)]
"""Millimetres around the ends of the reaches below."""


@given(
    st.lists(st.sampled_from(EDGES) | st.integers(0, 65535), min_size=1, max_size=50),
    st.sampled_from([(0.0, 0.0), (1.0, 0.0), (0.0, 2.0), (0.7, 3.1)]),
    st.booleans(),
)
def test_depths_out_of_reach_are_unknown_and_the_others_stay(values, reach, rehearsed):
    typical = load_profile("orbbec-femto-mega").range
    near = reach[0] or (0.0 if rehearsed else typical.near)
    far = reach[1] or (65.535 if rehearsed else typical.far)
    depth = np.array(values, np.uint16)
    kept = within(reach, "orbbec-femto-mega", rehearsed)(depth)
    for before, after in zip(values, kept.tolist(), strict=True):
        assert after == (before if round(1000 * near) <= before <= round(1000 * far) else 0)


def test_an_empty_reach_is_refused():
    with pytest.raises(InputError, match=r"near is 3.0 m and far 2.0 m"):
        within((3.0, 2.0), "arducam-tof", False)


@pytest.fixture
def take(tmp_path) -> str:
    with Recorder(tmp_path / "take.mcap") as recorder:
        for number in range(8):
            frame = DepthFrame(picture(number, 96, 64), camera(96, 64, 80.25), number * 10**8, "test")
            recorder.write_frame(frame)
    return str(tmp_path / "take.mcap")


def test_a_depth_of_little_confidence_is_unknown(take):
    """A slow twin, with confidences around the threshold and depths that are no numbers."""
    random = np.random.default_rng(1)
    confidence = random.integers(0, 60, (64, 96)).astype(np.float32)
    depth = random.uniform(-50.0, 70_000.0, (64, 96)).astype(np.float32)
    depth[0, :4] = np.nan, np.inf, -np.inf, 0.0
    with TofSensor(rehearse=take, confidence=40.0) as sensor:
        seen = sensor._trusted(depth, confidence)
        with pytest.raises(InputError, match="shapes"):
            sensor._trusted(depth[1:], confidence)
    for got, metres, sure in zip(seen.ravel(), depth.ravel(), confidence.ravel(), strict=True):
        known = sure >= 40.0 and 0.0 < metres < 65535.0
        assert got == (np.rint(metres) if known else 0)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"range": 3}, "no range of 3 m"), ({"near": 3.0, "far": 1.0, "rehearse": "x"}, "near is 3.0 m")],
)
def test_what_the_time_of_flight_camera_has_not(options, words):
    with pytest.raises(InputError, match=words):
        TofSensor(**options)


def test_orbbec_knows_its_ways_of_keeping_time():
    with pytest.raises(InputError, match="Give free_run, standalone, primary"):
        orbbec.OrbbecSensor(sync="boss")
    needs("orbbec")
    from pyorbbecsdk import OBMultiDeviceSyncMode

    assert all(hasattr(OBMultiDeviceSyncMode, word.upper()) for word in orbbec._SYNC)


BENT = (17.7, 12.3, 0.68, 18.0, 16.9, 3.6, 0.0001, -0.0002)
"""k1 to k6, p1, p2 of a Femto's depth camera, the size that these have there."""


def bent_stream(lens: Intrinsics, fps: int) -> bytes:
    """The message of a stream with a rational distortion, model 4 of Orbbec."""
    straight = playback_stream(lens, fps)
    return straight[: -8 * 4 - 1] + struct.pack("<8fB", *BENT, 4)


playback_stream = playback._stream


def test_orbbecs_library_and_the_import_straighten_alike(take, tmp_path, monkeypatch):
    """The library's own filter and ours round to the nearest pixel, but not every half in the same way."""
    needs("orbbec")
    monkeypatch.setattr(playback, "_stream", bent_stream)
    write_playback(take, tmp_path / "bent.bag")
    imported = {frame.sequence: frame for frame in BagReader().read([tmp_path / "bent.bag"])}
    with open_sensor("orbbec", rehearse=str(tmp_path / "bent.bag")) as sensor:
        played = next_frame(sensor)
    ours = imported[played.sequence]
    assert not any(played.intrinsics.distortion) and played.intrinsics == ours.intrinsics
    assert (played.depth == ours.depth).mean() > 0.95
    raw = picture(played.sequence, 96, 64)
    assert (played.depth == raw).mean() < 0.7, "it was bent enough to tell"


def test_a_playback_of_an_old_version_is_refused_before_the_library_hangs_on_it(take, tmp_path, monkeypatch):
    if importlib.util.find_spec("pyorbbecsdk") is None:
        pytest.skip("pyorbbecsdk is not installed: docs/sensors.md")
    monkeypatch.setattr(playback, "_FILE_VERSION", 1.0)
    write_playback(take, tmp_path / "old.bag")
    with pytest.raises(InputError, match="only version 2 is known"):
        kept_open(sensor_opener("orbbec", rehearse=str(tmp_path / "old.bag")))


ACCELERATION = (0.5, -9.7, -1.25)
"""What an accelerometer feels at rest, m/s^2, in its own frame: the opposite of gravity."""
TURN = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""(3, 3) from the accelerometer's frame to the depth camera's: an axis becomes the next."""


def felt(time_us: int, number: int) -> bytes:
    """``sensor_msgs/Imu`` with Orbbec's fields: the reading and its temperature once more, as bytes."""
    unknown, reading = struct.pack("<4d9d3d9d", *(0.0,) * 25), struct.pack("<4f", *ACCELERATION, 36.5)
    own = struct.pack("<IQfQQQ", len(reading), number, 36.5, time_us, time_us, time_us)
    moved = struct.pack("<3d9d", *ACCELERATION, *(0.0,) * 9)
    return playback._head(time_us) + unknown + moved + playback._sized(reading) + own


def accelerometer() -> bytes:
    """``custom_msg/OBImuStreamProfileInfo``: 4 g, 100 readings a second."""
    stands = struct.pack("<9f3f", *TURN.ravel(), 0.0, 0.0, 0.0)
    return playback._head() + struct.pack("<6B", 4, 16, 2, 7, 0, 0) + stands + struct.pack("<27d", *(0.0,) * 27)


def test_gravity_comes_from_the_accelerometer_in_the_cameras_frame(tmp_path, monkeypatch):
    """Through Orbbec's library, which takes readings and the accelerometer's place from a playback."""
    needs("orbbec")
    more = {
        "felt": ("/cam/sensor_4/frameType_4", "sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"),
        "stands": ("/cam/streamProfileType_4", "custom_msg/OBImuStreamProfileInfo", playback._MADE_UP),
    }
    monkeypatch.setattr(playback, "_TOPICS", playback._TOPICS | more)
    made = playback._Bag.write

    def write(bag, messages):
        kind, time_us, _ = messages[0]
        if kind == "image":
            messages = [*messages, *(("felt", time_us + 10 * i, felt(time_us, i)) for i in range(5))]
        else:
            messages = [*messages, ("stands", time_us, accelerometer())]
        made(bag, messages)

    monkeypatch.setattr(playback._Bag, "write", write)
    with Recorder(tmp_path / "take.mcap") as recorder:
        for number in range(40):
            frame = DepthFrame(picture(number, 96, 64), camera(96, 64, 80.25), number * 10**8, "test")
            recorder.write_frame(frame)
    write_playback(str(tmp_path / "take.mcap"), tmp_path / "felt.bag")
    with open_sensor("orbbec", rehearse=str(tmp_path / "felt.bag")) as sensor:
        gravity = None
        while gravity is None and next_frame(sensor) is not None:
            gravity = getattr(sensor.condition(), "gravity", None)
    np.testing.assert_allclose(gravity, -TURN @ ACCELERATION, atol=1e-5)
