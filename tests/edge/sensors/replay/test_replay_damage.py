"""Tests that a replay skips messages that are not frames, and continues."""

import struct

import pytest
from troubled import STEP, Troubled

from enliven.errors import InputError
from enliven.recording import Recorder, schemas
from enliven.recording.messages import pack_depth
from enliven_edge.sensors.replay import ReplaySensor


@pytest.fixture
def damaged(tmp_path):
    """Writes ten frames. The fifth has a NaN focal length, as an older recorder allowed."""
    Troubled.reset()
    device, path = Troubled(10), tmp_path / "a.mcap"
    with Recorder(path) as recorder:
        while (frame := device.read()) is not None:
            data = bytearray(pack_depth(frame, 1))
            if frame.time_ns == 5 * STEP:
                data[16:24] = struct.pack("<d", float("nan"))
            kind = schemas.DEPTH
            channel = (kind.schema_name, kind.schema_text, kind.schema_encoding, kind.message_encoding)
            recorder.write(schemas.DEPTH_TOPIC, *channel, bytes(data), frame.time_ns, "troubled")
    return path


def test_frames_after_damage_are_replayed(damaged):
    with ReplaySensor(damaged, speed=0) as sensor:
        times = [sensor.read().time_ns for _ in range(4)]
        with pytest.raises(InputError, match="focal length"):
            sensor.read()
        times += [frame.time_ns for frame in iter(sensor.read, None)]
    assert times == [i * STEP for i in range(1, 11) if i != 5]


def test_damaged_message_is_reported_in_every_loop(damaged):
    times, faults = [], 0
    with ReplaySensor(damaged, speed=0, loop=True) as sensor:
        while len(times) < 27:
            try:
                times.append(sensor.read().time_ns)
            except InputError:
                faults += 1
    assert faults == 3 and times == sorted(set(times))
