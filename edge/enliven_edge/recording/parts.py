"""A recording in parts.

It continues in a new file after a planned time, and when the disk was full and has space again.
"""

from __future__ import annotations

import logging
import os
import re
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from enliven.errors import InputError, ResourceError
from enliven.frames import Frame
from enliven.recording import Recorder
from enliven.supervision.closeable import Closeable
from enliven_edge.recording.disk_space import DiskSpaceGuard
from enliven_edge.recording.disk_sync import DiskSync
from enliven_edge.recording.settings import RecordingSettings

log = logging.getLogger(__name__)

FIRST_RETRY_S = 5.0
"""Seconds from a failed write to the first retry. In this time the system frees the space of a file that the
user has deleted."""
MAX_RETRY_S = 60.0
"""Maximum seconds between two retries. If a new part fails immediately, the wait is doubled, up to this
limit."""
MIN_FREE_BYTES = 1 << 17
"""Minimum free bytes on the disk before a new part is started. With less, the new part would fail
immediately."""
_MAX_NUMBER = 1_000_000
"""Maximum number that is tried for a free name. A service that restarts each minute reaches it after two
years.
"""
FLUSH_INTERVAL_S = 0.4
"""Seconds after which written messages are passed to the operating system. In addition, :class:`DiskSync` has
its own interval. A power cut loses less than a second of data."""
_SIZE_INTERVAL_S = 1.0
"""Seconds between two checks of a part's size."""
_FINISH_TIMEOUT_S = 5.0
"""Maximum seconds that closing waits until an earlier part is completed."""
_PART_NUMBER = re.compile(r"-part\d+$")
"""Pattern of the end of a part's name, for a part after a gap."""
_PLACEHOLDER = re.compile(r"\{([^{}]*)\}")
"""A placeholder in a file name."""


def free_path(pattern: Path) -> Path:
    """Returns the path to record to, with the placeholders in its file name filled in.

    ``{time}`` is the local time, as in 20261128-094500. ``{number}`` is the lowest number from 001 without an
    existing file. If a name with ``{time}`` exists, ``-2``, ``-3`` ... is appended. A name without
    placeholders is returned unchanged.

    Raises:
        InputError: for another placeholder.
    """
    names = set(_PLACEHOLDER.findall(pattern.name))
    if not names <= {"time", "number"}:
        unknown = "{" + min(names - {"time", "number"}) + "}"
        remedy = "Use {time} or {number}, as in take-{number}.mcap."
        raise InputError(
            f"the file name has the unknown placeholder {unknown}", where=str(pattern), remedy=remedy
        )
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
    raise InputError(
        "every number of this file name is in use",
        where=str(pattern),
        remedy="Move the recordings to another folder.",
    )


class PartedRecorder(Closeable):
    """A :class:`~enliven.recording.Recorder` that continues in a new part, after a planned time or after a
    failure.

    If the path has placeholders, a planned part gets a new name from them. All other parts are called
    ``NAME-part2.mcap``, next to ``NAME.mcap``. The previous part is completed in the background.

    A failed write never raises. Instead, ``failure`` contains the reason. When there is space again, the next
    write starts a new part. A disk with too little free space counts as a failure.

    Args:
        path: path of the first part, with placeholders as in :func:`free_path`.
        overwrite: True allows replacing an existing file.
        compression_level: see ``encode_depth``.
        settings: duration and size of a part, and the space to keep free.
        waits_for_space: True starts without a part if the disk is full. The first part follows when there is
            space. An unattended edge needs this, because it must also restart after a crash with a full disk.

    Attributes:
        paths: the parts, oldest first.
        failure: the reason why nothing can be written now; None while writing works.
        lost: number of messages that were not written because of failures.
        on_part_started: called after each later part has started, to write the data that every part needs.
            Its argument is True if messages before the part are missing.

    Raises:
        InputError: if the file already exists, or its folder does not.
        ResourceError: if the first part cannot be created, unless it waits for space.
    """

    def __init__(
        self,
        path: Path,
        *,
        overwrite: bool = False,
        compression_level: int = 1,
        settings: RecordingSettings | None = None,
        waits_for_space: bool = False,
    ) -> None:
        self._level, self._pattern, self._settings = compression_level, path, settings or RecordingSettings()
        self._metadata: dict[str, dict[str, str]] = {}
        keep_free_bytes = self._settings.keep_free * 1e9
        self._guard = DiskSpaceGuard(path, keep_free_bytes) if keep_free_bytes > 0.0 else None
        self.failure: ResourceError | None = None
        try:
            self.paths = [free_path(path)]
            self._recorder = self._open_first_part(overwrite, waits_for_space)
        except BaseException:
            if self._guard is not None:
                self._guard.close()
            raise
        if self._recorder is not None:
            self._disk = DiskSync(self._recorder.fileno())
        self.lost = 0
        self.on_part_started: Callable[[bool], None] = lambda is_after_gap: None
        self._wait_s, self._retry_at = FIRST_RETRY_S, time.monotonic() + FIRST_RETRY_S
        self._started_at = self._size_checked_at = time.monotonic()
        self._finishing: list[_PartFinisher] = []
        self._set_in_use()

    @property
    def path(self) -> Path:
        """Returns the path of the newest part."""
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
        """Adds a named metadata record to this part and to every later one."""
        self._metadata[name] = values
        self._run_step(lambda recorder: recorder.add_metadata(name, values))

    def sync(self) -> None:
        """Passes everything written to the operating system, as complete chunks."""
        if self._recorder is not None:
            self._run_step(lambda recorder: recorder.sync())

    def close(self) -> None:
        """Writes the index and closes the file. A second call does nothing."""
        self._close_part()
        for finisher in self._finishing:
            finisher.join(_FINISH_TIMEOUT_S)
        if self._guard is not None:
            self._guard.close()

    def _close_part(self) -> None:
        """Completes the current part. No part is open until :meth:`_start_part` is called."""
        recorder, self._recorder = self._recorder, None
        self._retry_at = float("inf")
        if recorder is not None:
            _finish_part(recorder, self._disk)

    def _run_step(self, step: Callable[[Recorder], None]) -> None:
        """Runs a step on the current part, or on a new one if that is due."""
        if self._recorder is None and time.monotonic() >= self._retry_at:
            self._start_part(is_after_gap=True)
        elif self._recorder is not None and self._is_part_complete(self._recorder):
            self._start_part(is_after_gap=False)
        if self._recorder is None:
            self.lost += 1
            return
        try:
            self._check_disk()
            step(self._recorder)
        except ResourceError as error:
            self.lost += 1
            self._handle_failure(error)

    def _handle_failure(self, error: ResourceError) -> None:
        """Closes the current part after a failed write, and schedules the next retry."""
        is_short = time.monotonic() - self._started_at < MAX_RETRY_S and len(self.paths) > 1
        self._wait_s = min(2 * self._wait_s, MAX_RETRY_S) if is_short else FIRST_RETRY_S
        until, self.failure = self._wait_s, error
        self._close_part()
        self._retry_at = time.monotonic() + until
        log.warning("%s The recording continues in a new file when there is space.", error)

    def _check_disk(self) -> None:
        """Raises ResourceError if the disk refused written data, or has too little free space."""
        self._disk.check()
        if self._guard is not None and self._guard.is_short:
            raise ResourceError(
                f"less than {self._settings.keep_free:g} GB are free, and no older recording can be deleted",
                where=str(self.path),
                remedy="Free some disk space, or lower keep_free under [recording].",
            )

    def _is_part_complete(self, recorder: Recorder) -> bool:
        """Returns True if the current part has reached its full duration or size."""
        now, settings = time.monotonic(), self._settings
        if settings.part_minutes > 0.0 and now - self._started_at >= 60.0 * settings.part_minutes:
            return True
        if settings.part_mb <= 0.0 or now - self._size_checked_at < _SIZE_INTERVAL_S:
            return False
        self._size_checked_at = now
        return os.fstat(recorder.fileno()).st_size >= settings.part_mb * 1e6

    def _start_part(self, *, is_after_gap: bool) -> None:
        """Starts the next part if the disk has room. Otherwise schedules another retry.

        If a planned part cannot be started, the current one continues.
        """
        if is_after_gap:
            self._retry_at = time.monotonic() + self._wait_s
        else:
            # If this part cannot be started, try again after another full duration.
            self._started_at = time.monotonic()
        recorder = self._open_part(is_after_gap)
        if recorder is None:
            return
        if self._recorder is not None:
            self._finishing = [finisher for finisher in self._finishing if finisher.is_alive()]
            self._finishing.append(_PartFinisher(self._recorder, self._disk))
        self._recorder, self._disk = recorder, DiskSync(recorder.fileno())
        self._started_at = self._size_checked_at = time.monotonic()
        self.paths = [path for path in self.paths if path.exists()] + [recorder.path]
        self._set_in_use()
        if is_after_gap:
            self.failure = None
            log.warning(
                "%s: the recording continues in this file; %d earlier messages are missing",
                self.path,
                self.lost,
            )
        self.on_part_started(is_after_gap)

    def _open_first_part(self, overwrite: bool, waits_for_space: bool) -> Recorder | None:
        """Returns the first part. Returns None if the disk is full and the recording waits for space."""
        path = self.paths[0]
        is_new = not path.exists()
        try:
            return Recorder(
                path,
                overwrite=overwrite,
                compression_level=self._level,
                sync_seconds=FLUSH_INTERVAL_S,
            )
        except ResourceError as error:
            if is_new:
                path.unlink(missing_ok=True)  # An empty file would occupy the name.
            if not waits_for_space or shutil.disk_usage(path.parent).free >= MIN_FREE_BYTES:
                raise
            self.failure = error
            log.warning("%s The recording starts when there is space.", error)
            return None

    def _open_part(self, is_after_gap: bool) -> Recorder | None:
        """Returns the next part with its metadata. Returns None if the disk has no space."""
        folder = self._pattern.parent
        try:
            is_short = self._guard is not None and self._guard.is_short
            if is_short or shutil.disk_usage(folder).free < MIN_FREE_BYTES:
                return None
            has_placeholders = bool(_PLACEHOLDER.search(self._pattern.name))
            path = free_path(self._pattern) if has_placeholders and not is_after_gap else self._next_part()
            recorder = Recorder(path, compression_level=self._level, sync_seconds=FLUSH_INTERVAL_S)
        except (OSError, ResourceError, InputError):
            return None
        try:
            for name, values in self._metadata.items():
                recorder.add_metadata(name, values)
        except ResourceError:
            path.unlink(missing_ok=True)
            return None
        return recorder

    def _next_part(self) -> Path:
        """Returns the first free name of a later part."""
        first, number = self._first_name, 2
        while (path := first.with_stem(f"{first.stem}-part{number}")).exists() or path.is_symlink():
            number += 1
        return path

    @property
    def _first_name(self) -> Path:
        """Returns the newest part's file name without the number of the part."""
        return self.path.with_stem(_PART_NUMBER.sub("", self.path.stem))

    def _set_in_use(self) -> None:
        """Protects the current part, and the parts that are being completed, from deletion."""
        if self._guard is not None:
            self._guard.in_use = frozenset(self.paths[-2 - len(self._finishing) :])


class _PartFinisher(threading.Thread):
    """Completes a part in the background, because writing its index and the last bytes takes a while."""

    def __init__(self, recorder: Recorder, disk: DiskSync) -> None:
        super().__init__(name="end of a part", daemon=True)
        self._part = recorder, disk
        self.start()

    def run(self) -> None:
        _finish_part(*self._part)


def _finish_part(recorder: Recorder, disk: DiskSync) -> None:
    """Writes the index of a part, and closes it."""
    try:
        recorder.close()
    except ResourceError as error:
        log.warning("the recording has no index, but can be read (%s)", error)
    disk.close()
