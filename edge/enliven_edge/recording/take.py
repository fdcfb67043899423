"""Writes the take of a performance: a full disk pauses the take, but not the show."""

from __future__ import annotations

import functools
import logging
from pathlib import Path
from typing import Any

import msgspec

from enliven.errors import InputError
from enliven.health import HealthKind, HealthState
from enliven.wire import BY_TYPE, CharacterMessage
from enliven_edge.recording.parts import PartedRecorder
from enliven_edge.tracking.health import HEALTH_MESSAGES

log = logging.getLogger(__name__)

CHARACTER_INTERVAL_S = 60.0
"""Interval at which every character is written again, in seconds of the take's clock. Poses can be read with
any copy of their character. So a damaged part of the file costs only its own messages."""
_ENCODER = msgspec.msgpack.Encoder()


class Take:
    """Writes all sent messages, and every character at the start, each minute and at the end.

    While nothing can be written, a health state reports it. When there is room again, the take continues in a
    new part, which starts with every character.

    Args:
        path: path of the first part. See :func:`~enliven_edge.recording.parts.free_path` for its
            placeholders.
        overwrite: True allows replacing an existing file.

    Raises:
        InputError: if the file already exists, or its folder does not.
        ResourceError: if it cannot be created.
    """

    def __init__(self, path: Path, *, overwrite: bool = False) -> None:
        self._parts = PartedRecorder(path, overwrite=overwrite)
        self._parts.on_part_started = self._begin_part
        self._characters: dict[str, CharacterMessage] = {}
        self._now_ns = 0
        self._last_repeat_ns: int | None = None
        self._gaps = 0
        self._health_states: dict[HealthKind, HealthState] = {}

    @property
    def health_states(self) -> list[HealthState]:
        """The health states of the take."""
        return list(self._health_states.values())

    def introduce(self, name: str, character: CharacterMessage) -> None:
        """Adds a new character, or a new revision of one, at the last written time."""
        self._characters[name] = character
        self._write_message(character, self._now_ns)

    def remove(self, name: str) -> None:
        """Removes a character: it is not written again."""
        self._characters.pop(name, None)

    def write(self, message: Any, time_ns: int) -> None:
        """Appends a message with its JSON schema. A failure is reported by :attr:`health_states`."""
        self._write_message(message, time_ns)
        self._now_ns = max(self._now_ns, time_ns)
        if self._last_repeat_ns is None:
            self._last_repeat_ns = time_ns
        elif not 0 <= time_ns - self._last_repeat_ns < CHARACTER_INTERVAL_S * 1e9:
            self._repeat_characters(time_ns)

    def close(self) -> None:
        """Writes the characters again and the index, and closes the file. A second call does nothing."""
        if self._last_repeat_ns is not None:
            self._repeat_characters(self._now_ns)
        self._parts.close()

    def _begin_part(self) -> None:
        """Starts a new part with every character, and reports the gap between the parts."""
        self._repeat_characters(self._now_ns)
        self._health_states.pop(HealthKind.TAKE_ENDED, None)
        facts = {"count": self._parts.lost, "path": self._parts.path.name}
        self._health_states.pop(HealthKind.TAKE_RESUMED, None)
        self._set_health_state(HealthKind.TAKE_RESUMED, "", **facts)

    def _repeat_characters(self, time_ns: int) -> None:
        self._last_repeat_ns = time_ns
        for character in self._characters.values():
            self._write_message(character, time_ns)

    def _write_message(self, message: Any, time_ns: int) -> None:
        kind: Any = type(message)
        channel = (f"enliven.{kind.__name__}", _json_schema(kind), "jsonschema", "msgpack")
        try:
            self._parts.write(BY_TYPE[kind].name, *channel, _ENCODER.encode(message), time_ns)
        except InputError as error:
            self._gaps += 1
            self._set_health_state(HealthKind.TAKE_GAPS, error.what, count=self._gaps)
        if self._parts.failure is not None:
            self._set_health_state(HealthKind.TAKE_ENDED, self._parts.failure.what)

    def _set_health_state(self, kind: HealthKind, reason: str, **facts: object) -> None:
        """Sets a health state, and logs it the first time."""
        message = HEALTH_MESSAGES[kind]
        sentence = message.what.format(why=reason, **facts)
        previous = self._health_states.get(kind)
        since = self._now_ns if previous is None else previous.since_ns
        self._health_states[kind] = HealthState(kind, message.severity, since, sentence, message.mend)
        if previous is None:
            log.warning("%s", self._health_states[kind])


@functools.cache
def _json_schema(kind: Any) -> str:
    return msgspec.json.encode(msgspec.json.schema(kind)).decode()
