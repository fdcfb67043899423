"""Tests of ``enliven recover``: it keeps every whole message of a damaged recording, and reports the
losses.
"""

import math
import random
import subprocess
import sys
import warnings

import pytest

from enliven.errors import InputError
from enliven.recording import Recorder, Recording
from enliven.recording.container import open_container
from enliven.recording.recovery import LostSpan, recover

STEP = 100_000_000
COUNT = 40
START = 1_700_000_000 * 10**9


def content(number: int) -> bytes:
    return random.Random(number).randbytes(300)


def write(path, sync_seconds=0.0, start=START):
    """Writes two topics with bytes of two sensors, one message per chunk, and metadata text."""
    with Recorder(path, sync_seconds=sync_seconds) as recorder:
        recorder.add_metadata("performer", {"name": "Ada"})
        for i in range(COUNT):
            topic = "/even" if i % 2 == 0 else "/odd"
            recorder.write(topic, "T", "{}", "jsonschema", "msgpack", content(i), start + i * STEP, topic[1:])
    return path


def messages(path) -> dict[int, tuple[str, bytes]]:
    """Returns topic and bytes of each message by number, read by the ordinary reader without any warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        recording = Recording(path)
        assert recording.info.complete
        return {
            (time_ns - START) // STEP: (topic, data)
            for topic in recording.info.topics
            for time_ns, data in recording.messages(topic)
        }


def expected(numbers) -> dict[int, tuple[str, bytes]]:
    return {i: ("/even" if i % 2 == 0 else "/odd", content(i)) for i in numbers}


def chunks(path):
    return sorted(open_container(path).chunks, key=lambda ref: ref.offset)


def test_a_whole_recording_is_copied_whole(tmp_path):
    recovery = recover(write(tmp_path / "a.mcap"), tmp_path / "b.mcap")
    assert messages(tmp_path / "b.mcap") == expected(range(COUNT))
    assert recovery.spans == [] and not recovery.lost and not recovery.cut and recovery.first_ns == START
    recording = Recording(tmp_path / "b.mcap")
    assert recording.info.metadata["performer"] == {"name": "Ada"}
    assert recording.info.sensors == ("even", "odd")


def test_a_cut_recording_keeps_every_whole_message_and_has_an_index_again(tmp_path):
    data = write(tmp_path / "a.mcap").read_bytes()
    refs = chunks(tmp_path / "a.mcap")
    for k in (1, 7, COUNT - 1):
        (tmp_path / "cut.mcap").write_bytes(data[: refs[k].offset + refs[k].length - 3])
        recovery = recover(tmp_path / "cut.mcap", tmp_path / f"b{k}.mcap")
        assert messages(tmp_path / f"b{k}.mcap") == expected(range(k))
        assert recovery.cut and recovery.spans == [LostSpan(START + (k - 1) * STEP, None)]


@pytest.mark.parametrize("cut", [False, True], ids=["with its index", "without"])
def test_damaged_chunks_are_skipped_and_reported(tmp_path, cut):
    path = write(tmp_path / "a.mcap")
    data, refs = bytearray(path.read_bytes()), chunks(path)
    for k in (0, 5, 6, 20):
        data[refs[k].offset + 60] ^= 0x55
    path.write_bytes(data[: refs[-1].offset + refs[-1].length] if cut else data)
    recovery = recover(path, tmp_path / "b.mcap")
    readable = [i for i in range(COUNT) if i not in (0, 5, 6, 20)]
    assert messages(tmp_path / "b.mcap") == expected(readable)
    spans = [(None, 1), (4, 7), (19, 21)] + ([(COUNT - 1, None)] if cut else [])
    at = lambda i: None if i is None else START + i * STEP  # noqa: E731
    assert recovery.spans == [LostSpan(at(a), at(b)) for a, b in spans]
    assert recovery.nameless == 0
    assert dict(recovery.lost) == ({} if cut else {"/even": 3, "/odd": 1})


def test_chunks_behind_a_record_of_a_wrong_length_are_found(tmp_path):
    """A reader that follows record lengths stops there."""
    path = write(tmp_path / "a.mcap")
    data, refs = bytearray(path.read_bytes()), chunks(path)
    data[refs[10].offset + 1 : refs[10].offset + 9] = (1 << 50).to_bytes(8, "little")
    data[refs[25].offset : refs[25].offset + refs[25].length] = bytes(refs[25].length)
    path.write_bytes(data[:-30])
    recovery = recover(path, tmp_path / "b.mcap")
    assert messages(tmp_path / "b.mcap") == expected(i for i in range(COUNT) if i not in (10, 25))
    at = [START + i * STEP for i in range(COUNT)]
    assert recovery.spans[:2] == [LostSpan(at[9], at[11]), LostSpan(at[24], at[26])]
    with pytest.warns(UserWarning, match="cut off"):
        assert Recording(path).info.topics["/even"].count == 5


def test_flipped_bits_never_make_a_message_that_was_not_there(tmp_path):
    whole = write(tmp_path / "a.mcap", sync_seconds=math.inf).read_bytes()
    chosen = random.Random(0)
    for k in range(60):
        data = bytearray(whole)
        for _ in range(chosen.randint(1, 4)):
            data[chosen.randrange(8, len(data))] ^= 1 << chosen.randrange(8)
        (tmp_path / "c.mcap").write_bytes(data[: chosen.randrange(len(data) // 2, len(data) + 1)])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                recover(tmp_path / "c.mcap", tmp_path / f"{k}.mcap")
            except InputError:
                assert not (tmp_path / f"{k}.mcap").exists()
                continue
        kept = messages(tmp_path / f"{k}.mcap")
        assert {i: data for i, (_, data) in kept.items()} == {i: content(i) for i in kept}


def enliven(*arguments) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "enliven", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


@pytest.mark.slow
def test_command_reports_losses_and_overwrites_nothing(tmp_path):
    path = write(tmp_path / "broken.mcap")
    data, refs = bytearray(path.read_bytes()), chunks(path)
    data[refs[5].offset + 60] ^= 0x55
    path.write_bytes(data)
    asked = enliven("recover", path, "-o", tmp_path / "whole.mcap")
    assert asked.returncode == 0, asked.stderr
    assert "39 messages" in asked.stdout and "/odd: 19 messages, 1 lost" in asked.stdout
    assert "lost: between 0.400 s and 0.600 s" in asked.stdout
    before = (tmp_path / "whole.mcap").read_bytes()
    for output in (tmp_path / "whole.mcap", path):
        again = enliven("recover", path, "-o", output)
        assert again.returncode == 3 and "exists already" in again.stderr
    assert (tmp_path / "whole.mcap").read_bytes() == before and path.read_bytes() == data


@pytest.mark.parametrize("content", [b"", b"no recording at all" * 30, b"\x89MCAP0\r\n" + b"\x01" * 60])
def test_non_recording_is_refused_without_leftovers(tmp_path, content):
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(InputError):
        recover(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert not (tmp_path / "b.mcap").exists()
