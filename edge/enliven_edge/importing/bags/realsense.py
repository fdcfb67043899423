"""Reads recordings of librealsense: .bag files up to version 2.56, .db3 files since 2.57."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.importing.bags.images import (
    check_step,
    check_time,
    convert_to_millimetres,
    intrinsics_from_lens,
    read_compressed_image,
    read_image,
)
from enliven_edge.importing.bags.ros1 import AlignedFields, Fields, Message

TOPIC = re.compile(r"/device_\d+/")
_STREAM = re.compile(r"(/device_\d+)(/sensor_\d+)/Depth_\d+")
_DESCRIPTION_TOPICS = re.compile(
    r"/device_\d+(/info|/sensor_\d+/(option/Depth[_ ]Units/value|Depth_\d+(/info)?/camera_info))"
)
_DEFAULT_STEP_MM = 1.0
"""Depth step in millimetres if none was recorded: that of the D400 family."""
Read = Callable[[Path, Callable[[str], bool]], Iterator[Message]]


@dataclass
class _BagContents:
    """The descriptions of a recording's cameras, by the prefixes of their topic names."""

    cameras: dict[str, Intrinsics] = field(default_factory=dict)
    steps: dict[str, float] = field(default_factory=dict)
    serials: dict[str, str] = field(default_factory=dict)


def frames(path: Path, read_messages: Read, device: str | None) -> Iterator[DepthFrame]:
    """Yields the depth images of one camera of a recording.

    Args:
        read_messages: returns the messages of the file.
        device: the camera's serial number, or a name for the sensor. If None, the only camera is read.

    Raises:
        InputError: if the recording has no depth camera, or several cameras and ``device`` is not given.
    """
    contents = _read_contents(path, read_messages)
    stream = _choose_stream(contents, device, path)
    match = _STREAM.match(stream)
    assert match is not None
    stream_of_topic, sensor = match[1], match[1] + match[2]
    camera, step = contents.cameras[stream], contents.steps.get(sensor, _DEFAULT_STEP_MM)
    serial = contents.serials.get(stream_of_topic, "")
    name = device if device and device != serial else "-".join(word for word in ("realsense", serial) if word)
    pending_frame: DepthFrame | None = None
    for topic, fields in read_messages(path, lambda topic: topic.startswith(f"{stream}/image/")):
        if topic.endswith(("/data", "/compressedDepth")):
            if pending_frame is not None:
                yield pending_frame
            pending_frame = _read_frame(topic, fields, camera, step, name)
        elif topic.endswith("/metadata") and isinstance(fields, AlignedFields) and pending_frame is not None:
            yield _add_number(pending_frame, dict(_pairs(fields)))
            pending_frame = None
    if pending_frame is not None:
        yield pending_frame


def _read_frame(topic: str, fields: Fields, camera: Intrinsics, step: float, name: str) -> DepthFrame:
    """Reads an image of a recording. The frame number precedes the image in a .bag, and follows it in a
    .db3.
    """
    number = None if isinstance(fields, AlignedFields) else fields.count()
    seconds, rest = fields.numbers("II")
    fields.text()
    depth = read_compressed_image(fields) if topic.endswith("/compressedDepth") else read_image(fields)
    time_ns = int(seconds) * 1_000_000_000 + int(rest)
    return DepthFrame(convert_to_millimetres(depth, step), camera, time_ns, name, sequence=number)


def _add_number(frame: DepthFrame, fields: dict[str, str]) -> DepthFrame:
    """Returns an image of a .db3 with its frame number and the camera's time. Both follow the image in the
    file.
    """
    try:
        time_ns = check_time(round(1e6 * float(fields["timestamp"])), frame.sensor)
        return replace(frame, sequence=int(fields["Frame number"]), time_ns=time_ns)
    except (KeyError, ValueError, OverflowError):
        return frame


def _read_contents(path: Path, read_messages: Read) -> _BagContents:
    contents = _BagContents()
    for topic, fields in read_messages(path, _is_small):
        if topic.endswith("camera_info"):
            stream = _STREAM.match(topic)
            if stream:
                contents.cameras[stream[0]] = _read_camera(fields)
        elif topic.endswith("/value"):
            contents.steps[topic.partition("/option/")[0]] = _depth_step_mm(fields)
        else:
            for key, value in _pairs(fields):
                if key == "Serial Number":
                    contents.serials[topic.removesuffix("/info")] = value
    return contents


def _is_small(topic: str) -> bool:
    """Returns True if a topic describes a camera.

    In addition, a .db3 repeats the camera's intrinsics as text with each image.
    """
    return _DESCRIPTION_TOPICS.fullmatch(topic) is not None


def _read_camera(fields: Fields) -> Intrinsics:
    """Reads intrinsics: ``sensor_msgs/CameraInfo`` in a .bag, text in a .db3."""
    if isinstance(fields, AlignedFields):
        return _parse_camera_text(fields)
    fields.numbers("III")
    fields.text()
    height, width, model = fields.count(), fields.count(), fields.text()
    distortion = fields.numbers("d" * min(fields.count(), 16))
    fx, _, cx, _, fy, cy, *_ = fields.numbers("9d")
    return intrinsics_from_lens(
        (width, height), (fx, fy, cx, cy), model, (*distortion, *(0.0,) * 5)[:5], fields.where
    )


def _parse_camera_text(fields: Fields) -> Intrinsics:
    properties = dict(_pairs(fields))
    try:
        size = int(properties["width"]), int(properties["height"])
        lens = tuple(float(properties[key]) for key in ("fx", "fy", "ppx", "ppy"))
        distortion = tuple(float(word) for word in properties["coeffs"].split(","))
        return intrinsics_from_lens(
            size, lens, properties["model"], (*distortion, *(0.0,) * 5)[:5], fields.where
        )
    except (KeyError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise fields.make_damage_error() from None


def _depth_step_mm(fields: Fields) -> float:
    """Returns the millimetres of one depth step."""
    try:
        metres = float(fields.text() if isinstance(fields, AlignedFields) else fields.number("f"))
    except ValueError:
        raise fields.make_damage_error() from None
    return check_step(1e3 * metres, fields.where)


def _pairs(fields: Fields) -> Iterator[tuple[str, str]]:
    """Reads key-value pairs: one pair per message in a .bag, ``key=value;`` in a .db3."""
    if not isinstance(fields, AlignedFields):
        yield fields.text(), fields.text()
        return
    for word in fields.text().split(";"):
        key, separator, value = word.partition("=")
        if separator:
            yield key.strip(), value


def _choose_stream(contents: _BagContents, device: str | None, path: Path) -> str:
    """Returns the stream of the chosen camera."""
    if not contents.cameras:
        remedy = "Record again, with the stereo module turned on in the RealSense Viewer."
        raise InputError(
            "the recording contains no depth images of a RealSense camera", where=str(path), remedy=remedy
        )
    streams = sorted(contents.cameras)
    serials = {stream: contents.serials.get("/" + stream.split("/")[1], "") for stream in streams}
    matching = [stream for stream in streams if serials[stream] == device]
    if len(streams) > 1 and not matching:
        remedy = f"Choose one camera: --device {' or '.join(filter(None, serials.values()))}"
        raise InputError(
            f"the recording contains {len(streams)} depth cameras", where=str(path), remedy=remedy
        )
    return (matching or streams)[0]
