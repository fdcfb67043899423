"""Writes a recording. If the program is killed, the recording stays readable up to that moment."""

from __future__ import annotations

import math
import time
from contextlib import nullcontext
from pathlib import Path
from types import TracebackType
from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Schema
from mcap.writer import Writer

from enliven import __version__
from enliven.errors import EnlivenError, InputError
from enliven.files import file_fault, replace_file
from enliven.frames import BodyFrame, DepthFrame, Frame
from enliven.recording import schemas
from enliven.recording.messages import pack_bodies, pack_depth
from enliven.recording.schemas import MessageKind
from enliven.recording.whole_file import WholeFile

_CHUNK_BYTES = 1 << 20
"""Maximum size in bytes of a chunk before compression. Larger chunks do not compress better."""
_FIRST_CHUNK_BYTES = 1 << 12
"""Size of a live recording's first chunk, in bytes. Each full chunk doubles the size of the next. So a
recording that ends early, for example because the disk is full, does not lose its only chunk."""
LATEST_NS = (1 << 63) - 1
"""The latest time of a message in nanoseconds. Times are signed 64-bit numbers everywhere except in MCAP."""


class Recorder:
    """Writes frames and messages into an MCAP file. Use it in a ``with`` statement.

    The current chunk is closed and passed to the operating system with the first message after
    ``sync_seconds``. So if the program is killed, at most the messages of this time are lost. If there may be
    long pauses between messages, call :meth:`sync` regularly. The first chunks are small, and schemas and
    channels are written twice, so that damage to a chunk affects only its own messages. With
    ``sync_seconds=math.inf`` the bytes of the file depend only on the messages, and all chunks are large.

    After a failed write, for example because the disk is full, all earlier messages stay readable. The file
    ends after its last complete record, and every further write raises the same error.

    Args:
        path: the file to create.
        compression_level: level of ``encode_depth``: 1 for live recording, 19 for archives.
        sync_seconds: wall time between two syncs to the operating system.
        overwrite: True replaces an existing file as soon as the beginning of the new file is written. If that
            fails, the existing file stays unchanged.

    Raises:
        InputError: if the file already exists.
        ResourceError: if it cannot be created or written.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        compression_level: int = 1,
        sync_seconds: float = 0.5,
        overwrite: bool = False,
    ) -> None:
        self.path = Path(path)
        self._level = compression_level
        self._sync_seconds = sync_seconds
        replaces = overwrite and self.path.is_file() and self.path.stat().st_size > 0
        with replace_file(self.path) if replaces else nullcontext(self.path) as begun:
            self._begin_file(begun, overwrite)
        if replaces:
            self._file.move(self.path)

    def _begin_file(self, begun: Path, overwrite: bool) -> None:
        """Opens the file and writes its beginning.

        Args:
            begun: the path of the file, or of a temporary file that will replace it.
        """
        self._file = _create_file(begun, overwrite)
        self._writer = Writer(self._file, chunk_size=_CHUNK_BYTES)  # type: ignore[arg-type]
        self._schemas: dict[tuple[str, str, str], int] = {}
        self._channels: dict[tuple[str, str, str], int] = {}
        self._live = math.isfinite(self._sync_seconds)
        self._room = _FIRST_CHUNK_BYTES if self._live else _CHUNK_BYTES
        self._filled = 0
        self._unrepeated: list[Schema | Channel] = []
        self._failure: EnlivenError | None = None
        self._synced = time.monotonic()
        self._run_step(self._writer.start, schemas.PROFILE, f"enliven {__version__}")
        self._run_step(self._writer.add_metadata, schemas.ABOUT_NAME, schemas.ABOUT)
        self.sync()

    def write_frame(self, frame: Frame) -> None:
        """Appends a depth frame (topic ``/depth``) or the bodies that a sensor tracked (``/bodies``)."""
        self._check_time(frame.time_ns, "frames")
        if isinstance(frame, DepthFrame):
            data = pack_depth(frame, self._level)
            self._write_message(schemas.DEPTH_TOPIC, schemas.DEPTH, frame.sensor, data, frame.time_ns)
        else:
            self._write_message(
                schemas.BODIES_TOPIC, schemas.BODIES, frame.sensor, pack_bodies(frame), frame.time_ns
            )

    def write_truth(self, frame: BodyFrame) -> None:
        """Appends the true bodies of a moment (topic ``/truth/bodies``)."""
        self._write_message(
            schemas.TRUTH_TOPIC, schemas.BODIES, frame.sensor, pack_bodies(frame), frame.time_ns
        )

    def write(
        self,
        topic: str,
        schema_name: str,
        schema_text: str,
        schema_encoding: str,
        message_encoding: str,
        data: bytes,
        time_ns: int,
        sensor: str = "",
    ) -> None:
        """Appends a message of any kind. Schema and channel are written when they first occur.

        Raises:
            InputError: if the time is before 0 or after :data:`LATEST_NS`.
            ResourceError: if it cannot be written.
        """
        kind = MessageKind(schema_name, schema_encoding, schema_text, message_encoding)
        self._write_message(topic, kind, sensor, data, time_ns)

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Adds a metadata record with texts for users, such as performer, place, command line or
        calibration."""
        self._run_step(self._writer.add_metadata, name, values)

    def fileno(self) -> int:
        """Returns the file's descriptor for :func:`os.fsync`, or -1 once the file is closed."""
        return -1 if self._file.closed else self._file.fileno()

    def sync(self) -> None:
        """Closes the current chunk, and passes all data to the operating system."""
        self._run_step(self._writer.flush)
        self._repeat_descriptions()
        self._filled = 0
        self._synced = time.monotonic()

    def close(self) -> None:
        """Writes the index and closes the file. Does nothing after a failed write, or at a second call."""
        if self._file.closed:
            return
        self._run_step(self._writer.finish)
        self._file.close()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _write_message(self, topic: str, kind: MessageKind, sensor: str, data: bytes, time_ns: int) -> None:
        self._check_time(time_ns, f"topic {topic}")
        channel = self._channel_id(topic, kind, sensor)
        self._run_step(self._writer.add_message, channel, time_ns, data, time_ns)
        self._filled += len(data)
        is_full = self._live and self._filled >= self._room
        if is_full:
            self._room = min(2 * self._room, _CHUNK_BYTES)
        if is_full or time.monotonic() - self._synced >= self._sync_seconds:
            self.sync()

    def _check_time(self, time_ns: int, what: str) -> None:
        """Raises InputError if a time is outside the range of MCAP or of enliven."""
        if not 0 <= time_ns <= LATEST_NS:
            raise InputError(
                f"the time {time_ns} ns is outside the range from 0 to 2^63 ns",
                where=f"{self.path}, {what}",
                remedy="Check the clock of the sensor.",
            )

    def _run_step(self, step: Any, *arguments: Any) -> None:
        """Runs a step of the writer. An OSError ends the recording."""
        if self._failure is not None:
            raise self._failure
        try:
            step(*arguments)
        except OSError as error:
            self._failure = file_fault(error, self.path, "written")
            self._file.close()
            raise self._failure from None

    def _repeat_descriptions(self) -> None:
        """Writes new schemas and channels a second time, outside of the chunk that contains them."""
        if self._unrepeated:
            builder = RecordBuilder()
            for record in self._unrepeated:
                record.write(builder)
            self._unrepeated = []
            self._run_step(self._file.write, builder.end())

    def _channel_id(self, topic: str, kind: MessageKind, sensor: str) -> int:
        """Returns the id of the channel of a topic, kind and sensor.

        The channel is registered at its first message.
        """
        key = (topic, kind.schema_name, sensor)
        if key not in self._channels:
            schema = (kind.schema_name, kind.schema_encoding, kind.schema_text)
            if schema not in self._schemas:
                name, encoding, text = schema[0], schema[1], schema[2].encode()
                number = self._schemas[schema] = self._writer.register_schema(name, encoding, text)
                self._store_description(Schema(id=number, name=name, encoding=encoding, data=text))
            of, metadata = self._schemas[schema], {"sensor": sensor} if sensor else {}
            number = self._channels[key] = self._writer.register_channel(
                topic, kind.message_encoding, of, metadata
            )
            self._store_description(Channel(number, topic, kind.message_encoding, metadata, of))
        return self._channels[key]

    def _store_description(self, record: Schema | Channel) -> None:
        """Queues a schema or channel to be written a second time. Does nothing for archives, which are always
        complete."""
        if self._live:
            self._unrepeated.append(record)


def _create_file(path: Path, overwrite: bool) -> WholeFile:
    try:
        return WholeFile(path, "wb" if overwrite else "xb")
    except FileExistsError:
        raise InputError(
            "the file exists already",
            where=str(path),
            remedy="Choose another name, or replace the file with --overwrite.",
        ) from None
    except FileNotFoundError:
        raise InputError(
            "the folder of the file does not exist",
            where=str(path),
            remedy=f"Create the folder {path.parent}.",
        ) from None
    except OSError as error:
        raise file_fault(error, path, "written") from None
