"""Writes the recording of a performance (a take). A full disk pauses the take, but not the show."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import msgspec

from enliven.errors import InputError
from enliven.health import HealthKind, HealthState
from enliven.wire import CharacterMessage, StageMessage, pack_recorded
from enliven_edge.recording.parts import PartedRecorder
from enliven_edge.recording.settings import RecordingSettings
from enliven_edge.tracking.health.alarm import HEALTH_MESSAGES

log = logging.getLogger(__name__)

CHARACTER_INTERVAL_S = 60.0
"""Seconds of the take's clock after which every character is written again. So a damaged part of the file
loses only its own messages, because poses can be read with any copy of their character."""


class Take:
    """Writes all sent messages, and every character at the start, each minute and at the end.

    While nothing can be written, a health state reports it. When there is space again, the take continues in
    a new part. Every part starts with the stage and every character, so that it can be read alone.

    Args:
        path: path of the first part. See :func:`~enliven_edge.recording.parts.free_path` for its
            placeholders.
        overwrite: True allows replacing an existing file.
        settings: duration and size of its parts, and the space to keep free.
        waits_for_space: True starts the take later if the disk is full now.

    Raises:
        InputError: if the file already exists, or its folder does not.
        ResourceError: if it cannot be created.
    """

    def __init__(
        self,
        path: Path,
        *,
        overwrite: bool = False,
        settings: RecordingSettings | None = None,
        waits_for_space: bool = False,
    ) -> None:
        self._parts = PartedRecorder(
            path, overwrite=overwrite, settings=settings, waits_for_space=waits_for_space
        )
        self._parts.on_part_started = self._begin_part
        self._characters: dict[str, CharacterMessage] = {}
        self._stage: StageMessage | None = None
        self._now_ns = 0
        self._last_repeat_ns: int | None = None
        self._gaps = 0
        self._health_states: dict[HealthKind, HealthState] = {}

    @property
    def health_states(self) -> list[HealthState]:
        """Returns the health states of the take."""
        return list(self._health_states.values())

    def introduce(self, name: str, character: CharacterMessage) -> None:
        """Adds a new character, or a new revision of one, at the time of the last written message."""
        self._characters[name] = character
        self._write_message(character, self._now_ns)

    def remove(self, name: str) -> None:
        """Removes a character, which is then no longer written."""
        self._characters.pop(name, None)

    def write(self, message: Any, time_ns: int) -> None:
        """Appends a message with its JSON schema. A failure is reported by :attr:`health_states`."""
        if isinstance(message, StageMessage):
            self._stage = message
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

    def _begin_part(self, is_after_gap: bool) -> None:
        """Starts a new part with the stage and every character, and reports a gap between the parts."""
        if self._stage is not None:
            stage = msgspec.structs.replace(self._stage, time_ns=self._now_ns)
            self._write_message(stage, self._now_ns)
        self._repeat_characters(self._now_ns)
        if not is_after_gap:
            return
        self._health_states.pop(HealthKind.TAKE_ENDED, None)
        facts = {"count": self._parts.lost, "path": self._parts.path.name}
        self._health_states.pop(HealthKind.TAKE_RESUMED, None)
        self._set_health_state(HealthKind.TAKE_RESUMED, "", **facts)

    def _repeat_characters(self, time_ns: int) -> None:
        """Writes every character again."""
        self._last_repeat_ns = time_ns
        for character in self._characters.values():
            self._write_message(character, time_ns)

    def _write_message(self, message: Any, time_ns: int) -> None:
        try:
            self._parts.write(*pack_recorded(message), time_ns)
        except InputError as error:
            self._gaps += 1
            self._set_health_state(HealthKind.TAKE_GAPS, error.what, count=self._gaps)
        if self._parts.failure is not None:
            self._set_health_state(HealthKind.TAKE_ENDED, self._parts.failure.what)

    def _set_health_state(self, kind: HealthKind, reason: str, **facts: object) -> None:
        """Sets a health state. Logs it the first time."""
        message = HEALTH_MESSAGES[kind]
        sentence = message.what.format(why=reason, **facts)
        previous = self._health_states.get(kind)
        since_ns = self._now_ns if previous is None else previous.since_ns
        self._health_states[kind] = HealthState(kind, message.severity, since_ns, sentence, message.remedy)
        if previous is None:
            log.warning("%s", self._health_states[kind])
