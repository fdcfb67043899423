"""The commands of controls, and the thread that reads a device with debouncing and reopening."""

from __future__ import annotations

import difflib
import logging
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from enliven.errors import EnlivenError, InputError
from enliven.person import parse_parts
from enliven.wire import Browse, Lock, Order, Possess, Release, Resize
from enliven_edge.controls.panel_protocol import Lamps
from enliven_edge.stage.stage import Stage

Call = Literal["record", "stop", "again"]
Word = Literal[
    "possess", "join", "extend", "release", "next", "previous", "follow", "lock", "unlock",
    "scale", "parts", "record", "stop", "again",
]  # fmt: skip
Command = str
"""A command word, such as "next". Commands that possess a character, and "parts", may be followed by parts of
the body: "possess left arm".
"""

WORDS: tuple[Word, ...] = get_args(Word)
CALLS: tuple[Call, ...] = get_args(Call)
"""The commands that windows carry out instead of the edge."""

_STEPS = {"next": 1, "previous": -1, "follow": 0}
"""Step of each command in the ranking of matches. With 0, the choice follows the pose again."""
_MODES: dict[str, Literal["alone", "join", "extend"]] = {
    "possess": "alone",
    "join": "join",
    "extend": "extend",
}
_PARTS_COMMAND = "parts"
"""The command that selects the body parts for the next possession. The mesh highlights them immediately."""
_COMMANDS_WITH_PARTS = (*_MODES, _PARTS_COMMAND)
"""The commands that accept parts of the body after them."""


def check_map(key_map: Mapping[str, str], where: str) -> dict[str, Command]:
    """Returns the map from a control's keys to commands after checking every command.

    Raises:
        InputError: for an unknown word or part of the body. The message suggests the nearest known one.
    """
    return {key: _parse_command(key, " ".join(command.split()), where) for key, command in key_map.items()}


def _parse_command(key: str, text: str, where: str) -> Command:
    """Returns the command of a key, or raises if it is invalid."""
    name, _, parts = text.partition(" ")
    if name in WORDS and (name in _COMMANDS_WITH_PARTS or not parts):
        if parts:
            try:
                parse_parts(parts)
            except InputError as error:
                raise InputError(f"{key!r}: {error.what}", where=where, remedy=error.remedy) from None
        elif name == _PARTS_COMMAND:
            remedy = 'For example: "parts legs".'
            raise InputError(
                f"{key!r} is mapped to {text!r}, which names no body part", where=where, remedy=remedy
            )
        return text
    similar = difflib.get_close_matches(text, WORDS, n=1)
    remedy = f"Did you mean {similar[0]!r}?" if similar else f"Known commands: {', '.join(WORDS)}."
    raise InputError(f"{key!r} is mapped to {text!r}, which is not a command", where=where, remedy=remedy)


def orders_from_command(command: Command, stage: Stage) -> list[Order]:
    """Returns the orders of a command, as if a viewer had sent them without naming a character.

    Returns an empty list for a command that windows carry out.
    """
    name, _, parts = command.partition(" ")
    if name in CALLS:
        return []
    if name in ("lock", "unlock"):
        return [Lock(name == "lock")]
    if not stage.actors:
        return []
    if name == "release":
        return [Release()]
    if name == "scale":
        return [Resize("hands")]
    if name in _STEPS:
        return [Browse(step=_STEPS[name])]
    if name == _PARTS_COMMAND:
        return [Possess(parts=parts, mode="preview")]
    mode = _MODES[name]
    return [
        Possess(possession.character, possession.body, parts or possession.parts, mode)
        for possession in stage.pending_possessions(mode)
    ]


log = logging.getLogger(__name__)

READ_TIMEOUT_S = 0.1
"""Seconds to wait for a press before checking whether to stop."""
_MAX_QUEUED = 32
"""Maximum number of queued commands. If the queue is full, the oldest commands are dropped, because the stage
has changed in the meantime."""
_MAX_UNKNOWN_KEYS = 16
"""Maximum number of different unknown keys that are logged. The log helps the user to add them to the map."""


class Device(ABC):
    """The device that a :class:`ControlReader` reads, used by its thread only."""

    @abstractmethod
    def open(self) -> None:
        """Opens the device, or opens it again.

        Raises:
            Exception: an error of the device's library, mostly an OSError, if the device is missing.
        """

    @abstractmethod
    def read(self) -> list[str]:
        """Returns the keys that went down, after :data:`READ_TIMEOUT_S` at the latest.

        Raises:
            Exception: an error of the device's library if the device was unplugged.
            EOFError: if no more input can come.
        """

    @property
    def is_responding(self) -> bool:
        """Returns True if the device behind an open port has answered as expected. Only then it counts as
        present.
        """
        return True

    def take_unrecognised_words(self) -> list[str]:
        """Returns the utterances since the last call that match none of the phrases of a voice control."""
        return []

    def show(self, lamps: Lamps) -> None:  # noqa: B027 (most devices have no lamps)
        """Sets the state of the device's lamps. Called from another thread than the other methods."""

    @abstractmethod
    def close(self) -> None:
        """Releases the device. May be called at any time, also twice."""


@dataclass(frozen=True)
class Press:
    """One press of a key, or one utterance.

    Attributes:
        key: the device's input: a line, a byte, a button, or words.
        command: the command of the key; empty for speech that is not a known phrase.
    """

    key: str
    command: Command = ""


class Debouncer:
    """Drops repeated events of one key press (contact bounce).

    Args:
        seconds: time without events after which a key counts again. A contact bounces for some 10 ms.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._last: dict[str, float] = {}

    def is_new_press(self, key: str, now: float) -> bool:
        """Returns True if this event is a new press.

        Args:
            now: seconds of a monotonic clock.
        """
        previous = self._last.get(key)
        self._last[key] = now
        return previous is None or now - previous >= self._seconds


class ControlReader:
    """Reads a device in a daemon thread until :meth:`close`. Opens it again after it was unplugged.

    Args:
        name: the user's name of the control.
        words: the command of each key.
        debounce: seconds without events after which a key counts again.
        retry: seconds between two attempts to open the device.
    """

    def __init__(
        self, name: str, device: Device, words: Mapping[str, Command], debounce: float, retry: float
    ) -> None:
        self.name = name
        self._device, self._words, self._retry = device, dict(words), retry
        self._debouncer = Debouncer(debounce)
        self._queue: deque[Press] = deque(maxlen=_MAX_QUEUED)
        self._paused = threading.Event()
        self._open_error: EnlivenError | None = None
        self._unknown_keys: set[str] = set()
        self._is_present = False
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"control {name}", daemon=True)
        self._thread.start()

    @property
    def is_present(self) -> bool:
        """Returns True if the device is present and being read. Earlier presses are lost."""
        return self._is_present

    @property
    def last_error(self) -> EnlivenError | None:
        """Returns the error of the last attempt to open the device.

        Returns None after success, or before the first attempt.
        """
        return self._open_error

    @property
    def is_paused(self) -> bool:
        """Returns True if the device is released until :meth:`pause` is called with False."""
        return self._paused.is_set()

    def pause(self, paused: bool) -> None:
        """Releases the device if ``paused`` is True, or opens it again."""
        if paused:
            self._paused.set()
        else:
            self._paused.clear()

    @property
    def phrases(self) -> dict[str, Command]:
        """Returns the command of each key."""
        return dict(self._words)

    def poll(self) -> list[Command]:
        """Returns the commands since the last call, the oldest first. Never blocks."""
        return [press.command for press in self.read_presses() if press.command]

    def read_presses(self) -> list[Press]:
        """Returns the presses since the last call, and speech that matches no phrase. Never blocks."""
        presses = []
        while self._queue:
            presses.append(self._queue.popleft())
        return presses

    def show(self, lamps: Lamps) -> None:
        """Sets the state of the device's lamps."""
        self._device.show(lamps)

    def close(self) -> None:
        """Ends the thread, which releases the device."""
        self._stopped.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        """Opens the device, reads until it is gone, waits, and repeats. Logs each change of its presence
        once.
        """
        is_logged = False
        while not self._stopped.is_set():
            if self._paused.is_set():
                self._stopped.wait(READ_TIMEOUT_S)
                continue
            try:
                self._device.open()
                self._open_error = None
                self._read()
            except EOFError:
                log.info("control %s: the input has ended", self.name)
                return
            except Exception as error:
                # Catch every error, because termios and PortAudio raise errors that are not OSErrors.
                if self._is_present or not is_logged:
                    log.warning(
                        "control %s is not available (%s). The edge keeps searching for it.", self.name, error
                    )
                log.debug("control %s", self.name, exc_info=True)
                is_logged = True
                self._open_error = error if isinstance(error, EnlivenError) else None
            finally:
                self._is_present = False
                self._device.close()
            self._stopped.wait(self._retry)

    def _read(self) -> None:
        """Reads until the device is gone, or until :meth:`pause` or :meth:`close` is called."""
        while not self._stopped.is_set() and not self._paused.is_set():
            if not self._is_present and self._device.is_responding:
                log.info("control %s is connected", self.name)
                self._is_present = True
            for key in self._device.read():
                if self._debouncer.is_new_press(key, time.monotonic()):
                    self._queue_press(key)
            self._queue.extend(map(Press, self._device.take_unrecognised_words()))

    def _queue_press(self, key: str) -> None:
        """Queues the command of a key.

        An unknown key is logged once, so that the user can add it to the map.
        """
        command = self._words.get(key)
        if command is not None:
            log.debug("control %s: %r, %s", self.name, key, command)
            self._queue.append(Press(key, command))
        elif key not in self._unknown_keys and len(self._unknown_keys) < _MAX_UNKNOWN_KEYS:
            self._unknown_keys.add(key)
            log.info("control %s sent %r, which is not in the map of this control", self.name, key)
