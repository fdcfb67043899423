"""Tests that recordings and projects from untrusted sources are refused in a sentence, in bounded memory and
time.
"""

import io
import os
import struct
import warnings
import zipfile
import zlib

import numpy as np
import pytest
import zstandard
from bounded import bounded

from enliven.document.project import Project
from enliven.errors import InputError
from enliven.formats.npy import read_npy
from enliven.formats.project.file import parse_project, project_bytes, read_project
from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.person.joints import J
from enliven.recording import Recorder, Recording
from enliven.recording.messages import unpack_bodies

FOOTER = 37
"""Number of bytes from the footer record to the end of an MCAP file."""


@pytest.fixture
def seed(tmp_path):
    """Returns the bytes of a small valid recording."""
    path = tmp_path / "seed.mcap"
    with Recorder(path) as recorder:
        recorder.write_frame(BodyFrame([Body(0, np.zeros((J, 3)), np.ones(J))], 5, "seed"))
    return path.read_bytes()


def chunk(content: bytes) -> bytes:
    """Returns a chunk record with a correct checksum."""
    return packed_chunk(zstandard.ZstdCompressor().compress(content), len(content), zlib.crc32(content))


def packed_chunk(packed: bytes, size: int, crc: int) -> bytes:
    body = struct.pack("<QQQII4sQ", 0, 10, size, crc, 4, b"zstd", len(packed)) + packed
    return struct.pack("<BQ", 6, len(body)) + body


def header(seed: bytes) -> bytes:
    """Returns the magic bytes and the header record of a recording."""
    return seed[: 17 + struct.unpack_from("<Q", seed, 9)[0]]


def drained(path) -> int:
    """Returns the number of messages in a recording, over all topics."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        recording = Recording(path)
        return sum(1 for topic in recording.info.topics for _ in recording.messages(topic))


def test_a_gigabyte_in_32_kilobytes_is_refused(tmp_path, seed):
    size = 1 << 30
    packer = zstandard.ZstdCompressor().compressobj(size=size)
    packed = b"".join(packer.compress(bytes(1 << 24)) for _ in range(64)) + packer.flush()
    assert len(packed) < 40_000
    path = tmp_path / "bomb.mcap"
    path.write_bytes(header(seed) + packed_chunk(packed, size, 0))
    with (
        bounded(),
        pytest.raises(InputError, match=f"{len(packed)} bytes states an unpacked size of {size} bytes"),
    ):
        drained(path)


def test_a_flood_of_records_in_a_few_bytes_is_refused(tmp_path, seed):
    path = tmp_path / "flood.mcap"
    # Records of an unknown kind without content have 9 bytes each.
    path.write_bytes(header(seed) + chunk(struct.pack("<BQ", 0x80, 0) * 7000) * 3)
    with bounded(), pytest.raises(InputError, match="records in 63000 bytes"):
        drained(path)


def test_an_index_that_names_a_chunk_many_times_yields_it_once(tmp_path, seed):
    start = struct.unpack_from("<Q", seed, len(seed) - FOOTER + 9)[0]
    summary, tail = seed[start : len(seed) - FOOTER], seed[len(seed) - FOOTER : len(seed) - 12]
    at, more = 0, b""
    while at < len(summary):
        size = 9 + struct.unpack_from("<Q", summary, at + 1)[0]
        more += summary[at : at + size] * (300 if summary[at] == 8 else 1)
        at += size
    crc = zlib.crc32(tail, zlib.crc32(more))
    path = tmp_path / "many.mcap"
    path.write_bytes(seed[:start] + more + tail + struct.pack("<I", crc) + seed[-8:])
    with bounded():
        assert drained(path) == 1


def test_an_index_may_name_places_that_no_file_has(tmp_path, seed):
    start = struct.unpack_from("<Q", seed, len(seed) - FOOTER + 9)[0]
    summary, tail = seed[start : len(seed) - FOOTER], seed[len(seed) - FOOTER : len(seed) - 12]
    at = next(i for i in range(len(summary)) if summary[i] == 10 and len(summary) - i > 60)
    far = summary[: at + 9] + struct.pack("<Q", 2**63) + summary[at + 17 :]
    path = tmp_path / "far.mcap"
    crc = zlib.crc32(tail, zlib.crc32(far))
    path.write_bytes(seed[:start] + far + tail + struct.pack("<I", crc) + seed[-8:])
    with bounded():
        assert drained(path) == 1


def test_a_message_nested_without_end_is_refused():
    deep = b'{"time_ns":1,"sensor":"s","bodies":[],"more":' + b"[" * 100_000
    with bounded(), pytest.raises(InputError, match="cannot be read"):
        unpack_bodies(deep)


def test_long_recording_of_covered_sensor_is_read(tmp_path):
    """This is the most repetitive valid recording: only the time changes."""
    path = tmp_path / "covered.mcap"
    with Recorder(path, sync_seconds=1e9) as recorder:
        for number in range(20_000):
            recorder.write_frame(BodyFrame([], number * 33_333_333, "s"))
    assert drained(path) == 20_000


def zipped(**entries: bytes) -> bytes:
    out = io.BytesIO(project_bytes(Project()))
    with zipfile.ZipFile(out, "a", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            archive.writestr(f"arrays/{name}.npy", data)
    return out.getvalue()


@pytest.mark.slow
def test_a_project_that_unpacks_to_a_flood_is_refused(tmp_path):
    path = tmp_path / "bomb.enliven"
    path.write_bytes(zipped(a=bytes(300 << 20)))
    assert path.stat().st_size < 1 << 20
    with bounded(100), pytest.raises(InputError, match="would unpack to") as caught:
        read_project(path)
    assert caught.value.exit_code == 3 and str(path) in caught.value.where


@pytest.mark.slow
def test_an_entry_that_lies_about_its_size_is_read_no_further(tmp_path):
    data = zipped(a=bytes(300 << 20))
    lie = data.replace(struct.pack("<I", 300 << 20), struct.pack("<I", 100))
    assert lie != data
    with bounded(100), pytest.raises(InputError, match="damaged"):
        parse_project(lie)


def npy(shape: str, kind: str = "<f8") -> bytes:
    """Returns an .npy file of 128 bytes."""
    head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + head.encode()


@pytest.mark.parametrize(
    ("shape", "kind"),
    [
        ("(1000000000,)", "<f8"),
        ("(10, -1)", "<f8"),
        ("(1" + "0" * 40 + ",)", "<f8"),
        ("(0, 1000000)", "|O"),
        ("(1,", "<f8"),
        ("(1,)", "|V4000000"),
    ],
)
def test_array_with_false_size_is_refused(shape, kind):
    data = npy(shape, kind)
    assert len(data) == 128
    with bounded(), pytest.raises(InputError, match="an array in the project is damaged") as caught:
        parse_project(zipped(a=data))
    assert caught.value.exit_code == 3


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("shape", [(), (0,), (3,), (2, 3, 4)])
@pytest.mark.parametrize("kind", ["<f8", "<f4", "|u1", "<i4", "|b1"])
def test_arrays_come_back_as_they_were_written(order, shape, kind):
    values = np.asarray(np.arange(np.prod(shape, dtype=int)).reshape(shape) % 2, kind, order=order)
    out = io.BytesIO()
    np.save(out, values)
    again = read_npy(out.getvalue())
    assert again.dtype == values.dtype and again.flags.writeable
    np.testing.assert_array_equal(again, values)


def test_a_pipe_is_no_recording_and_no_project(tmp_path):
    os.mkfifo(tmp_path / "a")
    for read in (Recording, read_project):
        with bounded(seconds=20), pytest.raises(InputError, match="not a regular file"):
            read(tmp_path / "a")
