"""Writing a recording that can be read up to the moment the program was killed."""

from __future__ import annotations

import time
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from mcap.writer import Writer

from enliven import __version__
from enliven.errors import InputError, ResourceError
from enliven.frames import BodyFrame, DepthFrame, Frame
from enliven.recording import schemas
from enliven.recording.messages import pack_bodies, pack_depth
from enliven.recording.schemas import MessageKind

_CHUNK_BYTES = 1 << 20


class Recorder:
    """Writes frames and messages into an MCAP file, for use in a ``with`` statement.

    The chunk in progress is closed and handed to the operating system with the first message that comes
    ``sync_seconds`` after the last time, so that a killed program loses no more. Where messages may stop
    for long, call :meth:`sync` now and then. With ``sync_seconds=math.inf`` the bytes of the file depend
    on the messages alone.

    Args:
        path: the file to make.
        compression_level: that of :func:`enliven.depth_codec.encode_depth`; 1 live, 19 for archives.
        sync_seconds: wall time between two hand-overs to the operating system.
        overwrite: replace an existing file.

    Raises:
        InputError: where the file exists already.
        ResourceError: where it cannot be made or written.
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
        self._file = _created(self.path, overwrite)
        self._writer = Writer(self._file, chunk_size=_CHUNK_BYTES)
        self._schemas: dict[tuple[str, str, str], int] = {}
        self._channels: dict[tuple[str, str, str], int] = {}
        self._synced = time.monotonic()
        self._writer.start(schemas.PROFILE, f"enliven {__version__}")
        self._writer.add_metadata("about", schemas.ABOUT)
        self.sync()

    def write_frame(self, frame: Frame) -> None:
        """Append a depth frame (topic ``/depth``) or the bodies that a sensor tracked (``/bodies``)."""
        if isinstance(frame, DepthFrame):
            data = pack_depth(frame, self._level)
            self._write(schemas.DEPTH_TOPIC, schemas.DEPTH, frame.sensor, data, frame.time_ns)
        else:
            self._write(schemas.BODIES_TOPIC, schemas.BODIES, frame.sensor, pack_bodies(frame), frame.time_ns)

    def write_truth(self, frame: BodyFrame) -> None:
        """Append the true bodies of a moment (topic ``/truth/bodies``)."""
        self._write(schemas.TRUTH_TOPIC, schemas.BODIES, frame.sensor, pack_bodies(frame), frame.time_ns)

    def write(
        self,
        topic: str,
        schema_name: str,
        schema_text: str,
        schema_encoding: str,
        message_encoding: str,
        data: bytes,
        time_ns: int,
    ) -> None:
        """Append a message of any kind; schema and channel are written when they first occur."""
        kind = MessageKind(schema_name, schema_encoding, schema_text, message_encoding)
        self._write(topic, kind, "", data, time_ns)

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """A named record of words for humans: performer, place, command line, calibration."""
        self._writer.add_metadata(name, values)

    def sync(self) -> None:
        """Hand everything written so far to the operating system, as whole chunks."""
        try:
            self._writer.flush()
        except OSError as error:
            raise _unwritable(self.path, error) from None
        self._synced = time.monotonic()

    def close(self) -> None:
        """Write the index and close the file; a second call does nothing."""
        if self._file.closed:
            return
        try:
            self._writer.finish()
            self._file.close()
        except OSError as error:
            raise _unwritable(self.path, error) from None

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _write(self, topic: str, kind: MessageKind, sensor: str, data: bytes, time_ns: int) -> None:
        if not 0 <= time_ns < 1 << 63:
            raise InputError(f"the time {time_ns} ns is outside 0..2^63", where=f"{self.path}, topic {topic}")
        channel = self._channel(topic, kind, sensor)
        try:
            self._writer.add_message(channel, log_time=time_ns, data=data, publish_time=time_ns)
        except OSError as error:
            raise _unwritable(self.path, error) from None
        if time.monotonic() - self._synced >= self._sync_seconds:
            self.sync()

    def _channel(self, topic: str, kind: MessageKind, sensor: str) -> int:
        """The id of the channel of a topic, kind and sensor, registered at its first message."""
        key = (topic, kind.schema_name, sensor)
        if key not in self._channels:
            schema = (kind.schema_name, kind.schema_encoding, kind.schema_text)
            if schema not in self._schemas:
                self._schemas[schema] = self._writer.register_schema(*schema[:2], schema[2].encode())
            self._channels[key] = self._writer.register_channel(
                topic, kind.message_encoding, self._schemas[schema], {"sensor": sensor} if sensor else {}
            )
        return self._channels[key]


def _created(path: Path, overwrite: bool) -> BinaryIO:
    try:
        return path.open("wb" if overwrite else "xb")
    except FileExistsError:
        raise InputError(
            "the file exists already",
            where=str(path),
            mend="Choose another name, or allow it to be overwritten.",
        ) from None
    except FileNotFoundError:
        raise InputError(
            "its folder does not exist", where=str(path), mend=f"Make the folder {path.parent}."
        ) from None
    except OSError as error:
        raise _unwritable(path, error) from None


def _unwritable(path: Path, error: OSError) -> ResourceError:
    return ResourceError(
        f"it cannot be written ({error.strerror or error})",
        where=str(path),
        mend="Check the space on the disk and the permissions of the folder.",
    )
