"""Reads a complete or truncated recording. Frames are ordered by time."""

from __future__ import annotations

import contextlib
import heapq
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from mcap.records import Message

from enliven.errors import InputError
from enliven.files import open_file
from enliven.frames import BodyFrame, Frame
from enliven.recording.chunks import ChunkRef, Damage, read_chunk
from enliven.recording.container import Container, check_version, open_container
from enliven.recording.messages import unpack_bodies, unpack_depth
from enliven.recording.schemas import BODIES_TOPIC, DEPTH_TOPIC, PROFILE, TRUTH_TOPIC

_MAX_WAITING_BYTES = 1 << 29
"""Maximum size in bytes of buffered messages in the sort by time. In enliven's recordings, two chunks of 1
MiB may overlap.
"""


class RecordingWarning(UserWarning):
    """Warns that a recording could be read only partly."""


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a recording: its schema, the encoding of its messages and their number."""

    name: str
    schema: str
    message_encoding: str
    count: int


@dataclass(frozen=True)
class RecordingInfo:
    """The content of a recording.

    Attributes:
        sensors: the identities of the sensors, sorted.
        topics: the topics by name.
        start_ns, end_ns: times of the first and the last message, nanoseconds of the sensor's clock.
        metadata: the metadata records by name. Each contains texts by key.
        complete: False if the file was not closed properly, for example because the recording program was
            killed.
    """

    sensors: tuple[str, ...]
    topics: dict[str, TopicInfo]
    start_ns: int
    end_ns: int
    metadata: dict[str, dict[str, str]]
    complete: bool

    @property
    def duration(self) -> float:
        """Seconds from the first message to the last."""
        return (self.end_ns - self.start_ns) * 1e-9


class Recording:
    """An MCAP file that a :class:`~enliven.recording.recorder.Recorder` wrote.

    From a truncated file, every message of its complete chunks can be read, and opening it issues one
    :class:`RecordingWarning`. Damaged chunks are skipped, and the first one issues one
    :class:`RecordingWarning`. ``problems`` lists all reported problems.

    Raises:
        InputError: if the file is missing, empty, of a later version, or not a recording of enliven.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.problems: list[str] = []
        self._container = open_container(self.path)
        _check_profile(self._container)
        check_version(self._container)
        self.info = _recording_info(self._container)
        self._report_cut()

    def frames(self, file: BinaryIO | None = None) -> Iterator[Frame]:
        """Yields depth frames and sensor-tracked bodies ordered by time. ``file`` is the opened recording, or
        None to open it.

        If a message is not a frame, ``next`` raises InputError. The following ``next`` continues with the
        message after it.
        """
        return map(
            lambda said: frame_from_message(said[0], said[2]),
            self.messages_in_order({DEPTH_TOPIC, BODIES_TOPIC}, file),
        )

    def truth(self) -> Iterator[BodyFrame]:
        """Yields the true bodies of a synthetic recording, ordered by time."""
        for _, _, data in self.messages_in_order({TRUTH_TOPIC}):
            yield unpack_bodies(data)

    def messages(self, topic: str) -> Iterator[tuple[int, bytes]]:
        """Yields the time in nanoseconds and the bytes of every message of a topic, ordered by time."""
        for _, time_ns, data in self.messages_in_order({topic}):
            yield time_ns, data

    def messages_in_order(
        self, topics: set[str], file: BinaryIO | None = None
    ) -> Iterator[tuple[str, int, bytes]]:
        """Yields topic, time in nanoseconds and bytes of all messages of some topics, ordered by time, then
        by file position.

        ``file`` is the opened recording, or None to open it.
        """
        for topic, message in self._read_messages(topics, file):
            yield topic, message.log_time, message.data

    def _read_messages(self, topics: set[str], file: BinaryIO | None = None) -> Iterator[tuple[str, Any]]:
        """Yields (topic, message) ordered by time.

        Chunks may overlap. Messages of equal time keep their order in the file.
        """
        names = {i: c.topic for i, c in self._container.channels.items() if c.topic in topics}
        chunks = sorted(self._container.chunks, key=lambda ref: (ref.start_ns, ref.offset))
        waiting: list[tuple[int, int, Any]] = []
        count = buffered = 0
        with open_file(self.path) if file is None else contextlib.nullcontext(file) as opened:
            for ref in chunks:
                while waiting and waiting[0][0] < ref.start_ns:
                    message = heapq.heappop(waiting)[2]
                    buffered -= len(message.data)
                    yield names[message.channel_id], message
                for record in self._chunk_records(opened, ref):
                    if isinstance(record, Message) and record.channel_id in names:
                        heapq.heappush(waiting, (record.log_time, count, record))
                        count, buffered = count + 1, buffered + len(record.data)
                if buffered > _MAX_WAITING_BYTES:
                    problem = f"{buffered} bytes of messages in the recording are out of order"
                    raise InputError(problem, where=str(self.path), remedy="Record again.")
        while waiting:
            message = heapq.heappop(waiting)[2]
            yield names[message.channel_id], message

    def _chunk_records(self, file: Any, ref: ChunkRef) -> list[Any]:
        try:
            return read_chunk(file, ref)
        except Damage as error:
            self._report_damage(f"{self.path}: a damaged part at byte {ref.offset} is skipped ({error}).")
            return []

    def _report_cut(self) -> None:
        if self._container.damaged_chunks:
            self.problems.append(f"{self._container.damaged_chunks} damaged parts are skipped.")
        if not self._container.complete:
            count = sum(self._container.counts.values())
            skipped_text = "".join(" " + problem for problem in self.problems)
            self._report_problem(
                f"{self.path}: the recording was cut off or is damaged at byte {self._container.cut_at}; "
                f"the {count} complete messages before this position are read.{skipped_text}"
            )

    def _report_damage(self, problem: str) -> None:
        if problem in self.problems:
            return
        if any("damaged part" in earlier_problem for earlier_problem in self.problems):
            self.problems.append(problem)
        else:
            self._report_problem(problem)

    def _report_problem(self, problem: str) -> None:
        self.problems.append(problem)
        warnings.warn(problem, RecordingWarning, stacklevel=4)


def frame_from_message(topic: str, data: bytes) -> Frame:
    """Returns the frame of a message.

    Raises:
        InputError: if it is not a frame.
    """
    return unpack_depth(data) if topic == DEPTH_TOPIC else unpack_bodies(data)


def _check_profile(container: Container) -> None:
    if container.profile == PROFILE or (not container.complete and not container.profile):
        return
    raise InputError(
        f"the file is an MCAP file of another program (profile {container.profile!r}, {container.library!r})",
        where=str(container.path),
        remedy="Only recordings of enliven can be read. `enliven import` imports depth as 16-bit PNG images.",
    )


def _recording_info(container: Container) -> RecordingInfo:
    topics: dict[str, TopicInfo] = {}
    for number, channel in sorted(container.channels.items()):
        schema = container.schemas.get(channel.schema_id)
        earlier_info = topics.get(channel.topic)
        count = container.counts[number] + (earlier_info.count if earlier_info else 0)
        topics[channel.topic] = TopicInfo(
            channel.topic, schema.name if schema else "", channel.message_encoding, count
        )
    sensors = {c.metadata["sensor"] for c in container.channels.values() if "sensor" in c.metadata}
    return RecordingInfo(
        tuple(sorted(sensors)),
        topics,
        min((ref.start_ns for ref in container.chunks), default=0),
        max((ref.end_ns for ref in container.chunks), default=0),
        container.metadata,
        container.complete,
    )
