"""Reads recordings of librealsense: a .bag until 2.56, a .db3 since."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from enliven.camera import Intrinsics
from enliven.errors import InputError
from enliven.frames import DepthFrame
from enliven_edge.importing.bags.images import (
    checked_step,
    checked_time,
    in_millimetres,
    packed_image,
    plain_image,
    plain_lens,
)
from enliven_edge.importing.bags.ros1 import AlignedFields, Fields, Message

TOPIC = re.compile(r"/device_\d+/")
_STREAM = re.compile(r"(/device_\d+)(/sensor_\d+)/Depth_\d+")
_SMALL = re.compile(
    r"/device_\d+(/info|/sensor_\d+/(option/Depth[_ ]Units/value|Depth_\d+(/info)?/camera_info))"
)
_USUAL_STEP = 1.0
"""Depth step if none was recorded, in millimetres: that of the D400 family."""
Read = Callable[[Path, Callable[[str], bool]], Iterator[Message]]


@dataclass
class _BagContents:
    """The descriptions of a recording's cameras, by the prefixes of their topics."""

    cameras: dict[str, Intrinsics] = field(default_factory=dict)
    steps: dict[str, float] = field(default_factory=dict)
    serials: dict[str, str] = field(default_factory=dict)


def frames(path: Path, read: Read, device: str | None) -> Iterator[DepthFrame]:
    """Yields the depth images of one camera of a recording.

    Args:
        read: returns the messages of the file.
        device: its serial number, or the name to give the sensor. None for the only camera.

    Raises:
        InputError: if there is none, or several and none is chosen.
    """
    about = _about(path, read)
    stream = _chosen(about, device, path)
    match = _STREAM.match(stream)
    assert match is not None
    of, sensor = match[1], match[1] + match[2]
    camera, step = about.cameras[stream], about.steps.get(sensor, _USUAL_STEP)
    serial = about.serials.get(of, "")
    name = device if device and device != serial else "-".join(word for word in ("realsense", serial) if word)
    waits: DepthFrame | None = None
    for topic, fields in read(path, lambda topic: topic.startswith(f"{stream}/image/")):
        if topic.endswith(("/data", "/compressedDepth")):
            if waits is not None:
                yield waits
            waits = _frame(topic, fields, camera, step, name)
        elif topic.endswith("/metadata") and isinstance(fields, AlignedFields) and waits is not None:
            yield _numbered(waits, dict(_pairs(fields)))
            waits = None
    if waits is not None:
        yield waits


def _frame(topic: str, fields: Fields, camera: Intrinsics, step: float, name: str) -> DepthFrame:
    """Reads an image of a recording. Its number precedes it in a .bag, and follows it in a .db3."""
    number = None if isinstance(fields, AlignedFields) else fields.count()
    seconds, rest = fields.numbers("II")
    fields.text()
    depth = packed_image(fields) if topic.endswith("/compressedDepth") else plain_image(fields)
    time_ns = int(seconds) * 1_000_000_000 + int(rest)
    return DepthFrame(in_millimetres(depth, step), camera, time_ns, name, sequence=number)


def _numbered(frame: DepthFrame, said: dict[str, str]) -> DepthFrame:
    """Returns an image of a .db3 with the number and the camera's own time that follow it."""
    try:
        time_ns = checked_time(round(1e6 * float(said["timestamp"])), frame.sensor)
        return replace(frame, sequence=int(said["Frame number"]), time_ns=time_ns)
    except (KeyError, ValueError, OverflowError):
        return frame


def _about(path: Path, read: Read) -> _BagContents:
    about = _BagContents()
    for topic, fields in read(path, _is_small):
        if topic.endswith("camera_info"):
            stream = _STREAM.match(topic)
            if stream:
                about.cameras[stream[0]] = _camera(fields)
        elif topic.endswith("/value"):
            about.steps[topic.partition("/option/")[0]] = _step(fields)
        else:
            for key, value in _pairs(fields):
                if key == "Serial Number":
                    about.serials[topic.removesuffix("/info")] = value
    return about


def _is_small(topic: str) -> bool:
    """Returns True if a topic describes a camera.

    A .db3 also repeats its intrinsics as text with each image.
    """
    return _SMALL.fullmatch(topic) is not None


def _camera(fields: Fields) -> Intrinsics:
    """Reads intrinsics: ``sensor_msgs/CameraInfo`` in a .bag, text in a .db3."""
    if isinstance(fields, AlignedFields):
        return _camera_in_words(fields)
    fields.numbers("III")
    fields.text()
    height, width, model = fields.count(), fields.count(), fields.text()
    bent = fields.numbers("d" * min(fields.count(), 16))
    fx, _, cx, _, fy, cy, *_ = fields.numbers("9d")
    return plain_lens((width, height), (fx, fy, cx, cy), model, (*bent, *(0.0,) * 5)[:5], fields.where)


def _camera_in_words(fields: Fields) -> Intrinsics:
    properties = dict(_pairs(fields))
    try:
        size = int(properties["width"]), int(properties["height"])
        lens = tuple(float(properties[key]) for key in ("fx", "fy", "ppx", "ppy"))
        bent = tuple(float(word) for word in properties["coeffs"].split(","))
        return plain_lens(size, lens, properties["model"], (*bent, *(0.0,) * 5)[:5], fields.where)
    except (KeyError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise fields.damaged() from None


def _step(fields: Fields) -> float:
    """Returns the millimetres of one depth step."""
    try:
        metres = float(fields.text() if isinstance(fields, AlignedFields) else fields.number("f"))
    except ValueError:
        raise fields.damaged() from None
    return checked_step(1e3 * metres, fields.where)


def _pairs(fields: Fields) -> Iterator[tuple[str, str]]:
    """Reads keys and values: one pair in a .bag, ``key=value;`` in a .db3."""
    if not isinstance(fields, AlignedFields):
        yield fields.text(), fields.text()
        return
    for word in fields.text().split(";"):
        key, equals, value = word.partition("=")
        if equals:
            yield key.strip(), value


def _chosen(about: _BagContents, device: str | None, path: Path) -> str:
    """Returns the stream of the chosen camera."""
    if not about.cameras:
        mend = "Record depth: in the RealSense Viewer the stereo module must be on."
        raise InputError("it holds no depth of a RealSense camera", where=str(path), mend=mend)
    streams = sorted(about.cameras)
    serials = {stream: about.serials.get("/" + stream.split("/")[1], "") for stream in streams}
    meant = [stream for stream in streams if serials[stream] == device]
    if len(streams) > 1 and not meant:
        mend = f"Choose one: --device {' or '.join(filter(None, serials.values()))}"
        raise InputError(f"it holds {len(streams)} depth cameras", where=str(path), mend=mend)
    return (meant or streams)[0]
