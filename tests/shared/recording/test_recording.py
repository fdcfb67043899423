"""Tests of recordings: lossless round trips, and damaged, truncated or foreign files."""

import dataclasses
import json
import math
import os
import signal
import subprocess
import sys
import textwrap
import time
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from enliven.camera import Intrinsics
from enliven.errors import InputError, ResourceError
from enliven.frames import BodyFrame, DepthFrame
from enliven.person.body import Body
from enliven.person.joints import J
from enliven.recording import Recorder, Recording, RecordingWarning
from enliven.recording.container import open_container
from enliven.recording.messages import pack_bodies, pack_depth, unpack_bodies, unpack_depth

CAMERA = Intrinsics(32, 24, 26.25, 26.3, 15.5, 11.5, (0.1, -0.2, 0.003, 0.004, 0.05))


def depth_frame(number: int, sensor: str = "test", **more) -> DepthFrame:
    rng = np.random.default_rng(number)
    depth = rng.integers(0, 4000, (24, 32), np.uint16)
    return DepthFrame(depth, CAMERA, number * 33_000_000, sensor, **more)


def body_frame(number: int, people: int = 1, sensor: str = "test") -> BodyFrame:
    rng = np.random.default_rng(number)
    bodies = [
        Body(i, rng.normal(size=(J, 3)), rng.random(J))
        if i == 0
        else Body(i, rng.normal(size=(J, 3)), rng.random(J), rng.normal(size=(J, 4)), rng.random(2), 1.7)
        for i in range(people)
    ]
    return BodyFrame(bodies, number * 33_000_000, sensor)


def same_depth(a: DepthFrame, b: DepthFrame) -> bool:
    arrays = ((a.depth, b.depth), (a.colour, b.colour), (a.world_from_camera, b.world_from_camera))
    equal = all((x is None) == (y is None) and (x is None or np.array_equal(x, y)) for x, y in arrays)
    headers = [(x.intrinsics, x.time_ns, x.sensor, x.sequence) for x in (a, b)]
    return equal and headers[0] == headers[1]


def same_bodies(a: BodyFrame, b: BodyFrame) -> bool:
    def equal(x: Body, y: Body) -> bool:
        same_options = all(
            (a is None) == (b is None) and (a is None or np.array_equal(a, b))
            for a, b in ((x.orientations, y.orientations), (x.contacts, y.contacts))
        )
        return (
            same_options
            and x.stature == y.stature
            and x.id == y.id
            and np.array_equal(x.joints, y.joints, True)
            and bool(np.array_equal(x.confidence, y.confidence))
        )

    return (a.time_ns, a.sensor, len(a.bodies)) == (b.time_ns, b.sensor, len(b.bodies)) and all(
        map(equal, a.bodies, b.bodies)
    )


def write(path, frames, **options):
    with Recorder(path, **options) as recorder:
        for frame in frames:
            recorder.write_frame(frame)
    return path


def test_depth_frames_come_back_exactly(tmp_path):
    rng = np.random.default_rng(0)
    frames = [
        depth_frame(0),
        depth_frame(1, colour=rng.integers(0, 256, (48, 64, 3), np.uint8), sequence=0),
        depth_frame(2, world_from_camera=rng.normal(size=(4, 4)), sequence=7),
        depth_frame(3, "kinect-ü", colour=np.zeros((1, 1, 3), np.uint8), world_from_camera=np.eye(4)),
    ]
    recording = Recording(write(tmp_path / "a.mcap", frames))
    assert all(map(same_depth, recording.frames(), frames))
    assert recording.info.sensors == ("kinect-ü", "test")
    assert recording.info.topics["/depth"].count == 4
    assert recording.info.duration == pytest.approx(0.099)
    assert recording.info.complete
    assert recording.problems == []


@given(
    values=st.lists(
        st.floats(allow_nan=False, allow_infinity=False, width=64), min_size=3 * J, max_size=3 * J
    ),
    time_ns=st.integers(0, 2**63 - 1),
    sensor=st.text(max_size=20),
)
@settings(deadline=None, max_examples=60)
def test_every_float64_of_a_body_comes_back_exactly(values, time_ns, sensor):
    joints = np.array(values).reshape(J, 3)
    frame = BodyFrame([Body(7, joints, np.linspace(0, 1, J))], time_ns, sensor)
    assert same_bodies(unpack_bodies(pack_bodies(frame)), frame)


def test_not_a_number_in_a_joint_comes_back():
    frame = body_frame(1)
    frame.bodies[0].joints[3, 1] = np.nan
    assert same_bodies(unpack_bodies(pack_bodies(frame)), frame)


def test_bodies_of_older_recordings_are_read():
    """The text is from version 0.1, which had neither contacts nor stature."""
    joints = "[" + ",".join(["[1.0,2.0,null]"] * J) + "]"
    body = f'{{"id":3,"joints":{joints},"confidence":{[0.5] * J},"orientations":null}}'
    old = f'{{"time_ns":5,"sensor":"k","bodies":[{body}]}}'
    (body,) = unpack_bodies(old.encode()).bodies
    assert body.id == 3 and np.isnan(body.joints[0, 2]) and body.confidence[0] == 0.5
    assert (body.orientations, body.contacts, body.stature) == (None, None, None)


def test_bodies_and_truth_are_kept_apart(tmp_path):
    seen, truth = [body_frame(i, i % 3) for i in range(5)], [body_frame(i + 10, 1) for i in range(5)]
    with Recorder(tmp_path / "a.mcap") as recorder:
        for a, b in zip(seen, truth, strict=True):
            recorder.write_frame(a)
            recorder.write_truth(b)
    recording = Recording(tmp_path / "a.mcap")
    assert all(map(same_bodies, recording.frames(), seen))
    assert all(map(same_bodies, recording.truth(), truth))
    assert {name: topic.count for name, topic in recording.info.topics.items()} == {
        "/bodies": 5,
        "/truth/bodies": 5,
    }


def test_any_message_can_be_recorded(tmp_path):
    schema = json.dumps({"type": "object"})
    with Recorder(tmp_path / "a.mcap") as recorder:
        for i in range(3):
            recorder.write("/pose", "enliven.Pose", schema, "jsonschema", "msgpack", bytes([i]), 10 * i)
        recorder.add_metadata("performer", {"name": "Ada"})
    recording = Recording(tmp_path / "a.mcap")
    assert list(recording.messages("/pose")) == [(0, b"\0"), (10, b"\1"), (20, b"\2")]
    assert list(recording.messages("/other")) == []
    assert recording.info.metadata["performer"] == {"name": "Ada"}
    assert recording.info.topics["/pose"].schema == "enliven.Pose"


def test_frames_come_in_the_order_of_time_over_chunks_and_sensors(tmp_path):
    order = [5, 3, 9, 1, 7, 2, 8]
    frames = [depth_frame(i, f"sensor{i % 2}") for i in order]
    path = write(tmp_path / "a.mcap", frames, sync_seconds=0.0)
    assert [f.time_ns // 33_000_000 for f in Recording(path).frames()] == sorted(order)


def test_other_readers_find_schemas_and_metadata(tmp_path):
    path = write(tmp_path / "a.mcap", [depth_frame(0), body_frame(1)])
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        messages = list(reader.iter_messages())
        assert {schema.name for schema, _, _ in messages} == {"enliven.DepthFrame", "enliven.BodyFrame"}
        for schema, channel, message in messages:
            if channel.message_encoding == "json":
                assert json.loads(schema.data)["type"] == "object"
                assert json.loads(message.data)["bodies"][0]["id"] == 0
            else:
                assert "offset size" in schema.data.decode()
        assert reader.get_header().profile == "enliven"
        assert any("depth sensor" in m.metadata["what"] for m in reader.iter_metadata())


def test_without_syncing_the_bytes_depend_on_the_messages_alone(tmp_path):
    paths = [tmp_path / "a.mcap", tmp_path / "b.mcap"]
    for path in paths:
        write(path, [depth_frame(i) for i in range(5)], sync_seconds=math.inf, compression_level=19)
        time.sleep(0.01)
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_existing_file_is_kept_by_default(tmp_path):
    path = write(tmp_path / "a.mcap", [depth_frame(0)])
    before = path.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        Recorder(path)
    assert path.read_bytes() == before
    write(path, [body_frame(0)], overwrite=True)
    assert "/bodies" in Recording(path).info.topics


def test_recorder_reports_errors(tmp_path):
    with pytest.raises(InputError, match="the folder of the file does not exist"):
        Recorder(tmp_path / "no" / "a.mcap")
    with pytest.raises((InputError, ResourceError), match=r"exists already|cannot be written"):
        Recorder(tmp_path)
    with Recorder(tmp_path / "a.mcap") as recorder, pytest.raises(InputError, match="time -5"):
        recorder.write("/x", "", "", "", "", b"", -5)


@pytest.mark.parametrize("sync_seconds", [0.0, math.inf], ids=["many chunks", "one chunk"])
def test_a_cut_file_yields_every_whole_chunk_and_one_warning(tmp_path, sync_seconds):
    frames = [depth_frame(i) for i in range(6)]
    data = write(tmp_path / "whole.mcap", frames, sync_seconds=sync_seconds).read_bytes()
    cut, counts = tmp_path / "cut.mcap", []
    for size in sorted({*range(8, len(data), 137), *range(8, 60), *range(len(data) - 60, len(data))}):
        cut.write_bytes(data[:size])
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            recording = Recording(cut)
            read = list(recording.frames())
        assert [w.category for w in caught] == [RecordingWarning]
        assert str(cut) in str(caught[0].message)
        assert all(map(same_depth, read, frames))
        info = recording.info
        assert not info.complete
        assert sum(topic.count for topic in info.topics.values()) == len(read)
        counts.append(len(read))
    assert counts == sorted(counts)
    assert counts[-1] == 6
    assert (set(counts) == set(range(7))) == (sync_seconds == 0.0)


def test_a_damaged_chunk_is_skipped_with_one_warning(tmp_path):
    frames = [depth_frame(i) for i in range(8)]
    path = write(tmp_path / "a.mcap", frames, sync_seconds=0.0)
    data = bytearray(path.read_bytes())
    refs = open_container(path).chunks
    for ref in (refs[2], refs[5]):
        data[ref.offset + ref.length // 2] ^= 0x55
    path.write_bytes(data)
    with pytest.warns(RecordingWarning, match="damaged part") as caught:
        recording = Recording(path)
        read = list(recording.frames())
        list(recording.frames())
    assert len(caught) == 1
    assert [f.time_ns for f in read] == [f.time_ns for i, f in enumerate(frames) if i not in (2, 5)]
    assert len(recording.problems) == 2


def test_no_single_damaged_byte_costs_more_than_its_chunk(tmp_path):
    frames = [body_frame(i) for i in range(6)]
    data = write(tmp_path / "a.mcap", frames, sync_seconds=0.0).read_bytes()
    damaged = tmp_path / "b.mcap"
    for place in range(60, len(data), 61):
        changed = bytearray(data)
        changed[place] ^= 0xFF
        damaged.write_bytes(changed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read = list(Recording(damaged).frames())
        assert len(read) >= 5, place


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "the file does not exist"),
        (b"", "empty"),
        (b"\x89MC", "not a recording"),
        (b"Head;1;2;3\n" * 100, "not a recording"),
        (bytes(range(256)) * 10, "not a recording"),
    ],
    ids=["missing", "empty", "short", "text", "binary"],
)
def test_non_recording_is_refused(tmp_path, content, expected):
    path = tmp_path / "a.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=expected) as caught:
        Recording(path)
    assert str(path) in str(caught.value)
    assert caught.value.remedy


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(InputError):
        Recording(tmp_path)


def test_the_mcap_file_of_another_program_is_refused(tmp_path):
    path = tmp_path / "ros.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start("ros2", "rosbag")
        channel = writer.register_channel("/imu", "cdr", writer.register_schema("imu", "ros2msg", b"x"))
        writer.add_message(channel, 1, b"abc", 1)
        writer.finish()
    with pytest.raises(InputError, match="another program"):
        Recording(path)


@given(data=st.binary(max_size=400))
@settings(deadline=None, max_examples=150)
def test_foreign_messages_are_input_errors(data):
    for unpack in (unpack_depth, unpack_bodies):
        with pytest.raises(InputError):
            unpack(data)


@given(
    sequence=st.none() | st.integers(-(2**63) + 1, 2**63 - 1), coloured=st.booleans(), placed=st.booleans()
)
@settings(deadline=None)
def test_a_sequence_number_comes_back_and_older_readers_pass_it_over(sequence, coloured, placed):
    colour = np.arange(300, dtype=np.uint16).astype(np.uint8).reshape(10, 10, 3) if coloured else None
    frame = depth_frame(1, colour=colour, world_from_camera=np.eye(4) if placed else None, sequence=sequence)
    data = bytearray(pack_depth(frame, 1))
    assert same_depth(unpack_depth(bytes(data)), frame)
    data[1] &= 3  # a reader of before looks at these two flags alone
    assert same_depth(unpack_depth(bytes(data)), dataclasses.replace(frame, sequence=None))


def test_a_sequence_number_that_the_layout_cannot_hold_is_left_out():
    assert unpack_depth(pack_depth(depth_frame(1, sequence=2**63), 1)).sequence is None


@given(place=st.integers(0, 10**6), value=st.integers(0, 255), cut=st.integers(0, 400))
@settings(deadline=None, max_examples=150)
def test_damaged_messages_give_a_frame_or_an_input_error(place, value, cut):
    colour = np.arange(300, dtype=np.uint16).astype(np.uint8).reshape(10, 10, 3)
    data = bytearray(pack_depth(depth_frame(1, colour=colour, world_from_camera=np.eye(4), sequence=9), 1))
    data[place % len(data)] = value
    try:
        frame = unpack_depth(bytes(data[: len(data) - cut]))
    except InputError:
        return
    assert frame.depth.shape == (frame.intrinsics.height, frame.intrinsics.width)


def test_bodies_of_the_wrong_shape_are_refused(tmp_path):
    with Recorder(tmp_path / "a.mcap") as recorder, pytest.raises(InputError, match="expected"):
        recorder.write_frame(BodyFrame([Body(0, np.zeros((19, 3)), np.zeros(20))], 0, "x"))
    with pytest.raises(InputError):
        unpack_bodies(b'{"time_ns":0,"sensor":"x","bodies":[{"id":0,"joints":[[0,0,0]],"confidence":[]}]}')


KILLED = """
    import sys, time
    import numpy as np
    from enliven.person.body import Body
    from enliven.person.joints import J
    from enliven.frames import BodyFrame
    from enliven.recording import Recorder

    with Recorder(sys.argv[1]) as recorder:
        for number in range(100_000):
            now = time.time_ns()
            recorder.write_frame(BodyFrame([Body(0, np.ones((J, 3)), np.ones(J))], now, "x"))
            print(now, flush=True)
            time.sleep(0.02)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs kill -9")
def test_a_killed_recorder_loses_at_most_the_last_second(tmp_path):
    path = tmp_path / "killed.mcap"
    program = [sys.executable, "-c", textwrap.dedent(KILLED), str(path)]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as process:
        written = [int(process.stdout.readline()) for _ in range(80)]
        os.kill(process.pid, signal.SIGKILL)
        written += [int(line) for line in process.stdout if line.endswith("\n")]
    with pytest.warns(RecordingWarning, match="cut off") as caught:
        times = [frame.time_ns for frame in Recording(path).frames()]
    assert len(caught) == 1
    assert times[: len(written)] == written[: len(times)]
    assert written[-1] - times[-1] < 1_000_000_000


def test_sync_writes_data_before_a_pause(tmp_path):
    recorder = Recorder(tmp_path / "a.mcap", sync_seconds=math.inf)
    recorder.write_frame(body_frame(0))
    recorder.sync()
    with pytest.warns(RecordingWarning):
        assert len(list(Recording(tmp_path / "a.mcap").frames())) == 1
    recorder.close()
    recorder.close()
    assert Recording(tmp_path / "a.mcap").info.complete
