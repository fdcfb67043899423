"""Tests of Orbbec's driver with Orbbec's library on generated recordings."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from contract import next_frame
from isolated_sensors import none_left  # noqa: F401 (a fixture)
from libraries import needs
from troubled import camera, picture

from enliven.camera import Intrinsics
from enliven.errors import InputError, ResourceError
from enliven.frames import DepthFrame
from enliven.recording import Recorder
from enliven_edge.importing.bags.reader import BagReader
from enliven_edge.sensors.base import SensorFault
from enliven_edge.sensors.drivers import orbbec, playback
from enliven_edge.sensors.drivers.orbbec_library import open_device
from enliven_edge.sensors.drivers.playback import write_playback
from enliven_edge.sensors.event_log import EventLog
from enliven_edge.sensors.registry import open_sensor, sensor_opener
from enliven_edge.sensors.reopening import open_reopening


@pytest.fixture
def take(tmp_path) -> str:
    with Recorder(tmp_path / "take.mcap") as recorder:
        for number in range(8):
            frame = DepthFrame(picture(number, 96, 64), camera(96, 64, 80.25), number * 10**8, "test")
            recorder.write_frame(frame)
    return str(tmp_path / "take.mcap")


def test_orbbec_knows_its_ways_of_keeping_time():
    with pytest.raises(InputError, match="Use one of these modes: free_run, standalone, primary"):
        orbbec.OrbbecSensor(sync="boss")
    needs("orbbec")
    from pyorbbecsdk import OBMultiDeviceSyncMode

    assert all(hasattr(OBMultiDeviceSyncMode, word.upper()) for word in orbbec.SYNC_MODES)


BENT = (17.7, 12.3, 0.68, 18.0, 16.9, 3.6, 0.0001, -0.0002)
"""Coefficients k1 to k6, p1 and p2 of realistic size for a Femto's depth camera."""


def bent_stream(lens: Intrinsics, fps: int) -> bytes:
    """Returns the message of a stream with rational distortion, model 4 of Orbbec."""
    straight = playback_stream(lens, fps)
    return straight[: -8 * 4 - 1] + struct.pack("<8fB", *BENT, 4)


playback_stream = playback.make_stream_message


def test_orbbecs_library_and_the_import_straighten_alike(take, tmp_path, monkeypatch):
    """The library's filter and ours both round to the nearest pixel, but they may round halves
    differently.
    """
    needs("orbbec")
    monkeypatch.setattr(playback, "make_stream_message", bent_stream)
    write_playback(take, tmp_path / "bent.bag")
    imported = {frame.sequence: frame for frame in BagReader().read([tmp_path / "bent.bag"])}
    with open_sensor("orbbec", rehearse=str(tmp_path / "bent.bag")) as sensor:
        played = next_frame(sensor)
    ours = imported[played.sequence]
    assert not any(played.intrinsics.distortion) and played.intrinsics == ours.intrinsics
    assert (played.depth == ours.depth).mean() > 0.95
    raw = picture(played.sequence, 96, 64)
    assert (played.depth == raw).mean() < 0.7, "it was bent enough to tell"


def test_old_playback_is_refused_before_the_library_hangs(take, tmp_path, monkeypatch):
    needs("orbbec")
    monkeypatch.setattr(playback, "FILE_VERSION", 1.0)
    write_playback(take, tmp_path / "old.bag")
    with pytest.raises(InputError, match="only version 2 is supported"):
        open_reopening(sensor_opener("orbbec", rehearse=str(tmp_path / "old.bag")))


ACCELERATION = (0.5, -9.7, -1.25)
"""Reading of an accelerometer at rest in its own frame, m/s^2. It is the opposite of gravity."""
TURN = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""(3, 3) rotation from the accelerometer's frame to the depth camera's: a permutation of the axes."""


def felt(time_us: int, number: int) -> bytes:
    """Returns ``sensor_msgs/Imu`` with Orbbec's fields. The last bytes repeat the temperature."""
    unknown, reading = struct.pack("<4d9d3d9d", *(0.0,) * 25), struct.pack("<4f", *ACCELERATION, 36.5)
    own = struct.pack("<IQfQQQ", len(reading), number, 36.5, time_us, time_us, time_us)
    moved = struct.pack("<3d9d", *ACCELERATION, *(0.0,) * 9)
    return playback.make_ros_header(time_us) + unknown + moved + playback.prefix_size(reading) + own


def accelerometer() -> bytes:
    """Returns ``custom_msg/OBImuStreamProfileInfo``: 4 g, 100 readings per second."""
    stands = struct.pack("<9f3f", *TURN.ravel(), 0.0, 0.0, 0.0)
    return (
        playback.make_ros_header()
        + struct.pack("<6B", 4, 16, 2, 7, 0, 0)
        + stands
        + struct.pack("<27d", *(0.0,) * 27)
    )


def test_gravity_comes_from_the_accelerometer_in_the_cameras_frame(tmp_path, monkeypatch):
    """Orbbec's library takes the readings and the accelerometer's pose from a recording."""
    needs("orbbec")
    more = {
        "felt": ("/cam/sensor_4/frameType_4", "sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2"),
        "stands": ("/cam/streamProfileType_4", "custom_msg/OBImuStreamProfileInfo", playback.ANY_CHECKSUM),
    }
    monkeypatch.setattr(playback, "TOPICS", playback.TOPICS | more)
    write_bag = playback.PlaybackBag.write

    def write(bag, messages):
        kind, time_us, _ = messages[0]
        if kind == "image":
            messages = [*messages, *(("felt", time_us + 10 * i, felt(time_us, i)) for i in range(5))]
        else:
            messages = [*messages, ("stands", time_us, accelerometer())]
        write_bag(bag, messages)

    monkeypatch.setattr(playback.PlaybackBag, "write", write)
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


STEPS = [
    (0x0800, b"Orbbec Gemini 335", 176, struct.pack("<f", 0.25)),
    (0x0660, b"Orbbec Astra 2", 75, struct.pack("<i", 2)),
]
"""Depth steps by product, name and property. A Gemini 335 states millimetres, an Astra 2 a precision
level.
"""


@pytest.mark.parametrize(("product", "name", "number", "value"), STEPS)
def test_orbbecs_library_and_the_import_take_the_same_steps(
    take, tmp_path, monkeypatch, product, name, number, value
):
    """Cameras that compute depth from disparities report this (85, 3004), and report that smoothing is off
    (24).
    """
    needs("orbbec")
    write_bag = playback.PlaybackBag.write

    def write(bag, messages):
        if messages[0][0] != "image":
            about = {
                85: struct.pack("<i", 1),
                3004: struct.pack("<i", 0),
                24: struct.pack("<i", 0),
                number: value,
            }
            messages = messages + [
                ("property", 1_000_000, playback.make_property_message(*each)) for each in about.items()
            ]
        write_bag(bag, messages)

    monkeypatch.setattr(playback.PlaybackBag, "write", write)
    monkeypatch.setattr(playback, "CLAIMED_CAMERA", (0x2BC5, product, name))
    write_playback(take, tmp_path / "steps.bag")
    imported = {frame.sequence: frame for frame in BagReader().read([tmp_path / "steps.bag"])}
    with open_sensor("orbbec", rehearse=str(tmp_path / "steps.bag")) as sensor:
        played = next_frame(sensor)
    np.testing.assert_array_equal(played.depth, imported[played.sequence].depth)
    assert played.depth.max() < 1100, "2.5 m in steps of a quarter or two fifths of a millimetre"


class Listed:
    """Two cameras, listed like by Orbbec's library. No device is connected."""

    cameras = (
        ("AY1", "Orbbec Gemini 335", "usb-1", "0.0.0.0", ""),
        ("CL2", "Orbbec Femto Mega", "net-2", "10.0.0.5", "left"),
    )
    words = ("serial_number", "name", "uid", "ip_address", "user_name")

    def __len__(self):
        return len(self.cameras)

    def __getattr__(self, asked):
        word = asked.removeprefix("get_device_").removesuffix("_by_index")
        return lambda index: self.cameras[index][self.words.index(word)]

    def get_device_by_index(self, index):
        return self.cameras[index][0]


class Connected:
    """Orbbec's context with those cameras."""

    OBError = RuntimeError

    def query_devices(self):
        return Listed()

    def create_net_device(self, address, port):
        if address == "10.0.0.99":
            raise RuntimeError("createNetDevice\n failed.")
        return f"{address}:{port}"


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        ("AY1", "AY1"),
        ("CL2", "CL2"),
        ("Orbbec Femto Mega", "CL2"),
        ("left", "CL2"),
        ("10.0.0.5", "CL2"),
        ("10.0.0.9", "10.0.0.9:8090"),
    ],
)
def test_a_camera_is_opened_by_any_of_its_names(wanted, found):
    assert open_device(Connected, Connected(), wanted) == found


def test_previous_one_of_several_cameras_is_reopened():
    assert open_device(Connected, Connected(), "", "CL2") == "CL2"
    with pytest.raises(
        ResourceError, match=r"2 cameras are connected: AY1, CL2\. Choose .* --set device=AY1"
    ):
        open_device(Connected, Connected(), "")


def test_a_camera_that_is_not_there_or_does_not_open_is_a_sentence():
    with pytest.raises(ResourceError, match=r"camera called XX is not connected\. Connected: AY1, CL2"):
        open_device(Connected, Connected(), "XX")
    with pytest.raises(ResourceError, match=r"cannot be used \(createNetDevice failed\)\. Unplug the camera"):
        open_device(Connected, Connected(), "10.0.0.99")


def test_a_rehearsal_is_all_of_one_sensor_over_its_losses_and_lenses(tmp_path):
    """Only the first of two sensors is replayed, with images before and after a loss. Each image has its own
    lens and number.
    """
    needs("orbbec")
    sizes = [(96, 64)] * 4 + [(128, 72)] * 3 + [(96, 64)] * 3
    with Recorder(tmp_path / "two.mcap") as recorder:
        diary = EventLog(recorder)
        for number, (width, height) in enumerate(sizes):
            lens = camera(width, height, 80.25)
            frame = DepthFrame(picture(number, width, height), lens, number * 10**8, "left")
            diary.write_frame(frame, None)
            diary.write_frame(replace(frame, sensor="right", depth=frame.depth + np.uint16(7)), None)
            if number == 1:
                diary.write_error(SensorFault("it was unplugged"))
    with open_sensor("orbbec", rehearse=str(tmp_path / "two.mcap")) as sensor:
        seen = list(iter(lambda: next_frame(sensor), None))
    assert [frame.sequence for frame in seen] == list(range(len(sizes)))
    for number, frame in enumerate(seen):
        np.testing.assert_array_equal(frame.depth, picture(number, *sizes[number]))
        assert (frame.intrinsics.width, frame.intrinsics.height) == sizes[number]
        assert frame.time_ns == number * 10**8
