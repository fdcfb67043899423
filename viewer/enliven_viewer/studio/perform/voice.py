"""Spoken commands in the studio: the state of the edge's microphone, and the last recognised words."""

from __future__ import annotations

import time

from enliven.wire import HEARD, VOICE, Answer, HeardMessage, Listen, Refused, VoiceMessage
from enliven_viewer.language import later, tr
from enliven_viewer.link.edge_client import EdgeClient
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.perform.topic_state import NOT_READY_TEXT, TopicState

UTTERANCE_DISPLAY_S = 5.0
"""Seconds for which an utterance is shown: long enough to read, and usually shorter than the time to the next
utterance.
"""
_OLD_EDGE = later("This stage's program is older and has no switch for the microphone. Update it")
_STATE_TEXTS = {
    "off": later("The microphone is off"),
    "starting": later("The microphone is being opened"),
    "listening": later("Listening"),
    "missing": later("No microphone"),
}


class StageVoice:
    """The state of an edge's voice control, and the commands that open or close its microphone.

    Attributes:
        wanted_state: True to open the microphone of an edge that this window starts, once that edge runs.
    """

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self.wanted_state = False
        self._state: TopicState[VoiceMessage] = TopicState(VOICE)
        self._heard: HeardMessage | None = None
        self._heard_until = 0.0
        self._asked_edge: object = None

    def advance(self, client: EdgeClient, *, is_near: bool) -> None:
        """Processes the edge's messages. Opens the microphone of an edge that this window has started, if
        requested.
        """
        for message in client.take(HEARD):
            self._heard, self._heard_until = message, time.monotonic() + UTTERANCE_DISPLAY_S
        self._state.advance(client)
        instance = client.edges[0].instance
        if is_near and self.wanted_state and self.state is not None and self._asked_edge != instance:
            self._asked_edge = instance
            self._send_request(client, True)

    def forget(self) -> None:
        """Discards the edge's state after the connection was closed."""
        self._state.forget()
        self._heard = self._asked_edge = None

    @property
    def state(self) -> VoiceMessage | None:
        """Returns the state of the microphone, or None before the edge has sent it."""
        return self._state.message

    @property
    def is_on(self) -> bool:
        """Returns True if the microphone is open or opening."""
        return self.state is not None and self.state.state != "off"

    @property
    def is_understood(self) -> bool:
        """Returns True if the displayed utterance is one of the known phrases."""
        return self._heard is not None and self._heard.understood

    @property
    def words(self) -> str:
        """Returns the words recognised in the last seconds, or an empty text if there are none."""
        heard = self._heard
        if heard is None or time.monotonic() > self._heard_until:
            return ""
        if heard.understood:
            return tr("Heard: {0}", heard.words) + (f" ({heard.refused})" if heard.refused else "")
        return tr("Not understood: {0}", heard.words) if heard.words else tr("Not understood")

    @property
    def status(self) -> str:
        """Returns a displayed text about the state of the microphone."""
        if self.state is None:
            return _OLD_EDGE if self._state.is_unsupported else NOT_READY_TEXT
        reason = f": {self.state.what}" if self.state.what else ""
        return f"{_STATE_TEXTS[self.state.state]}{reason}"

    @property
    def advice(self) -> str:
        """Returns advice on fixing the microphone, or about what to say."""
        if self.state is None:
            return ""
        if self.state.state == "missing":
            return self.state.remedy
        return (
            tr("Say: {0} ...", ", ".join(self.state.phrases[:2])) if self.state.state == "listening" else ""
        )

    @property
    def phrases(self) -> tuple[tuple[str, str], ...]:
        """Returns the known phrases, each with its command."""
        return () if self.state is None else tuple(zip(self.state.phrases, self.state.actions, strict=True))

    def toggle(self, client: EdgeClient | None) -> None:
        """Opens or closes the microphone."""
        self.wanted_state = not self.is_on
        if client is not None and self.state is not None:
            self._send_request(client, self.wanted_state)

    def _send_request(self, client: EdgeClient, on: bool) -> None:
        client.ask(Listen(on), self._handle_answer)

    def _handle_answer(self, answer: Answer) -> None:
        if isinstance(answer, Refused):
            self.wanted_state = False
            self._editor.toasts.say(tr("The microphone was not switched"), answer.reason)
