"""A recording in parts: after a full disk it continues in a new file as soon as there is room again."""

from __future__ import annotations

import logging
import re
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from enliven.errors import InputError, ResourceError
from enliven.frames import Frame
from enliven.recording import Recorder
from enliven_edge.closeable import Closeable
from enliven_edge.recording.disk_sync import DiskSync

log = logging.getLogger(__name__)

FIRST_RETRY_S = 5.0
"""Time from a failed write to the first retry, in seconds. By then, a file that the user has deleted has
freed its space."""
MAX_RETRY_S = 60.0
"""Maximum seconds between two retries. Each part that fills immediately doubles the wait up to this limit."""
MIN_FREE_BYTES = 1 << 17
"""Minimum free bytes on the disk before a new part is started: less would be full immediately."""
_MAX_NUMBER = 1_000_000
"""Maximum number that is tried for a free name: a service that restarts each minute needs two years for
them."""
_PLACEHOLDER = re.compile(r"\{([^{}]*)\}")
"""A placeholder in a file name."""


def free_path(pattern: Path) -> Path:
    """Returns the path to record to, with the placeholders in its file name filled in.

    ``{time}`` is the local time, as in 20261128-094500. ``{number}`` is the lowest number from 001 without an
    existing file. A name with ``{time}`` that exists gets ``-2``, ``-3`` ... at its end. A name without
    placeholders is returned unchanged.

    Raises:
        InputError: for another placeholder.
    """
    names = set(_PLACEHOLDER.findall(pattern.name))
    if not names <= {"time", "number"}:
        unknown = "{" + min(names - {"time", "number"}) + "}"
        mend = "Use {time} or {number}, as in take-{number}.mcap."
        raise InputError(f"its name has the unknown placeholder {unknown}", where=str(pattern), mend=mend)
    if not names:
        return pattern
    name = pattern.name.replace("{time}", time.strftime("%Y%m%d-%H%M%S"))
    for number in range(1, _MAX_NUMBER):
        if "number" in names:
            path = pattern.with_name(name.replace("{number}", f"{number:03}"))
        else:
            path = pattern.with_name(name)
            path = path if number == 1 else path.with_stem(f"{path.stem}-{number}")
        if not path.exists() and not path.is_symlink():
            return path
    raise InputError("every number is taken", where=str(pattern), mend="Move the recordings elsewhere.")


class PartedRecorder(Closeable):
    """A :class:`~enliven.recording.Recorder` that continues in a new part after writing has failed.

    A failed write never raises: ``failure`` contains the reason. When there is room again, the next write
    starts a new part, ``NAME-part2.mcap`` next to ``NAME.mcap``.

    Args:
        path: path of the first part, with placeholders as in :func:`free_path`.
        overwrite: True allows replacing an existing file.
        compression_level: that of ``encode_depth``.

    Attributes:
        paths: the parts, oldest first.
        failure: why nothing can be written now. None while writing works.
        lost: number of messages that were not written because of failures.
        on_part_started: called after each later part has started, to write the data that every part needs.

    Raises:
        InputError: if the file already exists, or its folder does not.
        ResourceError: if the first part cannot be created.
    """

    def __init__(self, path: Path, *, overwrite: bool = False, compression_level: int = 1) -> None:
        self._level = compression_level
        self._metadata: dict[str, dict[str, str]] = {}
        self._recorder: Recorder | None = Recorder(
            free_path(path), overwrite=overwrite, compression_level=compression_level
        )
        self._disk = DiskSync(self._recorder.fileno())
        self.paths = [self._recorder.path]
        self.failure: ResourceError | None = None
        self.lost = 0
        self.on_part_started: Callable[[], None] = lambda: None
        self._wait_s, self._retry_at, self._started_at = FIRST_RETRY_S, 0.0, time.monotonic()

    @property
    def path(self) -> Path:
        """The newest part."""
        return self.paths[-1]

    def write(self, *message: Any) -> None:
        """Appends a message, as :meth:`~enliven.recording.Recorder.write` does.

        Raises:
            InputError: for a time that a recording cannot hold.
        """
        self._run_step(lambda recorder: recorder.write(*message))

    def write_frame(self, frame: Frame) -> None:
        """Appends a frame, as :meth:`~enliven.recording.Recorder.write_frame` does.

        Raises:
            InputError: for a frame that a recording cannot hold.
        """
        self._run_step(lambda recorder: recorder.write_frame(frame))

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Adds a named record of texts to this part and to every later one."""
        self._metadata[name] = values
        self._run_step(lambda recorder: recorder.add_metadata(name, values))

    def sync(self) -> None:
        """Passes everything written to the operating system, as complete chunks."""
        if self._recorder is not None:
            self._run_step(lambda recorder: recorder.sync())

    def close(self) -> None:
        """Writes the index and closes the file. A second call does nothing."""
        recorder, self._recorder = self._recorder, None
        self._retry_at = float("inf")
        if recorder is None:
            return
        try:
            recorder.close()
        except ResourceError as error:
            log.warning("the recording lacks its index, and can be read (%s)", error)
        self._disk.close()

    def _run_step(self, step: Callable[[Recorder], None]) -> None:
        """Runs a step on the current part, or on a new one if a retry is due."""
        if self._recorder is None and time.monotonic() >= self._retry_at:
            self._start_part()
        if self._recorder is None:
            self.lost += 1
            return
        try:
            self._disk.check()
            step(self._recorder)
        except ResourceError as error:
            self.lost += 1
            self._handle_failure(error)

    def _handle_failure(self, error: ResourceError) -> None:
        """Closes the current part after a failed write, and schedules the next retry."""
        is_short = time.monotonic() - self._started_at < MAX_RETRY_S and len(self.paths) > 1
        self._wait_s = min(2 * self._wait_s, MAX_RETRY_S) if is_short else FIRST_RETRY_S
        until, self.failure = self._wait_s, error
        self.close()
        self._retry_at = time.monotonic() + until
        log.warning("%s It goes on in a new file when there is room.", error)

    def _start_part(self) -> None:
        """Starts the next part if the disk has room. Otherwise schedules another retry."""
        self._retry_at = time.monotonic() + self._wait_s
        first = self.paths[0]
        path = _next_part(first)
        try:
            if shutil.disk_usage(first.parent).free < MIN_FREE_BYTES:
                return
            recorder = Recorder(path, compression_level=self._level)
        except (OSError, ResourceError, InputError):
            return
        try:
            for name, values in self._metadata.items():
                recorder.add_metadata(name, values)
        except ResourceError:
            path.unlink(missing_ok=True)
            return
        self._recorder, self._disk = recorder, DiskSync(recorder.fileno())
        self._started_at = time.monotonic()
        self.paths.append(path)
        self.failure = None
        log.warning("%s: the recording goes on here; %d messages before are missing", path, self.lost)
        self.on_part_started()


def _next_part(first: Path) -> Path:
    """Returns the first free name of a later part of a recording."""
    number = 2
    while (path := first.with_stem(f"{first.stem}-part{number}")).exists() or path.is_symlink():
        number += 1
    return path
