"""Writes the take of a performance: a full disk ends the take and not the show."""

from __future__ import annotations

import contextlib
import errno
import functools
import logging
import os
import threading
from pathlib import Path
from typing import Any

import msgspec

from enliven.errors import EnlivenError, InputError, ResourceError
from enliven.health import HealthKind, HealthState
from enliven.recording import Recorder
from enliven.wire import BY_TYPE, CharacterMessage
from enliven_edge.tracking.health import HEALTH_MESSAGES

SYNC_EVERY = 5.0
"""Seconds between two calls of fsync: the part of a recording that a power cut may cost. A disk of a small
computer takes up to a second for one, which the frame loop must not wait for."""
_LAST = 1.0
"""Seconds for which closing waits for the last call."""
_NOT_THERE = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP}
"""Errors of a file system without fsync."""


class DiskSync:
    """Calls :func:`os.fsync` for a file at even intervals on a thread of its own.

    Args:
        descriptor: of the open file; it may be closed at any time.
        every: seconds between two calls.

    Attributes:
        count: how many calls have returned.
    """

    def __init__(self, descriptor: int, every: float = SYNC_EVERY) -> None:
        self._failure: OSError | None = None
        self.count = 0
        self._descriptor, self._every = os.dup(descriptor), every
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="disk", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Raises ResourceError where the disk refused written data."""
        if self._failure is not None:
            raise ResourceError(
                f"what was written does not reach the disk ({self._failure.strerror})",
                mend="Check the disk and its space.",
            )

    def close(self) -> None:
        """Calls it a last time, and waits a little for that; a second call does nothing."""
        self._ended.set()
        if self._thread is not threading.current_thread():
            self._thread.join(_LAST)

    def _run(self) -> None:
        ended = False
        while not ended:
            ended = self._ended.wait(self._every)
            try:
                os.fsync(self._descriptor)
                self.count += 1
            except OSError as error:
                if error.errno not in _NOT_THERE:
                    self._failure = error
                break
        with contextlib.suppress(OSError):
            os.close(self._descriptor)


log = logging.getLogger(__name__)

CHARACTER_EVERY = 60.0
"""Seconds of the take's clock after which every character is written again: a damaged part of the file then
costs no more than its own messages, because poses are read by any copy of their character."""
_ENCODER = msgspec.msgpack.Encoder()


class Take:
    """Writes messages as they are sent, and every character at the start, each minute and at the end.

    Args:
        overwrite: whether an existing file may be replaced.

    Raises:
        InputError: where the file exists already, or its folder does not.
        ResourceError: where it cannot be made.
    """

    def __init__(self, path: Path, *, overwrite: bool = False) -> None:
        self._recorder: Recorder | None = Recorder(path, overwrite=overwrite)
        self._disk = DiskSync(self._recorder.fileno())
        self._characters: dict[str, CharacterMessage] = {}
        self._now_ns = 0
        self._told_ns: int | None = None
        self._gaps = 0
        self._health_states: dict[HealthKind, HealthState] = {}

    @property
    def health_states(self) -> list[HealthState]:
        """The health states of the take."""
        return list(self._health_states.values())

    def introduce(self, name: str, character: CharacterMessage) -> None:
        """Adds a new character, or a new revision of one, from the last written moment on."""
        self._characters[name] = character
        self._put(character, self._now_ns)

    def remove(self, name: str) -> None:
        """Takes a character away: it is not written again."""
        self._characters.pop(name, None)

    def write(self, message: Any, time_ns: int) -> None:
        """Appends a message with its JSON schema; a failure is reported by :attr:`health_states`."""
        self._put(message, time_ns)
        self._now_ns = max(self._now_ns, time_ns)
        if self._told_ns is None:
            self._told_ns = time_ns
        elif not 0 <= time_ns - self._told_ns < CHARACTER_EVERY * 1e9:
            self._repeat_characters(time_ns)

    def close(self) -> None:
        """Writes the characters again and the index, and closes the file; a second call does nothing."""
        if self._told_ns is not None:
            self._repeat_characters(self._now_ns)
        self._end()

    def _end(self) -> None:
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            try:
                recorder.close()
            except ResourceError as error:
                log.warning("the take lacks its index, and can be read (%s)", error)
            self._disk.close()

    def _repeat_characters(self, time_ns: int) -> None:
        self._told_ns = time_ns
        for character in self._characters.values():
            self._put(character, time_ns)

    def _put(self, message: Any, time_ns: int) -> None:
        if self._recorder is None:
            return
        kind: Any = type(message)
        told = (f"enliven.{kind.__name__}", _schema(kind), "jsonschema", "msgpack")
        try:
            self._disk.check()
            self._recorder.write(BY_TYPE[kind].name, *told, _ENCODER.encode(message), time_ns)
        except InputError as error:
            self._gaps += 1
            self._say(HealthKind.TAKE_GAPS, error, count=self._gaps)
        except ResourceError as error:
            self._say(HealthKind.TAKE_ENDED, error)
            self._end()

    def _say(self, kind: HealthKind, error: EnlivenError, **facts: object) -> None:
        """What is wrong from now on; logged once."""
        message = HEALTH_MESSAGES[kind]
        what = message.what.format(why=error.what, **facts)
        before = self._health_states.get(kind)
        since = self._now_ns if before is None else before.since_ns
        self._health_states[kind] = HealthState(kind, message.severity, since, what, message.mend)
        if before is None:
            log.warning("%s", self._health_states[kind])


@functools.cache
def _schema(kind: Any) -> str:
    return msgspec.json.encode(msgspec.json.schema(kind)).decode()
