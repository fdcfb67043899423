"""Tests of a recorder whose file cannot grow: the error is reported, and earlier data stays readable."""

import math
import subprocess
import sys
import textwrap

import pytest

from enliven.errors import InputError, ResourceError
from enliven.recording import Recorder, Recording, RecordingWarning
from enliven.recording.container import open_container

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs limits of POSIX")

LIMITED = """
    import os, resource, signal, sys
    from enliven.errors import ResourceError
    from enliven.recording import Recorder

    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
    with Recorder(sys.argv[1], sync_seconds=float(sys.argv[3])) as recorder:
        for i in range(400):
            try:
                recorder.write("/x", "X", "{}", "jsonschema", "raw", os.urandom(1000), i)
            except ResourceError as error:
                print(i, error)
                break
        for _ in range(3):
            try:
                recorder.write("/x", "X", "{}", "jsonschema", "raw", b"more", 1000)
            except ResourceError as error:
                print("again", error)
"""


@pytest.mark.parametrize("sync_seconds", ["0.5", "0.0"])
@pytest.mark.parametrize("limit", [9_000, 60_000, 200_123])
def test_data_before_full_disk_is_readable(tmp_path, limit, sync_seconds):
    path = tmp_path / "a.mcap"
    command = [sys.executable, "-c", textwrap.dedent(LIMITED), str(path), str(limit), sync_seconds]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    first, *again = done.stdout.splitlines()
    assert "File too large" in first and len(again) == 3
    with pytest.warns(RecordingWarning, match="cut off"):
        recording = Recording(path)
    times = [time_ns for time_ns, _ in recording.messages("/x")]
    assert times == list(range(len(times)))
    assert len(times) * 1000 > 0.4 * limit
    assert recording.problems and "damaged parts" not in recording.problems[0]


def test_the_first_messages_are_on_the_disk_before_a_chunk_of_full_size_is_there(tmp_path):
    with Recorder(tmp_path / "a.mcap", sync_seconds=1e9) as recorder:
        for i in range(6):
            recorder.write("/x", "X", "{}", "jsonschema", "raw", bytes(1000), i)
        with pytest.warns(RecordingWarning):
            assert len(list(Recording(tmp_path / "a.mcap").messages("/x"))) == 5


def test_a_damaged_first_chunk_of_a_cut_recording_costs_its_messages_only(tmp_path):
    """Only the damaged chunk listed the topics. Without them, nothing in the file would be readable."""
    path = tmp_path / "a.mcap"
    recorder = Recorder(path, sync_seconds=0.0)
    for i in range(10):
        recorder.write("/x", "X", "{}", "jsonschema", "raw", bytes([i]) * 100, i)
    whole = path.read_bytes()
    recorder.close()
    ref = min(open_container(path).chunks, key=lambda ref: ref.offset)
    data = bytearray(whole)
    data[ref.offset + ref.length // 2] ^= 0x55
    path.write_bytes(data)
    with pytest.warns(RecordingWarning):
        assert [time_ns for time_ns, _ in Recording(path).messages("/x")] == list(range(1, 10))


@pytest.mark.parametrize("time_ns", [-1, 1 << 63, 1 << 70])
def test_a_frame_of_an_impossible_time_is_refused_and_the_recording_goes_on(tmp_path, time_ns):
    from enliven.frames import BodyFrame

    with Recorder(tmp_path / "a.mcap", sync_seconds=math.inf) as recorder:
        recorder.write_frame(BodyFrame([], 1, "x"))
        with pytest.raises(InputError, match="outside"):
            recorder.write_frame(BodyFrame([], time_ns, "x"))
        recorder.write_frame(BodyFrame([], 2, "x"))
    assert [frame.time_ns for frame in Recording(tmp_path / "a.mcap").frames()] == [1, 2]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /dev/full")
def test_a_device_that_is_always_full(tmp_path):
    with pytest.raises(ResourceError, match="No space left"):
        Recorder("/dev/full", overwrite=True)
