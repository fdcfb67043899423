"""Tests that malicious bag files and databases are refused with an error, using little memory and time."""

import bz2
import sqlite3
import struct
import tracemalloc

import lz4.frame
import pytest
from test_import_depth import read

from enliven.errors import InputError
from enliven_edge.importing.bags import ros1
from enliven_edge.sensors.drivers import playback


def chunk(how: bytes, size: int, packed: bytes) -> bytes:
    fields = {"compression": how, "size": struct.pack("<I", size)}
    return ros1.MAGIC + playback.make_record(playback.OP_CHUNK, fields, packed)


LISTED = playback.make_connection(0, *playback.TOPICS["image"])
BOMB = lz4.frame.compress(bytes(1 << 26))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (chunk(b"none", 1 << 31, b"a"), "2147483648 bytes"),
        (chunk(b"lz4", 1000, BOMB), "declared size"),
        (chunk(b"bz2", 1000, bz2.compress(bytes(1 << 20))), "declared size"),
        (chunk(b"lz4", 1000, b"nothing"), "cannot be decompressed"),
        (chunk(b"zip", 1, b"a"), "compression b'zip'"),
        (ros1.MAGIC + struct.pack("<I", 1 << 30), "ends in the middle"),
        (chunk(b"none", len(LISTED) - 2, LISTED[:-2]), "ends in the middle"),
        (ros1.MAGIC, "no images of a supported camera"),
    ],
)
def test_hostile_bags_are_refused(tmp_path, content, words):
    (tmp_path / "hostile.bag").write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=words):
            read(tmp_path)
        assert tracemalloc.get_traced_memory()[1] < 16 << 20, "a bomb was not let off"
    finally:
        tracemalloc.stop()


ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT"


@pytest.mark.parametrize(
    "script",
    [
        "CREATE TABLE other(id)",
        f"CREATE VIEW topics AS {ENDLESS} i AS id, '/device_0/x' AS name FROM n; CREATE TABLE messages(id)",
        "CREATE TABLE topics(id, name); CREATE TABLE messages(id, topic_id, data); "
        "INSERT INTO topics VALUES ('x', '/device_0/sensor_0/Depth_0/camera_info')",
        "CREATE TABLE topics(id, name); CREATE TABLE messages(id, topic_id, data); "
        "INSERT INTO topics VALUES (1, '/device_0/sensor_0/Depth_0/camera_info'); "
        "INSERT INTO messages VALUES (1, 1, x'0001000004000000')",
    ],
)
def test_hostile_databases_are_refused(tmp_path, script):
    path = tmp_path / "hostile.db3"
    database = sqlite3.connect(path)
    database.executescript(script)
    database.close()
    with pytest.raises(InputError):
        read(path)
    path.write_bytes(path.read_bytes()[:100] + bytes(1000))
    with pytest.raises(InputError, match="damaged"):
        read(path)
