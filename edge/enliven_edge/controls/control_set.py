"""All controls of an edge: opened from its settings, polled between two frames."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Literal, cast

from enliven.errors import EnlivenError, InputError
from enliven.supervision.closeable import Closeable
from enliven.wire import MAX_PHRASES, HeardMessage, Order, VoiceMessage
from enliven_edge.controls.base import (
    CALLS,
    WORDS,
    Call,
    Command,
    ControlReader,
    Device,
    Press,
    check_map,
    orders_from_command,
)
from enliven_edge.controls.panel_protocol import Lamps
from enliven_edge.controls.settings import ControlSettings, refuse_other_kinds
from enliven_edge.stage.stage import Stage

log = logging.getLogger(__name__)


PHRASES = {
    "puppet take it": "possess",
    "puppet join in": "join",
    "puppet let it go": "release",
    "puppet show another": "next",
    "puppet follow my pose": "follow",
    "puppet change your size": "scale",
    "puppet use my legs": "possess legs",
    "puppet use the upper body": "possess upper body",
    "puppet use everything": "possess all",
    "puppet start recording": "record",
    "puppet stop recording": "stop",
}
"""Phrases of the voice control that a window starts if the edge's settings contain no voice control."""
_MAX_MESSAGE_LENGTH = 160
"""Maximum number of characters of a sentence in a wire message."""


class _VoiceLoader(threading.Thread):
    """Loads the speech models in the background, which takes about a second."""

    def __init__(self) -> None:
        super().__init__(name="start of the voice", daemon=True)
        self.result: ControlReader | EnlivenError | None = None

    def run(self) -> None:
        settings = ControlSettings("voice", dict(PHRASES))
        try:
            device = create_device("voice", settings)
        except EnlivenError as error:
            self.result = error
        else:
            self.result = ControlReader("voice", device, PHRASES, settings.debounce, settings.retry)


class Controls(Closeable):
    """Carries out the commands of several controls on the stage.

    Args:
        voices: the names of the controls that listen to speech.
        hides_talk: whether unknown speech is reported without its words, because strangers may watch.
    """

    def __init__(
        self, controls: Sequence[ControlReader], voices: Collection[str] = (), *, hides_talk: bool = False
    ) -> None:
        self._controls, self._voices, self._hides_talk = list(controls), set(voices), hides_talk
        self._start: _VoiceLoader | None = None
        self._failure: EnlivenError | None = None
        self._state: VoiceMessage | None = None

    def apply_commands(
        self,
        stage: Stage,
        carry_out: Callable[[Order], None],
        send_call: Callable[[Call, str], None],
        send_message: Callable[[HeardMessage | VoiceMessage], None] = lambda message: None,
    ) -> None:
        """Carries out the commands since the last call. A command that fails is logged.

        Args:
            send_call: sends a command of windows, with the name of the control.
            send_message: sends windows the utterances that a voice control heard, and whether it listens.
        """
        self._finish_start()
        for control in self._controls:
            for press in control.read_presses():
                refusal = self._apply(control, press, stage, carry_out, send_call) if press.command else ""
                if control.name in self._voices:
                    send_message(self._utterance_message(control, press, refusal))
        state = self._voice_state()
        if state != self._state:
            self._state = state
            send_message(state)

    def _apply(
        self,
        control: ControlReader,
        press: Press,
        stage: Stage,
        carry_out: Callable[[Order], None],
        send_call: Callable[[Call, str], None],
    ) -> str:
        """Carries out a command. Returns the reason if the stage refuses it, or ""."""
        command, refusal = press.command, ""
        log.info("%s: %s", control.name, command)
        if command in CALLS:
            send_call(cast(Call, command), control.name)
        for order in orders_from_command(command, stage):
            try:
                carry_out(order)
            except EnlivenError as error:
                log.warning("%s: the command %r was refused: %s", control.name, command, error)
                refusal = error.what
        return refusal

    def _utterance_message(self, control: ControlReader, press: Press, refusal: str) -> HeardMessage:
        """Returns the message to windows about an utterance."""
        words = press.key if press.command or not self._hides_talk else ""
        shortened = words[:_MAX_MESSAGE_LENGTH], bool(press.command), press.command[:_MAX_MESSAGE_LENGTH]
        return HeardMessage(control.name[:64] or "voice", *shortened, refusal[:_MAX_MESSAGE_LENGTH])

    def listen(self, on: bool) -> None:
        """Opens or closes the microphones of all voice controls. Starts a voice control if there are none."""
        voices = [control for control in self._controls if control.name in self._voices]
        for control in voices:
            control.pause(not on)
        if not on:
            self._failure = self._start = None
        elif not voices and self._start is None:
            self._failure, self._start = None, _VoiceLoader()
            self._start.start()

    def _finish_start(self) -> None:
        """Adds the voice control that was started, or stores the reason of the failure."""
        if self._start is None or self._start.result is None:
            return
        result, self._start = self._start.result, None
        if isinstance(result, EnlivenError):
            self._failure = result
        else:
            self._controls.append(result)
            self._voices.add(result.name)

    def _voice_state(self) -> VoiceMessage:
        """Returns the message to windows about the microphone."""
        voices = [control for control in self._controls if control.name in self._voices]
        commands_by_phrase = {
            phrase: word for control in voices for phrase, word in control.phrases.items()
        } or PHRASES
        phrases = [phrase[:_MAX_MESSAGE_LENGTH] for phrase in commands_by_phrase][:MAX_PHRASES]
        actions = [word[:_MAX_MESSAGE_LENGTH] for word in commands_by_phrase.values()][:MAX_PHRASES]
        if any(control.is_present for control in voices):
            return VoiceMessage("listening", phrases=phrases, actions=actions)
        error = self._failure or next(
            (voice.last_error for voice in voices if voice.last_error is not None), None
        )
        if self._start is None and error is None and all(voice.is_paused for voice in voices):
            return VoiceMessage("off", phrases=phrases, actions=actions)
        if error is None or any(voice.is_paused for voice in voices):
            state: Literal["off", "starting"] = (
                "off" if any(voice.is_paused for voice in voices) else "starting"
            )
            return VoiceMessage(state, phrases=phrases, actions=actions)
        problem, remedy = error.what[:_MAX_MESSAGE_LENGTH], (error.remedy or "")[:_MAX_MESSAGE_LENGTH]
        return VoiceMessage("missing", problem, remedy, phrases, actions)

    def show(self, lamps: Lamps) -> None:
        """Shows the state of the stage. If this is not called for a second, the lamps show "no edge"."""
        for control in self._controls:
            control.show(lamps)

    @property
    def missing(self) -> list[str]:
        """Returns the names of the controls without a device."""
        return [control.name for control in self._controls if not control.is_present]

    def forget(self) -> None:
        """Drops the queued commands, because the stage was not ready."""
        for control in self._controls:
            control.poll()

    def close(self) -> None:
        """Releases all devices."""
        for control in self._controls:
            control.close()


def open_controls(
    settings: Mapping[str, ControlSettings], folder: Path | None = None, *, hides_talk: bool = False
) -> Controls:
    """Opens all controls of a settings file.

    Args:
        folder: folder of the file, to which its paths are relative.
        hides_talk: whether unknown speech is reported to windows without its words.

    Raises:
        InputError: for an invalid map or key.
        ResourceError: if a required library is missing. A missing device is not an error: it is searched for
            until it appears.
    """
    voices = [name for name, control in settings.items() if control.kind == "voice"]
    return Controls(open_readers(settings, folder), voices, hides_talk=hides_talk)


def open_readers(settings: Mapping[str, ControlSettings], folder: Path | None = None) -> list[ControlReader]:
    """Starts to read the device of each control. Arguments and errors are those of :func:`open_controls`."""
    controls = [(name, control, create_device(name, control, folder)) for name, control in settings.items()]
    return [
        ControlReader(name, device, commands_by_key(name, control), control.debounce, control.retry)
        for name, control, device in controls
    ]


def commands_by_key(name: str, settings: ControlSettings) -> dict[str, Command]:
    """Returns the command of each of a control's keys. Without a map, each command is its own key.

    Raises:
        InputError: for an unknown command, or a voice without phrases.
    """
    if settings.kind == "voice" and not settings.map:
        remedy = 'Add phrases to this map, such as "puppet let it go" = "release".'
        raise InputError("the voice control has no phrases", where=f"controls.{name}.map", remedy=remedy)
    return check_map(
        settings.map or {word: word for word in WORDS if word != "parts"}, f"controls.{name}.map"
    )


def create_device(name: str, settings: ControlSettings, folder: Path | None = None) -> Device:
    """Returns a control's device, not opened yet. Its library is imported only here."""
    where = f"controls.{name}"
    refuse_other_kinds(settings, where)
    words = commands_by_key(name, settings)
    if settings.kind == "serial" and settings.sends == "panel":
        from enliven_edge.controls.serial_panel import SerialPanel

        return SerialPanel(settings, where)
    if settings.kind == "serial":
        from enliven_edge.controls.serial_pedal import SerialPedal

        return SerialPedal(settings, where)
    if settings.kind == "hid":
        from enliven_edge.controls.hid_pedal import HidPedal

        return HidPedal(settings, where)
    from enliven_edge.controls.voice import Voice

    return Voice(settings, list(words), where, folder)
