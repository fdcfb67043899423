"""Rokoko as a sensor: the actors of Rokoko Studio's live stream (JSON v3) become bodies."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable

import msgspec
import numpy as np

from enliven.arrays import Float
from enliven.doctor import need
from enliven.errors import InputError
from enliven.files import DECODE_ERRORS
from enliven.person import (
    ROKOKO_BONES,
    ROKOKO_JOINTS,
    ROKOKO_PORT,
    Body,
    HumanPose,
    body_from_human_pose,
    placements_from_rokoko,
    rotations_from_rokoko,
)
from enliven.rotation import normalized
from enliven.supervision.closeable import Closeable
from enliven_edge.sensors.streams.stream_sensor import MAX_METRES, StreamSensor
from enliven_edge.sensors.streams.udp_port import MAX_PACKET_BYTES, listen_udp

LZ4_START = b"\x04\x22\x4d\x18"
"""The first bytes of an LZ4 frame."""
_MAX_JSON_BYTES = 1 << 20
"""Maximum bytes of a decompressed packet. Five actors with faces and fingers have 0.1 MB."""
_MAX_ACTORS = 8
"""Maximum number of actors. Rokoko Studio sends up to five."""
_MAX_NAMES = 64
"""Maximum number of actors with a remembered id."""
_TOE_END = ROKOKO_JOINTS.index("leftToeEnd"), ROKOKO_JOINTS.index("rightToeEnd")
"""Indices of joints that are only the end of a bone, not the start of another one."""
_NUMBERS = {name: k for k, name in enumerate(ROKOKO_JOINTS) if k not in _TOE_END}
"""The index in the stream of each joint at which a bone starts."""


class _Vector(msgspec.Struct):
    x: float
    y: float
    z: float


class _Quaternion(msgspec.Struct):
    x: float
    y: float
    z: float
    w: float


class _Placement(msgspec.Struct):
    position: _Vector
    rotation: _Quaternion


class _Actor(msgspec.Struct):
    name: str
    body: dict[str, _Placement] | None = None


class _Scene(msgspec.Struct):
    actors: list[_Actor]


class _Packet(msgspec.Struct):
    scene: _Scene
    version: str | int | float = ""


class _Head(msgspec.Struct):
    version: str | int | float
    trackers: msgspec.Raw = msgspec.Raw()


_READ_PACKET = msgspec.json.Decoder(_Packet)
_READ_HEAD = msgspec.json.Decoder(_Head)


class RokokoSensor(StreamSensor[list[HumanPose]]):
    """Delivers the actors that Rokoko Studio streams. Their motion comes from its suits or from videos.

    Args:
        port: UDP port to listen on. Rokoko Studio sends to 14043 by default.
        host: address to listen on. "0.0.0.0" also accepts other machines.

    Raises:
        InputError: for a wrong port.
        ResourceError: for a port in use, or if lz4 is missing.
    """

    def __init__(self, port: int = ROKOKO_PORT, host: str = "127.0.0.1") -> None:
        need("lz4", "outputs", "rokoko")
        super().__init__("rokoko", "actors", _RokokoPort(host, port))
        self._humans: list[HumanPose] = []
        self._ids: dict[str, int] = {}

    def _store_motion(self, data: list[HumanPose]) -> bool:
        self._humans = data
        return True

    def _bodies(self) -> list[Body]:
        bodies = []
        for human in self._humans:
            if human.name not in self._ids and len(self._ids) >= _MAX_NAMES:
                self._ids.pop(next(iter(self._ids)))
            number = self._ids.setdefault(human.name, max(self._ids.values(), default=0) + 1)
            bodies.append(body_from_human_pose(human, number))
        return bodies


class _RokokoPort(Closeable):
    """Receives packets of Rokoko Studio. Each packet is a whole frame.

    Attributes:
        malformed: number of packets that could not be read.

    Raises:
        InputError: for a number that is not a port.
        ResourceError: for a port in use, or an address that does not belong to this machine.
    """

    def __init__(self, host: str, port: int) -> None:
        self.malformed = 0
        self._socket = listen_udp(host, port, "sensor rokoko")
        self.port: int = self._socket.getsockname()[1]

    def frame(self, timeout: float | None) -> list[HumanPose]:
        """Returns the human figures of the newest packet.

        Raises:
            TimeoutError: if no readable packet arrived in time.
            InputError: if the packet has another version of the format.
        """
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            left = None if end is None else end - time.monotonic()
            if left is not None and left <= 0.0:
                raise TimeoutError
            self._socket.settimeout(left)
            data = self._newest(self._socket.recv(MAX_PACKET_BYTES))
            try:
                return unpack_rokoko(data)
            except InputError as error:
                self.malformed += 1
                if isinstance(error, RokokoVersionError):
                    raise

    def close(self) -> None:
        self._socket.close()

    def _newest(self, data: bytes) -> bytes:
        """Returns the last of the queued packets. Older ones would only add delay."""
        self._socket.setblocking(False)
        try:
            while True:
                data = self._socket.recv(MAX_PACKET_BYTES)
        except BlockingIOError:
            return data


class RokokoVersionError(InputError):
    """A packet of Rokoko Studio has another version of the format."""


def unpack_rokoko(data: bytes) -> list[HumanPose]:
    """Returns the actors of a packet, JSON or JSON in an LZ4 frame.

    Actors without a hip and joints with invalid numbers are dropped.

    Raises:
        RokokoVersionError: for JSON v1, v2 or v2.5.
        InputError: for a packet that cannot be read.
    """
    text = _decompress(data) if data.startswith(LZ4_START) else data
    try:
        _check_version(_READ_HEAD.decode(text))
        packet = _READ_PACKET.decode(text)
    except DECODE_ERRORS as error:
        raise InputError(f"the packet cannot be read ({error})", where="a Rokoko port") from None
    humans, names = list[HumanPose](), set[str]()
    for actor in packet.scene.actors[:_MAX_ACTORS]:
        name = actor.name[:64]
        while name in names:
            name += "'"
        names.add(name)
        human = _figure_from_actor(name, (actor.body or {}).items())
        if human is not None:
            humans.append(human)
    return humans


def _decompress(data: bytes) -> bytes:
    """Returns the content of an LZ4 frame, up to a maximum size.

    Raises:
        InputError: for a damaged frame, or a content that is too large.
    """
    import lz4.frame

    reader = lz4.frame.LZ4FrameDecompressor()
    try:
        text = bytes(reader.decompress(data, max_length=_MAX_JSON_BYTES))
    except (RuntimeError, EOFError, ValueError, MemoryError) as error:
        raise InputError(f"the LZ4 frame cannot be read ({error})", where="a Rokoko port") from None
    if not reader.eof:
        raise InputError("the LZ4 frame is cut off or too large", where="a Rokoko port")
    return text


def _check_version(head: _Head) -> None:
    """Raises RokokoVersionError for another version than 3. JSON v2.5 also states version 3, but contains
    trackers.
    """
    version = str(head.version).replace(".", ",").partition(",")[0]
    if version != "3" or bytes(head.trackers):
        remedy = "In Rokoko Studio, choose the data format JSON v3 for this receiver."
        shown = "2.5" if version == "3" else str(head.version)[:20]
        raise RokokoVersionError(
            f"a packet contains JSON of version {shown}, which is not supported",
            where="sensor rokoko",
            remedy=remedy,
        )


def _figure_from_actor(name: str, joints: Iterable[tuple[str, _Placement]]) -> HumanPose | None:
    """Returns the figure of the known joints with valid numbers, or None without a hip."""
    rows = {}
    for joint, placement in joints:
        number = _NUMBERS.get(joint)
        if number is not None and (values := _read_joint(placement)) is not None:
            rows[ROKOKO_BONES[number]] = number, values
    if "Hips" not in rows:
        return None
    bones = tuple(HumanPose.sort_bones(rows))
    numbers = np.array([rows[bone][0] for bone in bones])
    positions, turns = placements_from_rokoko(np.stack([rows[bone][1] for bone in bones]))
    return HumanPose(name, bones, positions, rotations_from_rokoko(normalized(turns), numbers))


def _read_joint(placement: _Placement) -> Float | None:
    """Returns the numbers (7,) of a joint, or None if they are not a position and a rotation."""
    position, turn = placement.position, placement.rotation
    values = (position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w)
    if not all(map(math.isfinite, values)):
        return None
    if max(map(abs, values[:3])) > MAX_METRES or not 0.5 < math.hypot(*values[3:]) < 2.0:
        return None
    return np.array(values)
