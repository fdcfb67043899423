"""Writes Orbbec's playback files from enliven's recordings, so that Orbbec's library can rehearse with them.

The layout is that of OrbbecSDK 2 (``RosWriter``): a ROS bag of version 2.0 with messages of Orbbec's own. Its
image messages have fields that are missing in the message definition, and some checksums of types are
arbitrary. The library compares all checksums.
"""

from __future__ import annotations

import itertools
import logging
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.files import TemporaryFolder
from enliven.frames import DepthFrame, Frame
from enliven_edge.sensors.base import SensorFault
from enliven_edge.sensors.drivers.refusals import make_one_line_message
from enliven_edge.sensors.replay import ReplaySensor

log = logging.getLogger(__name__)

BEGINNING_US = 1_000_000
"""Time in microseconds at which a playback starts. It is not 0, because ROS has no time 0."""
_MAX_IMAGE_BYTES = 1 << 30
"""Maximum bytes of images in a playback: more than a minute of 640x400 at 30 frames per second. It bounds the
file, which is written completely before it is played."""
_HEADER_SIZE = 4096
"""Size of the first record in bytes. It is written again at the end."""
OP_CHUNK = b"\5"
"""The kind of a record that contains messages."""
_OP_MESSAGE, _OP_HEADER, _OP_INDEX, _OP_CHUNK_INFO, _OP_CONNECTION = b"\2", b"\3", b"\4", b"\6", b"\7"
_DEPTH = 3
"""Orbbec's number of the depth sensor, its stream and its frames."""
_Y16 = 8
"""Orbbec's number of the format with 16 bits per pixel."""
_BROWN_CONRADY = 3
"""Orbbec's number of the distortion model that enliven uses."""
CLAIMED_CAMERA = (0x2BC5, 0x0669, b"Femto Mega")
"""USB vendor, USB product and name of the camera that a playback claims to be.

It is a Femto, because the library plays the depth of a Femto without changes."""
FILE_VERSION = 2.0
"""The file version that OrbbecSDK 2.4 and later write and accept."""
ANY_CHECKSUM = "0123456789abcdef0123456789abcdef"
"""The checksum that the library expects for the types of Orbbec's own messages."""
TOPICS = {
    "image": ("/cam/sensor_3/frameType_3", "sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743"),
    "device": ("/cam/deviceInfo", "custom_msg/OBDeviceInfo", "afef5328bb4abebd1a309e1ea8b26b3a"),
    "stream": ("/cam/streamProfileType_3", "custom_msg/OBStreamProfileInfo", ANY_CHECKSUM),
    "property": ("/cam/property", "custom_msg/OBProperty", ANY_CHECKSUM),
}
"""The topic, type and checksum of each kind of message."""


@dataclass(frozen=True)
class Playback:
    """A written playback file.

    Attributes:
        path: the file.
        images: number of images.
        shift_ns: nanoseconds to add to a played time to get the recording's time.
    """

    path: Path
    images: int
    shift_ns: int


def write_playback(recording: str, path: Path) -> list[Playback]:
    """Writes the depth images of an enliven recording as Orbbec playbacks.

    A playback has one set of intrinsics. Images with another size or other intrinsics are written to further
    files next to it. Images of another sensor are skipped.

    Raises:
        InputError: if it is not a recording, or has no depth camera.
    """
    parts: list[Playback] = []
    with ReplaySensor(recording, speed=0.0) as sensor:
        for camera, frames in itertools.groupby(
            _depth_images(sensor, recording), lambda frame: frame.intrinsics
        ):
            name = path.with_stem(f"{path.stem}-{len(parts) + 1}") if parts else path
            image_count = sum(part.images for part in parts)
            parts.append(_write(name, camera, round(sensor.fps or 30.0), frames, image_count))
    if not parts:
        raise InputError(
            "the recording contains no depth images",
            where=recording,
            remedy="Rehearse with a depth recording.",
        )
    return parts


def _write(
    path: Path, camera: Intrinsics, fps: int, frames: Iterator[DepthFrame], image_offset: int
) -> Playback:
    """Writes the images of one camera into one file. ``image_offset`` is the number of images in the previous
    files.
    """
    first, images = next(frames), 0
    shift_ns = first.time_ns - 1000 * BEGINNING_US
    with PlaybackBag(path) as bag:
        for frame in itertools.chain([first], frames):
            time_us = (frame.time_ns - shift_ns) // 1000
            bag.write([("image", time_us, _image_message(frame.depth, time_us, image_offset + images))])
            images += 1
        topics = {
            "device": _device_message(),
            "stream": make_stream_message(camera, fps),
            "property": make_property_message(0, struct.pack("<d", FILE_VERSION)),
        }
        bag.write([(kind, BEGINNING_US, data) for kind, data in topics.items()])
    return Playback(path, images, shift_ns)


def _depth_images(sensor: ReplaySensor, recording: str) -> Iterator[DepthFrame]:
    """Yields the depth images of the first sensor that has any, up to the size limit."""
    remaining_bytes, name, images = _MAX_IMAGE_BYTES, None, 0
    while (frame := _read_next(sensor)) is not None:
        if isinstance(frame, DepthFrame) and frame.sensor == (name or frame.sensor):
            if remaining_bytes <= 0:
                log.warning(
                    "%s: the rehearsal plays only the first %d images of this recording", recording, images
                )
                return
            name, images, remaining_bytes = frame.sensor, images + 1, remaining_bytes - frame.depth.nbytes
            yield frame


def _read_next(sensor: ReplaySensor) -> Frame | None:
    """Returns the next frame that can be used. Returns None at the end."""
    while True:
        try:
            return sensor.read()
        except (InputError, SensorFault) as error:
            log.warning("%s", error)


class PlaybackBag:
    """A ROS bag that is being written. Its index is at its end.

    Args:
        path: the file, which is replaced.
    """

    def __init__(self, path: Path) -> None:
        self._file: BinaryIO = path.open("wb")
        self._file.write(b"#ROSBAG V2.0\n" + _make_first_record(0, 0, 0))
        self._connections: dict[str, bytes] = {}
        self._chunks: list[bytes] = []

    def __enter__(self) -> PlaybackBag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        end = self._file.tell()
        self._file.write(b"".join([*self._connections.values(), *self._chunks]))
        self._file.seek(len(b"#ROSBAG V2.0\n"))
        self._file.write(_make_first_record(end, len(self._connections), len(self._chunks)))
        self._file.close()

    def write(self, messages: list[tuple[str, int, bytes]]) -> None:
        """Writes one chunk of messages: for each its kind, time in microseconds and content."""
        body, offsets = b"", dict[int, list[bytes]]()
        for kind, time_us, content in messages:
            if kind not in self._connections:
                self._connections[kind] = make_connection(len(self._connections), *TOPICS[kind])
                body += self._connections[kind]
            number = list(self._connections).index(kind)
            offsets.setdefault(number, []).append(_time(time_us) + struct.pack("<I", len(body)))
            fields = {"conn": struct.pack("<I", number), "time": _time(time_us)}
            body += make_record(_OP_MESSAGE, fields, content)
        position = self._file.tell()
        size = struct.pack("<I", len(body))
        self._file.write(make_record(OP_CHUNK, {"compression": b"none", "size": size}, body))
        for number, entries in offsets.items():
            fields = _numbers(ver=1, conn=number, count=len(entries))
            self._file.write(make_record(_OP_INDEX, fields, b"".join(entries)))
        times = [time_us for _, time_us, _ in messages]
        fields = _numbers(ver=1, count=len(offsets)) | {"chunk_pos": struct.pack("<Q", position)}
        fields |= {"start_time": _time(min(times)), "end_time": _time(max(times))}
        counts = b"".join(struct.pack("<II", number, len(entries)) for number, entries in offsets.items())
        self._chunks.append(make_record(_OP_CHUNK_INFO, fields, counts))


def _make_first_record(index: int, connections: int, chunks: int) -> bytes:
    fields = {"index_pos": struct.pack("<Q", index)} | _numbers(conn_count=connections, chunk_count=chunks)
    bare = len(make_record(_OP_HEADER, fields, b""))
    return make_record(_OP_HEADER, fields, b" " * (_HEADER_SIZE - bare))


def make_connection(number: int, topic: str, kind: str, checksum: str) -> bytes:
    """Returns the record that assigns a number to a topic and its type of message."""
    fields = {"topic": topic, "type": kind, "md5sum": checksum, "message_definition": ""}
    content = _fields({key: value.encode() for key, value in fields.items()})
    return make_record(_OP_CONNECTION, _numbers(conn=number) | {"topic": topic.encode()}, content)


def make_record(op: bytes, fields: Mapping[str, bytes], content: bytes) -> bytes:
    """Returns a record of a bag: its kind and its other fields, then its content."""
    return prefix_size(_fields({**fields, "op": op})) + prefix_size(content)


def _fields(fields: Mapping[str, bytes]) -> bytes:
    return b"".join(prefix_size(key.encode() + b"=" + value) for key, value in fields.items())


def _numbers(**numbers: int) -> dict[str, bytes]:
    return {key: struct.pack("<I", number) for key, number in numbers.items()}


def prefix_size(content: bytes) -> bytes:
    """Returns the content after its length as uint32."""
    return struct.pack("<I", len(content)) + content


def _time(time_us: int) -> bytes:
    seconds, rest = divmod(time_us, 1_000_000)
    return struct.pack("<II", seconds, 1000 * rest)


def make_ros_header(time_us: int = BEGINNING_US) -> bytes:
    """Returns the ROS header of a message: a counter, a time and a name."""
    return struct.pack("<I", 0) + _time(time_us) + prefix_size(b"")


def _image_message(depth: np.ndarray, time_us: int, number: int) -> bytes:
    """Returns ``sensor_msgs/Image``.

    It is followed by Orbbec's fields: bits per pixel, number, times and metadata.
    """
    height, width = depth.shape
    shape = struct.pack("<II", height, width) + prefix_size(b"mono16") + struct.pack("<BI", 0, 2 * width)
    pixels = prefix_size(np.ascontiguousarray(depth, "<u2").tobytes())
    orbbec_fields = struct.pack("<IQQQQ", 16, number, time_us, time_us, time_us)
    return make_ros_header(time_us) + shape + pixels + orbbec_fields + prefix_size(b"") + struct.pack("<I", 0)


def _device_message() -> bytes:
    """Returns ``custom_msg/OBDeviceInfo``."""
    vendor, product, name = CLAIMED_CAMERA
    serial, link = b"rehearsal", b"USB3.0"
    text = [name, name, b"", b"rehearsal", serial, b"1.2.8", b"1.0", b"2.0.0", link]
    words = [prefix_size(word) for word in text]
    words.insert(3, struct.pack("<HH", vendor, product))
    return make_ros_header() + b"".join(words) + struct.pack("<HB", 0, 0) + 2 * prefix_size(b"")


def make_stream_message(camera: Intrinsics, fps: int) -> bytes:
    """Returns ``custom_msg/OBStreamProfileInfo``: the intrinsics of the depth camera."""
    k1, k2, p1, p2, k3 = camera.distortion
    distortion = any(camera.distortion)
    values = [*np.eye(3).ravel(), 0.0, 0.0, 0.0]
    lens = [camera.fx, camera.fy, camera.cx, camera.cy, k1, k2, k3, 0.0, 0.0, 0.0, p1, p2]
    size = struct.pack("<HHH", camera.width, camera.height, fps)
    return (
        make_ros_header()
        + struct.pack("<BB12f", _DEPTH, _Y16, *values)
        + size
        + struct.pack("<12fB", *lens, _BROWN_CONRADY if distortion else 0)
    )


def make_property_message(number: int, value: bytes) -> bytes:
    """Returns ``custom_msg/OBProperty``."""
    return make_ros_header() + struct.pack("<I", number) + prefix_size(value) + struct.pack("<I", len(value))


def playbacks(ob: Any, path: str) -> list[tuple[Any, int]]:
    """Returns devices that play a recording of enliven or Orbbec, one for each set of intrinsics.

    Returns:
        each device with the nanoseconds to add to a played time to get the recording's time.

    Raises:
        InputError: for a recording that cannot be used.
    """
    with TemporaryFolder("rehearsal") as folder:
        if Path(path).suffix == ".bag":
            from enliven_edge.importing.bags.orbbec import check_playback

            check_playback(Path(path))
            files = [(Path(path), 0)]
        else:
            written = write_playback(path, Path(folder) / "rehearsal.bag")
            files = [(part.path, part.shift_ns) for part in written]
        # The library keeps the files open. So the files disappear when their last user closes them.
        try:
            return [(ob.PlaybackDevice(str(file)), shift_ns) for file, shift_ns in files]
        except ob.OBError as error:
            problem = f"Orbbec's library cannot play the recording ({make_one_line_message(error)})"
            raise InputError(problem, where=path) from None
